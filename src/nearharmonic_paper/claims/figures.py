"""Statements about the six figures."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache, partial
from typing import Any

import numpy as np

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.math import cos, exp, hypot, log, sin
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems import henon_heiles, kepler
from nearharmonic.theory.oscillator import kappa, lambda_max, stability_limit, zeta
from nearharmonic_paper.claims import judging
from nearharmonic_paper.claims.claim import (
    Claim,
    Decision,
    Results,
    Verdict,
    background,
    combined,
    counted,
    either,
    finding,
    label,
    mathematics,
    misprint,
    once,
    require,
    result,
    short,
    tallied,
)

# --- Figures 1 and 2: the harmonic oscillator, its observed orders and its error terms. -------------------------------

TERMS = ("cubes/sho_terms.h5",)
#: First moves of the ABA and of the BAB composition.
COMPOSITIONS: tuple[First, ...] = ("drift", "kick")
SIXTH = ("abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h")
FOURTH = ("ruth", "s5odr4", "aba104", "aba864", "aba1064")
READS_ORDER = "The slopes of the lines read the integrator order"
#: A term that vanishes for the true coefficients is below this bound for the printed ones; any other term is above it.
VANISHED = 1e-30
ZERO = "Terms below 10⁻³⁰ count as zero: rounded decimals leave up to 10⁻⁷³, and all other terms are above 10⁻⁴"


in_figure_1 = partial(
    result, paper="Section 4.B, text to Figure 1", threshold=judging.SLOPE, bound=judging.BAND, needs=("cubes/sho.h5",)
)
FIGURE_1 = (
    in_figure_1(
        id="fig-1-sixth-order",
        sentence="the integrators ABAs5o6H A, BABs7o7H, BAB's8o7H and BAB's9o7H behave as sixth order integrators",
        statement="ABAs5o6H, BABs7o7H, BAB's8o7H and BAB's9o7H behave as sixth order integrators on the oscillator",
    )(partial(judging.orders_on, "sho", dict.fromkeys(SIXTH, 6))),
    in_figure_1(
        id="fig-1-fourth-order",
        sentence=READS_ORDER,
        statement=f"{READS_ORDER}: four for Ruth, s5odr4, ABA104, ABA864 and ABA1064",
    )(partial(judging.orders_on, "sho", dict.fromkeys(FOURTH, 4))),
    in_figure_1(id="fig-1-yoshida", sentence=READS_ORDER, statement=f"{READS_ORDER}: six for Yosh s7o6 A")(
        partial(judging.orders_on, "sho", {"yoshida_s7o6a": 6})
    ),
)


in_figure_2 = partial(result, paper="Section 4.B, text to Figure 2", needs=TERMS)


@mathematics(
    paper="Section 3, last paragraph",
    sentence="The objectives κ₀ and κ₁ are always 0 if Σ c_i = Σ d_i = 1",
    statement="κ₀ and κ₁ are always 0 if the coefficients of each row sum to 1",
    threshold=f"κ₀ is exactly 0 and κ₁ vanishes for each method and composition of Figure 2. {ZERO}",
    bound=VANISHED,
    needs=TERMS,
)
def kappa_0_and_1(results: Results, vanished: float) -> Decision:
    terms = results.cube("sho_terms")["kappa"].sel(order=1).values
    zeroth = [abs(1 - zeta(m, first=first)[0]) for m in _methods(results) for first in COMPOSITIONS]
    good = [*(term == 0 for term in zeroth), *(terms < vanished).ravel()]
    return counted(good, f"κ₀ = {short(float(max(zeroth)))}, κ₁ up to {short(float(terms.max()), 1)}")


def _methods(results: Results) -> list[Any]:
    return [results.method(str(name)) for name in results.cube("sho_terms")["integrator"].values]


@once
def _terms(results: Results, name: str, first: str | None = None) -> Any:
    """Return all terms of one composition, by default the method's own; the first term has index 0."""
    first, terms = first or results.method(name).first, results.cube("sho_terms")["kappa"]
    require(name in terms["integrator"].values, f"Figure 2 of these results does not have the method {name}")
    row = terms.sel(integrator=name, first=first).values
    return row[np.isfinite(row)]


@result(
    paper="Figure 2, caption",
    sentence="Lines and markers of the same color intersect exactly at even orders",
    statement="At even orders the terms of the ABA and the BAB composition are exactly equal",
    threshold="even terms of both compositions agree to a unit in the last place of a double, or both are below 10⁻³⁰",
    bound=VANISHED,
    needs=TERMS,
)
def fig_2_even_orders_meet(results: Results, vanished: float) -> Decision:
    terms = results.cube("sho_terms")["kappa"]
    orders, values = terms["order"].values, terms.transpose("first", "integrator", "order").sel(first=[*COMPOSITIONS])
    one, other = values.values[..., orders % 2 == 0]
    reached = np.isfinite(one) & np.isfinite(other)
    none = (one < vanished) & (other < vanished)
    same = (np.abs(one - other) <= np.spacing(np.maximum(np.abs(one), np.abs(other)))) | none
    differ = np.nanmax(np.abs(np.diff(values.values[..., (orders % 2 == 1) & (orders > 3)], axis=0)))
    beside = f"; odd terms differ by up to {short(float(differ))}"
    return tallied(same[reached].tolist(), "even terms", beside)


@in_figure_2(
    sentence="the obtained BAB methods have more error terms when implemented as ABA methods",
    statement="The obtained BAB methods have more error terms when implemented as ABA methods",
    threshold=f"each BAB method of Figure 2 has more terms that do not vanish as ABA than as BAB. {ZERO}",
    bound=VANISHED,
)
def fig_2_more_terms_as_aba(results: Results, vanished: float) -> Decision:
    names = [m.name for m in _methods(results) if m.first == "kick"]
    require(names, "Figure 2 of these results has no BAB method")
    counts = {name: [int((_terms(results, name, f) > vanished).sum()) for f in COMPOSITIONS] for name in names}
    good = [aba > bab for aba, bab in counts.values()]
    told = (f"{label(name)} {aba} and {bab}" for name, (aba, bab) in counts.items())
    return counted(good, f"number of terms as ABA and as BAB: {', '.join(told)}")


@in_figure_2(
    sentence="the seventh harmonic order of BAB's8o7H eliminates the seventh order error term of the position "
    "coordinate for the BAB implementation as opposed to the sixth harmonic order integrator ABAs5o6H A",
    statement="κ₇ vanishes for BAB's8o7H as BAB, but not for ABAs5o6H",
    threshold=f"κ₇ of BAB's8o7H vanishes, and κ₇ of ABAs5o6H does not. {ZERO}",
    bound=VANISHED,
)
def fig_2_kappa_7(results: Results, vanished: float) -> Decision:
    bab, aba = _terms(results, "babps8o7h")[6], _terms(results, "abas5o6h")[6]
    return counted([bab < vanished, aba > vanished], f"κ₇ = {short(bab, 1)} for BAB's8o7H, {short(aba)} for ABAs5o6H")


@in_figure_2(
    sentence="The largest integer value of λ with no integration error reads the SHO integration order",
    statement="The largest λ up to which all terms vanish is the harmonic order in the name of the method",
    threshold=f"this λ equals the order in the name for each of the four new methods in the figures. {ZERO}",
    bound=VANISHED,
)
def fig_2_reads_order(results: Results, vanished: float) -> Decision:
    last = {label(name): int(np.argmax([*(_terms(results, name) >= vanished), True])) for name in SIXTH}
    told = ", ".join(f"{name} {n}" for name, n in last.items())
    return counted([f"o{n}H" in name for name, n in last.items()], f"largest λ: {told}")


#: Compositions of leapfrog steps of order six or more with the smallest known number of stages.
STAGE_OPTIMISED = ("yoshida_s7o6a", "s9odr6a", "s15odr8")


@in_figure_2(
    sentence="Stage-optimized integrators of higher orders generally have rapidly diverging higher order error "
    "contributions",
    statement="Of Yosh s7o6 A, s9odr6a and s15odr8, most have far larger terms κ than the new methods",
    threshold="for more than half of Yosh s7o6 A, s9odr6a and s15odr8, the largest κ is at least ten times the largest "
    f"κ of each of the four new methods in the figures. {judging.GREATLY.words}. {judging.GENERALLY.words}",
    bound=judging.GREATLY.number,
)
def fig_2_yoshida_diverges(results: Results, factor: float) -> Decision:
    new = {name: float(_terms(results, name).max()) for name in SIXTH}
    worst = max(new, key=new.__getitem__)
    theirs = {"yoshida_s7o6a": float(_terms(results, "yoshida_s7o6a").max())}
    for method in (results.methods[name] for name in STAGE_OPTIMISED[1:] if name in results.methods):
        theirs[method.name] = _largest_term(method)
    listed = ", ".join(f"{label(name)} {short(largest)}" for name, largest in theirs.items())
    value = f"largest κ: {listed}; of the new methods at most {short(new[worst])} ({label(worst)})"
    rapid = [largest >= factor * new[worst] for largest in theirs.values()]
    return either(sum(rapid) > judging.GENERALLY.number * len(rapid), value)


@cache
def _largest_term(method: Tableau) -> float:
    return float(max(kappa(method, lambda_max(method))))


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="these integrators are not suitable for integrating the SHO with large time steps",
    statement="Stage-optimized integrators of higher order are not suitable for the oscillator with large time steps",
    threshold="at every large step size, the maximum error of Yosh s7o6 A is at least ten times the smallest maximum "
    "error of the other nine methods. Yosh s7o6 A is the only stage-optimised method of higher order in the figures. "
    f"{judging.NOT_SUITABLE.words}. {judging.LARGE.words}",
    bound=judging.NOT_SUITABLE.number,
    needs=("cubes/sho.h5",),
)
def fig_2_large_steps(results: Results, factor: float) -> Decision:
    curves = judging.curves_of(results, "sho")
    others = (*FOURTH, *SIXTH)
    theirs, best = curves.errors(["yoshida_s7o6a"])[0], curves.errors(others).min(axis=0)
    asked = judging.large_steps(curves, *others)
    ratio = (theirs / best)[asked.asked]
    value = f"ratio of Yosh s7o6 A's error to the best error {short(ratio.min(), 2)} to {short(ratio.max(), 2)}"
    return judging.over(asked, theirs >= factor * best, value)


# --- Figure 3: the Hénon-Heiles system. -------------------------------------------------------------------------------

HENON_HEILES, KEPLER = ("cubes/henon_heiles.h5",), ("cubes/kepler.h5",)
DESCENDING = ("babps8o7h", "babps9o7h")
ORDERS = {
    "ruth": 4, "s5odr4": 4, "aba104": 4, "aba864": 4, "aba1064": 4, "yoshida_s7o6a": 6, "abas5o6h": 4, "babs7o7h": 4,
    "babps8o7h": 4, "babps9o7h": 4,
}  # fmt: skip


@mathematics(
    paper="Section 4.B, below Eq. 18",
    sentence="in this case H = 1/8, inside the chaotic domain",
    statement="H = 1/8 for q = (0.3, 0), p = (0, 0.4)",
    threshold="the initial values of the runs give this energy exactly, in rational arithmetic",
)
def henon_heiles_energy(_: Results) -> Decision:
    system = henon_heiles.SYSTEM
    q, p = system.start(Fraction)
    energy = system.energy(q, p, ())
    return either(energy == Fraction(1, 8), f"H = {energy}")


@result(
    paper="Section 4.B, below Eq. 18",
    sentence="in this case H = 1/8, inside the chaotic domain",
    statement="The orbit of the paper is chaotic",
    threshold="the lower end of the 95 % interval of the largest Lyapunov exponent is at least ten times the exponent "
    "of a regular orbit with H = 1/128 after the same time",
    bound=judging.GREATLY.number,
    needs=("cubes/henon_heiles_chaos.h5",),
)
def henon_heiles_chaotic(results: Results, factor: float) -> Decision:
    cube = results.cube("henon_heiles_chaos")
    last = cube["lyapunov_exponent"].isel(time=-1)
    exponent, regular = (float(last.sel(orbit=orbit)) for orbit in ("paper", "regular"))
    width = float(cube["lyapunov_exponent_interval"].sel(orbit="paper"))
    until = f"up to t = {short(float(cube['time'][-1]))} (growth by e in {1 / exponent:.0f} units of time)"
    value = f"exponent {short(exponent, 2)} ± {short(width, 2)} {until}; regular orbit {short(regular, 2)}"
    return either(exponent - width >= factor * regular, value)


@mathematics(
    paper="Section 4.B, text to Figure 3",
    sentence="The Hénon Heiles system can be considered as a perturbed SHO for small values of q_x and q_y",
    statement="V is the potential of the oscillator plus a term of third degree, which is negligible for small q",
    threshold="V(εq) = ε²|q|²/2 + ε³ (V(q) - |q|²/2) exactly, for ε = 1/2, 1/4 and 1/8, at the initial position and "
    "at (2/7, -3/5)",
)
def henon_heiles_near_harmonic(_: Results) -> Decision:
    system, good = henon_heiles.SYSTEM, []
    start = system.start(Fraction)[0]
    for x, y in (start, (Fraction(2, 7), Fraction(-3, 5))):
        harmonic = (x * x + y * y) / 2
        rest = system.V((x, y)) - harmonic
        scales = [Fraction(1, 2**n) for n in (1, 2, 3)]
        good += [system.V((e * x, e * y)) == e**2 * harmonic + e**3 * rest for e in scales]
    depth = f"{2 / 3 * float(start[0]):.2g} at the start"
    return tallied(good, "equations", f"; the term is at most 2/3 |q| of the oscillator's potential, {depth}")


def orders_of_figure(number: int, system: str) -> Claim:
    """Make the statement that the curves of a figure have the orders of the methods."""
    return background(
        id=f"fig-{number}-orders",
        paper=f"Section 1, tried on Figure {number}",
        sentence="Nth order integrators have their integration error reduced by a factor k^N when the time step is "
        "reduced by a factor k",
        statement=f"For small steps the curves of Figure {number} have the order of the methods: six for Yosh s7o6 A, "
        "four for the other methods",
        threshold=judging.SLOPE,
        bound=judging.BAND,
        needs=(f"cubes/{system}.h5",),
    )(partial(judging.orders_on, system, ORDERS))


FIGURE_3 = orders_of_figure(3, "henon_heiles")


@result(
    paper="Section 4.B, text to Figure 3",
    sentence="especially BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    statement="BAB's8o7H and BAB's9o7H exhibit a sixth order descent of the maximum error for large τ",
    threshold=f"{judging.SLOPE}. Only large step sizes count. {judging.LARGE.words}",
    bound=judging.BAND,
    needs=HENON_HEILES,
)
def fig_3_sixth_order_descent(results: Results, band: float) -> Decision:
    curves, told, found = judging.curves_of(results, "henon_heiles"), [], []
    asked = judging.large_steps(curves, *DESCENDING)
    for name in DESCENDING:
        slopes = judging.local_slopes(curves, name)
        piece = asked.longest(np.abs(slopes - 6) <= band)
        found.append(piece)
        inside = slopes[(curves.x >= piece.low) & (curves.x <= piece.high)]
        spread = f" with slopes {inside.min():.1f} to {inside.max():.1f}" if inside.size else ""
        told.append(f"{label(name)} {piece.words(curves.unit)}{spread}")
    steepest = short(np.nanmax([judging.local_slopes(curves, name)[asked.asked] for name in DESCENDING]), 2)
    told += [f"irregular slopes up to {steepest} at larger steps", f"large step sizes are {asked.words()}"]
    return combined(map(judging.judged, found), "; ".join(told))


@result(
    paper="Section 4.B, text to Figure 3",
    sentence="especially BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    statement="No other fourth order method keeps a sixth order descent as long as BAB's8o7H and BAB's9o7H",
    threshold=f"each of the two methods has local slopes within {judging.BAND} of 6 over more decades of large step "
    f"sizes than each of the other seven methods of fourth order. {judging.LARGE.words}",
    bound=judging.BAND,
    needs=HENON_HEILES,
)
def fig_3_steepest(results: Results, band: float) -> Decision:
    curves, lengths = judging.curves_of(results, "henon_heiles"), {}
    for name in (name for name, order in ORDERS.items() if order == 4):
        asked = judging.large_steps(curves, name)
        lengths[name] = asked.longest(np.abs(judging.local_slopes(curves, name) - 6) <= band).decades
    others = {name: length for name, length in lengths.items() if name not in DESCENDING}
    longest = max(others, key=others.__getitem__)
    told = ", ".join(f"{label(name)} {lengths[name]:.2f}" for name in DESCENDING)
    value = f"{told} decades; other methods up to {others[longest]:.2f} decades ({label(longest)})"
    return counted([lengths[name] > others[longest] for name in DESCENDING], value)


# --- Figures 4 and 5: the advance of the perihelion of Mercury and the energy errors. ---------------------------------


@background(
    paper="Section 4.B, below Eq. 19",
    sentence="the aphelion is chosen as the initial Sun-Mercury distance yielding the minimum orbital velocity",
    statement="The orbit starts at the aphelion of Mercury, where its velocity is lowest",
    threshold="at the start q·p = 0, and the speed is below the speed of a circular orbit. Eccentricity and period "
    "agree with Mercury's fact sheet, 0.2056 and 87.97 d, to a relative 10⁻³, the precision of the sheet",
    bound=1e-3,
)
def kepler_starts_at_aphelion(_: Results, off: float) -> Decision:
    system = kepler.SYSTEM
    ((x, y), (u, v)), (GM,) = system.start(float), system.constants(float)
    eccentricity = 1 - hypot(x, y) * (u * u + v * v) / GM
    days = kepler.orbital_period((x, y), (u, v), GM) / 24
    good = x * u + y * v == 0 and max(abs(eccentricity / 0.2056 - 1), abs(days / 87.97 - 1)) < off
    return either(good, f"eccentricity {eccentricity:.4f}, period {days:.2f} d")


#: Masses of Sun and Mercury in kg, from the fact sheets that the paper names.
SUN, MERCURY = 1.9885e30, 0.3301e24


@mathematics(
    paper="Eq. 19",
    sentence="H = ‖p‖²/(2M) - G m_S m_M/‖q‖ ≈ ‖p‖²/(2 m_M) - G m_S m_M/‖q‖",
    statement="The reduced mass M may be replaced by the mass of Mercury",
    threshold="m_M/M - 1 = m_M/m_S is below 10⁻⁴, the last digit of the data in the fact sheets",
    bound=1e-4,
)
def eq_19_approximation(_: Results, off: float) -> Decision:
    ratio = MERCURY / SUN
    return either(ratio < off, f"m_M/m_S = {short(ratio, 2)}")


@mathematics(
    paper="Eq. 20",
    sentence="A = p × L - r̂",
    statement="The Laplace-Runge-Lenz vector is p × L - r/|r|, in units with mk = 1",
    threshold="the length of the vector is constant to 10⁻¹² along the exact orbit of Mercury, at 64 true anomalies, "
    "for H = p²/(2m) - k/r in units with mk = 1. The paper does not name its units",
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
        f"length {short(natural.mean(), 6)}, constant within {short(float(np.ptp(natural)), 1)}. In the units of the "
        f"system, with L = {short(L)} and GM = {short(GM)}, and without the factor 1/(mk), the length varies from "
        f"{short(own.min(), 2)} to {short(own.max(), 2)}"
    )
    return either(bool(np.ptp(natural) < off), value)


FIGURE_5 = orders_of_figure(5, "kepler")


#: The reference method of sixth order: the value has a second verdict on the methods without it.
SIXTH_ORDER = "yoshida_s7o6a"


def with_and_without_sixth_order(decide: Callable[[tuple[str, ...]], Decision]) -> Decision:
    """Decide among the ten methods; if the statement does not hold, decide without the sixth order method as well."""
    found = decide(BENCHMARKED)
    if found.verdict == "holds":
        return found
    without = decide(tuple(name for name in BENCHMARKED if name != SIXTH_ORDER))
    said = f"Without {label(SIXTH_ORDER)} the statement {without.verdict}: {without.value.partition(';')[0]}"
    return found._replace(value=f"{found.value}. {said}")


def _best(name: str, variable: str, results: Results, ratio: float) -> Decision:
    """Decide whether a method has the smallest error of the ten."""
    curves = judging.curves_of(results, "kepler")

    def decide(among: tuple[str, ...]) -> Decision:
        largest = curves.errors(among)
        asked = curves.compared(largest, kept=largest[among.index(name)])
        others = [one for one in among if one != name]
        errors = curves.errors(others, variable)
        good = curves.errors([name], variable)[0] < ratio * errors.min(axis=0)
        beaten = dict.fromkeys(errors.argmin(axis=0)[asked.asked & ~good])
        elsewhere = ", ".join(label(others[i]) for i in beaten)
        return judging.over(asked, good, f"smallest errors elsewhere: {elsewhere}" if elsewhere else "")

    return with_and_without_sixth_order(decide)


BEST = tuple(
    result(
        id=f"fig-5-best-{measure}",
        paper="Section 4.B, text to Figure 5",
        sentence=f"{name} shows the best performance in regard to the {words} error",
        statement=f"{name} shows the best performance in regard to the {words} error",
        threshold=f"the {measure} error of {name} is below the {measure} error of each of the other nine methods "
        f"{judging.range_words(name)}",
        bound=1.0,
        needs=KEPLER,
    )(partial(_best, method, judging.MEASURES[measure]))
    for measure, words, name, method in (
        ("maximum", "maximum", "ABA104", "aba104"),
        ("mean", "average", "BAB's9o7H", "babps9o7h"),
    )
)


COINCIDING = ("abas5o6h", "aba104", "babps8o7h")


@result(
    paper="Figure 4, caption",
    sentence="The integrators ABAs5o6H, ABA104 and BAB's8o7H achieve approximately the same performance, obfuscating "
    "their plots",
    statement="ABAs5o6H, ABA104 and BAB's8o7H have approximately equal perihelion advances",
    threshold="the largest of the three advances is at most 1.26 times the smallest advance "
    f"{judging.range_words('one of the three methods')}. {judging.APPROXIMATELY.brief}",
    bound=judging.DOT,
    needs=KEPLER,
)
def fig_4_coincide(results: Results, dot: float) -> Decision:
    curves = judging.curves_of(results, "kepler")
    advance = np.abs(curves.rows(COINCIDING, "perihelion_advance"))
    asked = curves.compared(curves.errors(COINCIDING))
    ratio = advance.max(axis=0) / advance.min(axis=0)
    low, high = short(ratio[asked.asked].min()), short(ratio[asked.asked].max())
    value = f"ratio of largest to smallest advance {low} to {high}"
    return judging.over(asked, ratio <= dot, value + _at_evaluations(curves, advance))


def _at_evaluations(curves: judging.Curves, advance: Floats, number: float = 240.0) -> str:
    """Describe the advances at a number of evaluations per orbit, interpolated between step sizes by a power law."""
    told = []
    for name, row in zip(COINCIDING, advance, strict=True):
        evaluations = curves.of(name, "evaluations_per_orbit")
        known = np.flatnonzero(np.isfinite(row) & (row > 0))
        known = known[np.argsort(evaluations[known], kind="stable")]
        if known.size == 0 or not evaluations[known[0]] <= number <= evaluations[known[-1]]:
            return ""
        between = float(np.interp(log(number), log(evaluations[known]), log(row[known])))
        told.append(f"{label(name)} {1e6 * exp(between):.2f}")
    return f"; advances at {number:.0f} evaluations per orbit: {', '.join(told)} × 10⁻⁶ rad"


@result(
    paper="Figure 4, caption",
    sentence="Linear fit 95% confidence intervals of the perihelion advance are significantly smaller than the dot "
    "size",
    statement="95 % confidence intervals of the perihelion advance are significantly smaller than the dot size",
    threshold="the width of each interval is at most 21 % of the advance (1/1.26 of the 26 % that a dot covers) "
    f"{judging.range_words('one of the ten methods')}. {judging.SIGNIFICANTLY.brief}",
    bound=(judging.DOT - 1) / judging.SIGNIFICANTLY.number,
    needs=KEPLER,
)
def fig_4_intervals(results: Results, widest: float) -> Decision:
    curves = judging.curves_of(results, "kepler")
    advance, interval = (np.abs(curves.rows(BENCHMARKED, f"perihelion_advance{end}")) for end in ("", "_interval"))
    asked = curves.compared(curves.errors(BENCHMARKED))
    share = (2 * interval / advance).max(axis=0)
    low, high = (short(100 * one, 2) for one in (share[asked.asked].min(), share[asked.asked].max()))
    return judging.over(asked, share <= widest, f"width of the widest interval {low} to {high} % of the advance")


@background(
    paper="Section 4.B, paragraph on precession",
    sentence="The orbital precession advances linearly with time t",
    statement="For the ten methods the perihelion advances at the same rate in both halves of the ten years",
    threshold="the rates of advance in the two halves differ by at most 2 % (the widest 95 % interval of a fit) "
    f"{judging.range_words('one of the ten methods')}",
    bound=0.02,
    needs=KEPLER,
)
def precession_linear(results: Results, off: float) -> Decision:
    curves = judging.curves_of(results, "kepler")
    asked = curves.compared(curves.errors(BENCHMARKED))
    halves, line = (
        np.array([curves.of(name, f"perihelion_advance_{what}") for name in BENCHMARKED])
        for what in ("halves", "linearity")
    )
    apart = np.abs(halves - 1).max(axis=0)
    least = np.nanmin(line[:, asked.asked])
    most = short(100 * np.nanmax(apart[asked.asked]), 2)
    value = f"the rates of the halves differ by up to {most} %; smallest R² {short(least, 4)}"
    return judging.over(asked, apart <= off, value)


@misprint(
    paper="Section 4.B, paragraph on precession",
    sentence="Figure 5 shows the perihelion precession dθ/dt which has been obtained numerically through linear "
    "regression of θ(t) over numerous orbital periods",
    statement="Figure 5 shows the perihelion precession",
    threshold="the curves of ABAs5o6H, ABA104 and BAB's8o7H coincide in Figure 5. The caption of Figure 4 says that "
    "they coincide in the precession. They coincide if maximum and mean errors are within a factor of 1.26 "
    f"{judging.range_words()}. {judging.APPROXIMATELY.brief}",
    bound=judging.DOT,
    needs=KEPLER,
)
def figure_of_the_precession(results: Results, dot: float) -> Decision:
    curves, told = judging.curves_of(results, "kepler"), []
    asked = curves.compared(curves.errors(COINCIDING))
    verdicts: list[Verdict] = []
    for measure, variable in judging.MEASURES.items():
        errors = curves.errors(COINCIDING, variable)
        largest, least = errors.max(axis=0), errors.min(axis=0)
        verdicts.append(judging.over(asked, largest <= dot * least).verdict)
        shown = largest[asked.asked] / least[asked.asked]
        coinciding = f"coinciding at {int((shown <= dot).sum())} of {shown.size} step sizes"
        told.append(f"{measure} error {short(shown.min())} to {short(shown.max())}, {coinciding}")
    value = f"ratio of largest to smallest error of the three methods: {'; '.join(told)}"
    return combined(verdicts, f"{value}. The paper means Figure 4")


@result(
    paper="Section 4.B, paragraph on precession",
    sentence="Comparison of Figure 4 and 5 suggests that the accumulated error is in better agreement with the average "
    "error than the maximum error",
    statement="The accumulated error is in better agreement with the average error than with the maximum error",
    threshold="the rank correlation of the advances of the ten methods with their mean errors is nearer to 1 than the "
    f"rank correlation with their maximum errors, {judging.range_words()}",
    bound=1.0,
    needs=KEPLER,
)
def accumulated_error_and_mean(results: Results, ratio: float) -> Decision:
    curves = judging.curves_of(results, "kepler")

    def decide(names: tuple[str, ...]) -> Decision:
        largest, mean = curves.errors(names), curves.errors(names, "mean_energy_error")
        advance = np.abs(curves.rows(names, "perihelion_advance"))
        known = curves.compared(largest)
        asked = known._replace(asked=known.asked & np.isfinite(advance).all(axis=0))
        lacking = f"the advances of the {len(names)} methods are known at fewer than three step sizes"
        require(asked.asked.sum() >= judging.FEWEST, lacking)
        by_mean, by_largest = (judging.rank_correlation(advance, other) for other in (mean, largest))
        told = (short(float(np.median(one[asked.asked])), 2) for one in (by_mean, by_largest))
        value = "median rank correlation {} with the mean error, {} with the maximum error".format(*told)
        return judging.over(asked, 1 - by_mean < ratio * (1 - by_largest), value)

    return with_and_without_sixth_order(decide)


# --- Figure 6: substeps in phase space. -------------------------------------------------------------------------------


@result(
    paper="Figure 6, caption",
    sentence="(C) shows an unstable integration where H is not conserved",
    statement="(C), Yosh s7o6 A on the Hénon-Heiles system, shows an unstable integration",
    threshold=f"the relative energy error exceeds 1 within 1000 iterations. {judging.STABLE.words}",
)
def fig_6_c_unstable(results: Results) -> Decision:
    panel = results.panels()["C"]
    left = int(panel["left_at"])
    value = f"the run leaves its energy surface at iteration {left}" if left else "stable for 1000 iterations"
    return either(left > 0, value)


DISPLACED = ("cubes/substeps_displaced.h5",)


@result(
    paper="Figure 6, caption",
    sentence="(A) (B) and (D) show stable integrations which preserve H indefinitely",
    statement="(A), (B) and (D) are stable; (D) starts in the plane q_x = p_x = 0, as in the caption",
    threshold="(A) and (B) are stable in 1000 iterations. They are stable for ever: τ = π/4 is below the proved linear "
    "limits of both methods. (D) is stable in 100000 iterations, with compensated sums and with plain sums. "
    f"{judging.STABLE.words}",
    needs=DISPLACED,
)
def fig_6_others_stable(results: Results) -> Decision:
    panels, cube = results.panels(), results.cube("substeps_displaced")
    largest = {letter: float(panels[letter]["max_energy_error"]) for letter in "AB"}
    good = [int(panels[letter]["left_at"]) == 0 for letter in "AB"]
    good += [np.pi / 4 < float(stability_limit(results.method(name))) for name in ("yoshida_s7o6a", "babs7o7h")]
    start, left = cube["displacement"].values, cube["left_at"].values
    good += (left[start == 0] == 0).ravel().tolist()
    told = ", ".join(f"({letter}) {short(error)}" for letter, error in largest.items())
    plane = float(cube["max_energy_error"].values[start == 0].max(initial=0.0))
    iterations = int(cube.attrs["iterations"])
    return counted(good, f"largest energy errors {told}, (D) {short(plane)} in {iterations} iterations in its plane")


@finding(
    paper="Figure 6, caption",
    sentence="(A) (B) and (D) show stable integrations which preserve H indefinitely",
    statement="(D) is unstable if it starts outside its plane; the paper does not show this",
    threshold="the relative energy error exceeds 1 within 100000 iterations from each start with q_x from 10⁻¹² to "
    f"10⁻², with compensated sums and with plain sums. {judging.STABLE.words}",
    needs=DISPLACED,
)
def fig_6_beside_the_plane(results: Results) -> Decision:
    cube = results.cube("substeps_displaced")
    start, left = cube["displacement"].values, cube["left_at"].values
    beside = left[start > 0].ravel()
    gone = beside[beside > 0]
    when = f", at iterations {gone.min()} to {gone.max()}; the iteration depends on rounding" if gone.size else ""
    return tallied((beside > 0).tolist(), "runs are unstable", when)


@result(
    paper="Section 5, Discussion",
    sentence="Yosh s7o6 A (A) (C) performs large forward and backward steps compared to BABs7o7H (B) (D)",
    statement="Yosh s7o6 A performs large forward and backward steps compared to BABs7o7H",
    threshold="on both systems the longest substep of Yosh s7o6 A in phase space is longer than the longest substep of "
    "BABs7o7H, both forward and backward. A substep is a pair of a drift and a kick. A backward substep has a negative "
    "coefficient",
    bound=1.0,
)
def fig_6_large_substeps(results: Results, ratio: float) -> Decision:
    panels = results.panels()
    good, told, longest = [], [], {}
    for letter in "ABCD":
        panel = panels[letter]
        length = hypot(*(np.diff(panel[name].values, axis=1) for name in "qp"))
        back = np.minimum(panel["next_drift_sign"].values, panel["next_kick_sign"].values)[:-1] < 0
        longest[letter] = [float(length[:, chosen].max()) for chosen in (~back, back)]
    for i, way in enumerate(("forward", "backward")):
        good += [longest[one][i] > ratio * longest[other][i] for one, other in ("AB", "CD")]
        told.append(f"{way} " + ", ".join(f"({letter}) {short(row[i])}" for letter, row in longest.items()))
    return counted(good, f"longest substep {'; '.join(told)}")


@mathematics(
    paper="Section 2, below Eq. 3",
    sentence="the intermediate steps (q_j, p_j), j = 1, 2, ..., k - 1, referred to as substeps, do not represent the "
    "time evolution of (q₀, p₀)",
    statement="Substeps are not points of the orbit: their energy errors are large",
    threshold="in each panel of Figure 6 the largest energy error at substeps is at least ten times the largest energy "
    "error after the two iterations",
    bound=judging.GREATLY.number,
)
def substeps_are_no_evolution(results: Results, factor: float) -> Decision:
    good, told = [], []
    for letter, panel in results.panels().items():
        errors = np.abs(panel["energy_error"].values)
        within, after = float(errors[:, 1:-1].max()), float(errors[:, -1].max())
        good.append(within >= factor * after)
        told.append(f"({letter}) {short(within, 2)} and {short(after, 2)}")
    return counted(good, f"largest energy errors at substeps and at steps: {', '.join(told)}")
