"""Size of the coefficients of Table 4, and so of the substeps."""

from __future__ import annotations

from nearharmonic.integrators.tableau import Tableau
from nearharmonic_paper.claims.claim import Decision, counted, either, result
from nearharmonic_paper.claims.judging import GENERALLY, SMALL
from nearharmonic_paper.claims.results import Results, label, short
from nearharmonic_paper.claims.statements.equations.search import largest
from nearharmonic_paper.claims.statements.tableaus.coefficients import sets


def _size(tableau: Tableau) -> float:
    return largest(*tableau.kick, *tableau.drift)


near_forward = result(
    id="near-forward",
    paper="Section 1, last paragraph",
    sentence="The presented splitting coefficients generally have small absolute values and are therefore referred "
    "to as near-forward SIs",
    statement="The presented coefficients generally have small absolute values",
    threshold=f"more than half of the ten sets have no coefficient above 1; {SMALL.brief}; {GENERALLY.brief}",
    bound=SMALL.number,
)(lambda results, small: either(*_small(results, small)))


@result(
    paper="Section 5, Discussion",
    sentence="BABs7o7H and other splitting coefficients obtained in this paper generally perform small near-forward "
    "steps",
    statement="BABs7o7H and the other sets generally perform small substeps",
    threshold=f"BABs7o7H and more than half of the ten sets have no coefficient above 1; {SMALL.brief}; "
    f"{GENERALLY.brief}",
    bound=SMALL.number,
)
def small_near_forward_steps(results: Results, small: float) -> Decision:
    most, value = _small(results, small)
    return counted([_size(results.method("babs7o7h")) <= small, most], value)


def _small(results: Results, small: float) -> tuple[bool, str]:
    """Return True if the sets generally have small coefficients, and their sizes."""
    others = ", ".join(f"{label(n)} {short(_size(results.method(n)))}" for n in ("ruth", "yoshida_s7o6a", "s5odr4"))
    sizes = sorted((_size(t), t.label) for t in sets(results))
    good = [size <= small for size, _ in sizes]
    least, most = (f"{name} {short(size)}" for size, name in (sizes[0], sizes[-1]))
    value = f"{sum(good)} of {len(good)} sets; largest coefficient from {least} to {most}; {others}"
    return sum(good) > GENERALLY.number * len(good), value


@result(
    paper="Section 5, Discussion",
    sentence="some of the methods presented in Table 4 only have small coefficients for either d or c",
    statement="Some of the methods of Table 4 only have small coefficients for either d or c",
    threshold="for at least one set the coefficients of one row are small compared to the other: at most half as large",
    bound=2.0,
)
def small_coefficients_of_one_row(results: Results, ratio: float) -> Decision:
    told = []
    for t in sets(results):
        d, c = largest(*t.outer), largest(*t.inner)
        if max(c, d) >= ratio * min(c, d):
            told.append(f"{t.label} {'c' if c > d else 'd'} by {short(max(c, d) / min(c, d), 2)}")
    return either(bool(told), f"{len(told)} sets, larger in: {', '.join(told)}" if told else "no set")
