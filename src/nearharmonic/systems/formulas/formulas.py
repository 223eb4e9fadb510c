"""Integrated formulas of a system, of an autonomous system of one more coordinate if V depends on time.

A potential V(q, t) is that of an autonomous system whose last coordinate is the time t, with a momentum p_t conjugate
to it: H = T(p) + p_t + V(q, t). Then dt/dt = 1, dp_t/dt = -dV/dt, and H is conserved; p_t starts at 0, so that -p_t is
the energy that the system has received. T + p_t is of degree 2 in the momenta if T is. Source: Hairer, Lubich & Wanner
(2006), Geometric Numerical Integration, Sec. VI.1 (extended phase space).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nearharmonic.core.formulas.number import NO_SUCH_COMPONENT, Constant, FormulaError, components, vector
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.formulas.energy import Energy
from nearharmonic.systems.formulas.kinetic_energy import MassKineticEnergy, takes_parameters
from nearharmonic.systems.formulas.regularisation import RegularisedFormulas

if TYPE_CHECKING:
    from nearharmonic.core.formulas.chain import Chain
    from nearharmonic.systems.definition.system import System

Vector = tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class Formulas:
    """The formulas of an autonomous system of ``dimension`` coordinates, each with its parameters behind them.

    ``V(q, *parameters)`` and ``T(p, *parameters)`` return a scalar, ``grad_V(q, *parameters)`` and
    ``grad_T(p, *parameters)`` a tuple of ``dimension`` components. ``hessian_V_times(q, vector, *parameters)`` and
    ``hessian_T_times(p, vector, *parameters)`` are derived from them. ``grad_V_and_V(q, *parameters)`` returns the
    components of the gradient and V behind them, of shared operations, ``balanced_T(p, *parameters)`` is T in an order
    that keeps chains of operations short. ``acceleration(force, *parameters)`` is the change of grad_T by a force, the
    same at all momenta if T is quadratic. ``energies`` are V and T as expressions, ``regularised`` the maps of a
    regularised system. ``name`` is that of the system, for errors.
    """

    name: str
    dimension: int
    V: Callable[..., Any]
    grad_V: Callable[..., Vector]
    T: Callable[..., Any]
    grad_T: Callable[..., Vector]
    grad_V_and_V: Callable[..., Vector]
    balanced_T: Callable[..., Any]
    hessian_V_times: Callable[..., Vector]
    hessian_T_times: Callable[..., Vector]
    acceleration: Callable[..., Vector]
    energies: tuple[Energy, Energy]
    regularised: RegularisedFormulas | None = None

    @property
    def are_loops(self) -> bool:
        """True if kernels of the system are loops, for one trajectory at a time."""
        return self.energies[0].traced and any(energy.is_long for energy in self.energies)

    def force_chain(self, constants: Sequence[Constant], parameters: int) -> Chain:
        """Return the longest chain of operations from q to grad_V.

        Parameters
        ----------
        constants : sequence of Constant
            The parameters, if they are compiled in.
        parameters : int
            Number of parameters.
        """
        from nearharmonic.core.formulas.chain import Chained, longest_chain

        values = [Chained() for _ in range(self.dimension + parameters)]
        q, given = tuple(values[: self.dimension]), values[self.dimension :]
        return longest_chain(vector(self, "grad_V", q, *(constants or given)))


class DerivedGradient:
    """The gradient of an energy, derived from it at the first call."""

    def __init__(self, energy: Energy, time_dependent: bool = False) -> None:
        self.energy, self.time_dependent = energy, time_dependent

    def __call__(self, x: Vector, *others: Any) -> Vector:
        if self.time_dependent:
            t, *parameters = others
            return self.energy.gradient((*x, t), *parameters)[:-1]
        return self.energy.gradient(tuple(x), *others)


def formulas_of(system: System, potential: Energy, kinetic_energy: Energy) -> Formulas:
    """Return what is integrated of ``system``.

    Parameters
    ----------
    system : System
        Its gradients, or that they are derived.
    potential : Energy
        V of the coordinates that are integrated, the time among them if V depends on it.
    kinetic_energy : Energy
        T of the momenta of the system.
    """
    T, grad_T = kinetic_energy.function, with_parameters(system.grad_T, len(system.parameters))
    derived = isinstance(system.grad_V, DerivedGradient)
    if not system.time_dependent:
        V, grad_V = system.V, potential.gradient if derived else system.grad_V
    else:
        V, grad_V = potential.function, potential.gradient if derived else _ExtendedForce(system.grad_V, potential)
        T, grad_T = _ExtendedKineticEnergy(T), _ExtendedVelocity(grad_T)
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
        acceleration=_Acceleration(system, kinetic_energy),
        energies=(potential, kinetic),
    )


def regularised_formulas(system: System) -> Formulas:
    """Return the formulas of an oscillator that ``system``, whose ``regularisation`` is given, is mapped to.

    Raises
    ------
    SystemDefinitionError
        Another number of coordinates than 2 or 3, masses other than 1, V that depends on time, or no such parameter.
    """
    given = system.regularisation
    assert given is not None
    places = list(system.parameters)
    if (
        system.dimension not in (2, 3)
        or not system.unit_masses
        or system.time_dependent
        or not {
            given.gravity,
            given.strength or given.gravity,
        }
        <= set(places)
    ):
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


@dataclass(frozen=True)
class _Acceleration:
    """Acceleration in a system whose T is quadratic; the clock of an extended system has none."""

    system: System
    kinetic_energy: Energy

    def __call__(self, force: Vector, *parameters: Any) -> Vector:
        if self.system.time_dependent:
            return *self._of(force[:-1], *parameters), Constant(0)
        return self._of(force, *parameters)

    def _of(self, force: Vector, *parameters: Any) -> Vector:
        if isinstance(self.system.T, MassKineticEnergy):
            return self.system.T.velocity(force, *parameters)
        if self.system.unit_masses:
            return force
        return self.kinetic_energy.hessian_times(force, force, *parameters)


def with_parameters(formula: Callable[..., Any], count: int) -> Callable[..., Any]:
    """Return T or grad_T as a function of the momenta and the parameters, of which it may take none."""
    taken = not count or isinstance(formula, DerivedGradient) or takes_parameters(formula)
    return formula if taken else _WithoutParameters(formula)


@dataclass(frozen=True)
class _WithoutParameters:
    """A function of the momenta alone, called with the parameters too."""

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
    """V or grad_V of the coordinates without the time, which errors do not count."""
    try:
        return formula(q, t, *parameters)
    except IndexError as error:
        if str(error) != NO_SUCH_COMPONENT:
            raise
        raise IndexError(f"{error}: {components('q', len(q))}") from error


@dataclass(frozen=True)
class _ExtendedForce:
    """(dV/dq, dV/dt): the one given with the system, the other derived."""

    grad_V: Callable[..., Vector]
    potential: Energy

    def __call__(self, x: Vector, *parameters: Any) -> Vector:
        *q, t = x
        force = tuple(_of_time(self.grad_V, tuple(q), t, *parameters))
        if len(force) != len(q):
            raise FormulaError(
                f"returns {len(force)} components, expected a tuple of {len(q)}, one number a coordinate"
            )
        return *force, self.potential.slope(len(q), x, *parameters)


@dataclass(frozen=True)
class _ExtendedKineticEnergy:
    """T(p) + p_t."""

    T: Callable[..., Any]

    def __call__(self, p: Vector, *parameters: Any) -> Any:
        return self.T(p[:-1], *parameters) + p[-1]


@dataclass(frozen=True)
class _ExtendedVelocity:
    """(dT/dp, 1)."""

    grad_T: Callable[..., Vector]

    def __call__(self, p: Vector, *parameters: Any) -> Vector:
        return *self.grad_T(p[:-1], *parameters), 1
