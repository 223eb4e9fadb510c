"""Formulas of the extended phase space, and adapters for formulas without parameters.

A system with V(q, t) is extended to an autonomous system, whose last coordinate is the time t with the conjugate
momentum p_t: H = T(p) + p_t + V(q, t). Then dt/dt = 1, dp_t/dt = -dV/dt, and H is conserved. p_t starts at 0, so that
-p_t is the energy that the system has received. T + p_t has degree 2 in the momenta if T has. Source: Hairer, Lubich &
Wanner (2006), Geometric Numerical Integration, Sec. VI.1 (extended phase space).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nearharmonic.core.formulas.number import NO_SUCH_COMPONENT, FormulaError, components
from nearharmonic.systems.formulas.energy import Energy
from nearharmonic.systems.formulas.kinetic_energy import takes_parameters

Vector = tuple[Any, ...]


class DerivedGradient:
    """The gradient of an energy, derived at the first call."""

    def __init__(self, energy: Energy, time_dependent: bool = False) -> None:
        self.energy, self.time_dependent = energy, time_dependent

    def __call__(self, x: Vector, *others: Any) -> Vector:
        if self.time_dependent:
            t, *parameters = others
            return self.energy.gradient((*x, t), *parameters)[:-1]
        return self.energy.gradient(tuple(x), *others)


def with_parameters(formula: Callable[..., Any], count: int) -> Callable[..., Any]:
    """Return T or grad_T, which may take no parameters, as a function of momenta and parameters."""
    taken = not count or isinstance(formula, DerivedGradient) or takes_parameters(formula)
    return formula if taken else _WithoutParameters(formula)


@dataclass(frozen=True)
class _WithoutParameters:
    """A function of the momenta only, as a function of momenta and parameters."""

    formula: Callable[..., Any]

    def __call__(self, p: Vector, *_: Any) -> Any:
        return self.formula(p)


@dataclass(frozen=True)
class ExtendedPotential:
    """V(q, t) as a function of the coordinates (q, t)."""

    V: Callable[..., Any]

    def __call__(self, x: Vector, *parameters: Any) -> Any:
        *q, t = x
        return _of_time(self.V, tuple(q), t, *parameters)


def _of_time(formula: Callable[..., Any], q: Vector, t: Any, *parameters: Any) -> Any:
    """Call V or grad_V; error messages do not count the time as a coordinate."""
    try:
        return formula(q, t, *parameters)
    except IndexError as error:
        if str(error) != NO_SUCH_COMPONENT:
            raise
        raise IndexError(f"{error}: {components('q', len(q))}") from error


@dataclass(frozen=True)
class ExtendedForce:
    """(dV/dq, dV/dt): dV/dq is given with the system, dV/dt is derived."""

    grad_V: Callable[..., Vector]
    potential: Energy

    def __call__(self, x: Vector, *parameters: Any) -> Vector:
        *q, t = x
        force = tuple(_of_time(self.grad_V, tuple(q), t, *parameters))
        if len(force) != len(q):
            raise FormulaError(
                f"returns {len(force)} components, expected a tuple of {len(q)}, one number per coordinate"
            )
        return *force, self.potential.slope(len(q), x, *parameters)


@dataclass(frozen=True)
class ExtendedKineticEnergy:
    """T(p) + p_t."""

    T: Callable[..., Any]

    def __call__(self, p: Vector, *parameters: Any) -> Any:
        return self.T(p[:-1], *parameters) + p[-1]


@dataclass(frozen=True)
class ExtendedVelocity:
    """(dT/dp, 1)."""

    grad_T: Callable[..., Vector]

    def __call__(self, p: Vector, *parameters: Any) -> Vector:
        return *self.grad_T(p[:-1], *parameters), 1
