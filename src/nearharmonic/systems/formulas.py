"""Integrated formulas of a system: its own, those of the extended phase space, or those of a regularised system.

Formulas of the extended phase space, and adapters for formulas without parameters.

A system with V(q, t) is extended to an autonomous system, whose last coordinate is the time t with the conjugate
momentum p_t: H = T(p) + p_t + V(q, t). Then dt/dt = 1, dp_t/dt = -dV/dt, and H is conserved. p_t starts at 0, so that
-p_t is the energy that the system has received. T + p_t has degree 2 in the momenta if T has. Source: Hairer, Lubich &
Wanner (2006), Geometric Numerical Integration, Sec. VI.1 (extended phase space).

Potential and kinetic energy of a system, as expressions that are traced at first use.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from nearharmonic.core.formulas.number import NO_SUCH_COMPONENT, Constant, FormulaError, components
from nearharmonic.core.formulas.tracing import Hamiltonian
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.declaration import Members
from nearharmonic.systems.energy import Energy, MassKineticEnergy, Vector, quadratic_T, takes_parameters
from nearharmonic.systems.numba_potential import NumbaEnergy, numba_potential
from nearharmonic.systems.regularisation import RegularisedFormulas


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


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Energies(Members):
    """The energies of a system, and properties of its kinetic energy."""

    @cached_property
    def _potential(self) -> Energy:
        numba = numba_potential(self)
        if numba is not None:
            return NumbaEnergy(numba, self.constants(Constant))
        V = ExtendedPotential(self.V) if self.time_dependent else self.V
        return Energy(self.name, "V", V, self.dimension + self.time_dependent, self.constants(Constant))

    @cached_property
    def _kinetic_energy(self) -> Energy:
        T = with_parameters(self.T, len(self.parameters))
        return Energy(self.name, "T", T, self.dimension, self.constants(Constant))

    @property
    def energies(self) -> tuple[Energy, Energy]:
        """V and T. V is a function of the coordinates, and of time if it depends on time."""
        return self._potential, self._kinetic_energy

    @cached_property
    def quadratic_kinetic_energy(self) -> bool:
        """True if T is a polynomial of degree at most 2 in the momenta, as Nystrom methods require."""
        return self.T is quadratic_T or isinstance(self.T, MassKineticEnergy) or self._kinetic_energy.is_quadratic

    @cached_property
    def unit_masses(self) -> bool:
        """True if T = p.p / 2: accelerations are then minus grad_V."""
        return self.T is quadratic_T or self._kinetic_energy.is_half_square

    @cached_property
    def typical_energy(self) -> float:
        """T(p0) + max |V(q0, t)| to two digits, over 17 times of the interval; 0 if V does not depend on time.

        The energy at the start of a system that depends on time may be near 0 by accident.
        """
        if not self.time_dependent:
            return 0.0
        constants, times = self.constants(float), (float(self.t_end) * k / 16 for k in range(17))
        q0, p0 = (tuple(map(float, x)) for x in (self.q0, self.p0))
        V = max(abs(float(self.V(q0, t, *constants))) for t in times)
        return float(f"{float(self._kinetic_energy.function(p0, *constants)) + V:.2g}")

    def energy(self, q: Vector, p: Vector, constants: Sequence[Any] = (), t: Any = None) -> Any:
        """Return H = T(p) + V(q), or T(p) + V(q, t).

        Parameters
        ----------
        q, p : tuple of d numbers or arrays
            State, in any number type.
        constants : sequence of numbers
            Parameters in the same type, from :meth:`constants`.
        t : number or array
            Time, if V depends on it.

        Raises
        ------
        SystemDefinitionError
            V depends on time, and ``t`` is not given.
        """
        if self.time_dependent and t is None:
            raise SystemDefinitionError(f"{self.name}: V depends on time, and its energy needs t")
        time = (t,) if self.time_dependent else ()
        return self._kinetic_energy.function(p, *constants) + self.V(q, *time, *constants)


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


def formulas_of(system: Energies, potential: Energy, kinetic_energy: Energy) -> Formulas:
    """Return the integrated formulas of ``system``, with derived gradients where it has none.

    V is a function of the integrated coordinates, which include the time if V depends on it, T of the system's momenta.
    """
    T, grad_T = kinetic_energy.function, with_parameters(system.grad_T, len(system.parameters))
    derived = isinstance(system.grad_V, DerivedGradient)
    if not system.time_dependent:
        V, grad_V = system.V, potential.gradient if derived else system.grad_V
    else:
        V, grad_V = potential.function, potential.gradient if derived else ExtendedForce(system.grad_V, potential)
        T, grad_T = ExtendedKineticEnergy(T), ExtendedVelocity(grad_T)
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


def regularised_formulas(system: Energies) -> Formulas:
    """Return the formulas of the oscillator of ``system``, which has a ``regularisation``.

    Raises
    ------
    SystemDefinitionError
        The system does not have 2 or 3 coordinates and masses of 1, V depends on time, or a parameter is missing.
    """
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


@dataclass(frozen=True)
class _Acceleration:
    """Acceleration in a system whose T is quadratic; that of the time coordinate of an extended system is 0."""

    system: Energies
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
