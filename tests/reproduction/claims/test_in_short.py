"""Values in README's table, compared with short forms written by hand."""

from __future__ import annotations

import pytest

from nearharmonic.reproduction.claims.pages.documents import SHOWN
from nearharmonic.reproduction.claims.pages.in_short import BY_SYSTEM, SHORT, by_system, in_short

CASES = {
    "significantly-better": (
        "pairs: oscillator 24 and 23 of 24, Hénon-Heiles system 2 and 1 of 24, Sun-Mercury system 13 and 16 of 24",
        "pairs won by maximum / mean error, of 24: oscillator 24 / 23, Hénon-Heiles 2 / 1, Sun-Mercury 13 / 16",
    ),
    "outperform-ruth": (
        "x: oscillator 19 to 7 × 10⁴ and 20 to 8 × 10⁴ at 64 step sizes, Sun-Mercury system 2.8 to 19 and 2 to 24 at 9",
        "Ruth's maximum error over theirs: oscillator 19 to 7 × 10⁴, Sun-Mercury 2.8 to 19",
    ),
    "fig-1-sixth-order": (
        "A 6 over τ/s = 1 to 9 (0.95 decades); B 6 over τ/s = 1 to 10 (1.00 decades)",
        "slope 6 over 0.95 to 1.00 decades",
    ),
    "fig-3-sixth-order-descent": (
        "A for τ/s = 1 to 2 (0.30 decades), slopes 6 to 6; B for τ/s = 1 to 3 (0.48 decades)",
        "slope 6 over 0.30 to 0.48 decades; half a decade asked",
    ),
    "fig-4-coincide": (
        "all 104 step sizes; at 240 evaluations an orbit ABAs5o6H 7.50, ABA104 8.25, BAB's8o7H 7.60 × 10⁻⁶ rad",
        "104 of 104 step sizes; at 240 evaluations an orbit within 10 %",
    ),
    "fig-5-best-maximum": (
        "τ/s = 2.99 to 31.6 h, in one piece; 48 of 93 step sizes of τ/s = 1 to 75 h",
        "48 of 93 step sizes: τ/s = 2.99 to 31.6 h",
    ),
    "fig-5-best-mean": ("τ/s = 1 to 9 h, all 5 step sizes", "5 of 5 step sizes: τ/s = 1 to 9 h"),
}


@pytest.mark.parametrize("name", SHORT)
def test_a_value_in_short_has_the_expected_words(name):
    value, expected = CASES[name]
    assert in_short(name, value) == expected


def test_values_of_other_statements_are_shown_whole():
    assert in_short("fig-6-c-unstable", "leaves at iteration 52") == "leaves at iteration 52"


def test_fewest_and_most_step_sizes_are_shown_for_each_system():
    some = (
        "ahead at step sizes, of 9: maximum error ABAs5o6H 9, BAB's9o7H 7, the best of them 9; mean error each at all"
    )
    every = "ahead at step sizes, of 5: maximum error each at all; mean error each at all; τ/s = 1 to 2"
    none = "ahead at step sizes, of 8: maximum error ABAs5o6H 0, BABs7o7H 0, the best of them 0; mean error ABAs5o6H 3"
    told = by_system("outperform-kahan", [some, every, none])
    assert told.endswith("oscillator 7 to 9 of 9, Hénon-Heiles 5 of 5, Sun-Mercury 0 to 3 of 8")


def test_moderate_steps_begin_where_the_value_says():
    values = ["maximum error at all step sizes of τ/s = 1 to 2; x", "maximum error from τ/s = 5 h on, of τ/s", "x"]
    with pytest.raises(ValueError, match="README's table looks for"):
        by_system("yoshida-moderate-steps", values)
    values[2] = "maximum error 3 of 9 step sizes; mean error 2"
    assert by_system("yoshida-moderate-steps", values).endswith(
        "oscillator at all step sizes, Hénon-Heiles from τ/s = 5 h on, Sun-Mercury 3 of 9 step sizes"
    )


def test_every_short_form_is_of_a_row_of_the_table():
    rows = {ids if isinstance(ids, str) else ids[0] for _, _, ids in SHOWN}
    assert rows >= SHORT.keys() | BY_SYSTEM.keys()
