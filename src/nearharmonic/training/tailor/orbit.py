"""The orbit of a system's own start: its states, and the fastest oscillation on it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.systems.system import System
from nearharmonic.training.population import Floats

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
        The orbit leaves its energy surface, or nothing oscillates on it.
    """
    q, p = (np.array([row]) for row in system.start(float))
    frequency = fastest(system, q, p)
    for _ in range(2):  # the frequency at the start may be another than that on the orbit
        q, p = _states(system, frequency)
        frequency = fastest(system, q[:: len(q) // POINTS], p[:: len(p) // POINTS])
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
    parameters = system.constants(float)
    with np.errstate(all="ignore"):
        squares = np.array([_square(system, a, b, parameters) for a, b in zip(q, p, strict=True)])
    frequency = float(np.sqrt(np.abs(squares).mean()))
    if not 0 < frequency < np.inf:
        allowed = "one with a force that depends on the position along the orbit of its start"
        raise bad_setting("system", system.name, allowed)
    return frequency


def _square(system: System, q: Floats, p: Floats, parameters: tuple[float, ...]) -> float:
    """The largest eigenvalue of T'' V'' at a state."""
    d, time = len(q), (0.0,) if system.time_dependent else ()
    grad_T = system.formulas().grad_T
    size = 0.0
    w = np.random.default_rng(d).normal(size=d)
    velocity = np.array(grad_T((*p, *time), *parameters)[:d], dtype=float)
    for _ in range(PRODUCTS):
        w = w / (np.abs(w).max() or 1.0)
        force = np.array(system.hessian_V_times(tuple(q), tuple(w), *time, *parameters), dtype=float)
        h = DISPLACEMENT * (np.abs(p).max() or 1.0) / (np.abs(force).max() or 1.0)
        moved = np.array(grad_T((*(p + h * force), *time), *parameters)[:d], dtype=float)
        after = (moved - velocity) / h
        size = float(after @ w / (w @ w))
        w = after
    return size


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
    spread = np.sqrt(2) * rows.std(axis=0)
    still = spread < 1e-9 * spread.max()
    if still.any() and not still.all():
        spread[still] = spread[~still].mean()
    return spread
