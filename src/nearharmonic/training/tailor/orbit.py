"""The orbit of a system's own start: its states, and the fastest oscillation on it."""

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

#: The method of the orbit, for every separable H, and its step per stage in radians of the fastest oscillation.
METHOD, STEP = "blanes_moan_s6o4", 0.03
#: States of the orbit that are kept, and those of them at which the frequency is found.
SAMPLES, POINTS = 240, 12
#: Radians of the fastest oscillation that an orbit takes: twelve periods.
RADIANS = 24 * np.pi
#: Products of the two Hessians with a vector, until it is that of the fastest oscillation.
PRODUCTS = 40
#: Displacement of momenta whose change of velocity stands for the derivative, over their size.
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
        """By how much each position and momentum (d,) varies; the mean of the others for one that does not."""
        return _spread(self.q), _spread(self.p)


def orbit_of(system: System) -> Orbit:
    """Return the orbit of the system's own start over twelve periods of its fastest oscillation.

    Raises
    ------
    SettingError
        The orbit leaves its energy surface, rests, or nothing oscillates on it.
    """
    q, p = (np.array([row]) for row in system.start(float))
    frequency = fastest(system, q, p)
    for _ in range(2):  # the frequency at the start may be another than that on the orbit
        q, p = _states(system, frequency)
        frequency = fastest(system, q[:: len(q) // POINTS], p[:: len(p) // POINTS])
    if not (np.ptp(q, axis=0).any() or np.ptp(p, axis=0).any()):
        start = f"({list(system.q0)}, {list(system.p0)})"
        raise bad_setting("(q0, p0)", start, f"a start that moves; {system.name} rests there")
    return Orbit(q=q, p=p, frequency=frequency)


def fastest(system: System, q: Floats, p: Floats) -> float:
    """Return the root of the mean square of the fastest frequency of small oscillations about states (S, d).

    The square is the largest eigenvalue of T'' V'', found by repeated products. Where it is below 0, the motion is
    unstable as fast as its modulus says, which counts the same.

    Raises
    ------
    SettingError
        It is 0 at each of the states, or not finite.
    """
    with np.errstate(all="ignore"):
        squares = _squares(system, q.T, p.T)
    frequency = float(np.sqrt(np.abs(squares).mean()))
    if not 0 < frequency < np.inf:
        allowed = "one with a force that depends on the position along the orbit of its start"
        raise bad_setting("system", system.name, allowed)
    return frequency


def _squares(system: System, q: Floats, p: Floats) -> Floats:
    """The largest eigenvalue (S,) of T'' V'' at each state (d, S)."""
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
        length = (w * w).sum(axis=0)  # 0 where the potential is flat
        size = np.divide((after * w).sum(axis=0), length, out=np.zeros_like(length), where=length > 0)
        w = after
    return size


def _rows(components: Sequence[Any], like: Floats) -> Floats:
    """Components, of which some may be constants, as an array (d, S)."""
    return np.array([np.broadcast_to(np.asarray(x, dtype=float), like.shape[1:]) for x in components])


def _largest(rows: Floats) -> Floats:
    """The largest modulus in each column, 1 where all are 0."""
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
