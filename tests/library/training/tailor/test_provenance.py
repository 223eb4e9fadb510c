"""The file of a method: valid Python with all digits, for any texts."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest

import nearharmonic as nh
from nearharmonic.integrators import load_tableaus
from nearharmonic.training.tailor import file_text


@pytest.mark.parametrize("name", ["babps8o7h", "srkn_b11", "babs7o7h", "abas5o6h"])
def test_file_returns_every_digit_of_odd_and_even_rows(name, tmp_path):
    given = replace(nh.integrators[name], note="for a test", benchmarked=False, generalised_order=None)
    (tmp_path / "mine.py").write_text(file_text(given, "mine"), encoding="utf-8")
    (found,) = load_tableaus(tmp_path / "mine.py").values()
    assert found.name == "mine"
    for key in ("kick", "drift"):
        assert list(map(Fraction, getattr(found, key))) == list(map(Fraction, getattr(given, key)))
    same = ("label", "order", "first", "digits", "requires", "harmonic_order", "source", "note", "symmetric")
    assert [getattr(found, key) for key in same] == [getattr(given, key) for key in same]


@pytest.mark.parametrize("text", ['a "b" \\ c', '"""', "it's\nnew", "ü \\N{x} " * 30, "\\"])
def test_texts_with_quotes_and_backslashes_do_no_harm(text, tmp_path):
    given = replace(nh.integrators["babs7o7h"], label=text, source=text, note=text)
    (tmp_path / "mine.py").write_text(file_text(given, "mine"), encoding="utf-8")
    (found,) = load_tableaus(tmp_path / "mine.py").values()
    assert (found.label, found.source, found.note) == (text, text, text)


def test_the_docstring_says_what_is_proved(tmp_path):
    text = file_text(replace(nh.integrators["srkn_b11"], note="for x", harmonic_order=6), "mine")
    assert "Order 6 for quadratic T, proved; harmonic order 6" in text
    limit = float(nh.stability_limit("srkn_b11"))
    assert f"stability limit of the oscillator {limit:.4g}" in " ".join(text.split())
    assert max(map(len, text.splitlines())) <= 110
