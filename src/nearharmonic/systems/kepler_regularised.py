"""Sun-Mercury system with a perturbation, H = p^2/2 - GM/|q| - A/|q|^3, integrated as an oscillator (Levi-Civita).

The term -A/|q|^3 is due to general relativity, to first order in 1/c^2, with A = GM L^2/c^2: the perihelion advances by
6 pi GM/(c^2 a (1 - e^2)) an orbit. Source: Einstein (1915), Sitzungsber. Preuss. Akad. Wiss. 831; the potential in
Goldstein (2002), Classical Mechanics, Sec. 12. A is 0 by default, so that the orbit is a Kepler ellipse.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.systems import kepler
from nearharmonic.systems.formulas import Regularisation
from nearharmonic.systems.quantities import Parameter, Vector
from nearharmonic.systems.system import System


def V(q: Vector, GM: Any, A: Any) -> Any:
    """-GM/|q| - A/|q|^3."""
    (x, y) = q
    square = x * x + y * y
    return -(GM + A / square) / sqrt(square)


def perturbation(q: Vector, r: Any, GM: Any, A: Any) -> Any:
    """-A/r^3."""
    return -A / (r * r * r)


def exact_position(system: System, t: Any) -> Vector | None:
    """Return the position on the Kepler orbit; None if A is not 0."""
    GM, A = system.parameters.values()
    if float(A.value) != 0:
        return None
    parameters = {"GM": replace(kepler.SYSTEM.parameters["GM"], value=GM.value)}
    return kepler.exact_position(replace(kepler.SYSTEM, q0=system.q0, p0=system.p0, parameters=parameters), t)


SYSTEM = System(
    name="kepler_regularised",
    label="Sun-Mercury system, regularised",
    V=V,
    q0=kepler.SYSTEM.q0,
    p0=kepler.SYSTEM.p0,
    t_end=kepler.SYSTEM.t_end,
    units=kepler.SYSTEM.units,
    parameters={
        **kepler.SYSTEM.parameters,
        "A": Parameter(value="0", unit="1e30 km5 h-2", meaning="strength of the perturbation -A/r^3"),
    },
    invariants={"angular_momentum": kepler.SYSTEM.invariants["angular_momentum"]},
    observables=kepler.SYSTEM.observables,
    exact_position=exact_position,
    regularisation=Regularisation(gravity="GM", perturbation=perturbation, strength="A"),
    source=f"{kepler.SYSTEM.source}; regularisation of Levi-Civita (1920), doi:10.1007/BF02404404",
    surface_limit=1.0,
    surface_reason=kepler.SYSTEM.surface_reason,
)
