"""Planar Sun-Mercury system per unit mass of Mercury, H = p^2/2 - GM/|q| (Nielsen 2015, Eq. 19, right-hand form)."""

from __future__ import annotations

import math
from typing import Any

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.math import atan2
from nearharmonic.systems.quantities import Observable, Parameter, Vector
from nearharmonic.systems.system import System


def V(q: Vector, GM: Any) -> Any:
    """V = -GM / |q|."""
    x, y = q
    return -GM / sqrt(x * x + y * y)


def grad_V(q: Vector, GM: Any) -> Vector:
    """dV/dq = GM q / |q|^3."""
    x, y = q
    square = x * x + y * y
    pull = GM / (square * square) * sqrt(square)  # the division does not wait for the root: a shorter chain
    return pull * x, pull * y


def angular_momentum(q: Vector, p: Vector, *_: Any) -> Any:
    """L = x py - y px, per unit mass."""
    (x, y), (u, v) = q, p
    return x * v - y * u


def eccentricity_vector(q: Vector, p: Vector, GM: Any) -> Vector:
    """Laplace-Runge-Lenz vector divided by GM (Nielsen 2015, Eq. 20 for GM = 1); it points to the perihelion."""
    (x, y), (u, v) = q, p
    L = x * v - y * u
    r = sqrt(x * x + y * y)
    return v * L / GM - x / r, -u * L / GM - y / r


def orbital_period(q: Vector, p: Vector, GM: float) -> float:
    """Kepler's third law: 2 pi sqrt(a^3 / GM) with the semi-major axis a = -GM / 2H."""
    (u, v) = p
    semi_major_axis = -GM / (u * u + v * v + 2 * V(q, GM))
    return 2 * math.pi * math.sqrt(semi_major_axis * semi_major_axis * semi_major_axis / GM)


def perihelion_angle(q: Vector, p: Vector, GM: Any, *_: Any) -> Any:
    """Angle of the Laplace-Runge-Lenz vector in (-pi, pi]; constant on an exact orbit."""
    x, y = eccentricity_vector(q, p, GM)
    return atan2(y, x)


def exact_position(system: System, t: Any) -> Vector | None:
    """Return Lagrange's f and g solution from any start on an ellipse; None if the orbit is unbound.

    Newton's method solves Kepler's equation for the change of the eccentric anomaly. Source: Battin (1999), Sec. 4.3.
    """
    from mpmath import cos, floor, mp, mpf, pi, sin, sqrt

    ((x, y), (u, v)), (GM,) = system.start(mpf), system.constants(mpf)
    r, rv = sqrt(x * x + y * y), x * u + y * v
    energy = (u * u + v * v) / 2 - GM / r
    if energy >= 0:
        return None
    a = -GM / (2 * energy)
    n = sqrt(GM / a**3)
    turn = n * t - 2 * pi * floor(n * t / (2 * pi))
    sigma, rho = rv / sqrt(GM * a), 1 - r / a
    change = turn
    for _ in range(60):
        off = change - rho * sin(change) + sigma * (1 - cos(change)) - turn
        step = off / (1 - rho * cos(change) + sigma * sin(change))
        change -= step
        if abs(step) < mpf(10) ** (5 - mp.dps):
            break
    f = 1 - a / r * (1 - cos(change))
    g = turn / n + (sin(change) - change) / n
    return f * x + g * u, f * y + g * v


SYSTEM = System(
    name="kepler",
    label="Sun-Mercury system",
    V=V,
    grad_V=grad_V,
    # Aphelion distance 69.82e6 km and minimum orbital velocity 38.86 km/s = 0.139896e6 km/h.
    q0=("69.82", "0"),
    p0=("0", "0.139896"),
    t_end="87660",
    units={"q": "1e6 km", "p": "1e6 km h-1", "t": "h", "energy": "1e12 km2 h-2"},
    parameters={
        # 1.32712e11 km^3 s^-2 times (3600 s/h)^2, in (1e6 km)^3 h^-2: exact.
        "GM": Parameter(value="1.71994752", unit="1e18 km3 h-2", meaning="gravitational constant times solar mass"),
    },
    invariants={
        "angular_momentum": Observable(
            function=angular_momentum, unit="1e12 km2 h-1", meaning="angular momentum per unit mass"
        ),
        "eccentricity_vector": Observable(
            function=eccentricity_vector, unit="1", meaning="Laplace-Runge-Lenz vector over GM"
        ),
    },
    observables={
        "perihelion_angle": Observable(
            function=perihelion_angle, unit="rad", meaning="angle of the Laplace-Runge-Lenz vector"
        )
    },
    period=orbital_period,
    gravity=True,
    exact_position=exact_position,
    source="NASA Space Science Data Center, Sun and Mercury fact sheets; ten years of 8766 h (Nielsen 2015, Fig. 5)",
    surface_limit=1.0,
    surface_reason="at |dH/H0| = 1 the energy has reached zero or doubled: the orbit is unbound or lost",
)
