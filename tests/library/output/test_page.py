"""Generated parts of Markdown pages."""

from __future__ import annotations

import pytest

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.table import filled, pipes


@pytest.mark.parametrize(
    ("align", "marks"), [("l", "|---|---|---|"), ("lr", "|---|---:|---:|"), ("rrl", "|---:|---:|---|")]
)
def test_last_letter_of_alignment_holds_for_all_further_columns(align, marks):
    assert pipes(["a", "b", "c"], [[1, "x", 2.5]], align) == ["| a | b | c |", marks, "| 1 | x | 2.5 |"]


def test_each_part_stands_between_its_marks_and_nothing_else_changes():
    page = "a\n<!-- one -->\nold\n<!-- end -->\nb\n<!-- two -->\n<!-- end -->\nc\n"
    expected = "a\n<!-- one -->\n1 \\1\n<!-- end -->\nb\n<!-- two -->\n2\n<!-- end -->\nc\n"
    assert filled(page, {"one": "1 \\1", "two": "2"}) == expected
    assert filled(expected, {"one": "1 \\1"}) == expected


@pytest.mark.parametrize("page", ["", "<!-- one -->\n", "<!-- one -->\n<!-- end -->\n<!-- one -->\n<!-- end -->\n"])
def test_page_without_exactly_one_place_for_part_is_refused(page):
    with pytest.raises(NearharmonicError, match="places for one"):
        filled(page, {"one": "1"})
