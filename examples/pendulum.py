"""A pendulum of mass 1 on a rod of length l: H = p^2 / (2 l^2) + g l (1 - cos q), q the angle from the vertical."""

from nearharmonic import Parameter, System
from nearharmonic.math import cos


def V(q, g, length):
    return g * length * (1 - cos(q[0]))


def T(p, g, length):
    return p[0] ** 2 / (2 * length**2)


SYSTEM = System(
    name="pendulum",
    label="pendulum",
    V=V,
    T=T,
    q0=("0.5",),
    p0=("0",),
    t_end="60",
    units={"q": "rad", "p": "kg m2 s-1", "t": "s", "energy": "J"},
    parameters={
        "g": Parameter(value="9.80665", unit="m s-2", meaning="acceleration of free fall"),
        "length": Parameter(value="1", unit="m", meaning="length of the rod"),
    },
    source="textbook example",
)
