"""How large the coefficients of Table 4 are, and so the substeps."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.reproduction.claims.claim import Decision, claim, counted, either
from nearharmonic.reproduction.claims.definitions import GENERALLY, SMALL
from nearharmonic.reproduction.claims.results import Results, label, short
from nearharmonic.reproduction.claims.statements.coefficients import sets


def _largest(row: Sequence[str]) -> float:
    return max(abs(float(c)) for c in row)


def _size(tableau: Tableau) -> float:
    return max(_largest(tableau.kick), _largest(tableau.drift))


@claim(
    id="near-forward",
    paper="Section 1, last paragraph",
    sentence="The presented splitting coefficients generally have small absolute values and are therefore referred "
    "to as near-forward SIs",
    kind="result",
    statement="The presented coefficients generally have small absolute values",
    threshold="the largest of a set no larger than 1, for more than half of the ten sets; "
    f"{SMALL.words}; {GENERALLY.words}; whether methods of small coefficients err less is asked of "
    "minimised-coefficients",
    bound=SMALL.number,
)
def near_forward(results: Results, small: float) -> Decision:
    return _small(results, small, GENERALLY.number)


@claim(
    id="small-near-forward-steps",
    paper="Section 5, Discussion",
    sentence="BABs7o7H and other splitting coefficients obtained in this paper generally perform small near-forward "
    "steps",
    kind="result",
    statement="The substeps of the other sets are small as well, beside those of Ruth and of Yosh s7o6 A",
    threshold="the longest substep of each of the ten sets shorter than that of Ruth's method and of Yosh s7o6 A",
    bound=1.0,
)
def small_steps(results: Results, ratio: float) -> Decision:
    bound = min(_size(results.method(name)) for name in ("ruth", "yoshida_s7o6a"))
    return _small(results, ratio * bound, None)


def _small(results: Results, bound: float, share: float | None) -> Decision:
    """Compare the longest substeps with a bound: for more than a share of the sets, or for all."""
    others = ", ".join(f"{label(n)} {short(_size(results.method(n)))}" for n in ("ruth", "yoshida_s7o6a", "s5odr4"))
    sizes = sorted((_size(t), t.label) for t in sets(results))
    good = [size < bound for size, _ in sizes]
    least, most = (f"{name} {short(size)}" for size, name in (sizes[0], sizes[-1]))
    value = f"{sum(good)} of {len(good)} sets; longest substep from {least} to {most}; {others}"
    return counted(good, value) if share is None else either(sum(good) > share * len(good), value)


@claim(
    id="small-coefficients-of-one-row",
    paper="Section 5, Discussion",
    sentence="some of the methods presented in Table 4 only have small coefficients for either d or c",
    kind="result",
    statement="Some of the methods of Table 4 only have small coefficients for either d or c",
    threshold="the largest of one row at least twice the largest of the other, for one set or more",
    bound=2.0,
)
def small_of_one_row(results: Results, ratio: float) -> Decision:
    told = []
    for t in sets(results):
        d, c = _largest(t.outer), _largest(t.inner)
        if max(c, d) >= ratio * min(c, d):
            told.append(f"{t.label} {'c' if c > d else 'd'} by {short(max(c, d) / min(c, d), 2)}")
    return either(bool(told), f"{len(told)} sets, larger in {', '.join(told)}" if told else "no set")
