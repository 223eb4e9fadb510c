"""Named systems, with starts at given energies; no method is trained on them.

All have T = p.p/2 and rest at q = 0, where V is 0. The energy of a start is log-uniform in a given range. Its direction
is uniform on the energy surface of the small oscillations, and its length is the first at which H along this direction
reaches the energy. Directions of frequency 0, such as the translation of the Toda ring, are omitted: the total momentum
is 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from nearharmonic.engine.numbers import standard_parameters
from nearharmonic.math import cos, exp, log
from nearharmonic.numerics.portable import Floats, eigen, product
from nearharmonic.systems import henon_heiles
from nearharmonic.systems.quantities import Vector
from nearharmonic.systems.system import System
from nearharmonic.training.population import Ensemble
from nearharmonic_studies.trained.problems.anharmonicity import hessians, with_anharmonicity

#: Sites of the chains of Fermi, Pasta, Ulam and Tsingou, of Toda's ring, and atoms of the chain of Lennard-Jones.
CHAIN_SITES, RING, ATOMS = 8, 6, 5
#: Coefficients of the cubic and of the quartic chain, and of the quartic well.
ALPHA, BETA, WELL = 0.25, 1.0, 0.25
#: Ratio of successive lengths in the search along a direction, and number of bisections.
SHORTEST, LENGTH_RATIO, BISECTIONS = 1e-3, 1.02, 60
#: Limit of squared frequencies, below which a direction counts as free.
FREE = 1e-9


def pendulum(q: Vector) -> Any:
    """V = 1 - cos q."""
    return 1 - cos(q[0])


def morse(q: Vector) -> Any:
    """V = (1 - exp(-q))^2: the depth is 1, and so is the width."""
    x = 1 - exp(-q[0])
    return x * x


def quartic_well(q: Vector) -> Any:
    """V = q.q/2 + b (q.q)^2 in the plane."""
    square = q[0] * q[0] + q[1] * q[1]
    return square / 2 + WELL * (square * square)


def toda_ring(q: Vector) -> Any:
    """V = sum of exp(d) - d - 1 over the differences d of neighbours in a ring; the sum of d is 0."""
    return sum(exp(a - b) - 1 for a, b in pairwise((*q, q[0])))


def fput_alpha(q: Vector) -> Any:
    """V = sum of d^2/2 + alpha d^3/3 over the springs of a chain between fixed ends."""
    return sum(d * d * (0.5 + ALPHA / 3 * d) for d in _springs(q))


def fput_beta(q: Vector) -> Any:
    """V = sum of d^2/2 + beta d^4/4 over the springs of a chain between fixed ends."""
    return sum(d * d * (0.5 + BETA / 4 * (d * d)) for d in _springs(q))


def lennard_jones(q: Vector) -> Any:
    """V = sum of (r^-12 - 2 r^-6 + 1)/72 over neighbours at r = 1 + d between fixed ends: each bond has V'' = 1."""
    return sum(_lennard_jones_bond(1 + d) for d in _springs(q))


def _springs(q: Vector) -> list[Any]:
    return [b - a for a, b in zip((0, *q), (*q, 0), strict=True)]


def _lennard_jones_bond(r: Any) -> Any:
    square = 1 / (r * r)
    x = 1 - square * square * square
    return x * x / 72


@dataclass(frozen=True, kw_only=True)
class Named:
    """A potential of ``dimension`` coordinates, and the range of the energies of its starts."""

    name: str
    label: str
    V: Callable[..., Any]
    dimension: int
    energies: tuple[float, float]
    source: str

    def system(self) -> System:
        """Return the system."""
        if self.V is henon_heiles.V:
            return henon_heiles.SYSTEM
        rest = ("0",) * self.dimension
        return System(
            name=f"{self.name}_trained", label=self.label, V=self.V, q0=("0.125", *rest[1:]), p0=rest, t_end="100",
            source=self.source,
        )  # fmt: skip


_FPUT = "Fermi, Pasta, Ulam & Tsingou (1955), Los Alamos report LA-1940"
#: Named systems in the order of tables and figures.
NAMED = (
    Named(name="pendulum", label="pendulum", V=pendulum, dimension=1, energies=(0.005, 0.5), source="textbook"),
    Named(
        name="morse", label="Morse", V=morse, dimension=1, energies=(0.002, 0.3),
        source="Morse (1929), Phys. Rev. 34, 57, doi:10.1103/PhysRev.34.57",
    ),
    Named(
        name="quartic_well", label="quartic well", V=quartic_well, dimension=2, energies=(0.005, 0.5),
        source="textbook",
    ),
    Named(
        name="henon_heiles", label="Hénon-Heiles", V=henon_heiles.V, dimension=2, energies=(1 / 600, 1 / 8),
        source="Hénon & Heiles (1964), Astron. J. 69, 73, doi:10.1086/109234",
    ),
    Named(
        name="toda", label="Toda ring", V=toda_ring, dimension=RING, energies=(0.03, 1.0),
        source="Flaschka (1974), Phys. Rev. B 9, 1924, doi:10.1103/PhysRevB.9.1924",
    ),
    Named(
        name="lennard_jones", label="Lennard-Jones chain", V=lennard_jones, dimension=ATOMS, energies=(5e-5, 2e-3),
        source="textbook",
    ),
    Named(
        name="fput_alpha", label="FPUT-α", V=fput_alpha, dimension=CHAIN_SITES, energies=(1e-3, 0.1), source=_FPUT,
    ),
    Named(name="fput_beta", label="FPUT-β", V=fput_beta, dimension=CHAIN_SITES, energies=(0.05, 1.0), source=_FPUT),
)  # fmt: skip


def named_ensembles(count: int, seed: int, t_end: float) -> Iterator[Ensemble]:
    """Yield ``count`` starts of each system, with their anharmonicities.

    ``t_end`` is the length of every run, in radians of the fastest small oscillation.
    """
    for place, one in enumerate(NAMED):
        yield with_anharmonicity(named_ensemble(one, count, [seed, place], t_end))


def named_ensemble(one: Named, count: int, seed: int | list[int], t_end: float) -> Ensemble:
    """Return ``count`` starts of one system; parameters as for :func:`named_ensembles`."""
    system, d = one.system(), one.dimension
    squares, modes = eigen(hessians(system, np.zeros((1, d)))[0])
    random = np.random.default_rng(seed)
    low, high = map(log, one.energies)
    energies = exp(random.uniform(low, high, count))
    bound = modes[:, squares >= FREE].T
    # The distribution on the sphere is isotropic, so that any basis can be used; here that of the coordinates.
    sphere = product(random.normal(size=(count, 2, d)), product(bound.T, bound))
    sphere /= np.sqrt((sphere**2).sum(axis=(1, 2), keepdims=True))
    q = product(sphere[:, 0], product(bound.T / np.sqrt(squares[squares >= FREE]), bound))
    p = sphere[:, 1]
    length = _lengths(system, q, p, energies)[:, None]
    start = np.zeros((count, 4, d))
    start[:, 0], start[:, 2] = q * length, p * length
    unit = 1 / float(np.sqrt(squares[-1]))
    return Ensemble(
        name=one.label, system=system, start=start.reshape(count, -1), parameters=standard_parameters(system)[None, :],
        t_end=t_end * unit, unit=unit,
    )  # fmt: skip


def _lengths(system: System, q: Floats, p: Floats, energies: Floats) -> Floats:
    """Return the smallest r (count,) with H(r q, r p) = E."""

    def short(r: Floats) -> Any:
        return system.energy(tuple(r * x for x in q.T), tuple(r * x for x in p.T)) < energies

    low = SHORTEST * np.sqrt(2 * energies)
    while (go_on := short(low * LENGTH_RATIO)).any():
        low = np.where(go_on, low * LENGTH_RATIO, low)
    high = low * LENGTH_RATIO
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        inside = short(middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low
