"""A product of quartic oscillators with frequencies over a decade: U = sum x^2/2 + b x^4/4 with x = omega q."""

from __future__ import annotations

from typing import Any

import numpy as np

from nearharmonic.math import exp, log
from nearharmonic.numerics.compiled import Normal, compiled
from nearharmonic.numerics.portable import Floats
from nearharmonic_studies.samplers.targets.target import Target

#: Strength b of the quartic term; the ratio of the frequencies; modes that the slowest observables see.
STRENGTH, RATIO, SLOW = 1.0, 10.0, 10
#: Places of the density of x, which is below exp(-20) of its maximum at the ends for b >= 0 and REACH^2 / 2 = 20.
PLACES, REACH = 4001, 6.4


def quantiles(strength: float, probabilities: Floats, temperature: float = 1.0) -> Floats:
    """Return the quantiles of the density exp(-(x^2/2 + b x^4/4)/temperature), by the trapezoidal rule."""
    x = np.linspace(-REACH, REACH, PLACES) * np.sqrt(temperature)
    density = exp(-(x**2 / 2 + strength * x**4 / 4) / temperature)
    sums = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
    found: Floats = np.interp(probabilities * sums[-1], sums, x)
    return found


def frequencies_of(n: int) -> Floats:
    """Return n frequencies, log-uniform from 1/RATIO to 1, ascending."""
    found: Floats = exp(-log(RATIO) * (1 - (np.arange(n) + 0.5) / n))
    return found


def _gradient_of(frequencies: Floats, strength: float) -> Any:
    squares = frequencies**2

    @compiled
    def gradient(q, out):  # type: ignore[no-untyped-def]
        total = 0.0
        for k in range(len(q)):
            square = squares[k] * q[k] * q[k]
            out[k] = squares[k] * q[k] * (1.0 + strength * square)
            total += square * (2.0 + strength * square)
        return total / 4

    return gradient


@compiled
def observe(q, potential, out):  # type: ignore[no-untyped-def]
    """Write the slowest coordinate, the sum of squares of the slowest ones, and U."""
    out[0], out[1], out[2] = q[0], 0.0, potential
    for k in range(min(SLOW, len(q))):
        out[1] += q[k] * q[k]


def quartic(n: int, strength: float = STRENGTH) -> Target:
    """Return the target in n dimensions."""
    frequencies = frequencies_of(n)

    def start(normal: Normal) -> Floats:
        return quantiles(strength, normal.uniform.random(n)) / frequencies

    return Target(
        name="quartic",
        label=f"quartic posterior, {n} dimensions",
        dimension=n,
        highest=1.0,
        lengths=(4.0, 8.0, 16.0),
        gradient=_gradient_of(frequencies, strength),
        observe=observe,
        observables=("slowest coordinate", "squares of the slowest", "U"),
        start=start,
    )
