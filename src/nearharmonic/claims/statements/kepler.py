"""Figures 4 and 5: the Sun-Mercury system, its energy errors and the advance of the perihelion."""

from __future__ import annotations

import numpy as np

from nearharmonic.claims.claim import Decision, Verdict, claim, combined, either
from nearharmonic.claims.curves import (
    FEWEST,
    MEASURES,
    SLOPE,
    Curves,
    Floats,
    Range,
    orders,
    over,
    range_words,
    rank_correlation,
)
from nearharmonic.claims.results import Results, Undecided, label, short
from nearharmonic.claims.statements.henon_heiles import ORDERS
from nearharmonic.math import cos, exp, hypot, log, sin
from nearharmonic.systems import kepler

CUBE = ("cubes/kepler.h5",)
COINCIDING = ("abas5o6h", "aba104", "babps8o7h")
#: Ten methods, or there is no best of them.
TEN = tuple(ORDERS)
#: A dot of 2 pt in a figure 5 inches high over 18 decades covers a tenth of a decade.
DOT = 1.2589254117941673  # 10^(1/10)
DOT_WORDS = "a tenth of a decade, 26 %, what a dot of 2 pt covers in a figure of 5 inches over 18 decades"


@claim(
    id="kepler-starts-at-aphelion",
    paper="Section 4.B, below Eq. 19",
    statement="The aphelion is the initial distance, yielding the minimum orbital velocity",
    threshold="the start is an apsis (q.p = 0) outside the circular orbit of its speed, and the ellipse is Mercury's: "
    "eccentricity 0.2056 and period 87.97 d within 10⁻³ of them, the digits of the fact sheet",
)
def kepler_starts_at_aphelion(_: Results) -> Decision:
    system = kepler.SYSTEM
    ((x, y), (u, v)), (GM,) = system.start(float), system.constants(float)
    eccentricity = 1 - hypot(x, y) * (u * u + v * v) / GM
    days = kepler.orbital_period((x, y), (u, v), GM) / 24
    good = x * u + y * v == 0 and abs(eccentricity / 0.2056 - 1) < 1e-3 and abs(days / 87.97 - 1) < 1e-3
    return either(good, f"eccentricity {eccentricity:.4f}, period {days:.2f} d")


#: Masses of Sun and Mercury in kg by the fact sheets that the paper names.
SUN, MERCURY = 1.9885e30, 0.3301e24


@claim(
    id="eq-19-approximation",
    paper="Eq. 19",
    statement="The reduced mass is that of Mercury, approximately",
    threshold="m_M/M - 1 = m_M/m_S below 10⁻⁴, the last digit of the data that the system is made of",
)
def eq_19(_: Results) -> Decision:
    return either(MERCURY / SUN < 1e-4, f"m_M/m_S = {short(MERCURY / SUN, 2)}")


@claim(
    id="eq-20",
    paper="Eq. 20",
    statement="The Laplace-Runge-Lenz vector is p × L - r/|r|",
    threshold="of constant length, to 10⁻¹², along the exact orbit of Mercury, at 64 true anomalies",
)
def eq_20(_: Results) -> Decision:
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
    return either(bool(np.ptp(printed) < 1e-12), value)


@claim(
    id="fig-5-orders",
    paper="Figure 5",
    statement="Small steps show the general order: six for Yosh s7o6 A, four for the others",
    threshold=SLOPE,
    needs=CUBE,
)
def fig_5_orders(results: Results) -> Decision:
    return orders(Curves(results.cube("kepler")), ORDERS)


@claim(
    id="fig-5-best-maximum",
    paper="Section 4.B, text to Figure 5",
    statement="ABA104 shows the best performance in regard to the maximum error",
    threshold=f"the least maximum error of the ten {range_words('ABA104')}",
    needs=CUBE,
)
def fig_5_best_maximum(results: Results) -> Decision:
    return _best(results, "aba104", "max_energy_error")


@claim(
    id="fig-5-best-mean",
    paper="Section 4.B, text to Figure 5",
    statement="BAB's9o7H shows the best performance in regard to the average error",
    threshold="the least mean error of the ten " + range_words("BAB's9o7H"),
    needs=CUBE,
)
def fig_5_best_mean(results: Results) -> Decision:
    return _best(results, "babps9o7h", "mean_energy_error")


def _best(results: Results, name: str, variable: str) -> Decision:
    curves = Curves(results.cube("kepler"))
    errors, largest = curves.errors(TEN, variable), curves.errors(TEN)
    asked = curves.compared(largest, kept=largest[TEN.index(name)])
    least = errors.argmin(axis=0)
    others = [label(TEN[i]) for i in dict.fromkeys(least[asked.asked]) if TEN[i] != name]
    return over(asked, least == TEN.index(name), f"elsewhere {', '.join(others)}" if others else "")


def _advance(curves: Curves, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Absolute advance and interval, a row a method."""
    rows = [[np.abs(curves.of(n, v)) for n in names] for v in ("perihelion_advance", "perihelion_advance_interval")]
    return np.array(rows[0]), np.array(rows[1])


@claim(
    id="fig-4-coincide",
    paper="Figure 4, caption",
    statement="ABAs5o6H, ABA104 and BAB's8o7H coincide in perihelion advance",
    threshold=f"their largest and least advance within {DOT_WORDS}; {range_words('the first of the three')}",
    needs=CUBE,
)
def fig_4_coincide(results: Results) -> Decision:
    curves = Curves(results.cube("kepler"))
    advance, _ = _advance(curves, COINCIDING)
    asked = curves.compared(curves.errors(COINCIDING))
    ratio = advance.max(axis=0) / advance.min(axis=0)
    value = f"largest over least {short(ratio[asked.asked].min())} to {short(ratio[asked.asked].max())}"
    return over(asked, ratio <= DOT, value + _at_evaluations(curves, advance))


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
    statement="95 % confidence intervals of the perihelion advance are significantly smaller than the dot size",
    threshold=f"the width of the interval at most half of {DOT_WORDS}; {range_words('the first of the ten')}",
    needs=CUBE,
)
def fig_4_intervals(results: Results) -> Decision:
    curves = Curves(results.cube("kepler"))
    advance, interval = _advance(curves, TEN)
    asked = curves.compared(curves.errors(TEN))
    share = (2 * interval / advance).max(axis=0)
    low, high = share[asked.asked].min(), share[asked.asked].max()
    return over(
        asked,
        share <= (DOT - 1) / 2,
        f"widest of the ten {short(100 * low, 2)} to {short(100 * high, 2)} % of the advance",
    )


@claim(
    id="figure-of-the-precession",
    paper="Section 4.B, paragraph on precession",
    statement="Figure 5 shows the perihelion precession",
    threshold="the curves of ABAs5o6H, ABA104 and BAB's8o7H coincide in the precession (caption of Figure 4): their "
    f"maximum and mean errors, which Figure 5 shows, would do so as well, within {DOT_WORDS}; {range_words()}",
    needs=CUBE,
)
def figure_of_the_precession(results: Results) -> Decision:
    curves, told = Curves(results.cube("kepler")), []
    asked = curves.compared(curves.errors(COINCIDING))
    verdicts: list[Verdict] = []
    for measure, variable in MEASURES.items():
        errors = curves.errors(COINCIDING, variable)
        largest, least = errors.max(axis=0), errors.min(axis=0)
        verdicts.append(over(asked, largest <= DOT * least).verdict)
        shown = largest[asked.asked] / least[asked.asked]
        told.append(
            f"{measure} {short(shown.min())} to {short(shown.max())}, coinciding at {int((shown <= DOT).sum())} of "
            f"{shown.size} step sizes"
        )
    return combined(verdicts, f"largest over least error of the three: {'; '.join(told)}. Figure 4 is meant")


@claim(
    id="accumulated-error-and-mean",
    paper="Section 4.B, paragraph on precession",
    statement="The accumulated error is in better agreement with the average error than with the maximum error",
    threshold="rank correlation, over the ten methods, of the perihelion advance with the mean error above that with "
    f"the maximum error; {range_words()}",
    needs=CUBE,
)
def accumulated_and_mean(results: Results) -> Decision:
    curves = Curves(results.cube("kepler"))
    largest, mean = curves.errors(TEN), curves.errors(TEN, "mean_energy_error")
    advance, _ = _advance(curves, TEN)
    found = curves.compared(largest)
    asked = Range(found.x, found.asked & np.isfinite(advance).all(axis=0), found.unit)
    if asked.asked.sum() < FEWEST:
        message = "the advances of the ten methods are known at fewer than three step sizes"
        raise Undecided(message)
    by_mean, by_largest = (rank_correlation(advance, other) for other in (mean, largest))
    told = (short(float(np.median(one[asked.asked])), 2) for one in (by_mean, by_largest))
    value = "median rank correlation {} with the mean and {} with the maximum error".format(*told)
    return over(asked, by_mean > by_largest, value)
