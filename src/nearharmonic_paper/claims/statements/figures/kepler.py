"""Figures 4 and 5: the advance of the perihelion of Mercury and the energy errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.math import cos, exp, hypot, log, sin
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems import kepler
from nearharmonic_paper.claims.claim import (
    Decide,
    Decision,
    Verdict,
    background,
    combined,
    either,
    mathematics,
    misprint,
    result,
)
from nearharmonic_paper.claims.judging import (
    APPROXIMATELY,
    DOT,
    FEWEST,
    MEASURES,
    SIGNIFICANTLY,
    Curves,
    Range,
    curves_of,
    over,
    range_words,
    rank_correlation,
)
from nearharmonic_paper.claims.results import Results, label, require, short
from nearharmonic_paper.claims.statements.figures.henon_heiles import orders_of_figure


@background(
    paper="Section 4.B, below Eq. 19",
    sentence="the aphelion is chosen as the initial Sun-Mercury distance yielding the minimum orbital velocity",
    statement="The orbit starts at the aphelion of Mercury, where its velocity is lowest",
    threshold="at the start q·p = 0 and the speed is below that of a circular orbit; eccentricity 0.2056 and period "
    "87.97 d of Mercury's fact sheet to a relative 10⁻³, its digits",
    bound=1e-3,
)
def kepler_starts_at_aphelion(_: Results, off: float) -> Decision:
    system = kepler.SYSTEM
    ((x, y), (u, v)), (GM,) = system.start(float), system.constants(float)
    eccentricity = 1 - hypot(x, y) * (u * u + v * v) / GM
    days = kepler.orbital_period((x, y), (u, v), GM) / 24
    good = x * u + y * v == 0 and max(abs(eccentricity / 0.2056 - 1), abs(days / 87.97 - 1)) < off
    return either(good, f"eccentricity {eccentricity:.4f}, period {days:.2f} d")


#: Masses of Sun and Mercury in kg by the fact sheets that the paper names.
SUN, MERCURY = 1.9885e30, 0.3301e24


@mathematics(
    paper="Eq. 19",
    sentence="H = ‖p‖²/(2M) - G m_S m_M/‖q‖ ≈ ‖p‖²/(2 m_M) - G m_S m_M/‖q‖",
    statement="The reduced mass M may be replaced by the mass of Mercury",
    threshold="m_M/M - 1 = m_M/m_S below 10⁻⁴, the last digit of the data of the fact sheets",
    bound=1e-4,
)
def eq_19_approximation(_: Results, off: float) -> Decision:
    ratio = MERCURY / SUN
    return either(ratio < off, f"m_M/m_S = {short(ratio, 2)}")


@mathematics(
    paper="Eq. 20",
    sentence="A = p × L - r̂",
    statement="The Laplace-Runge-Lenz vector is p × L - r/|r|, in units with mk = 1",
    threshold="its length is constant to 10⁻¹² along the exact orbit of Mercury, at 64 true anomalies, in units with "
    "mk = 1, for H = p²/(2m) - k/r; the paper does not name its units",
    bound=1e-12,
)
def eq_20(_: Results, off: float) -> Decision:
    system = kepler.SYSTEM
    ((x, _y), (_u, v)), (GM,) = system.start(float), system.constants(float)
    L, e = x * v, abs(1 - x * v * v / GM)
    f = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    # p x L along the radius and across it, for the momentum (GM/L) (e sin f, 1 + e cos f).
    along, across = GM * (1 + e * cos(f)), -GM * e * sin(f)
    natural, own = hypot(along / GM - 1, across / GM), hypot(along - 1, across)
    value = (
        f"length {short(natural.mean(), 6)} within {short(float(np.ptp(natural)), 1)}; in the units of the system, "
        f"with L = {short(L)} and GM = {short(GM)}, without the factor 1/(mk): length {short(own.min(), 2)} to "
        f"{short(own.max(), 2)}"
    )
    return either(bool(np.ptp(natural) < off), value)


FIGURE_5 = orders_of_figure(5, "kepler")


#: The reference method of sixth order: what a statement is without it is told beside the verdict.
SIXTH_ORDER = "yoshida_s7o6a"


def with_and_without_sixth_order(decide: Callable[[tuple[str, ...]], Decision]) -> Decision:
    """Decide among the ten methods, and without that of sixth order as well if the statement does not hold."""
    found = decide(BENCHMARKED)
    if found.verdict == "holds":
        return found
    without = decide(tuple(name for name in BENCHMARKED if name != SIXTH_ORDER))
    said = f"without {label(SIXTH_ORDER)} it {without.verdict}: {without.value.partition(';')[0]}"
    return found._replace(value=f"{found.value}; {said}")


def _least(curves: Curves, name: str, variable: str, among: tuple[str, ...], ratio: float) -> Decision:
    largest = curves.errors(among)
    asked = curves.compared(largest, kept=largest[among.index(name)])
    others = [one for one in among if one != name]
    errors = curves.errors(others, variable)
    good = curves.errors([name], variable)[0] < ratio * errors.min(axis=0)
    beaten = dict.fromkeys(errors.argmin(axis=0)[asked.asked & ~good])
    elsewhere = ", ".join(label(others[i]) for i in beaten)
    return over(asked, good, f"elsewhere ahead: {elsewhere}" if elsewhere else "")


def _best(name: str, variable: str) -> Decide:
    """Judge of statements that a method has the smallest error of the ten."""

    def decide(results: Results, ratio: float) -> Decision:
        curves = curves_of(results, "kepler")
        return with_and_without_sixth_order(lambda among: _least(curves, name, variable, among, ratio))

    return decide


BEST = tuple(
    result(
        id=f"fig-5-best-{measure}",
        paper="Section 4.B, text to Figure 5",
        sentence=f"{name} shows the best performance in regard to the {words} error",
        statement=f"{name} shows the best performance in regard to the {words} error",
        threshold=f"its {measure} error below that of each of the other nine {range_words(name)}",
        bound=1.0,
        needs=("cubes/kepler.h5",),
    )(_best(method, MEASURES[measure]))
    for measure, words, name, method in (
        ("maximum", "maximum", "ABA104", "aba104"),
        ("mean", "average", "BAB's9o7H", "babps9o7h"),
    )
)


COINCIDING = ("abas5o6h", "aba104", "babps8o7h")


def _advance(curves: Curves, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Return absolute advances and intervals, one row per method."""
    rows = [[np.abs(curves.of(n, v)) for n in names] for v in ("perihelion_advance", "perihelion_advance_interval")]
    return np.array(rows[0]), np.array(rows[1])


@result(
    paper="Figure 4, caption",
    sentence="The integrators ABAs5o6H, ABA104 and BAB's8o7H achieve approximately the same performance, obfuscating "
    "their plots",
    statement="ABAs5o6H, ABA104 and BAB's8o7H coincide in perihelion advance",
    threshold="the largest of their advances at most 1.26 times the smallest, "
    f"{range_words('the first of the three')}; {APPROXIMATELY.brief}",
    bound=DOT,
    needs=("cubes/kepler.h5",),
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
    paper="Figure 4, caption",
    sentence="Linear fit 95% confidence intervals of the perihelion advance are significantly smaller than the dot "
    "size",
    statement="95 % confidence intervals of the perihelion advance are significantly smaller than the dot size",
    threshold="the width of each interval at most 21 % of the advance, 1/1.26 of the 26 % that a dot covers, "
    f"{range_words('the first of the ten')}; {SIGNIFICANTLY.brief}",
    bound=(DOT - 1) / SIGNIFICANTLY.number,
    needs=("cubes/kepler.h5",),
)
def fig_4_intervals(results: Results, widest: float) -> Decision:
    curves = curves_of(results, "kepler")
    advance, interval = _advance(curves, BENCHMARKED)
    asked = curves.compared(curves.errors(BENCHMARKED))
    share = (2 * interval / advance).max(axis=0)
    low, high = (short(100 * one, 2) for one in (share[asked.asked].min(), share[asked.asked].max()))
    return over(asked, share <= widest, f"widest of the ten {low} to {high} % of the advance")


@background(
    paper="Section 4.B, paragraph on precession",
    sentence="The orbital precession advances linearly with time t",
    statement="The perihelion of the ten methods advances in the second half of the ten years as in the first",
    threshold="the rates of advance in the two halves within 2 % of each other, the widest 95 % interval of a fit, "
    f"{range_words('the first of the ten')}",
    bound=0.02,
    needs=("cubes/kepler.h5",),
)
def precession_linear(results: Results, off: float) -> Decision:
    curves = curves_of(results, "kepler")
    asked = curves.compared(curves.errors(BENCHMARKED))
    halves, line = (
        np.array([curves.of(name, f"perihelion_advance_{what}") for name in BENCHMARKED])
        for what in ("halves", "linearity")
    )
    apart = np.abs(halves - 1).max(axis=0)
    least = np.nanmin(line[:, asked.asked])
    value = f"halves apart by up to {short(100 * np.nanmax(apart[asked.asked]), 2)} %, R² from {short(least, 4)} on"
    return over(asked, apart <= off, value)


@misprint(
    paper="Section 4.B, paragraph on precession",
    sentence="Figure 5 shows the perihelion precession dθ/dt which has been obtained numerically through linear "
    "regression of θ(t) over numerous orbital periods",
    statement="Figure 5 shows the perihelion precession",
    threshold="the curves of ABAs5o6H, ABA104 and BAB's8o7H coincide in Figure 5, as they do in the precession by the "
    f"caption of Figure 4: maximum and mean errors within a factor of 1.26, {range_words()}; {APPROXIMATELY.brief}",
    bound=DOT,
    needs=("cubes/kepler.h5",),
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
    paper="Section 4.B, paragraph on precession",
    sentence="Comparison of Figure 4 and 5 suggests that the accumulated error is in better agreement with the average "
    "error than the maximum error",
    statement="The accumulated error is in better agreement with the average error than with the maximum error",
    threshold="the rank correlation of the ten methods' advances with their mean errors is nearer to 1 than with their "
    f"maximum errors, {range_words()}",
    bound=1.0,
    needs=("cubes/kepler.h5",),
)
def accumulated_error_and_mean(results: Results, ratio: float) -> Decision:
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
