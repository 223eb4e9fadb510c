"""Exact positions: by the closed form of a system that has one, by runs with small steps for the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import SystemDefinitionError, bad_setting
from nearharmonic.integrators import yoshida_1990
from nearharmonic.systems.numba_potential import numba_potential
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    from nearharmonic.integrators.tableau import Tableau

#: Digits in which closed forms are evaluated.
DIGITS = 40
#: Steps of the first extended run, and the most: at 100 ns a step and stage some seconds.
FIRST_STEPS, MOST_STEPS = 2_000, 512_000
#: A reference is good when halving its steps moves it by less than this part of the distance.
AGREEMENT = {"extended": 1e-17, "double": 1e-14}
#: One that never settles to this is no reference: the orbit is chaotic.
USABLE = {"extended": 1e-13, "double": 1e-10}
#: Relative difference beyond which a closed form contradicts the system: formulas may hold literals of 16 digits.
CONTRADICTION = 1e-12


@dataclass(frozen=True, kw_only=True)
class Reference:
    """An exact position ``q`` (d, 2) as pairs high + low of doubles.

    ``scale`` is the distance that errors are relative to, max(|q(0)|, |q(t)|), ``uncertainty`` the error of ``q`` over
    it, and ``source`` how it was found.
    """

    q: NDArray[np.float64]
    scale: float
    uncertainty: float
    source: str

    def error(self, q: Any, q_low: Any = 0.0) -> Any:
        """Return |q + q_low - exact| / scale of arrays (..., d); infinite where a position is no number.

        A time behind the coordinates is no position.
        """
        q, q_low = (np.asarray(x)[..., : len(self.q)] if np.ndim(x) else x for x in (q, q_low))
        difference = (q - self.q[:, 0]) + (q_low - self.q[:, 1])
        size = np.sqrt((difference * difference).sum(axis=-1)) / self.scale
        return np.where(np.isfinite(size), size, np.inf)


def position_t_end(system: System, t_end: str) -> str:
    """Return the end of the interval for comparing positions: ``t_end``, or the system's own if that is earlier."""
    return t_end if system.position_t_end is None else min(system.position_t_end, t_end, key=Fraction)


def reference(system: System, t_end: str) -> Reference:
    """Return the exact position of ``system`` at ``t_end``, by a closed form that fits the equations of motion or by
    runs.

    Runs with ever smaller steps that do not converge raise SettingError, a closed form that contradicts the equations
    SystemDefinitionError.
    """
    import mpmath

    with mpmath.workdps(DIGITS):
        exact = system.exact_position and system.exact_position(system, mpmath.mpf(t_end))
    if not exact:
        return _settled(system, t_end, "double" if numba_potential(system) else "extended")
    _check_closed_form(system, t_end)
    with mpmath.workdps(DIGITS):
        return _made(system, exact, 1e-32, f"closed form in {DIGITS} digits")


def _check_closed_form(system: System, t_end: str) -> None:
    """Compare a closed form with the initial values, and at ``t_end`` with the force if q'' = -grad_V."""
    import mpmath

    exact = system.exact_position
    assert exact is not None
    with mpmath.workdps(2 * DIGITS):
        end = mpmath.mpf(t_end)
        h = end / mpmath.mpf(10) ** (DIGITS // 2)  # so differences below are good to about (h / period)^2

        def around(t: Any) -> list[NDArray[Any]]:
            return [np.array(exact(system, t + k * h), dtype=object) for k in (-1, 0, 1)]

        q0 = np.array(system.start(mpmath.mpf)[0], dtype=object)
        before, start, after = around(mpmath.mpf(0))
        size, constants = max(abs(q0)), system.constants(mpmath.mpf)
        p0 = system.extended_start(mpmath.mpf)[1]
        velocity = np.array(p0 if system.unit_masses else system.formulas().grad_T(p0, *constants))[: len(q0)]
        pairs = [(start, q0, size), ((after - before) / (2 * h), velocity, size / end)]
        if system.unit_masses:
            before, q, after = around(end)
            time = (end,) if system.time_dependent else ()
            force = -np.array(system.grad_V(tuple(q), *time, *constants))
            pairs.append(((after - 2 * q + before) / h**2, force, size / end**2))
        for found, expected, scale in pairs:
            if max(abs(found - expected)) > CONTRADICTION * max(*abs(expected), scale):
                message = "exact_position contradicts its initial values or its potential"
                raise SystemDefinitionError(f"{system.name}: {message}")


def _made(system: System, q: Sequence[Any], uncertainty: float, source: str) -> Reference:
    pairs = np.array([(float(x), float(x - type(x)(float(x)))) for x in q])
    start = np.array([float(x) for x in system.q0])
    scale = float(max(np.linalg.norm(start), np.linalg.norm(pairs[:, 0])))
    return Reference(q=pairs, scale=scale, uncertainty=uncertainty, source=source)


def _settled(system: System, t_end: str, precision: str) -> Reference:
    """Runs with ever smaller steps, until two agree: in extended precision, or in double if V is a function of numba.

    Of order 6, the finer of two runs in extended precision is off by 1/63 of what lies between them. In double, that
    may be rounding, which both have.
    """
    share = 63 if precision == "extended" else 1
    (tableau,) = yoshida_1990.TABLEAUS
    steps, before, change = FIRST_STEPS, None, np.inf
    while steps <= MOST_STEPS:
        q = _end(system, tableau, t_end, steps, precision)
        finite = bool(np.isfinite(q).all())
        if finite and before is not None:
            scale = _made(system, [Fraction(high) + Fraction(low) for high, low in q], 0.0, "").scale
            change = float(np.linalg.norm((q - before).sum(axis=1))) / scale
            if change / share < AGREEMENT[precision]:
                break
        before = q if finite else None
        steps *= 2
    if before is None or not change / share < USABLE[precision]:
        allowed = f"the orbit of {system.name} cannot be followed that far ({change:.1e} between two fine runs)"
        raise bad_setting("t_end", t_end, f"{allowed}: compare energies, or choose an earlier t_end")
    arithmetic = {"extended": "double-double", "double": "double, as V is,"}[precision]
    source = f"{tableau.label} in {arithmetic} {min(steps, MOST_STEPS)} steps; half as many differ by {change:.1e}"
    return _made(system, [Fraction(high) + Fraction(low) for high, low in q], change / share, source)


def _end(system: System, tableau: Tableau, t_end: str, steps: int, precision: str) -> NDArray[np.float64]:
    """The position (d, 2) at the end of one run."""
    from nearharmonic.engine.batch import integrate_batch

    numerics = Numerics(precision=precision, width=1)
    paths = integrate_batch(system, tableau, t_end=Fraction(t_end), steps=[steps], samples=2, numerics=numerics)
    return np.stack([paths.q[0, -1], paths.q_low[0, -1]], axis=-1)[: system.dimension]
