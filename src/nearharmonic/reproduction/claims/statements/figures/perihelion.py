"""Figure 4: the advance of the perihelion, and what it has in common with the energy errors of Figure 5."""

from __future__ import annotations

import numpy as np

from nearharmonic.math import exp, log
from nearharmonic.numerics.types import Floats
from nearharmonic.reproduction.claims.claim import Decision, Verdict, background, combined, misprint, result
from nearharmonic.reproduction.claims.judging.curves import (
    FEWEST,
    MEASURES,
    Curves,
    Range,
    curves_of,
    over,
    range_words,
    rank_correlation,
)
from nearharmonic.reproduction.claims.judging.definitions import APPROXIMATELY, DOT, SIGNIFICANTLY
from nearharmonic.reproduction.claims.results import Results, label, require, short
from nearharmonic.reproduction.claims.statements.figures.kepler import CUBE, TEN, with_and_without_sixth_order

COINCIDING = ("abas5o6h", "aba104", "babps8o7h")


def _advance(curves: Curves, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Absolute advance and interval, a row a method."""
    rows = [[np.abs(curves.of(n, v)) for n in names] for v in ("perihelion_advance", "perihelion_advance_interval")]
    return np.array(rows[0]), np.array(rows[1])


@result(
    id="fig-4-coincide",
    paper="Figure 4, caption",
    sentence="The integrators ABAs5o6H, ABA104 and BAB's8o7H achieve approximately the same performance, obfuscating "
    "their plots",
    statement="ABAs5o6H, ABA104 and BAB's8o7H coincide in perihelion advance",
    threshold="the largest of their advances at most 1.26 times the smallest, "
    f"{range_words('the first of the three')}; {APPROXIMATELY.brief}",
    bound=DOT,
    needs=CUBE,
)
def fig_4_coincide(results: Results, dot: float) -> Decision:
    curves = curves_of(results, "kepler")
    advance, _ = _advance(curves, COINCIDING)
    asked = curves.compared(curves.errors(COINCIDING))
    ratio = advance.max(axis=0) / advance.min(axis=0)
    value = f"largest over least {short(ratio[asked.asked].min())} to {short(ratio[asked.asked].max())}"
    return over(asked, ratio <= dot, value + _at_evaluations(curves, advance))


def _at_evaluations(curves: Curves, advance: Floats, number: float = 240.0) -> str:
    """The advances at a number of evaluations an orbit, between step sizes by a power law."""
    told = []
    for name, row in zip(COINCIDING, advance, strict=True):
        evaluations = curves.of(name, "evaluations_per_orbit")
        known = np.flatnonzero(np.isfinite(row) & (row > 0))
        known = known[np.argsort(evaluations[known], kind="stable")]
        if known.size == 0 or not evaluations[known[0]] <= number <= evaluations[known[-1]]:
            return ""
        between = float(np.interp(log(number), log(evaluations[known]), log(row[known])))
        told.append(f"{label(name)} {1e6 * exp(between):.2f}")
    return f"; at {number:.0f} evaluations an orbit {', '.join(told)} × 10⁻⁶ rad"


@result(
    id="fig-4-intervals",
    paper="Figure 4, caption",
    sentence="Linear fit 95% confidence intervals of the perihelion advance are significantly smaller than the dot "
    "size",
    statement="95 % confidence intervals of the perihelion advance are significantly smaller than the dot size",
    threshold="the width of each interval at most 21 % of the advance, 1/1.26 of the 26 % that a dot covers, "
    f"{range_words('the first of the ten')}; {SIGNIFICANTLY.brief}",
    bound=(DOT - 1) / SIGNIFICANTLY.number,
    needs=CUBE,
)
def fig_4_intervals(results: Results, widest: float) -> Decision:
    curves = curves_of(results, "kepler")
    advance, interval = _advance(curves, TEN)
    asked = curves.compared(curves.errors(TEN))
    share = (2 * interval / advance).max(axis=0)
    low, high = (short(100 * one, 2) for one in (share[asked.asked].min(), share[asked.asked].max()))
    return over(asked, share <= widest, f"widest of the ten {low} to {high} % of the advance")


@background(
    id="precession-linear",
    paper="Section 4.B, paragraph on precession",
    sentence="The orbital precession advances linearly with time t",
    statement="The perihelion of the ten methods advances in the second half of the ten years as in the first",
    threshold="the rates of advance in the two halves within 2 % of each other, the widest 95 % interval of a fit, "
    f"{range_words('the first of the ten')}",
    bound=0.02,
    needs=CUBE,
)
def precession_linear(results: Results, off: float) -> Decision:
    curves = curves_of(results, "kepler")
    asked = curves.compared(curves.errors(TEN))
    halves, line = (
        np.array([curves.of(name, f"perihelion_advance_{what}") for name in TEN]) for what in ("halves", "linearity")
    )
    apart = np.abs(halves - 1).max(axis=0)
    least = np.nanmin(line[:, asked.asked])
    value = f"halves apart by up to {short(100 * np.nanmax(apart[asked.asked]), 2)} %, R² from {short(least, 4)} on"
    return over(asked, apart <= off, value)


@misprint(
    id="figure-of-the-precession",
    paper="Section 4.B, paragraph on precession",
    sentence="Figure 5 shows the perihelion precession dθ/dt which has been obtained numerically through linear "
    "regression of θ(t) over numerous orbital periods",
    statement="Figure 5 shows the perihelion precession",
    threshold="the curves of ABAs5o6H, ABA104 and BAB's8o7H coincide in Figure 5, as they do in the precession by the "
    f"caption of Figure 4: maximum and mean errors within a factor of 1.26, {range_words()}; {APPROXIMATELY.brief}",
    bound=DOT,
    needs=CUBE,
)
def figure_of_the_precession(results: Results, dot: float) -> Decision:
    curves, told = curves_of(results, "kepler"), []
    asked = curves.compared(curves.errors(COINCIDING))
    verdicts: list[Verdict] = []
    for measure, variable in MEASURES.items():
        errors = curves.errors(COINCIDING, variable)
        largest, least = errors.max(axis=0), errors.min(axis=0)
        verdicts.append(over(asked, largest <= dot * least).verdict)
        shown = largest[asked.asked] / least[asked.asked]
        coinciding = f"coinciding at {int((shown <= dot).sum())} of {shown.size} step sizes"
        told.append(f"{measure} {short(shown.min())} to {short(shown.max())}, {coinciding}")
    return combined(verdicts, f"largest over least error of the three: {'; '.join(told)}. Figure 4 is meant")


@result(
    id="accumulated-error-and-mean",
    paper="Section 4.B, paragraph on precession",
    sentence="Comparison of Figure 4 and 5 suggests that the accumulated error is in better agreement with the average "
    "error than the maximum error",
    statement="The accumulated error is in better agreement with the average error than with the maximum error",
    threshold="the rank correlation of the ten methods' advances with their mean errors is nearer to 1 than with their "
    f"maximum errors, {range_words()}",
    bound=1.0,
    needs=CUBE,
)
def accumulated_and_mean(results: Results, ratio: float) -> Decision:
    curves = curves_of(results, "kepler")
    return with_and_without_sixth_order(lambda names: _agreement(curves, names, ratio))


def _agreement(curves: Curves, names: tuple[str, ...], ratio: float) -> Decision:
    largest, mean = curves.errors(names), curves.errors(names, "mean_energy_error")
    advance, _ = _advance(curves, names)
    known = curves.compared(largest)
    asked = Range(known.x, known.asked & np.isfinite(advance).all(axis=0), known.unit)
    lacking = f"the advances of the {len(names)} methods are known at fewer than three step sizes"
    require(asked.asked.sum() >= FEWEST, lacking)
    by_mean, by_largest = (rank_correlation(advance, other) for other in (mean, largest))
    told = (short(float(np.median(one[asked.asked])), 2) for one in (by_mean, by_largest))
    value = "median rank correlation {} with the mean and {} with the maximum error".format(*told)
    return over(asked, 1 - by_mean < ratio * (1 - by_largest), value)
