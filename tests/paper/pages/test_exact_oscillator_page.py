"""docs/results/exact_oscillator.md: its sentences on trained methods are those of its table."""

from __future__ import annotations

import re

from support.results.stated_numbers import ROOT

PAGE = (ROOT / "docs/results/exact_oscillator.md").read_text(encoding="utf-8")


def test_method_better_at_every_amplitude_is_so_in_table():
    ((name, tau),) = re.findall(
        r"`(\w+)`, which is trained for a small rest, is at τ/s = (\S+) and equal numbers", PAGE
    )
    (row,) = re.findall(rf"\| {name.replace('_', ' ')} \| {tau} \| (.*?) \|", PAGE)
    assert row == "everywhere"
