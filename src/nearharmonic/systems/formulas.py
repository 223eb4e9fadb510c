"""Integrated formulas of a system: its own, those of the extended phase space, or those of a regularised system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from nearharmonic.core.number import NO_SUCH_COMPONENT, Constant, FormulaError, components
from nearharmonic.core.tracing import Hamiltonian
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.energy import Energy, MassKineticEnergy, Vector, takes_parameters
from nearharmonic.systems.regularisation import RegularisedFormulas

# --- Formulas of the extended phase space, and adapters for formulas without parameters.
#
# A system with V(q, t) is extended to an autonomous system, whose last coordinate is the time t with the conjugate
# momentum p_t: H = T(p) + p_t + V(q, t). Then dt/dt = 1, dp_t/dt = -dV/dt, and H is conserved. p_t starts at 0, so that
# -p_t is the energy that the system has received. T + p_t has degree 2 in the momenta if T has. Source: Hairer,
# Lubich &
# Wanner (2006), Geometric Numerical Integration, Sec. VI.1 (extended phase space).


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
    return formula if taken else partial(_without_parameters, formula)


# The functions below take their first arguments by functools.partial, which can be pickled and compared by what it has.
def _without_parameters(formula: Callable[..., Any], p: Vector, *_: Any) -> Any:
    return formula(p)


def extended_V(V: Callable[..., Any], x: Vector, *parameters: Any) -> Any:
    """V(q, t) as a function of the coordinates (q, t)."""
    *q, t = x
    return _of_time(V, tuple(q), t, *parameters)


def _of_time(formula: Callable[..., Any], q: Vector, t: Any, *parameters: Any) -> Any:
    """Call V or grad_V; error messages do not count the time as a coordinate."""
    try:
        return formula(q, t, *parameters)
    except IndexError as error:
        if str(error) != NO_SUCH_COMPONENT:
            raise
        raise IndexError(f"{error}: {components('q', len(q))}") from error


def extended_force(grad_V: Callable[..., Vector], potential: Energy, x: Vector, *parameters: Any) -> Vector:
    """(dV/dq, dV/dt): dV/dq is given with the system, dV/dt is derived."""
    *q, t = x
    force = tuple(_of_time(grad_V, tuple(q), t, *parameters))
    if len(force) != len(q):
        raise FormulaError(f"returns {len(force)} components, expected a tuple of {len(q)}, one number per coordinate")
    return *force, potential.slope(len(q), x, *parameters)


def extended_T(T: Callable[..., Any], p: Vector, *parameters: Any) -> Any:
    """T(p) + p_t."""
    return T(p[:-1], *parameters) + p[-1]


def extended_velocity(grad_T: Callable[..., Vector], p: Vector, *parameters: Any) -> Vector:
    """(dT/dp, 1)."""
    return *grad_T(p[:-1], *parameters), 1


@dataclass(frozen=True, kw_only=True)
class Formulas(Hamiltonian):
    """The integrated formulas of a system.

    ``hessian_V_times(q, vector, *parameters)`` and ``hessian_T_times(p, vector, *parameters)`` are derived from V and
    T. ``energies`` are V and T as expressions, and ``regularised`` holds the maps of a regularised system.
    """

    acceleration: Callable[..., Vector]
    hessian_V_times: Callable[..., Vector]
    hessian_T_times: Callable[..., Vector]
    energies: tuple[Energy, Energy]
    regularised: RegularisedFormulas | None = None

    @property
    def are_loops(self) -> bool:
        """True if kernels of the system are loops, for one trajectory at a time."""
        return self.energies[0].traced and any(energy.is_long for energy in self.energies)


def formulas_of(system: Any, potential: Energy, kinetic_energy: Energy) -> Formulas:
    """Return the integrated formulas of ``system``, with derived gradients where it has none.

    V is a function of the integrated coordinates, which include the time if V depends on it, T of the system's momenta.
    """
    T, grad_T = kinetic_energy.function, with_parameters(system.grad_T, len(system.parameters))
    derived = isinstance(system.grad_V, DerivedGradient)
    if not system.time_dependent:
        V, grad_V = system.V, potential.gradient if derived else system.grad_V
    else:
        V, grad_V = (
            potential.function,
            potential.gradient if derived else partial(extended_force, system.grad_V, potential),
        )
        T, grad_T = partial(extended_T, T), partial(extended_velocity, grad_T)
    kinetic = Energy(system.name, "T", T, potential.dimension, kinetic_energy.parameters)
    return Formulas(
        name=system.name,
        dimension=potential.dimension,
        V=V,
        grad_V=grad_V,
        T=T,
        grad_T=grad_T,
        grad_V_and_V=potential.gradient_and_value if derived else lambda q, *given: (*grad_V(q, *given), V(q, *given)),
        balanced_T=kinetic.balanced,
        hessian_V_times=potential.hessian_times,
        hessian_T_times=kinetic.hessian_times,
        acceleration=partial(_acceleration, system, kinetic_energy),
        energies=(potential, kinetic),
    )


def regularised_formulas(system: Any) -> Formulas:
    """Return the formulas of the oscillator of ``system``, which has a ``regularisation`` that fits it."""
    given = system.regularisation
    assert given is not None
    places, named = list(system.parameters), {given.gravity, given.strength or given.gravity}
    fits = system.dimension in (2, 3) and system.unit_masses and not system.time_dependent
    if not (fits and named <= set(places)):
        raise SystemDefinitionError(
            f"{system.name}: regularisation = {given!r} is not allowed: it is for two or three coordinates, masses of "
            "1, V that does not depend on time, and parameters of the names of gravity and strength"
        )
    maps = RegularisedFormulas(given, places.index(given.gravity), system.dimension)
    constants = system.constants(Constant)
    V, T = (
        Energy(system.name, name, formula, maps.coordinates, constants)
        for name, formula in (("V", maps.V), ("T", maps.T))
    )
    return Formulas(
        name=system.name,
        dimension=maps.coordinates,
        V=maps.V,
        grad_V=V.gradient,
        T=maps.T,
        grad_T=lambda p, *_: (*p[:-1], Constant(0)),
        grad_V_and_V=V.gradient_and_value,
        balanced_T=T.balanced,
        hessian_V_times=V.hessian_times,
        hessian_T_times=T.hessian_times,
        acceleration=lambda force, *_: (*force[:-1], Constant(0)),
        energies=(V, T),
        regularised=maps,
    )


def _acceleration(system: Any, kinetic_energy: Energy, force: Vector, *parameters: Any) -> Vector:
    """The acceleration in a system whose T is quadratic; that of the time coordinate of an extended system is 0."""
    if system.time_dependent:
        return *_of_force(system, kinetic_energy, force[:-1], *parameters), Constant(0)
    return _of_force(system, kinetic_energy, force, *parameters)


def _of_force(system: Any, kinetic_energy: Energy, force: Vector, *parameters: Any) -> Vector:
    if isinstance(system.T, MassKineticEnergy):
        return system.T.velocity(force, *parameters)
    return force if system.unit_masses else kinetic_energy.hessian_times(force, force, *parameters)
