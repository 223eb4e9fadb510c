"""The Fermi-Pasta-Ulam-Tsingou chain of 1024 sites between fixed ends: V = sum of d^2/2 + beta d^4/4 over all d."""

from math import pi, sin

from nearharmonic import Parameter, System
from nearharmonic.math import array, sum

SITES = 1024


def V(q, beta):
    q = array((0, *q, 0))
    d = q[1:] - q[:-1]
    return sum(d**2 / 2 + beta * d**4 / 4)


SYSTEM = System(
    name="fput_chain",
    label="FPUT chain",
    V=V,
    q0=[f"{sin(pi * i / (SITES + 1)):.9f}" for i in range(1, SITES + 1)],
    p0=["0"] * SITES,
    t_end="1000",
    parameters={"beta": Parameter(value="0.1", unit="1", meaning="strength of the quartic term")},
    source="Fermi, Pasta, Ulam & Tsingou (1955), Los Alamos report LA-1940",
)
