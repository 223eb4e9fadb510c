"""Henon-Heiles system, H = (px^2 + py^2)/2 + (x^2 + y^2)/2 + x^2 y - y^3/3 (Nielsen 2015, Eq. 18)."""

from __future__ import annotations

from typing import Any

from nearharmonic.systems.quantities import Vector
from nearharmonic.systems.system import System


def V(q: Vector) -> Any:
    """V = (x^2 + y^2)/2 + x^2 y - y^3/3, in a form with few operations: (x^2 + y^2)/2 + y (x^2 - y^2/3)."""
    x, y = q
    xx, yy = x * x, y * y
    return (xx + yy) / 2 + y * (xx - yy / 3)


def grad_V(q: Vector) -> Vector:
    """dV/dq = (x + 2xy, y + x^2 - y^2)."""
    x, y = q
    return x + (y + y) * x, y + x * x - y * y


SYSTEM = System(
    name="henon_heiles",
    label="Hénon-Heiles system",
    V=V,
    grad_V=grad_V,
    q0=("0.3", "0"),
    p0=("0", "0.4"),
    t_end="500",
    # Orbits are chaotic at H = 1/8: distances of neighbours grow by a factor e in 22 units of time (mean up to t =
    # 1e7).
    position_t_end="20",
    frequencies=("1", "1"),
    source="Henon & Heiles (1964), doi:10.1086/109234; initial values of Nielsen (2015), Eq. 18: H = 1/8, chaotic",
    surface_limit=1.0,
    surface_reason="escape takes 1/3 of H = 1/8; at twice the energy no closed surface is left and the orbit runs away",
)
