"""Random palindromes whose rows sum to 1: any identity of the algebra has to hold for these, orders aside."""

from decimal import Decimal

from hypothesis import strategies as st

from nearharmonic.integrators.tableau import Tableau


@st.composite
def tableaus(draw):
    """Random palindromes of 1 to 6 stages with coefficients of three decimals; the innermost values close the sums."""
    stages, rows = draw(st.integers(1, 6)), []
    for length in (stages + 1, stages):
        half = [Decimal(n) / 1000 for n in draw(st.lists(st.integers(-2000, 2000), min_size=6, max_size=6))]
        half = half[: (length - 1) // 2]
        middle = [(1 - 2 * sum(half)) / (2 - length % 2)] * (2 - length % 2)
        rows.append(tuple(map(str, [*half, *middle, *reversed(half)])))
    first = draw(st.sampled_from(["drift", "kick"]))
    outer, inner = rows
    drift, kick = (outer, inner) if first == "drift" else (inner, outer)
    return Tableau(name="random", order=1, first=first, kick=kick, drift=drift, source="random", digits=18)
