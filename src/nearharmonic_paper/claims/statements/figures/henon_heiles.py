"""Figure 3: the Hénon-Heiles system."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from nearharmonic.systems import henon_heiles
from nearharmonic_paper.claims.claim import (
    Claim,
    Decision,
    background,
    combined,
    counted,
    either,
    mathematics,
    result,
    tallied,
)
from nearharmonic_paper.claims.judging import (
    BAND,
    GREATLY,
    LARGE,
    SLOPE,
    curves_of,
    judged,
    large_steps,
    local_slopes,
    slopes_are,
    stretch,
)
from nearharmonic_paper.claims.results import Results, label, short

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
    bound=GREATLY.number,
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
        threshold=SLOPE,
        bound=BAND,
        needs=(f"cubes/{system}.h5",),
    )(slopes_are(system, ORDERS))


FIGURE_3 = orders_of_figure(3, "henon_heiles")


@result(
    paper="Section 4.B, text to Figure 3",
    sentence="especially BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    statement="BAB's8o7H and BAB's9o7H exhibit a sixth order descent of the maximum error for large τ",
    threshold=f"{SLOPE}; among large step sizes, {LARGE.brief}",
    bound=BAND,
    needs=("cubes/henon_heiles.h5",),
)
def fig_3_sixth_order_descent(results: Results, band: float) -> Decision:
    curves, told, verdicts = curves_of(results, "henon_heiles"), [], []
    asked = large_steps(curves, *DESCENDING)
    for name in DESCENDING:
        slopes = local_slopes(curves, name)
        found = stretch(asked, slopes, 6, band)
        verdicts.append(judged(found))
        inside = slopes[(curves.x >= found.low) & (curves.x <= found.high)]
        spread = f", slopes {inside.min():.1f} to {inside.max():.1f}" if inside.size else ""
        told.append(f"{label(name)} for {found.words(curves.unit)}{spread}")
    steepest = short(np.nanmax([local_slopes(curves, name)[asked.asked] for name in DESCENDING]), 2)
    told += [f"for larger steps ragged, up to {steepest}", f"large: {asked.words()}"]
    return combined(verdicts, "; ".join(told))


@result(
    paper="Section 4.B, text to Figure 3",
    sentence="especially BAB's8o7H and BAB's9o7H exhibit a sixth order descent of error for large τ",
    statement="Especially these two: no other fourth order method keeps a sixth order descent as long",
    threshold=f"more decades of large step sizes with local slopes within {BAND} of 6 than each of the other seven "
    f"methods of fourth order; {LARGE.brief}",
    bound=BAND,
    needs=("cubes/henon_heiles.h5",),
)
def fig_3_steepest(results: Results, band: float) -> Decision:
    curves, lengths = curves_of(results, "henon_heiles"), {}
    for name in (name for name, order in ORDERS.items() if order == 4):
        asked = large_steps(curves, name)
        lengths[name] = stretch(asked, local_slopes(curves, name), 6, band).decades
    others = {name: length for name, length in lengths.items() if name not in DESCENDING}
    longest = max(others, key=others.__getitem__)
    told = ", ".join(f"{label(name)} {lengths[name]:.2f}" for name in DESCENDING)
    value = f"{told} decades, the others up to {others[longest]:.2f}, {label(longest)}"
    return counted([lengths[name] > others[longest] for name in DESCENDING], value)
