"""Simple harmonic oscillator, H = p^2/2 + q^2/2 (Nielsen 2015, Eq. 11 with k = m = 1)."""

from __future__ import annotations

from typing import Any

from nearharmonic.systems.quantities import Vector
from nearharmonic.systems.system import System


def V(q: Vector) -> Any:
    """V = q^2 / 2."""
    (x,) = q
    return x * x / 2


def grad_V(q: Vector) -> Vector:
    """dV/dq = q."""
    return q


def exact_position(system: System, t: Any) -> Vector:
    """q cos t + p sin t, with the period 2 pi."""
    from mpmath import cos, mpf, sin

    (q,), (p,) = system.start(mpf)
    return (q * cos(t) + p * sin(t),)


SYSTEM = System(
    name="sho",
    label="simple harmonic oscillator",
    V=V,
    grad_V=grad_V,
    q0=("1",),
    p0=("0",),
    t_end="500",
    frequencies=("1",),
    source="Nielsen (2015), arXiv:1501.04345, Eq. 11 and Fig. 1: (p, q) = (0, 1), t in [0, 500]",
    harmonic=True,
    exact_position=exact_position,
    surface_limit=1e6,
    surface_reason="every ellipse of the linear map is closed, however eccentric: only exponential growth leaves it",
)
