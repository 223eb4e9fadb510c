"""Growth of round-off over long times: energy and along-track error of an ensemble of Kepler orbits.

The rounding error of a run in double precision is its difference from a run with equal method, step size and
coefficients (rounded to double) in double-double: truncation errors and rounded coefficients cancel. Rounded
coefficients define another method, close to the exact one; they shift the phase in proportion to time. Compensated sums
cannot remove this shift, so it is measured separately. For double-double there is no better reference run: its rounding
error is the difference from a run of the orbit scaled by 9 (lengths), 1/3 (momenta) and 27 (times), divided by sqrt(2).
The scaled run rounds differently at every operation.

Brouwer (1937), doi:10.1086/105423: with independent rounding errors, the energy error grows as t^(1/2), and the error
of the position along the track, due to the mean motion, as t^(3/2).
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from math import ceil, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import Floats, Integers, geometric
from nearharmonic.numerics.statistics import quasi_random
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic_paper.experiments.stability.kepler.run import PERIOD, SYSTEM, kepler_apoapsis
from nearharmonic_paper.experiments.stability.settings import RoundingSettings

#: Number of lanes of the kernels: two AVX-512 registers, which hide each other's latency.
WIDTH = 16
#: Eccentricities of the ensemble: small, so that truncation errors and their modulation are small.
ECCENTRICITY = (0.05, 0.3)
#: Number of stored states of a run, evenly spaced, and number of compared times among them, evenly spaced in log t.
SAMPLES, TIMES = 2000, 60
#: Digits of the differences: more than those of double-double.
DIGITS = 50
#: Scale of the second run in double-double: the square of an integer that is no power of two.
SCALE_ROOT = 3
_CONSTANTS = SYSTEM.constants(Decimal)
#: Decimals of an array of floats; energies of arrays of Decimals x, y, u, v.
_decimals = np.frompyfunc(Decimal, 1, 1)
_energy = np.frompyfunc(lambda x, y, u, v: SYSTEM.energy((x, y), (u, v), _CONSTANTS), 4, 1)
#: Compared quantities, in this order.
SOURCES = ("plain", "compensated", "extended", "coefficients")


class Schedule(NamedTuple):
    """Division of a run: all steps, all periods, and samples after the start, an integer number of periods apart."""

    steps: int
    samples: int
    periods: int


def schedule(settings: RoundingSettings, stages: int) -> Schedule:
    """Return the division with the requested number of steps, rounded to an integer number of samples at apoapsis.

    At the apoapsis the truncation error of the energy is stationary, so that a lag along the track does not affect the
    energy. The number of samples is equal for all methods.
    """
    per_orbit = max(1, round(settings.evaluations_per_orbit / stages))
    samples = min(SAMPLES, settings.steps // settings.evaluations_per_orbit)
    between = ceil(settings.steps / (per_orbit * samples))
    return Schedule(steps=samples * between * per_orbit, samples=samples, periods=samples * between)


def warm_up() -> dict[str, Contents]:
    """Compile the kernels into the cache; nothing is returned."""
    for precision, summation in (("double", "plain"), ("double", "compensated"), ("extended", "compensated")):
        kernel_of(SYSTEM, Numerics(precision=precision, summation=summation, width=WIDTH, energy="samples"))
    return {}


def starts(settings: RoundingSettings) -> Floats:
    """Return orbits of quasi-random eccentricity and orientation (ensemble, 8)."""
    u = quasi_random(settings.ensemble, 2, settings.seed)
    lowest, highest = ECCENTRICITY
    return kepler_apoapsis(lowest + (highest - lowest) * u[:, 0], 2 * pi * u[:, 1])


def _scaled(start: Floats) -> Floats:
    """Return orbits with lengths times 9 and momenta divided by 3, as double-doubles."""
    factors = [Fraction(SCALE_ROOT**2)] * 2 + [Fraction(1, SCALE_ROOT)] * 2
    result = np.zeros_like(start)
    for row, scaled in zip(start, result, strict=True):
        for k, factor in enumerate(factors):
            place = k + 2 * (k // 2)  # x, y, their carries, then the momenta
            exact = Fraction(row[place]) * factor
            scaled[place], scaled[place + 2] = rounded_pair(exact.numerator, exact.denominator)
    return result


def states(paths: Trajectories, samples: Integers, scale: int = 1) -> NDArray[Any]:
    """Return x, y, u, v (orbits, samples, 4) as Decimals with all digits, in units of the unscaled orbit."""
    with localcontext(prec=DIGITS):
        q, p = (
            _decimals(high[:, samples]) + _decimals(low[:, samples])
            for high, low in ((paths.q, paths.q_low), (paths.p, paths.p_low))
        )
        return np.concatenate([q / scale**2, p * scale], axis=-1)


def errors(found: NDArray[Any], reference: NDArray[Any]) -> tuple[Floats, Floats]:
    """Return energy error / |H0| and lag in mean anomaly (rad), (orbits, samples), of states against others.

    The lag is the displacement along the velocity, divided by the speed, times the mean motion, which is 1. It is a
    mean anomaly, which grows evenly, while the distance along the track oscillates with the speed.
    """
    here, there = np.moveaxis(found, -1, 0), np.moveaxis(reference, -1, 0)
    with localcontext(prec=DIGITS):
        energy = (_energy(*here) - _energy(*there)) * 2  # |H0| = 1/2
        (dx, dy), (u, v) = (here - there)[:2], there[2:]
        lag = (dx * u + dy * v) / (u * u + v * v)
    return energy.astype(float), lag.astype(float)


def measure(integrator: str, settings: RoundingSettings) -> dict[str, Contents]:
    """Return the file ``run``: energy error and lag by rounding alone over (source, orbit, sample), for one method."""
    tableau = integrators[integrator]
    plan, start = schedule(settings, tableau.stages), starts(settings)
    samples = np.unique(np.array(geometric(1, plan.samples, TIMES)).round().astype(np.int64))

    def run(start: Floats = start, scale: int = 1, **how: Any) -> NDArray[Any]:
        paths = integrate_batch(
            SYSTEM, tableau, t_end=plan.periods * PERIOD * scale**3, steps=np.full(len(start), plan.steps),
            samples=plan.samples + 1, start=start, numerics=Numerics(width=WIDTH, energy="samples", **how),
        )  # fmt: skip
        return states(paths, samples, scale)

    exact, rounded_coefficients = run(precision="extended"), run(precision="extended", double_coefficients=True)
    pairs = {name: errors(run(summation=name), rounded_coefficients) for name in ("plain", "compensated")}
    energy_pair, lag_pair = errors(run(_scaled(start), SCALE_ROOT, precision="extended"), exact)
    pairs["extended"] = energy_pair / sqrt(2), lag_pair / sqrt(2)
    pairs["coefficients"] = errors(rounded_coefficients, exact)
    energy, lag = (np.array([pairs[source][k] for source in SOURCES]) for k in (0, 1))
    periods = samples * (plan.periods // plan.samples)
    over = ("source", "orbit", "sample")
    variables = {
        "energy_error": variable(over, energy, "(H - H of the exact arithmetic)/|H0|, by rounding alone"),
        "time": variable("sample", periods.astype(float), "periods of the exact orbit"),
        "lag": variable(over, lag, "displacement along the track as mean anomaly, by rounding alone", "rad"),
        **coordinate("source", list(SOURCES), "arithmetic of the run, or its coefficients alone"),
    }
    return {"run": Contents(variables=variables, coordinates=("time",))}
