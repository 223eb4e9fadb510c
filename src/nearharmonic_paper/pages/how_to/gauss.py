"""The tables and the figure of docs/how_to/gauss.md: iterations of the implicit method, growth of its errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics
from nearharmonic.engine.trajectory import integrate
from nearharmonic.integrators import integrators as registered
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.statistics import power_law, quasi_random
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.plotting.style import house_style, log_scale, new_figure
from nearharmonic_paper.experiments.stability.kepler.run import PERIOD, SYSTEM, kepler_apoapsis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHOD = "gauss16"
#: Amplitudes of the Henon-Heiles system, in units of that of the paper's start; the interval; numbers of steps that are
#: tried, and the energy error that the first of them must reach.
AMPLITUDES, T_END, STEPS, ERROR = (1.0, 0.3, 0.1, 0.03, 0.01), 500, range(100, 600, 10), 1e-12
#: Position and momentum of that start.
START = (0.3, 0.0), (0.0, 0.4)
#: Orbits of the ensemble, the range of their eccentricities, steps in an orbit, and orbits at which errors are taken.
ORBITS, ECCENTRICITIES, STEPS_PER_ORBIT = 32, (0.05, 0.3), 20
TIMES = (16, 64, 256, 1024, 4096, 16384)
#: Looks of the sums in the figure.
LOOKS: dict[str, dict[str, Any]] = {
    "plain": {"color": "#e86a10", "marker": "s"},
    "compensated": {"color": "#0b3c8c", "marker": "o"},
}


def page(page: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, Any]:
    """Fill the page, and draw its figure."""
    grown = {summation: growth(summation) for summation in LOOKS}
    filled = {"iterations": "\n".join(iterations_table()), "growth": "\n".join(growth_table(grown))}
    return {"page": filled_page(page, filled), "figure": drawn(grown)}


def iterations(amplitude: float, steps: int, split: str) -> tuple[float, float]:
    """Return the iterations in a step, and the maximum energy error, on Henon-Heiles."""
    q0, p0 = ([amplitude * x for x in row] for row in START)
    run = integrate("henon_heiles", METHOD, T_END / steps, t_end=T_END, samples=2, q0=q0, p0=p0, split=split)
    return run.evaluations.item() / (steps * registered[METHOD].stages), run.max_energy_error.item()


def iterations_table() -> list[str]:
    """Lines of the table of iterations, with the oscillators outside and inside of the equations."""
    rows = []
    for amplitude in AMPLITUDES:
        steps = next(n for n in STEPS if iterations(amplitude, n, EXACT_OSCILLATOR)[1] <= ERROR)
        outside, inside = (iterations(amplitude, steps, split)[0] for split in (KINETIC_POTENTIAL, EXACT_OSCILLATOR))
        rows.append([f"{amplitude:g}", steps, f"{outside:.1f}", f"{inside:.1f}", f"{1 - inside / outside:.0%}"])
    heads = ("amplitude", "steps", "iterations a step", "with oscillators inside", "fewer")
    return pipes(heads, rows, align="r")


def growth(summation: str) -> Floats:
    """Return the root mean square of the energy errors of an ensemble of Kepler orbits, at :data:`TIMES`."""
    u, (least, most) = quasi_random(ORBITS, 2, 1), ECCENTRICITIES
    start = kepler_apoapsis(least + (most - least) * u[:, 0], 2 * pi * u[:, 1])
    marks = np.tile([0, *(STEPS_PER_ORBIT * orbits for orbits in TIMES)], (ORBITS, 1))
    paths = integrate_batch(
        SYSTEM, registered[METHOD], t_end=Fraction(TIMES[-1]) * PERIOD, steps=marks[:, -1], samples=marks.shape[1],
        start=start, marks=marks, numerics=Numerics(summation=summation, energy="samples"),
    )  # fmt: skip
    found: Floats = np.sqrt((paths.energy_error[:, 1:] ** 2).mean(axis=0))
    return found


def growth_table(grown: Mapping[str, Floats]) -> list[str]:
    """Lines of the table of energy errors after so many orbits, and of their exponents in time."""
    rows = []
    for summation, errors in grown.items():
        exponent, _ = power_law(np.array(TIMES, float), errors)
        rows.append([summation, *(f"{x:.0e}" for x in errors), f"{exponent:.2f}"])
    return pipes(("sums", *(f"{n} orbits" for n in TIMES), "exponent"), rows, align="lr")


@house_style
def drawn(grown: Mapping[str, Floats]) -> Figure:
    """Draw the growth of the energy errors, with the slope of a random walk."""
    figure = new_figure(4.5, 3)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.17, right=0.97, top=0.97, bottom=0.17)
    for summation, errors in grown.items():
        axes.plot(TIMES, errors, label=f"{summation} sums", **LOOKS[summation])
    first = 0.4 * min(errors[0] for errors in grown.values())
    axes.plot(TIMES, [first * (n / TIMES[0]) ** 0.5 for n in TIMES], color="#808080", linestyle=":", label=r"$t^{1/2}$")
    axes.set(xlabel="orbits", ylabel="rms energy error")
    log_scale(axes, "x")
    log_scale(axes, "y")
    axes.legend()
    return figure
