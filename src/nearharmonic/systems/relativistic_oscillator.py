"""Relativistic oscillator, H = sqrt(1 + p^2) - 1 + q^2/2: a kinetic energy that is not quadratic (m = c = k = 1)."""

from __future__ import annotations

from typing import Any

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.systems.quantities import Vector
from nearharmonic.systems.system import System


def V(q: Vector) -> Any:
    """V = q^2 / 2."""
    (x,) = q
    return x * x / 2


def grad_V(q: Vector) -> Vector:
    """dV/dq = q."""
    return q


def T(p: Vector) -> Any:
    """T = sqrt(1 + p^2) - 1, in the form p^2 / (1 + sqrt(1 + p^2)), which has no cancellation at small p."""
    (u,) = p
    square = u * u
    return square / (1 + sqrt(1 + square))


def grad_T(p: Vector) -> Vector:
    """dT/dp = p / sqrt(1 + p^2), the velocity; it is below 1."""
    (u,) = p
    return (u / sqrt(1 + u * u),)


# H excludes the rest energy: the energy error is then relative to the energy of the motion, as for "sho", the limit of
# this system for small amplitudes.
SYSTEM = System(
    name="relativistic_oscillator",
    label="relativistic oscillator",
    V=V,
    grad_V=grad_V,
    T=T,
    grad_T=grad_T,
    q0=("1",),
    p0=("0",),
    t_end="500",
    source="Zarmi (2023), Applied Mathematics 14, 1, doi:10.4236/am.2023.141001; amplitude 1: speeds up to 0.75 c",
    surface_limit=1.0,
    surface_reason="the well has no end, but at twice its energy a run is on no orbit near the one it began on",
)
