"""Systems whose runs are derivatives of runs of another system.

The derivative of a splitting step is the same step applied to a separable Hamiltonian of twice as many coordinates, K =
grad T(p).w + grad V(q).u, with coordinates (q, u) and momenta (w, p): q and p follow the orbit, u and w are the exact
derivative of the discrete map times the initial deviation. Deviations therefore use the kernels of ordinary systems.
Poisson brackets commute with this extension, so that kicks of a modified potential have the same property.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import bad_setting
from nearharmonic.systems.definition.quantities import Vector
from nearharmonic.systems.definition.remembered import remembered
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.kinetic_energy import MassKineticEnergy, takes_parameters


@remembered
def tangent_system(system: System) -> System:
    """Return the system K of a ``system`` of d coordinates.

    It has 2 d coordinates and the same parameters. If V depends on time, K is that of the extended system with the
    coordinates (q, t). Its initial deviation has length 1, along the first coordinate.
    """
    formulas, (q0, p0) = system.formulas(), system.extended_start(str)
    d = formulas.dimension

    def V(x: Vector, *parameters: Any) -> Any:
        return _product(formulas.grad_V(x[:d], *parameters), x[d:])

    def T(y: Vector, *parameters: Any) -> Any:
        return _product(formulas.grad_T(y[d:], *parameters), y[:d])

    rest = ("0",) * d
    return System(
        name=f"{system.name}_tangent", V=V, T=T, q0=(*q0, "1", *rest[1:]), p0=(*rest, *p0), t_end=system.t_end,
        parameters=system.parameters, source=system.source,
    )  # fmt: skip


@remembered
def sensitive_system(system: System) -> System:
    """Return the system K of a ``system`` of d coordinates in which the P parameters are coordinates.

    A parameter theta of V is a coordinate without kinetic energy; its momentum collects -dK/dtheta. Its coordinates are
    (q, u, theta) and its momenta (w, p, pi). Where T has parameters too, a second copy of them are momenta, whose
    coordinates chi collect dK/dtheta: (q, u, theta, chi) and (w, p, pi, theta). The derivative with respect to theta is
    then pi - chi.
    """
    formulas, (q0, p0), own = system.formulas(), system.extended_start(str), system.constants(str)
    d, count, constants = formulas.dimension, len(own), system.constants(Constant)
    moving = kinetic_parameters(system)

    def V(x: Vector) -> Any:
        return _product(formulas.grad_V(x[:d], *x[2 * d : 2 * d + count]), x[d : 2 * d])

    def T(y: Vector) -> Any:
        parameters = y[2 * d + count :] if moving else constants
        return _product(formulas.grad_T(y[d : 2 * d], *parameters), y[:d])

    rest, none = ("0",) * d, ("0",) * count
    return System(
        name=f"{system.name}_sensitive", V=V, T=T, t_end=system.t_end, source=system.source,
        q0=(*q0, "1", *rest[1:], *own, *(none if moving else ())), p0=(*rest, *p0, *none, *(own if moving else ())),
    )  # fmt: skip


def kinetic_parameters(system: System) -> bool:
    """Return True if T is a function of parameters."""
    if isinstance(system.T, MassKineticEnergy):
        return any(isinstance(mass, int) for mass in system.T.masses)
    return bool(system.parameters) and takes_parameters(system.T)


def check_differentiable(system: System) -> None:
    """Raise an error for a system whose step has no derivative here.

    Raises
    ------
    SettingError
        The system is regularised, or its V is a function of numba.
    """
    if system.regularisation is not None:
        what = "it is regularised, and its steps are those of a fictitious time, which depends on the orbit"
        raise bad_setting("system", system.name, what)
    if not system.energies[0].traced:
        what = "its V is a function of numba, which has no second derivatives: write it as a formula"
        raise bad_setting("system", system.name, what)


def _product(one: Vector, other: Vector) -> Any:
    terms = [a * b for a, b in zip(one, other, strict=True)]
    return sum(terms[1:], terms[0])
