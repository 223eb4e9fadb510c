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
#: An error term that vanishes for the true coefficients is below this for the printed ones, and any other above it.
VANISHED = 1e-30
ZERO = "a term below 10⁻³⁰ vanishes: rounded decimals leave up to 10⁻⁷³ of one, and all others are above 10⁻⁴"


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
    threshold=f"κ₀ = 0 exactly, and κ₁ vanishes, for each method and composition of Figure 2; {ZERO}",
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
    """The terms of one composition as far as they reach, the method's own by default; the first at index 0."""
    first, terms = first or results.method(name).first, results.cube("sho_terms")["kappa"]
    require(name in terms["integrator"].values, f"Figure 2 of these results does not have the method {name}")
    row = terms.sel(integrator=name, first=first).values
    return row[np.isfinite(row)]


@result(
    paper="Figure 2, caption",
    sentence="Lines and markers of the same color intersect exactly at even orders",
    statement="Terms of the ABA and the BAB composition intersect exactly at even orders",
    threshold="even terms of both are equal to a unit in the last place of a double, or both below 10⁻³⁰",
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
    beside = f"; odd ones differ, by up to {short(float(differ))}"
    return tallied(same[reached].tolist(), "even terms", beside)


@in_figure_2(
    sentence="the obtained BAB methods have more error terms when implemented as ABA methods",
    statement="The obtained BAB methods have more error terms when implemented as ABA methods",
    threshold=f"more terms that do not vanish as ABA than as BAB, for each BAB method of Figure 2; {ZERO}",
    bound=VANISHED,
)
def fig_2_more_terms_as_aba(results: Results, vanished: float) -> Decision:
    names = [m.name for m in _methods(results) if m.first == "kick"]
    require(names, "Figure 2 of these results has no BAB method")
    counts = {name: [int((_terms(results, name, f) > vanished).sum()) for f in COMPOSITIONS] for name in names}
    good = [aba > bab for aba, bab in counts.values()]
    return counted(good, ", ".join(f"{label(name)} {aba} against {bab}" for name, (aba, bab) in counts.items()))


@in_figure_2(
    sentence="the seventh harmonic order of BAB's8o7H eliminates the seventh order error term of the position "
    "coordinate for the BAB implementation as opposed to the sixth harmonic order integrator ABAs5o6H A",
    statement="κ₇ vanishes for BAB's8o7H as BAB, as opposed to ABAs5o6H",
    threshold=f"κ₇ of BAB's8o7H vanishes, that of ABAs5o6H does not; {ZERO}",
    bound=VANISHED,
)
def fig_2_kappa_7(results: Results, vanished: float) -> Decision:
    bab, aba = _terms(results, "babps8o7h")[6], _terms(results, "abas5o6h")[6]
    return counted([bab < vanished, aba > vanished], f"{short(bab, 1)} for BAB's8o7H, {short(aba)} for ABAs5o6H")


@in_figure_2(
    sentence="The largest integer value of λ with no integration error reads the SHO integration order",
    statement="The largest λ up to which all terms vanish is the harmonic order in the name of the method",
    threshold=f"equal numbers for each of the four new methods in the figures; {ZERO}",
    bound=VANISHED,
)
def fig_2_reads_order(results: Results, vanished: float) -> Decision:
    last = {label(name): int(np.argmax([*(_terms(results, name) >= vanished), True])) for name in SIXTH}
    return counted([f"o{n}H" in name for name, n in last.items()], ", ".join(f"{name} {n}" for name, n in last.items()))


#: The methods of order six and more that are compositions of leapfrog steps with as few stages as solutions were found.
STAGE_OPTIMISED = ("yoshida_s7o6a", "s9odr6a", "s15odr8")


@in_figure_2(
    sentence="Stage-optimized integrators of higher orders generally have rapidly diverging higher order error "
    "contributions",
    statement="Of Yosh s7o6 A, s9odr6a and s15odr8 most have terms κ far larger than those of the new methods",
    threshold="the largest κ at least ten times that of each of the four new methods in the figures, for more than "
    f"half of Yosh s7o6 A, s9odr6a and s15odr8; {judging.GREATLY.brief}; {judging.GENERALLY.brief}",
    bound=judging.GREATLY.number,
)
def fig_2_yoshida_diverges(results: Results, factor: float) -> Decision:
    new = {name: float(_terms(results, name).max()) for name in SIXTH}
    worst = max(new, key=new.__getitem__)
    theirs = {"yoshida_s7o6a": float(_terms(results, "yoshida_s7o6a").max())}
    for method in (results.methods[name] for name in STAGE_OPTIMISED[1:] if name in results.methods):
        theirs[method.name] = _largest_term(method)
    listed = ", ".join(f"{label(name)} {short(largest)}" for name, largest in theirs.items())
    value = f"{listed}, against at most {short(new[worst])}, of {label(worst)}"
    rapid = [largest >= factor * new[worst] for largest in theirs.values()]
    return either(sum(rapid) > judging.GENERALLY.number * len(rapid), value)


@cache
def _largest_term(method: Tableau) -> float:
    return float(max(kappa(method, lambda_max(method))))


@result(
    paper="Section 4.B, text to Figure 2",
    sentence="these integrators are not suitable for integrating the SHO with large time steps",
    statement="Stage-optimized integrators of higher order are not suitable for the oscillator with large time steps",
    threshold="the maximum error of Yosh s7o6 A, the only one of them in the figures, at least ten times that of the "
    f"best of the other nine, at every large step size; {judging.NOT_SUITABLE.brief}; {judging.LARGE.brief}",
    bound=judging.NOT_SUITABLE.number,
    needs=("cubes/sho.h5",),
)
def fig_2_large_steps(results: Results, factor: float) -> Decision:
    curves = judging.curves_of(results, "sho")
    others = (*FOURTH, *SIXTH)
    theirs, best = curves.errors(["yoshida_s7o6a"])[0], curves.errors(others).min(axis=0)
    asked = judging.large_steps(curves, *others)
    ratio = (theirs / best)[asked.asked]
    value = f"its error over that of the best {short(ratio.min(), 2)} to {short(ratio.max(), 2)}"
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
    threshold="exact, in rational arithmetic, from the initial values that are integrated",
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
    threshold="the largest Lyapunov exponent, at the lower end of its 95 % interval, at least ten times that of a "
    "regular orbit, of H = 1/128, after the same time",
    bound=judging.GREATLY.number,
    needs=("cubes/henon_heiles_chaos.h5",),
)
def henon_heiles_chaotic(results: Results, factor: float) -> Decision:
    cube = results.cube("henon_heiles_chaos")
    last = cube["lyapunov_exponent"].isel(time=-1)
    exponent, regular = (float(last.sel(orbit=orbit)) for orbit in ("paper", "regular"))
    width = float(cube["lyapunov_exponent_interval"].sel(orbit="paper"))
    until = f"up to t = {short(float(cube['time'][-1]))}, a factor e in {1 / exponent:.0f} units of time"
    value = f"{short(exponent, 2)} ± {short(width, 2)} {until}; regular {short(regular, 2)}"
    return either(exponent - width >= factor * regular, value)


@mathematics(
    paper="Section 4.B, text to Figure 3",
    sentence="The Hénon Heiles system can be considered as a perturbed SHO for small values of q_x and q_y",
    statement="V is that of the oscillator plus a term of third degree, which vanishes beside it for small q",
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
    return tallied(good, "equal", f"; the term is at most 2/3 |q| of the oscillator's, {depth}")


def orders_of_figure(number: int, system: str) -> Claim:
    """Make the statement that the curves of a figure have the orders of the methods."""
    return background(
        id=f"fig-{number}-orders",
        paper=f"Section 1, tried on Figure {number}",
        sentence="Nth order integrators have their integration error reduced by a factor k^N when the time step is "
        "reduced by a factor k",
        statement=f"For small steps the curves of Figure {number} have the order of the methods: six for Yosh s7o6 A, "
        "four for the others",
        threshold=judging.SLOPE,
        bound=judging.BAND,
        needs=(f"cubes/{system}.h5",),
    )(partial(judging.orders_on, system, ORDERS))


FIGURE_3 = orders_of_figure(3, "henon_heiles")


@result(
    paper="Section 4.B, text to Figure 3",
    sentence="especially BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    statement="BAB's8o7H and BAB's9o7H exhibit a sixth order descent of the maximum error for large τ",
    threshold=f"{judging.SLOPE}; among large step sizes, {judging.LARGE.brief}",
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
        spread = f", slopes {inside.min():.1f} to {inside.max():.1f}" if inside.size else ""
        told.append(f"{label(name)} for {piece.words(curves.unit)}{spread}")
    steepest = short(np.nanmax([judging.local_slopes(curves, name)[asked.asked] for name in DESCENDING]), 2)
    told += [f"for larger steps ragged, up to {steepest}", f"large: {asked.words()}"]
    brief = f"slope 6 over {judging.in_decades(found)}; half a decade asked"
    return combined(map(judging.judged, found), "; ".join(told), brief)


@result(
    paper="Section 4.B, text to Figure 3",
    sentence="especially BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    statement="Especially these two: no other fourth order method keeps a sixth order descent as long",
    threshold=f"more decades of large step sizes with local slopes within {judging.BAND} of 6 than each of the other "
    f"seven methods of fourth order; {judging.LARGE.brief}",
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
    value = f"{told} decades, the others up to {others[longest]:.2f}, {label(longest)}"
    return counted([lengths[name] > others[longest] for name in DESCENDING], value)


# --- Figures 4 and 5: the advance of the perihelion of Mercury and the energy errors. ---------------------------------


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
        found = judging.over(asked, good, f"elsewhere ahead: {elsewhere}" if elsewhere else "")
        return found._replace(brief=f"{found.brief} step sizes: {found.value.partition(',')[0]}")

    return with_and_without_sixth_order(decide)


BEST = tuple(
    result(
        id=f"fig-5-best-{measure}",
        paper="Section 4.B, text to Figure 5",
        sentence=f"{name} shows the best performance in regard to the {words} error",
        statement=f"{name} shows the best performance in regard to the {words} error",
        threshold=f"its {measure} error below that of each of the other nine {judging.range_words(name)}",
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
    statement="ABAs5o6H, ABA104 and BAB's8o7H coincide in perihelion advance",
    threshold="the largest of their advances at most 1.26 times the smallest, "
    f"{judging.range_words('the first of the three')}; {judging.APPROXIMATELY.brief}",
    bound=judging.DOT,
    needs=KEPLER,
)
def fig_4_coincide(results: Results, dot: float) -> Decision:
    curves = judging.curves_of(results, "kepler")
    advance = np.abs(curves.rows(COINCIDING, "perihelion_advance"))
    asked = curves.compared(curves.errors(COINCIDING))
    ratio = advance.max(axis=0) / advance.min(axis=0)
    value = f"largest over least {short(ratio[asked.asked].min())} to {short(ratio[asked.asked].max())}"
    return judging.over(asked, ratio <= dot, value + _at_evaluations(curves, advance))


def _at_evaluations(curves: judging.Curves, advance: Floats, number: float = 240.0) -> str:
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
    f"{judging.range_words('the first of the ten')}; {judging.SIGNIFICANTLY.brief}",
    bound=(judging.DOT - 1) / judging.SIGNIFICANTLY.number,
    needs=KEPLER,
)
def fig_4_intervals(results: Results, widest: float) -> Decision:
    curves = judging.curves_of(results, "kepler")
    advance, interval = (np.abs(curves.rows(BENCHMARKED, f"perihelion_advance{end}")) for end in ("", "_interval"))
    asked = curves.compared(curves.errors(BENCHMARKED))
    share = (2 * interval / advance).max(axis=0)
    low, high = (short(100 * one, 2) for one in (share[asked.asked].min(), share[asked.asked].max()))
    return judging.over(asked, share <= widest, f"widest of the ten {low} to {high} % of the advance")


@background(
    paper="Section 4.B, paragraph on precession",
    sentence="The orbital precession advances linearly with time t",
    statement="The perihelion of the ten methods advances in the second half of the ten years as in the first",
    threshold="the rates of advance in the two halves within 2 % of each other, the widest 95 % interval of a fit, "
    f"{judging.range_words('the first of the ten')}",
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
    value = f"halves apart by up to {short(100 * np.nanmax(apart[asked.asked]), 2)} %, R² from {short(least, 4)} on"
    return judging.over(asked, apart <= off, value)


@misprint(
    paper="Section 4.B, paragraph on precession",
    sentence="Figure 5 shows the perihelion precession dθ/dt which has been obtained numerically through linear "
    "regression of θ(t) over numerous orbital periods",
    statement="Figure 5 shows the perihelion precession",
    threshold="the curves of ABAs5o6H, ABA104 and BAB's8o7H coincide in Figure 5, as they do in the precession by the "
    "caption of Figure 4: maximum and mean errors within a factor of 1.26, "
    f"{judging.range_words()}; {judging.APPROXIMATELY.brief}",
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
        told.append(f"{measure} {short(shown.min())} to {short(shown.max())}, {coinciding}")
    return combined(verdicts, f"largest over least error of the three: {'; '.join(told)}. Figure 4 is meant")


@result(
    paper="Section 4.B, paragraph on precession",
    sentence="Comparison of Figure 4 and 5 suggests that the accumulated error is in better agreement with the average "
    "error than the maximum error",
    statement="The accumulated error is in better agreement with the average error than with the maximum error",
    threshold="the rank correlation of the ten methods' advances with their mean errors is nearer to 1 than with their "
    f"maximum errors, {judging.range_words()}",
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
        value = "median rank correlation {} with the mean and {} with the maximum error".format(*told)
        return judging.over(asked, 1 - by_mean < ratio * (1 - by_largest), value)

    return with_and_without_sixth_order(decide)


# --- Figure 6: substeps in phase space. -------------------------------------------------------------------------------


@result(
    paper="Figure 6, caption",
    sentence="(C) shows an unstable integration where H is not conserved",
    statement="(C), Yosh s7o6 A on the Hénon-Heiles system, shows an unstable integration",
    threshold=f"the relative energy error passes 1 within 1000 iterations; {judging.STABLE.brief}",
)
def fig_6_c_unstable(results: Results) -> Decision:
    panel = results.panels()["C"]
    left = int(panel["left_at"])
    value = f"leaves its energy surface at iteration {left}" if left else "stays for 1000 iterations"
    return either(left > 0, value)


DISPLACED = ("cubes/substeps_displaced.h5",)


@result(
    paper="Figure 6, caption",
    sentence="(A) (B) and (D) show stable integrations which preserve H indefinitely",
    statement="(A), (B) and (D) are stable, (D) in the plane q_x = p_x = 0 of the caption",
    threshold="(A) and (B) for ever, as τ = π/4 is below the proved linear limits of both methods, and in 1000 "
    f"iterations; (D) in 100000 iterations, with compensated and with plain sums; {judging.STABLE.brief}",
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
    statement="(D) is unstable from starts beside its plane, which the paper does not show",
    threshold="the relative energy error passes 1 within 100000 iterations from each start with q_x from 10⁻¹² to "
    f"10⁻², with compensated and with plain sums; {judging.STABLE.brief}",
    needs=DISPLACED,
)
def fig_6_beside_the_plane(results: Results) -> Decision:
    cube = results.cube("substeps_displaced")
    start, left = cube["displacement"].values, cube["left_at"].values
    beside = left[start > 0].ravel()
    gone = beside[beside > 0]
    when = f", at iterations {gone.min()} to {gone.max()}: rounding decides when" if gone.size else ""
    return tallied((beside > 0).tolist(), "runs", when)


@result(
    paper="Section 5, Discussion",
    sentence="Yosh s7o6 A (A) (C) performs large forward and backward steps compared to BABs7o7H (B) (D)",
    statement="Yosh s7o6 A performs large forward and backward steps compared to BABs7o7H",
    threshold="its longest substep in phase space, a pair of a drift and a kick, longer than that of BABs7o7H on both "
    "systems, forward and, with a negative coefficient, backward",
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
    statement="Substeps are not points of the orbit: their energy is far off",
    threshold="in each panel of Figure 6 the largest energy error at substeps at least ten times that after the two "
    "iterations",
    bound=judging.GREATLY.number,
)
def substeps_are_no_evolution(results: Results, factor: float) -> Decision:
    good, told = [], []
    for letter, panel in results.panels().items():
        errors = np.abs(panel["energy_error"].values)
        within, after = float(errors[:, 1:-1].max()), float(errors[:, -1].max())
        good.append(within >= factor * after)
        told.append(f"({letter}) {short(within, 2)} against {short(after, 2)}")
    return counted(good, f"largest energy error at substeps against steps: {', '.join(told)}")
