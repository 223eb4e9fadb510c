"""The paper's general words, each with the one meaning in which all statements are read."""

from __future__ import annotations

from typing import NamedTuple


class Meaning(NamedTuple):
    """A number, and what it is asked of."""

    number: float
    words: str


#: A dot of 2 pt in a figure 5 inches high over 18 decades covers a tenth of a decade.
DOT = 1.2589254117941673  # 10^(1/10)
DOT_WORDS = "a tenth of a decade, 26 %, what a dot of 2 pt covers in a figure of 5 inches over 18 decades"

APPROXIMATELY = Meaning(DOT, f"'approximately' is read as within {DOT_WORDS}")
GENERALLY = Meaning(0.5, "'generally', 'usually' and 'often' are read as more than half")
SIGNIFICANTLY = Meaning(DOT, f"'significantly' is read as more than {DOT_WORDS}")
GREATLY = Meaning(10.0, "'greatly', 'drastically' and 'rapidly' are read as a factor of ten or more")
SEVERAL_ORDERS = Meaning(100.0, "'several orders of magnitude' are two at least")
NOT_SUITABLE = Meaning(10.0, "'not suitable' is read as ten times the error or more of another way at the same cost")
LARGE = Meaning(
    10.0, "'large' step sizes are those of the decade that ends where the first of the errors compared passes 1 %"
)
SMALL = Meaning(1.0, "a substep is 'small' that is no longer than the whole step")
STABLE = Meaning(1.0, "a run is 'stable' as long as its relative energy error stays below 1, the energy surface")
#: All of them, for the page.
MEANINGS = (APPROXIMATELY, GENERALLY, SIGNIFICANTLY, GREATLY, SEVERAL_ORDERS, NOT_SUITABLE, LARGE, SMALL, STABLE)
