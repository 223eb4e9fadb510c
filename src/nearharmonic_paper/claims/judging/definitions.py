"""Definitions of the paper's general words and of terms in verdicts, used for all statements."""

from __future__ import annotations

from typing import NamedTuple


class Meaning(NamedTuple):
    """A number, its definition with the origin, and a short form for thresholds."""

    number: float
    words: str
    brief: str


#: A dot of 2 pt in a figure 5 inches high over 18 decades covers a tenth of a decade.
DOT = 1.2589254117941673  # 10^(1/10)
DOT_WORDS = "a tenth of a decade (a factor of 1.26), what a dot of 2 pt covers in a figure of 5 inches over 18 decades"

PERFORMANCE = Meaning(
    1.0,
    "'Performance' is the energy error at equal cost, which is at equal step size per stage τ/s; to 'outperform' is to "
    "have the smaller error",
    "'outperform': smaller error at equal τ/s",
)
APPROXIMATELY = Meaning(
    DOT, f"'Approximately' means within {DOT_WORDS}", "'approximately': within a tenth of a decade, a factor of 1.26"
)
SIGNIFICANTLY = Meaning(
    DOT, f"'Significantly' means by more than {DOT_WORDS}", "'significantly': by more than a tenth of a decade"
)
GENERALLY = Meaning(
    0.5,
    "'Generally', 'usually' and 'often' mean in more than half of the cases",
    "'generally', 'usually', 'often': more than half",
)
GREATLY = Meaning(
    10.0,
    "'Greatly', 'drastically' and 'rapidly' mean by a factor of 10 or more",
    "'greatly', 'drastically', 'rapidly': 10 times or more",
)
SEVERAL = Meaning(2.0, "'Several' means two or more", "'several': two or more")
SEVERAL_ORDERS = Meaning(
    100.0, "'Several orders of magnitude' means a factor of 100 or more", "'several orders of magnitude': 100 or more"
)
NOT_SUITABLE = Meaning(
    10.0,
    "A method is 'not suitable' if its error is at least ten times that of another at equal cost",
    "'not suitable': ten times the error or more",
)
LARGE = Meaning(
    10.0,
    "'Large' step sizes are the decade below the one at which the first of the maximum errors compared passes 1 %",
    "'large': the decade below an error of 1 %",
)
MODERATE = Meaning(
    0.5,
    "'Moderate' step sizes are the last half decade or more of the range of comparison. Smaller ones are left to "
    "methods of higher order",
    "'moderate': the last half decade of the range, or more",
)
SMALL = Meaning(
    1.0,
    "A coefficient or substep is 'small' if it is no longer than the whole step",
    "'small': no longer than the whole step",
)
STABLE = Meaning(
    1.0, "A run is 'stable' while its relative energy error stays below 1", "'stable': relative energy error below 1"
)
#: A run whose energy is off by more than 1 % is no integration that anyone would keep.
RANGE = Meaning(
    0.01,
    "The 'range of comparison' contains the step sizes at which all curves compared show truncation, not rounding. It "
    "begins where each of them is 100 times its lowest point. It ends where the first of the maximum errors compared "
    "passes 1 %, or that of the method that the threshold names",
    "",
)
EDGES = Meaning(
    0.95,
    "A statement about a range 'holds' at every step size of it. It 'holds but for edges' at 95 % or more, all others "
    "among the first or last tenth. It 'holds in part' over half a decade or more without a gap",
    "",
)
SLOPES = Meaning(
    0.5,
    "A curve 'has an order' where its local slopes are within 0.5 of it, so that no other integer is nearer. A local "
    "slope is a fit to log(maximum error) within 0.05 decades of a step size. The statement holds if they stay so over "
    "half a decade, and in part over 0.2 decades, two windows of the fits",
    "",
)
#: All definitions, for the page.
MEANINGS = (
    PERFORMANCE, APPROXIMATELY, SIGNIFICANTLY, GENERALLY, GREATLY, SEVERAL, SEVERAL_ORDERS, NOT_SUITABLE, LARGE,
    MODERATE, SMALL, STABLE, RANGE, EDGES, SLOPES,
)  # fmt: skip
