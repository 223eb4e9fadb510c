"""docs/results/training.md: its statements on registered methods are proved."""

from __future__ import annotations

from pathlib import Path

from nearharmonic.output.page import filled
from nearharmonic.reproduction.pages.training import parts

PAGE = (Path(__file__).parents[3] / "docs/results/training.md").read_text(encoding="utf-8")


def test_tables_of_page_are_those_of_registered_methods():
    found = parts({})
    del found["landscape"]  # of searches
    assert all(text.count("\n|") > 2 for text in found.values())
    assert filled(PAGE, found) == PAGE
