"""Energy errors and perihelion rotations over step sizes, all step sizes of a method side by side.

The two nonlinear systems are integrated in doubles with compensated sums. The oscillator is a power of a 2x2 matrix.
Ten roundings of an energy to a double make up a tenth of 1.1e-14, the lower end of a range.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from mpmath import matrix, mpf, workdps

from support.second_opinion.methods import METHODS, Method


class System(NamedTuple):
    """Planar system with T = p^2/2 per unit mass; gradient and potential take arrays over step sizes."""

    start: tuple[float, float, float, float]
    t_end: float
    x: np.ndarray  # step sizes per stage, as asked for
    gradient: Callable[[np.ndarray], np.ndarray]
    potential: Callable[..., np.ndarray]


class Curves(NamedTuple):
    """Results of a method over the step sizes per stage ``x``, as used.

    ``largest`` and ``mean`` are of |dH/H0| over all steps, infinite where a run diverges. ``rotation`` is the angle in
    rad by which the orbit turns until t_end, from a linear fit.
    """

    x: np.ndarray
    largest: np.ndarray
    mean: np.ndarray
    rotation: np.ndarray


def henon_heiles_gradient(q):
    x, y = q
    return np.array([x + 2 * x * y, y + x * x - y * y])


def henon_heiles_potential(x, y):
    return (x * x + y * y) / 2 + x * x * y - y**3 / 3


#: 1.32712e11 km^3 s^-2 in (10^6 km)^3 h^-2.
GM = 1.32712e11 * 3600**2 / 1e18


def kepler_gradient(q):
    square = q[0] * q[0] + q[1] * q[1]
    return GM / (square * np.sqrt(square)) * q


def kepler_potential(x, y):
    return -GM / np.sqrt(x * x + y * y)


def eccentricity_angle(x, y, u, v):
    """Angle of the vector to the aphelion, which is 0 at the start."""
    L, r = x * v - y * u, np.sqrt(x * x + y * y)
    return np.arctan2(u * L / GM + y / r, -v * L / GM + x / r)


def grid(lowest: int, highest: int) -> np.ndarray:
    """Return 10^(k/40) for k from lowest to highest."""
    return 10 ** (np.arange(lowest, highest + 1) / 40)


SYSTEMS = {
    "Henon-Heiles": System((0.3, 0.0, 0.0, 0.4), 500.0, grid(-115, -12), henon_heiles_gradient, henon_heiles_potential),
    # Aphelion distance in 10^6 km, lowest velocity in 10^6 km/h, ten years in hours.
    "Kepler": System((69.82, 0.0, 0.0, 0.139896), 87660.0, grid(-37, 76), kepler_gradient, kepler_potential),
}


def add(total: np.ndarray, lost: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return total + change, and what rounding took from it, to be added with the next change (Kahan)."""
    change = change + lost
    result = total + change
    return result, change - (result - total)


def steps_of(t_end: float, tau: np.ndarray) -> np.ndarray:
    """Return numbers of steps; the step sizes give way so that the last step ends at t_end."""
    return np.rint(t_end / tau).astype(int)


def walk(
    method: Method, system: System, steps: np.ndarray, tau: np.ndarray
) -> Iterator[tuple[int, tuple[np.ndarray, ...]]]:
    """Yield the number of each step and the state after it, of the smallest step sizes, which still run."""
    moves = [(kind == "kick", float(coefficient) * tau) for kind, coefficient in method.moves()]
    q, p = (np.array([np.full(tau.size, value) for value in half]) for half in (system.start[:2], system.start[2:]))
    q_lost, p_lost = np.zeros_like(q), np.zeros_like(p)
    done = 0
    for live in range(tau.size, 0, -1):
        q, p, q_lost, p_lost = (values[:, :live].copy() for values in (q, p, q_lost, p_lost))
        current = [(is_kick, length[:live]) for is_kick, length in moves]
        for step in range(done, steps[live - 1]):
            for is_kick, length in current:
                if is_kick:
                    p, p_lost = add(p, p_lost, -length * system.gradient(q))
                else:
                    q, q_lost = add(q, q_lost, length * p)
            yield step + 1, (*q, *p)
        done = steps[live - 1]


@cache
def curves(name: str, label: str) -> Curves:
    """Integrate a method on a system at all its step sizes."""
    if name == "oscillator":
        return oscillator_curves(METHODS[label])
    method, system = METHODS[label], SYSTEMS[name]
    n = steps_of(system.t_end, system.x * method.stages)
    tau = system.t_end / n

    def energy(x, y, u, v):
        return (u * u + v * v) / 2 + system.potential(x, y)

    start = energy(*(np.float64(value) for value in system.start))
    largest, total, moment = np.zeros((3, n.size))
    with np.errstate(all="ignore"):  # a run that diverges
        for step, state in walk(method, system, n, tau):
            live = state[0].size
            error = np.abs(energy(*state) / start - 1)
            largest[:live] = np.maximum(largest[:live], error)
            total[:live] += error
            if name == "Kepler":
                moment[:live] += (step - n[:live] / 2) * eccentricity_angle(*state)
    # The line through the angles of steps 0 to n, whose squared distances from their middle sum to n(n+1)(n+2)/12.
    rotation = 12 * moment / ((n + 1) * (n + 2))
    return Curves(tau / method.stages, finite(largest), finite(total / n), np.abs(rotation))


def finite(errors: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(errors), errors, np.inf)


def step_matrix(method: Method, tau: mpf) -> matrix:
    """Return the matrix of a step on H = (p^2 + q^2)/2, for (q, p)."""
    step = matrix([[1, 0], [0, 1]])
    for kind, coefficient in method.moves():
        length = tau * coefficient.numerator / coefficient.denominator
        step = matrix([[1, 0], [-length, 1]] if kind == "kick" else [[1, length], [0, 1]]) * step
    return step


def oscillator_errors(method: Method, tau: float, steps: int) -> np.ndarray:
    """Return |dH/H0| after each step from (q, p) = (1, 0), doubling the number of states known by a squared matrix."""
    states = np.array([[1.0], [0.0]])
    with workdps(40), np.errstate(all="ignore"):
        power = step_matrix(method, mpf(tau))
        while states.shape[1] <= steps:
            states = np.hstack([states, np.array(power.tolist(), dtype=float) @ states])
            power = power * power
        return finite(np.abs((states[:, 1 : steps + 1] ** 2).sum(axis=0) - 1))


def oscillator_curves(method: Method) -> Curves:
    n = steps_of(500.0, grid(-100, 0) * method.stages)
    tau = 500.0 / n
    errors = [oscillator_errors(method, *one) for one in zip(tau, n, strict=True)]
    largest, mean = (np.array([of(one) for one in errors]) for of in (np.max, np.mean))
    return Curves(tau / method.stages, largest, mean, np.zeros_like(tau))
