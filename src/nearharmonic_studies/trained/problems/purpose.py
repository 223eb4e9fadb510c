"""Kinds of purposes of trained methods: a window of step sizes, the problems, and the families that are searched."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import ClassVar

from nearharmonic.integrators.tableau import First
from nearharmonic.training.family import Family
from nearharmonic.training.population import Ensemble
from nearharmonic.training.published import modified_names, published_names
from nearharmonic.training.search import DescentName, Effort
from nearharmonic_studies.trained.problems.cubic_potentials import cubic_ensemble
from nearharmonic_studies.trained.problems.orbits import orbit_ensemble
from nearharmonic_studies.trained.problems.random_potentials import random_ensemble, with_exact_oscillators
from nearharmonic_studies.trained.problems.rings import SITES, ring_ensemble

#: Ranges of the strength of random potentials: for most methods, and for methods for small anharmonicity.
STRONG, WEAK = (0.01, 0.5), (0.001, 0.03)
#: Ranges of the strength of the rest of oscillators that are solved exactly; with more, T and V are better.
SMALL, MODERATE = (0.001, 0.01), (0.01, 0.06)
#: Range of the rms change of a bond in model crystals: the Hessian varies by 0.02 to 0.2, as in crystals below melting.
THERMAL = (0.01, 0.1)
#: Range of the energy of cubic potentials over the lowest barrier; Henon-Heiles at H = 1/8 has 0.75.
BOUND = (0.05, 0.75)
#: Bounds of the eccentricity of orbits.
ECCENTRICITIES = (0.02, 0.35)
#: Cost of the gradient of the square of grad V, in forces, for polynomials and for Kepler: docs/reference/methods.md.
CHARGE, CHARGE_OF_ORBITS = 1.1, 0.3
#: Random points near which members of order eight are sought, of which one in several hundred leads to a member, and
#: members at which searches begin.
POINTS, MEMBERS = 30_000, 80
#: Searches with short descents take this part of the trials of others from each start. Those with exactly solved
#: oscillators begin at so many times as many random starts, and are refined so many times as often.
PART, MORE, AGAIN = 3, 30, 10


@dataclass(frozen=True, kw_only=True)
class Chain:
    """Families of increasing numbers of ``stages``, each extended from the previous one; see :class:`Family`."""

    first: First
    stages: tuple[int, ...]
    order: int = 4
    harmonic_order: int = 4
    squares: tuple[int, ...] = ()
    potential_degree: int | None = None
    generalised_order: tuple[int, ...] = ()

    def families(self) -> Iterator[Family]:
        """Yield the families."""
        for stages in self.stages:
            yield Family(
                stages=stages, first=self.first, order=self.order, harmonic_order=self.harmonic_order,
                squares=self.squares, potential_degree=self.potential_degree,
                generalised_order=self.generalised_order,
            )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Purpose:
    """Purpose of one trained method.

    ``name``, ``what``: suffix of the name of the method, and the purpose in words. ``tau_per_stage``: step sizes over
    the cost of a step, in radians of the fastest oscillation. ``t_end``: length of a run, in the same unit. ``chains``:
    families of the search. ``band``: bounds of the strength of random potentials; orbits, if None. ``after``: purpose
    whose method is an additional start of the search: that of a neighbouring window. ``descent``: way from a start to a
    minimum.
    """

    #: False if no method was good enough, or if its method is registered in a module of its own.
    registered: ClassVar[bool] = True
    #: Problems in words, with the bounds of the band.
    described: ClassVar[str] = "random potentials, d = 2 and 3, strengths {:g} to {:g}"

    name: str
    what: str
    tau_per_stage: tuple[float, ...]
    t_end: float
    chains: tuple[Chain, ...]
    band: tuple[float, float] | None = STRONG
    after: str | None = None
    descent: DescentName = "evolution"

    @property
    def title(self) -> str:
        """Name of the method."""
        return f"trained_{self.name}"

    @property
    def window(self) -> tuple[float, float]:
        """Smallest and largest step size."""
        return min(self.tau_per_stage), max(self.tau_per_stage)

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the starting methods of a search; published methods among them are the reference."""
        modified = any(chain.squares for chain in self.chains)
        return published_names() + (modified_names() if modified else ())

    @property
    def charge(self) -> float:
        """Cost of the gradient of the square of grad V, in forces."""
        return CHARGE_OF_ORBITS if self.band is None else CHARGE

    @property
    def problems(self) -> str:
        """The ensemble in words."""
        if self.band is None:
            return f"Kepler orbits, e {ECCENTRICITIES[0]:g} to {ECCENTRICITIES[1]:g}"
        return self.described.format(*self.band)

    def effort(self, trials: int, random: int, refinements: int) -> Effort:
        """Return the settings of a search."""
        return Effort(trials=trials, random=random, refinements=refinements, descent=self.descent)

    def ensembles(self, systems: int, seed: int, longer: float = 1.0) -> list[Ensemble]:
        """Return the problems, over intervals that are ``longer`` by a factor."""
        t_end = self.t_end * longer
        if self.band is None:
            return [orbit_ensemble(systems, seed, eccentricities=ECCENTRICITIES, orbits=t_end / (2 * pi))]
        return self.drawn(systems, seed, self.band, t_end)

    def drawn(self, systems: int, seed: int, band: tuple[float, float], t_end: float) -> list[Ensemble]:
        """Return the problems of a band: half of them in two coordinates and half in three."""
        return [random_ensemble(d, -(-systems // 2), seed, band=band, t_end=t_end) for d in (2, 3)]


class CrystalPurpose(Purpose):
    """Purpose of a method for crystals; ``band`` bounds the rms change of a bond.

    Its lead on crystals is too small for a registered method: docs/results/crystals.md.
    """

    registered = False
    described = f"rings of {SITES} masses, bonds change by {{:g}} to {{:g}}"

    def drawn(self, systems: int, seed: int, band: tuple[float, float], t_end: float) -> list[Ensemble]:
        """Return the rings of a band."""
        return [ring_ensemble(systems, seed, band=band, t_end=t_end)]


class CubicPurpose(Purpose):
    """Purpose of a method for cubic potentials; ``band`` bounds the energy over the lowest barrier."""

    registered = False
    described = "cubic potentials, d = 2 and 3, {:g} to {:g} of the barrier"

    def drawn(self, systems: int, seed: int, band: tuple[float, float], t_end: float) -> list[Ensemble]:
        """Return the cubic potentials of a band, half of them in two coordinates and half in three."""
        return [cubic_ensemble(d, -(-systems // 2), seed, band=band, t_end=t_end) for d in (2, 3)]


class PrecisePurpose(Purpose):
    """Purpose of a method of order eight for polynomial potentials, those of degree four by default."""

    registered = False

    def effort(self, trials: int, random: int, refinements: int) -> Effort:
        """Return the settings of a search: short descents from members near random points, of which few have one."""
        return Effort(
            trials=-(-trials // PART), random=random, refinements=2 * refinements, descent="tangent_evolution",
            members=POINTS, member_starts=MEMBERS, around_found=(0.03, 0.01), screened=4, behind=0.3, bases=4,
        )  # fmt: skip


class PreciseCubicPurpose(PrecisePurpose, CubicPurpose):
    """Purpose of a method of order eight for cubic potentials; ``band`` bounds the energy over the lowest barrier."""


class OscillatorPurpose(Purpose):
    """Purpose of a method for an oscillator that is solved exactly; ``band`` bounds the strength of the rest."""

    described = "random potentials, d = 2, strengths {:g} to {:g}, oscillators solved exactly"

    def effort(self, trials: int, random: int, refinements: int) -> Effort:
        """Return the settings of a search: short descents from many random starts, and from points around the best."""
        return Effort(
            trials=-(-trials // PART), random=MORE * random, refinements=AGAIN * refinements, descent=self.descent,
            around_found=(0.01, 0.03, 0.1), random_points=30, screened=4, bases=4, small_value=3e-4,
        )  # fmt: skip

    def drawn(self, systems: int, seed: int, band: tuple[float, float], t_end: float) -> list[Ensemble]:
        """Return the potentials of a band, with their oscillators solved exactly."""
        return [with_exact_oscillators(random_ensemble(2, systems, seed, band=band, t_end=t_end))]
