"""Figure 5: the Sun-Mercury system and its energy errors."""

from __future__ import annotations

import numpy as np

from nearharmonic.math import cos, hypot, sin
from nearharmonic.reproduction.claims.claim import Decision, background, either, mathematics, result
from nearharmonic.reproduction.claims.judging.curves import Curves, curves_of, over, range_words
from nearharmonic.reproduction.claims.judging.slopes import BAND, SLOPE, orders
from nearharmonic.reproduction.claims.results import Results, label, short
from nearharmonic.reproduction.claims.statements.figures.henon_heiles import ORDERS
from nearharmonic.systems import kepler

CUBE = ("cubes/kepler.h5",)
#: Ten methods, or there is no best of them.
TEN = tuple(ORDERS)


@background(
    id="kepler-starts-at-aphelion",
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
    id="eq-19-approximation",
    paper="Eq. 19",
    sentence="H = ‖p‖²/(2M) - G m_S m_M/‖q‖ ≈ ‖p‖²/(2 m_M) - G m_S m_M/‖q‖",
    statement="The reduced mass M may be replaced by the mass of Mercury",
    threshold="m_M/M - 1 = m_M/m_S below 10⁻⁴, the last digit of the data of the fact sheets",
    bound=1e-4,
)
def eq_19(_: Results, off: float) -> Decision:
    ratio = MERCURY / SUN
    return either(ratio < off, f"m_M/m_S = {short(ratio, 2)}")


@mathematics(
    id="eq-20",
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


@background(
    id="fig-5-orders",
    paper="Section 1, tried on Figure 5",
    sentence="Nth order integrators have their integration error reduced by a factor k^N when the time step is "
    "reduced by a factor k",
    statement="For small steps the curves of Figure 5 have the order of the methods: six for Yosh s7o6 A, four for the "
    "others",
    threshold=SLOPE,
    bound=BAND,
    needs=CUBE,
)
def fig_5_orders(results: Results, band: float) -> Decision:
    return orders(curves_of(results, "kepler"), ORDERS, band)


@result(
    id="fig-5-best-maximum",
    paper="Section 4.B, text to Figure 5",
    sentence="ABA104 shows the best performance in regard to the maximum error",
    statement="ABA104 shows the best performance in regard to the maximum error",
    threshold=f"its maximum error below that of each of the other nine {range_words('ABA104')}",
    bound=1.0,
    needs=CUBE,
)
def fig_5_best_maximum(results: Results, ratio: float) -> Decision:
    return _best(results, "aba104", "max_energy_error", ratio)


@result(
    id="fig-5-best-mean",
    paper="Section 4.B, text to Figure 5",
    sentence="BAB's9o7H shows the best performance in regard to the average error",
    statement="BAB's9o7H shows the best performance in regard to the average error",
    threshold="its mean error below that of each of the other nine " + range_words("BAB's9o7H"),
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
    return over(asked, good, f"elsewhere ahead: {elsewhere}" if elsewhere else "")
