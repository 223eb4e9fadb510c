"""Iterations of the implicit method with oscillators inside and outside of its equations, and growth of its errors.

Run: ``python benchmarks/gauss.py``; ``--page`` writes tables and figure to ``docs/how_to/gauss.md``. Nothing is timed.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import pi
from typing import TYPE_CHECKING

import numpy as np
from timing import fill

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics
from nearharmonic.engine.trajectory import integrate
from nearharmonic.integrators import integrators as registered
from nearharmonic.numerics.portable import Floats, power_law, quasi_random
from nearharmonic.plotting.style import house_style, log_scale, new_figure
from nearharmonic_paper.experiments.stability.run import PERIOD, SYSTEM, kepler_apoapsis
from nearharmonic_paper.pages.filling import table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, PICTURE = "docs/how_to/gauss.md", "gauss.svg"
GAUSS = "gauss16"
#: Amplitudes of the Henon-Heiles system, in units of the paper's start; the interval; numbers of steps that are
#: tried, and the energy error that the first of them must reach; position and momentum of that start.
AMPLITUDES, UNTIL, STEPS, ERROR = (1.0, 0.3, 0.1, 0.03, 0.01), 500, range(100, 600, 10), 1e-12
START = (0.3, 0.0), (0.0, 0.4)
#: Orbits of the ensemble, the range of their eccentricities, steps in an orbit, and orbits at which errors are taken.
ORBITS, ECCENTRICITIES, STEPS_PER_ORBIT = 32, (0.05, 0.3), 20
TIMES = (16, 64, 256, 1024, 4096, 16384)


def parts():
    """Iterations of the implicit method with oscillators outside and inside of its equations, growth of its errors."""
    rows = []
    for amplitude in AMPLITUDES:
        steps = next(n for n in STEPS if iterations(amplitude, n, EXACT_OSCILLATOR)[1] <= ERROR)
        outside, inside = (iterations(amplitude, steps, split)[0] for split in (KINETIC_POTENTIAL, EXACT_OSCILLATOR))
        rows.append((f"{amplitude:g}", steps, f"{outside:.1f}", f"{inside:.1f}", f"{1 - inside / outside:.0%}"))
    grown = {summation: growth(summation) for summation in ("plain", "compensated")}
    exponents = {name: power_law(np.array(TIMES, float), errors)[0] for name, errors in grown.items()}
    heads = ("amplitude", "steps", "iterations a step", "with oscillators inside", "fewer")
    return {
        "iterations": table(heads, rows, left=0),
        "growth": table(
            ("sums", *(f"{n} orbits" for n in TIMES), "exponent"),
            ((name, *(f"{x:.0e}" for x in errors), f"{exponents[name]:.2f}") for name, errors in grown.items()),
        ),
        "figure": growth_drawn(grown),
    }


def iterations(amplitude: float, steps: int, split: str) -> tuple[float, float]:
    """Iterations in a step, and the maximum energy error, on Henon-Heiles."""
    q0, p0 = ([amplitude * x for x in row] for row in START)
    run = integrate("henon_heiles", GAUSS, UNTIL / steps, t_end=UNTIL, samples=2, q0=q0, p0=p0, split=split)
    return run.evaluations.item() / (steps * registered[GAUSS].stages), run.max_energy_error.item()


def growth(summation: str) -> Floats:
    """Root mean square of the energy errors of an ensemble of Kepler orbits, at :data:`TIMES`."""
    u, (low, high) = quasi_random(ORBITS, 2, 1), ECCENTRICITIES
    start = kepler_apoapsis(low + (high - low) * u[:, 0], 2 * pi * u[:, 1])
    marks = np.tile([0, *(STEPS_PER_ORBIT * orbits for orbits in TIMES)], (ORBITS, 1))
    paths = integrate_batch(
        SYSTEM, registered[GAUSS], t_end=Fraction(TIMES[-1]) * PERIOD, steps=marks[:, -1], samples=marks.shape[1],
        start=start, marks=marks, numerics=Numerics(summation=summation, energy="samples"),
    )  # fmt: skip
    found: Floats = np.sqrt((paths.energy_error[:, 1:] ** 2).mean(axis=0))
    return found


@house_style
def growth_drawn(grown: Mapping[str, Floats]) -> Figure:
    """Draw the growth of the energy errors, with the slope of a random walk."""
    figure = new_figure(4.5, 3)
    axes = figure.subplots()
    figure.subplots_adjust(left=0.17, right=0.97, top=0.97, bottom=0.17)
    for (summation, errors), look in zip(grown.items(), (("#e86a10", "s"), ("#0b3c8c", "o")), strict=True):
        axes.plot(TIMES, errors, label=f"{summation} sums", color=look[0], marker=look[1])
    first = 0.4 * min(errors[0] for errors in grown.values())
    axes.plot(TIMES, [first * (n / TIMES[0]) ** 0.5 for n in TIMES], color="#808080", linestyle=":", label=r"$t^{1/2}$")
    axes.set(xlabel="orbits", ylabel="rms energy error")
    log_scale(axes, "xy")
    axes.legend()
    return figure


if __name__ == "__main__":
    fill(__doc__, parts, PAGE, PICTURE)
