"""The oracle of methods with an oscillator solved exactly: steps in mpmath, each rotation by its cosine and sine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mpmath import cos, mpf, sin

from nearharmonic import System
from support.oracles.multiprecision import kick, states_of


@dataclass(frozen=True)
class Oscillators:
    """A system with its frequencies, and by hand the gradient of V without the oscillators."""

    system: System
    frequencies: tuple[Any, ...]
    gradient: Any

    def energy(self, q, p):
        """H in mpmath."""
        constants = [mpf(parameter.value) for parameter in self.system.parameters.values()]
        return sum(x * x for x in p) / 2 + self.system.V(tuple(q), *constants)

    def states(self, tableau, tau, steps):
        """States (q, p) after 0, 1, ..., ``steps`` steps, with nothing merged."""
        flows = {"A": self._rotated, "B": kick(lambda q: self.gradient(*q))}
        return states_of(tableau, flows, self.system.start(mpf), tau, steps)

    def _rotated(self, t, q, p):
        turned = [], []
        for x, u, w in zip(q, p, map(mpf, self.frequencies), strict=True):
            turned[0].append(x * cos(w * t) + (u * sin(w * t) / w if w else u * t))
            turned[1].append(u * cos(w * t) - w * x * sin(w * t))
        return turned


def quartic(x):
    return (x**3,)


def henon_heiles(x, y):
    return 2 * x * y, x * x - y * y


def chain(x, y, z):
    """Gradient of V below, without the oscillators of frequencies 1.5, 2 and 0."""
    g = mpf("0.3")
    return (g * 3 * (x - y) ** 2 / 10, -g * 3 * (x - y) ** 2 / 10 + sin(y - z), -sin(y - z))


QUARTIC = Oscillators(
    System(
        name="quartic_oscillator",
        V=lambda q: q[0] ** 2 / 2 + q[0] ** 4 / 4,
        q0=["0.4"],
        p0=["0.3"],
        t_end=8,
        frequencies=("1",),
    ),
    ("1",),
    quartic,
)


def _chain(q, strength, w):
    from nearharmonic.math import cos as cosine

    x, y, z = q
    return 9 * x * x / 8 + w * w * y * y / 2 + strength * (x - y) ** 3 / 10 - cosine(y - z)


#: Three frequencies, one of them a parameter, one 0; a rest of V that is no polynomial.
CHAIN = Oscillators(
    System(
        name="chain_of_three",
        V=_chain,
        q0=["0.3", "-0.2", "0.1"],
        p0=["0.1", "0.4", "0.2"],
        t_end=8,
        parameters={"strength": "0.3", "w": "2"},
        frequencies=("3/2", "w", "0"),
    ),
    ("1.5", "2", "0"),
    chain,
)
