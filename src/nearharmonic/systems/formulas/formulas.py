"""Integrated formulas of a system: its own, those of the extended phase space, or those of a regularised system."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.core.formulas.physics import Hamiltonian
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.definition.energies import Energies
from nearharmonic.systems.definition.extended import (
    DerivedGradient,
    ExtendedForce,
    ExtendedKineticEnergy,
    ExtendedVelocity,
    with_parameters,
)
from nearharmonic.systems.formulas.energy import Energy
from nearharmonic.systems.formulas.kinetic_energy import MassKineticEnergy
from nearharmonic.systems.formulas.regularisation import RegularisedFormulas

Vector = tuple[Any, ...]


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
