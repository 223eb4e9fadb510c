"""Where the exact orbit is at time t: a closed form for the oscillator and Kepler, extended precision for the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.errors import bad_setting
from nearharmonic.systems import System, systems

if TYPE_CHECKING:
    from nearharmonic.tableau import Tableau

#: Ends of the intervals over which positions are compared, where the system's own is too long: orbits of
#: Henon-Heiles at H = 1/8 part by a factor e in about ten units of time.
POSITION_T_END = {"henon_heiles": "20"}

DIGITS = 40
#: Steps of the first extended run, and the most: at 100 ns a step and stage some seconds.
FIRST_STEPS, MOST_STEPS = 2_000, 512_000
#: A reference is good when halving its steps moves it by less than this part of the distance.
AGREEMENT = 1e-17
#: One that never settles to this is no reference: the orbit is chaotic.
USABLE = 1e-13


@dataclass(frozen=True, kw_only=True)
class Reference:
    """The exact position ``q`` (d,) as pairs high + low of doubles (d, 2); ``scale``, the distance that errors are
    relative to, max(|q(0)|, |q(t)|); ``uncertainty``, relative to it; and ``source``, how it was found."""

    q: NDArray[np.float64]
    scale: float
    uncertainty: float
    source: str

    def error(self, q: Any, q_low: Any = 0.0) -> Any:
        """|q + q_low - exact| / scale for positions (..., d); infinite where a position is no number."""
        difference = (np.asarray(q) - self.q[:, 0]) + (np.asarray(q_low) - self.q[:, 1])
        size = np.sqrt((difference * difference).sum(axis=-1)) / self.scale
        return np.where(np.isfinite(size), size, np.inf)


def position_t_end(system: System, t_end: str) -> str:
    """End of the interval for comparing positions: ``t_end``, or earlier where chaos would decide the outcome."""
    own = POSITION_T_END.get(system.name) if system.name in systems and systems[system.name] is system else None
    return t_end if own is None else min(own, t_end, key=Fraction)


def reference(system: System, t_end: str) -> Reference:
    """The exact position of ``system`` at ``t_end``.

    Raises:
        SettingError: no closed form is known and runs in extended precision do not converge.
    """
    known = system.name in systems and systems[system.name] is system
    exact = _CLOSED_FORMS.get(system.name) if known else None
    if exact is None:
        return _extended(system, t_end)
    import mpmath

    with mpmath.workdps(DIGITS):
        return _made(system, exact(system, mpmath.mpf(t_end)), 1e-32, f"closed form in {DIGITS} digits")


def _made(system: System, q: Sequence[Any], uncertainty: float, source: str) -> Reference:
    pairs = np.array([(float(x), float(x - type(x)(float(x)))) for x in q])
    start = np.array([float(x) for x in system.q0])
    scale = float(max(np.linalg.norm(start), np.linalg.norm(pairs[:, 0])))
    return Reference(q=pairs, scale=scale, uncertainty=uncertainty, source=source)


def _oscillator(system: System, t: Any) -> tuple[Any, ...]:
    """q cos t + p sin t: one turn of phase space in 2 pi."""
    import mpmath

    (q,), (p,) = system.q0, system.p0
    return (mpmath.mpf(q) * mpmath.cos(t) + mpmath.mpf(p) * mpmath.sin(t),)


def _kepler(system: System, t: Any) -> tuple[Any, Any]:
    """Lagrange's f and g from the start (Battin 1999, Sec. 4.3), after Newton on Kepler's equation for the change of
    the eccentric anomaly; good for any elliptic orbit, wherever on it the start lies."""
    import mpmath
    from mpmath import cos, mpf, pi, sin, sqrt

    (x, y), (u, v) = (tuple(map(mpf, row)) for row in (system.q0, system.p0))
    GM = mpf(system.parameters["GM"].value)
    r, rv = sqrt(x * x + y * y), x * u + y * v
    a = 1 / (2 / r - (u * u + v * v) / GM)
    n = sqrt(GM / a**3)
    turn = n * t - 2 * pi * mpmath.floor(n * t / (2 * pi))
    sigma, rho = rv / sqrt(GM * a), 1 - r / a
    change = turn
    for _ in range(60):
        off = change - rho * sin(change) + sigma * (1 - cos(change)) - turn
        step = off / (1 - rho * cos(change) + sigma * sin(change))
        change -= step
        if abs(step) < mpf(10) ** (5 - DIGITS):
            break
    f = 1 - a / r * (1 - cos(change))
    g = turn / n + (sin(change) - change) / n
    return f * x + g * u, f * y + g * v


_CLOSED_FORMS: dict[str, Callable[[System, Any], tuple[Any, ...]]] = {"sho": _oscillator, "kepler": _kepler}


def _extended(system: System, t_end: str) -> Reference:
    """Runs in extended precision with ever smaller steps, until two agree."""
    from nearharmonic.integrators import integrators

    tableau = integrators["yoshida_s7o6a"]
    steps, before, change = FIRST_STEPS, None, np.inf
    while steps <= MOST_STEPS:
        q = _end(system, tableau, t_end, steps)
        finite = bool(np.isfinite(q).all())
        if finite and before is not None:
            scale = _made(system, [Fraction(high) + Fraction(low) for high, low in q], 0.0, "").scale
            change = float(np.linalg.norm((q - before).sum(axis=1))) / scale
            # Order 6: the finer of two runs is off by 1/63 of what lies between them.
            if change / 63 < AGREEMENT:
                break
        before = q if finite else None
        steps *= 2
    if before is None or not change / 63 < USABLE:
        allowed = f"the orbit of {system.name} cannot be followed that far ({change:.1e} between two fine runs)"
        raise bad_setting("t_end", t_end, f"{allowed}: compare energies, or choose an earlier t_end")
    source = f"{tableau.label} in double-double, {min(steps, MOST_STEPS)} steps; half as many differ by {change:.1e}"
    return _made(system, [Fraction(high) + Fraction(low) for high, low in q], change / 63, source)


def _end(system: System, tableau: Tableau, t_end: str, steps: int) -> NDArray[np.float64]:
    """The position (d, 2) at the end of one run in double-double."""
    from nearharmonic.batch import integrate_batch

    paths = integrate_batch(
        system, tableau, t_end=Fraction(t_end), steps=[steps], samples=2, precision="extended", width=1
    )
    return np.stack([paths.q[0, -1], paths.q_low[0, -1]], axis=-1)
