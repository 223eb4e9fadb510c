"""Margins of thresholds, for verdicts that are known at every threshold."""

from __future__ import annotations

import pytest

from nearharmonic_paper.claims.claim import Undecided, margin


def between(low, high):
    return lambda bound: "holds" if low <= bound <= high else "fails"


@pytest.mark.parametrize(
    ("verdict_at", "words"),
    [
        (between(83.25, 191.5), "threshold 100; the same verdict from 83.3 to 191"),
        (between(0, 191.5), "threshold 100; the same verdict up to 191"),
        (between(2e-74, 1e300), "threshold 100; the same verdict from 2 × 10⁻⁷⁴ up"),
        (between(0, 3e17), "threshold 100; the same verdict up to 3 × 10¹⁷"),
        (between(-1, 1e300), "threshold 100; any other gives the same verdict"),
    ],
)
def test_the_margin_ends_where_the_verdict_changes(verdict_at, words):
    assert margin(verdict_at, 100.0) == words


def test_the_nearest_change_ends_the_margin():
    """The verdict comes back beyond a gap."""
    assert margin(lambda bound: "fails" if 150 < bound < 200 else "holds", 100.0).endswith("up to 150")


def test_a_threshold_at_which_nothing_is_decided_ends_the_margin():
    def verdict_at(bound):
        if bound > 120:
            raise Undecided
        return "holds"

    assert margin(verdict_at, 100.0) == "threshold 100; the same verdict up to 120"
