"""Figures 4 and 5: the Sun-Mercury system, its energy errors and the advance of the perihelion."""

from __future__ import annotations

import numpy as np

from nearharmonic.claims.claim import Decision, Verdict, claim, combined, either
from nearharmonic.claims.curves import (
    FEWEST,
    MEASURES,
    Curves,
    Floats,
    Range,
    curves_of,
    over,
    range_words,
    rank_correlation,
)
from nearharmonic.claims.definitions import DOT, DOT_WORDS, SIGNIFICANTLY
from nearharmonic.claims.results import Results, Undecided, label, short
from nearharmonic.claims.slopes import BAND, SLOPE, orders
from nearharmonic.claims.statements.henon_heiles import ORDERS
from nearharmonic.math import cos, exp, hypot, log, sin
from nearharmonic.systems import kepler

CUBE = ("cubes/kepler.h5",)
COINCIDING = ("abas5o6h", "aba104", "babps8o7h")
#: Ten methods, or there is no best of them.
TEN = tuple(ORDERS)


@claim(
    id="kepler-starts-at-aphelion",
    paper="Section 4.B, below Eq. 19",
    sentence="the aphelion is chosen as the initial Sun-Mercury distance yielding the minimum orbital velocity",
    kind="background",
    statement="The aphelion is the initial distance, yielding the minimum orbital velocity",
    threshold="the start is an apsis (q.p = 0) outside the circular orbit of its speed, and the ellipse is Mercury's: "
    "eccentricity 0.2056 and period 87.97 d within 10⁻³ of them, the digits of the fact sheet",
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


@claim(
    id="eq-19-approximation",
    paper="Eq. 19",
    sentence="H = ‖p‖²/(2M) - G m_S m_M/‖q‖ ≈ ‖p‖²/(2 m_M) - G m_S m_M/‖q‖",
    kind="mathematics",
    statement="The reduced mass is that of Mercury, approximately",
    threshold="m_M/M - 1 = m_M/m_S below 10⁻⁴, the last digit of the data that the system is made of",
    bound=1e-4,
)
def eq_19(_: Results, off: float) -> Decision:
    ratio = MERCURY / SUN
    return either(ratio < off, f"m_M/m_S = {short(ratio, 2)}")


@claim(
    id="eq-20",
    paper="Eq. 20",
    sentence="A = p × L - r̂",
    kind="misprint",
    statement="The Laplace-Runge-Lenz vector is p × L - r/|r|",
    threshold="of constant length, to 10⁻¹², along the exact orbit of Mercury, at 64 true anomalies. It is in units "
    "with mk = 1, which the paper does not say",
    bound=1e-12,
)
def eq_20(_: Results, off: float) -> Decision:
    system = kepler.SYSTEM
    ((x, _y), (_u, v)), (GM,) = system.start(float), system.constants(float)
    L, e = x * v, abs(1 - x * v * v / GM)
    f = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    # p x L along the radius and across it, for the momentum (GM/L) (e sin f, 1 + e cos f).
    along, across = GM * (1 + e * cos(f)), -GM * e * sin(f)
    printed, mended = hypot(along - 1, across), hypot(along / GM - 1, across / GM)
    value = (
        f"L = {short(L)} and GM = {short(GM)} in the units of the system: length {short(printed.min(), 2)} to "
        f"{short(printed.max(), 2)}; with p × L divided by GM, mk in general, it is {short(mended.mean(), 6)} "
        f"within {short(float(np.ptp(mended)), 1)}"
    )
    return either(bool(np.ptp(printed) < off), value)


@claim(
    id="fig-5-orders",
    paper="Figure 5",
    sentence="Nth order integrators have their integration error reduced by a factor k^N when the time step is "
    "reduced by a factor k",
    kind="background",
    statement="Small steps show the general order: six for Yosh s7o6 A, four for the others",
    threshold=SLOPE,
    bound=BAND,
    needs=CUBE,
)
def fig_5_orders(results: Results, band: float) -> Decision:
    return orders(curves_of(results, "kepler"), ORDERS, band)


@claim(
    id="fig-5-best-maximum",
    paper="Section 4.B, text to Figure 5",
    sentence="ABA104 shows the best performance in regard to the maximum error",
    kind="result",
    statement="ABA104 shows the best performance in regard to the maximum error",
    threshold=f"its maximum error over the least of the others below 1 {range_words('ABA104')}",
    bound=1.0,
    needs=CUBE,
)
def fig_5_best_maximum(results: Results, ratio: float) -> Decision:
    return _best(results, "aba104", "max_energy_error", ratio)


@claim(
    id="fig-5-best-mean",
    paper="Section 4.B, text to Figure 5",
    sentence="BAB's9o7H shows the best performance in regard to the average error",
    kind="result",
    statement="BAB's9o7H shows the best performance in regard to the average error",
    threshold="its mean error over the least of the others below 1 " + range_words("BAB's9o7H"),
    bound=1.0,
    needs=CUBE,
)
def fig_5_best_mean(results: Results, ratio: float) -> Decision:
    return _best(results, "babps9o7h", "mean_energy_error", ratio)


#: The reference method of sixth order: what a statement is without it is told beside the verdict.
SIXTH_ORDER = "yoshida_s7o6a"


def _best(results: Results, name: str, variable: str, ratio: float) -> Decision:
    curves = curves_of(results, "kepler")
    verdict, value = _least(curves, name, variable, TEN, ratio)[:2]
    if verdict == "holds":
        return Decision(verdict, value)
    without = _least(curves, name, variable, tuple(one for one in TEN if one != SIXTH_ORDER), ratio)
    said = f"without {label(SIXTH_ORDER)} it {without.verdict}: {without.value.partition(';')[0]}"
    return Decision(verdict, f"{value}; {said}")


def _least(curves: Curves, name: str, variable: str, among: tuple[str, ...], ratio: float) -> Decision:
    largest = curves.errors(among)
    asked = curves.compared(largest, kept=largest[among.index(name)])
    others = [one for one in among if one != name]
    errors = curves.errors(others, variable)
    good = curves.errors([name], variable)[0] < ratio * errors.min(axis=0)
    beaten = dict.fromkeys(errors.argmin(axis=0)[asked.asked & ~good])
    elsewhere = ", ".join(label(others[i]) for i in beaten)
    return over(asked, good, f"elsewhere {elsewhere}" if elsewhere else "")


def _advance(curves: Curves, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Absolute advance and interval, a row a method."""
    rows = [[np.abs(curves.of(n, v)) for n in names] for v in ("perihelion_advance", "perihelion_advance_interval")]
    return np.array(rows[0]), np.array(rows[1])


@claim(
    id="fig-4-coincide",
    paper="Figure 4, caption",
    sentence="The integrators ABAs5o6H, ABA104 and BAB's8o7H achieve approximately the same performance, obfuscating "
    "their plots",
    kind="result",
    statement="ABAs5o6H, ABA104 and BAB's8o7H coincide in perihelion advance",
    threshold=f"their largest and least advance within {DOT_WORDS}; {range_words('the first of the three')}",
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


@claim(
    id="fig-4-intervals",
    paper="Figure 4, caption",
    sentence="Linear fit 95% confidence intervals of the perihelion advance are significantly smaller than the dot "
    "size",
    kind="result",
    statement="95 % confidence intervals of the perihelion advance are significantly smaller than the dot size",
    threshold=f"the width of the interval, as a share of the advance, at most 0.21, that of a dot over 1.26: "
    f"{SIGNIFICANTLY.words}; {range_words('the first of the ten')}",
    bound=(DOT - 1) / SIGNIFICANTLY.number,
    needs=CUBE,
)
def fig_4_intervals(results: Results, widest: float) -> Decision:
    curves = curves_of(results, "kepler")
    advance, interval = _advance(curves, TEN)
    asked = curves.compared(curves.errors(TEN))
    share = (2 * interval / advance).max(axis=0)
    low, high = share[asked.asked].min(), share[asked.asked].max()
    return over(
        asked,
        share <= widest,
        f"widest of the ten {short(100 * low, 2)} to {short(100 * high, 2)} % of the advance",
    )


@claim(
    id="figure-of-the-precession",
    paper="Section 4.B, paragraph on precession",
    sentence="Figure 5 shows the perihelion precession dθ/dt which has been obtained numerically through linear "
    "regression of θ(t) over numerous orbital periods",
    kind="misprint",
    statement="Figure 5 shows the perihelion precession",
    threshold="the curves of ABAs5o6H, ABA104 and BAB's8o7H coincide in the precession (caption of Figure 4): their "
    f"maximum and mean errors, which Figure 5 shows, would do so as well, within {DOT_WORDS}; {range_words()}",
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
        told.append(
            f"{measure} {short(shown.min())} to {short(shown.max())}, coinciding at {int((shown <= dot).sum())} of "
            f"{shown.size} step sizes"
        )
    return combined(verdicts, f"largest over least error of the three: {'; '.join(told)}. Figure 4 is meant")


@claim(
    id="accumulated-error-and-mean",
    paper="Section 4.B, paragraph on precession",
    sentence="Comparison of Figure 4 and 5 suggests that the accumulated error is in better agreement with the average "
    "error than the maximum error",
    kind="result",
    statement="The accumulated error is in better agreement with the average error than with the maximum error",
    threshold="rank correlation, over the ten methods, of the perihelion advance with the mean error nearer to 1 than "
    f"that with the maximum error: the ratio of the distances below 1; {range_words()}",
    bound=1.0,
    needs=CUBE,
)
def accumulated_and_mean(results: Results, ratio: float) -> Decision:
    curves = curves_of(results, "kepler")
    found = _agreement(curves, TEN, ratio)
    if found.verdict == "holds":
        return found
    without = _agreement(curves, tuple(one for one in TEN if one != SIXTH_ORDER), ratio)
    said = f"without {label(SIXTH_ORDER)} it {without.verdict}: {without.value.partition(';')[0]}"
    return found._replace(value=f"{found.value}; {said}")


def _agreement(curves: Curves, names: tuple[str, ...], ratio: float) -> Decision:
    largest, mean = curves.errors(names), curves.errors(names, "mean_energy_error")
    advance, _ = _advance(curves, names)
    known = curves.compared(largest)
    asked = Range(known.x, known.asked & np.isfinite(advance).all(axis=0), known.unit)
    if asked.asked.sum() < FEWEST:
        message = f"the advances of the {len(names)} methods are known at fewer than three step sizes"
        raise Undecided(message)
    by_mean, by_largest = (rank_correlation(advance, other) for other in (mean, largest))
    told = (short(float(np.median(one[asked.asked])), 2) for one in (by_mean, by_largest))
    value = "median rank correlation {} with the mean and {} with the maximum error".format(*told)
    return over(asked, 1 - by_mean < ratio * (1 - by_largest), value)
