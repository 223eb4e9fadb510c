"""Purposes of trained methods."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from math import pi
from typing import ClassVar

from nearharmonic.integrators.tableau import First
from nearharmonic.training.family import Family
from nearharmonic.training.population import Ensemble
from nearharmonic.training.published import modified_names, published_names
from nearharmonic.training.search import DescentName, Effort
from nearharmonic_studies.trained.problems import (
    SITES,
    cubic_ensemble,
    orbit_ensemble,
    random_ensemble,
    ring_ensemble,
    with_exact_oscillators,
)

# --- Kinds of purposes of trained methods: a window of step sizes, the problems, and the families that are searched.

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


def evaluations_an_orbit(*counts: int) -> tuple[float, ...]:
    """Return step sizes over the cost of a step for numbers of force evaluations in 2 pi."""
    return tuple(2 * pi / count for count in counts)


#: SRKN 11b of Blanes & Moan (2002) leads to the best methods for random potentials, their SRKN 14a to those for orbits.
_ELEVEN, _TWELVE = Chain(first="kick", stages=(11,)), Chain(first="kick", stages=(11, 12))
_FOURTEEN = Chain(first="drift", stages=(14, 15, 16), order=6)


def _perturbed(generalised_order: tuple[int, ...], *stages: int) -> Chain:
    """Return the families of a method for exactly solved oscillators; all good ones found have kicks first."""
    return Chain(first="kick", stages=stages, generalised_order=generalised_order)


_ALL = (
    Purpose(
        name="coarse", what="few evaluations", tau_per_stage=(0.15, 0.185, 0.235), t_end=60.0, after="light",
        chains=(Chain(first="kick", stages=(6, 7, 8)), _ELEVEN),
    ),
    Purpose(
        name="light", what="low accuracy", tau_per_stage=(0.1, 0.125, 0.155), t_end=50.0, after="moderate",
        chains=(_ELEVEN,),
    ),
    Purpose(
        name="moderate", what="moderate accuracy", tau_per_stage=(0.064, 0.08, 0.102), t_end=50.0, chains=(_TWELVE,)
    ),
    Purpose(name="fine", what="high accuracy", tau_per_stage=(0.041, 0.051, 0.065), t_end=40.0, chains=(_TWELVE,)),
    Purpose(
        name="finer", what="higher accuracy", tau_per_stage=(0.027, 0.034, 0.042), t_end=30.0, after="fine",
        chains=(_ELEVEN,),
    ),
    Purpose(
        name="finest", what="highest accuracy", tau_per_stage=(0.0175, 0.022, 0.0275), t_end=20.0, after="finer",
        chains=(_ELEVEN,),
    ),
    Purpose(
        name="precise", what="errors of 1e-12", tau_per_stage=(0.0115, 0.014, 0.0175), t_end=14.0,
        chains=(Chain(first="kick", stages=(17,), order=6),),
    ),
    Purpose(
        name="weak", what="small anharmonicity", tau_per_stage=(0.085, 0.11, 0.14), t_end=50.0, band=WEAK,
        chains=(Chain(first="kick", stages=(8, 9), harmonic_order=6),),
    ),
    CrystalPurpose(
        name="crystal_coarse", what="crystals, few evaluations", tau_per_stage=(0.33, 0.4, 0.5), t_end=60.0,
        band=THERMAL, chains=(Chain(first="kick", stages=(5, 6)),),
    ),
    CubicPurpose(
        name="cubic", what="cubic potentials, high accuracy", tau_per_stage=(0.035, 0.042, 0.05), t_end=40.0,
        band=BOUND, chains=(Chain(first="kick", stages=(11,), order=6, potential_degree=3),),
    ),
    PreciseCubicPurpose(
        name="cubic_precise", what="cubic potentials, errors of 1e-13", tau_per_stage=(0.0125, 0.016, 0.02),
        t_end=20.0, band=BOUND, chains=(Chain(first="drift", stages=(15,), order=8, potential_degree=3),),
    ),
    PrecisePurpose(
        name="quartic_precise", what="quartic potentials, errors of 1e-13", tau_per_stage=(0.0115, 0.014, 0.0175),
        t_end=14.0, chains=(Chain(first="kick", stages=(19,), order=8, potential_degree=4),),
    ),
    OscillatorPurpose(
        name="exact_coarse", what="oscillators solved exactly, few evaluations", tau_per_stage=(0.165, 0.2, 0.25),
        t_end=60.0, band=SMALL, descent="gauss_newton",
        chains=(_perturbed((8, 4), 7), _perturbed((6, 4), 11)),
    ),
    OscillatorPurpose(
        name="exact_light", what="oscillators solved exactly, low accuracy", tau_per_stage=(0.09, 0.11, 0.14),
        t_end=50.0, band=MODERATE, descent="gauss_newton", chains=(_perturbed((6, 4), 11),),
    ),
    OscillatorPurpose(
        name="exact_fine", what="oscillators solved exactly, high accuracy", tau_per_stage=(0.05, 0.06, 0.075),
        t_end=30.0, band=MODERATE, descent="gauss_newton", chains=(_perturbed((8, 4), 11),),
    ),
    OscillatorPurpose(
        name="exact_finer", what="oscillators solved exactly, higher accuracy", tau_per_stage=(0.028, 0.034, 0.042),
        t_end=30.0, band=MODERATE, descent="gauss_newton", chains=(_perturbed((8, 4), 11, 12, 13),),
    ),
    Purpose(
        name="orbits", what="planetary orbits", tau_per_stage=evaluations_an_orbit(480, 340, 240), t_end=8 * pi,
        band=None, chains=(_FOURTEEN,),
    ),
    Purpose(
        name="orbits_coarse", what="planetary orbits, few evaluations", band=None, t_end=10 * pi,
        tau_per_stage=evaluations_an_orbit(120, 85, 60), chains=(Chain(first="kick", stages=(11, 12, 13)),),
    ),
    Purpose(
        name="modified", what="planetary orbits, kicks of a modified potential", band=None, t_end=10 * pi,
        tau_per_stage=evaluations_an_orbit(150, 110, 75),
        chains=(
            Chain(first="drift", stages=(5, 6), squares=(0, 1, 2)),
            Chain(first="kick", stages=(5, 6), squares=(0, 1)),
        ),
    ),
)  # fmt: skip
#: All purposes by name, and the names of those whose methods are registered.
PURPOSES = {one.name: one for one in _ALL}
REGISTERED = tuple(name for name, one in PURPOSES.items() if one.registered)


def trained_before(purpose: str, trained: Collection[str]) -> list[str]:
    """Return the purpose whose method is an additional start, if it is ``trained``."""
    after = PURPOSES[purpose].after
    return [after] if after is not None and after in trained else []
