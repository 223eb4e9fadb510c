"""The orbit from the initial values of a system: states and fastest oscillation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System

#: Integrator of the orbit, for every separable H, and its step per stage in radians of the fastest oscillation.
METHOD, STEP = "blanes_moan_s6o4", 0.03
#: Number of states that are kept, and number of states at which the frequency is computed.
SAMPLES, POINTS = 240, 12
#: Length of an orbit in radians of the fastest oscillation: twelve periods.
RADIANS = 24 * np.pi
#: Number of products of both Hessians with a vector, which converges to the eigenvector of the fastest oscillation.
PRODUCTS = 40
#: Relative displacement of momenta for the finite difference of the velocity.
DISPLACEMENT = 1e-6


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """Some states of an orbit.

    Attributes
    ----------
    q, p : (S, d) array of float
        The states.
    frequency : float
        Root of the mean square of the fastest frequency of small oscillations about these states, in the inverse unit
        of time.
    """

    q: Floats
    p: Floats
    frequency: float

    @property
    def amplitudes(self) -> tuple[Floats, Floats]:
        """Amplitude of each position and momentum (d,); for a constant component the mean of the others."""
        return _spread(self.q), _spread(self.p)


def orbit_of(system: System) -> Orbit:
    """Return the orbit from the initial values of a system over twelve periods of its fastest oscillation.

    Raises
    ------
    SettingError
        The orbit diverges, is at rest, or has no oscillation.
    """
    q, p = (np.array([row]) for row in system.start(float))
    frequency = fastest(system, q, p)
    for _ in range(2):  # the frequency at the start may differ from that on the orbit
        q, p = _states(system, frequency)
        frequency = fastest(system, q[:: len(q) // POINTS], p[:: len(p) // POINTS])
    if not (np.ptp(q, axis=0).any() or np.ptp(p, axis=0).any()):
        start = f"({list(system.q0)}, {list(system.p0)})"
        raise bad_setting("(q0, p0)", start, f"a start that moves; {system.name} rests there")
    return Orbit(q=q, p=p, frequency=frequency)


def fastest(system: System, q: Floats, p: Floats) -> float:
    """Return the root of the mean square of the fastest frequency of small oscillations about states (S, d).

    The square of the frequency is the largest |eigenvalue| of T'' V'', computed by repeated products. A negative
    eigenvalue is the square of a growth rate, which limits the step size in the same way.

    Raises
    ------
    SettingError
        The frequency is 0 at all states, or not finite.
    """
    with np.errstate(all="ignore"):
        squares = _squares(system, q.T, p.T)
    frequency = float(np.sqrt(np.abs(squares).mean()))
    if not 0 < frequency < np.inf:
        allowed = "one with a force that depends on the position along the orbit of its start"
        raise bad_setting("system", system.name, allowed)
    return frequency


def _squares(system: System, q: Floats, p: Floats) -> Floats:
    """Return the largest |eigenvalue| (S,) of T'' V'' at each state (d, S)."""
    d, parameters = len(q), system.constants(float)
    time = (np.zeros(q.shape[1]),) if system.time_dependent else ()
    grad_T = system.formulas().grad_T
    velocity = _rows(grad_T((*p, *time), *parameters)[:d], p)
    w = np.random.default_rng(d).normal(size=p.shape)
    size = np.zeros(p.shape[1])
    for _ in range(PRODUCTS):
        w = w / _largest(w)
        force = _rows(system.hessian_V_times(tuple(q), tuple(w), *time, *parameters), p)
        h = DISPLACEMENT * _largest(p) / _largest(force)
        after = (_rows(grad_T((*(p + h * force), *time), *parameters)[:d], p) - velocity) / h
        length = (w * w).sum(axis=0)  # 0 for a constant potential
        size = np.divide((after * w).sum(axis=0), length, out=np.zeros_like(length), where=length > 0)
        w = after
    return size


def _rows(components: Sequence[Any], like: Floats) -> Floats:
    """Return components as an array (d, S); some may be constants."""
    return np.array([np.broadcast_to(np.asarray(x, dtype=float), like.shape[1:]) for x in components])


def _largest(rows: Floats) -> Floats:
    """Return the largest modulus in each column, or 1 if all are 0."""
    largest = np.abs(rows).max(axis=0)
    found: Floats = np.where(largest > 0, largest, 1.0)
    return found


def _states(system: System, frequency: float) -> tuple[Floats, Floats]:
    method = integrators[METHOD]
    t_end = Fraction(RADIANS / frequency)
    steps = int(np.ceil(RADIANS / (STEP * method.stages)))
    run = integrate_batch(system, method, t_end=t_end, steps=[steps], samples=SAMPLES, numerics=Numerics())
    d = system.dimension
    q, p = run.q[0, :, :d], run.p[0, :, :d]
    if run.left_at[0] or not (np.isfinite(q).all() and np.isfinite(p).all()):
        what = f"a start whose orbit stays on its energy surface; that of {system.name} leaves it"
        raise bad_setting("(q0, p0)", f"({list(system.q0)}, {list(system.p0)})", what)
    return q, p


def _spread(rows: Floats) -> Floats:
    spread: Floats = np.sqrt(2) * rows.std(axis=0)
    still = spread < 1e-9 * spread.max()
    if still.any() and not still.all():
        spread[still] = spread[~still].mean()
    return spread
