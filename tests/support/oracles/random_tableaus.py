"""Random palindromes whose rows sum to 1: any identity of the algebra has to hold for these, orders aside."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import strategies as st

from nearharmonic.integrators.tableau import Tableau


def _decimal(number):
    """A fraction with a denominator of 2^a 5^b as a decimal string."""
    scaled = number * 10**20
    assert scaled.denominator == 1
    return f"{scaled.numerator}e-20"


@st.composite
def tableaus(draw):
    """Random palindromes of 1 to 6 stages with coefficients of three decimals; the innermost values close the sums."""
    stages, rows = draw(st.integers(1, 6)), []
    for length in (stages + 1, stages):
        half = [Fraction(n, 1000) for n in draw(st.lists(st.integers(-2000, 2000), min_size=6, max_size=6))]
        half = half[: (length - 1) // 2]
        middle = [(1 - 2 * sum(half, Fraction(0))) / (2 - length % 2)] * (2 - length % 2)
        rows.append(tuple(map(_decimal, [*half, *middle, *reversed(half)])))
    first = draw(st.sampled_from(["drift", "kick"]))
    outer, inner = rows
    drift, kick = (outer, inner) if first == "drift" else (inner, outer)
    return Tableau(
        name="random", label="random", order=1, first=first, kick=kick, drift=drift, source="random", digits=18
    )
