"""Purposes of trained methods, the methods that they are compared with, and the settings of the experiment."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Annotated, ClassVar

from nearharmonic.engine.settings import MOST_STEPS, one_of
from nearharmonic.integrators import modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.training import family
from nearharmonic.training.objective import Ensemble
from nearharmonic.training.search import DescentName, Effort
from nearharmonic_paper.entries import (
    POSITIVE,
    STRICT,
    PositiveDecimal,
    Reading,
    check_affordable,
    positive_numbers,
    setting,
    whole_between,
    whole_from,
)
from nearharmonic_studies.trained import problems as made

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

    def families(self) -> Iterator[family.Family]:
        """Yield the families."""
        return (family.Family(**{**vars(self), "stages": stages}) for stages in self.stages)


@dataclass(frozen=True, kw_only=True)
class Purpose:
    """Purpose of one trained method.

    ``name``, ``what``: suffix of the name of the method, and the purpose in words. ``tau_per_stage``: step sizes over
    the cost of a step, in radians of the fastest oscillation. ``t_end``: length of a run, in the same unit. ``chains``:
    families of the search. ``band``: bounds of the strength of random potentials; orbits, if None. ``after``: purpose
    whose method is an additional start of the search, with a neighbouring window. ``descent``: way from a start to a
    minimum.
    """

    #: False if no method was good enough, or if its method is registered in a module of its own.
    registered: ClassVar[bool] = True
    #: Draws of problems in two and three coordinates, and these problems in words, with the bounds of the band.
    draw: ClassVar[Callable[..., Ensemble]] = staticmethod(made.random_ensemble)
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
        return family.published_names() + (family.modified_names() if modified else ())

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
            return [made.orbit_ensemble(systems, seed, eccentricities=ECCENTRICITIES, orbits=t_end / (2 * pi))]
        return self.drawn(systems, seed, self.band, t_end)

    def drawn(self, systems: int, seed: int, band: tuple[float, float], t_end: float) -> list[Ensemble]:
        """Return the problems of a band: half of them in two coordinates and half in three."""
        return [self.draw(d, -(-systems // 2), seed, band=band, t_end=t_end) for d in (2, 3)]


class CrystalPurpose(Purpose):
    """Purpose of a method for crystals; ``band`` bounds the rms change of a bond.

    Its lead on crystals is too small for a registered method: docs/results/crystals.md.
    """

    registered = False
    described = f"rings of {made.SITES} masses, bonds change by {{:g}} to {{:g}}"

    def drawn(self, systems: int, seed: int, band: tuple[float, float], t_end: float) -> list[Ensemble]:
        """Return the rings of a band."""
        return [made.ring_ensemble(systems, seed, band=band, t_end=t_end)]


class CubicPurpose(Purpose):
    """Purpose of a method for cubic potentials; ``band`` bounds the energy over the lowest barrier."""

    registered = False
    draw = staticmethod(made.cubic_ensemble)
    described = "cubic potentials, d = 2 and 3, {:g} to {:g} of the barrier"


class PrecisePurpose(Purpose):
    """Purpose of a method of order eight for polynomial potentials, of degree four by default."""

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
        return [made.with_exact_oscillators(made.random_ensemble(2, systems, seed, band=band, t_end=t_end))]


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


# --- Methods of the comparison: trained ones, published ones, and other methods of this project.

#: Ideas of methods for the exactly solved oscillator: all but trained ones, and trained ones.
EXACT_IDEAS = ("exact_oscillator", "trained_exact")
#: Ideas of methods, in the order of tables and figures.
IDEAS = (*EXACT_IDEAS, "harmonic_conditions", "nystrom", "trained", "general")
#: Minimum order of a Nystrom method (with quadratic T) of high order.
NYSTROM_ORDER = 6


def contestants() -> tuple[str, ...]:
    """Return the names of all registered methods for T and V whose energy is measured at every step.

    Processed methods are not among them, and those trained with the oscillator solved exactly.
    """
    modified = [name for name in modified_integrators.registered if not modified_integrators[name].processed]
    return tuple(
        name for name in (*plain_integrators.registered, *modified) if not name.startswith(family.TRAINED_EXACT)
    )


def exact_contestants(others: Sequence[str]) -> tuple[str, ...]:
    """Return the names of methods for the exactly solved oscillator: ``others`` and all registered plain methods."""
    return tuple(dict.fromkeys((*others, *plain_integrators.registered)))


def kind_of(name: str) -> str:
    """Return the kind of a registered method: trained, published, or own."""
    if name.startswith(family.TRAINED):
        return "trained"
    return "own" if family.module_of(name) in family.OURS else "published"


def idea_of(method: Tableau) -> str | None:
    """Return the idea of a method with T and V; None for methods with modified potentials.

    Methods with a harmonic order belong to this idea for any general order and any author.
    """
    if method.name.startswith(family.TRAINED):
        return "trained"
    if method.modified:
        return None
    if method.harmonic_order is not None:
        return "harmonic_conditions"
    return "nystrom" if method.requires and method.order >= NYSTROM_ORDER else "general"


# --- Settings of the comparison and of the search, and limits of their cost.

#: Maximum numbers of methods and ensembles, for the estimate of evaluations.
MOST_METHODS, ENSEMBLES = 100, 17
#: Periods of a Kepler orbit.
ORBITS = 10
#: Evaluations per step of the long runs, all methods and starts together.
LONG = 10**4

EvaluationsPerOrbit = Annotated[int, Reading(*whole_between(10, 10**6))]


@dataclass(frozen=True, kw_only=True)
class ProofSettings:
    """All methods on ensembles that none was trained on."""

    __pydantic_config__ = STRICT

    seed: int = setting(
        "Seed of the test ensembles and of all other random numbers except the training", default=1501, **whole_from(0)
    )
    systems: int = setting("Problems of each ensemble", default=192, **whole_from(4, 10**5))
    t_end: PositiveDecimal = setting(
        "Length of each run in radians of the fastest small oscillation", POSITIVE, unit="rad", default="100"
    )
    tau_per_stage: tuple[PositiveDecimal, ...] = positive_numbers(
        "Step sizes divided by the cost of a step in evaluations, in radians of the fastest small oscillation",
        *("0.012", "0.02", "0.03", "0.05", "0.07", "0.1", "0.12", "0.14", "0.17", "0.2", "0.25"),
        unit="rad",
    )
    evaluations_per_orbit: tuple[EvaluationsPerOrbit, ...] = setting(
        "Force evaluations in a period of a Kepler orbit",
        "a list of integers from 10 to 1000000",
        unit="1",
        each="an integer from 10 to 1000000",
        default=(60, 120, 240, 480),
        min_length=1,
    )
    steps: int = setting("Steps of the long runs", default=10**6, **whole_from(1000, MOST_STEPS))

    def check(self) -> None:
        """Raise an error for too many force evaluations; keys are named as in a config."""
        each = sum(float(self.t_end) / float(tau) for tau in self.tau_per_stage)
        problem = MOST_METHODS * (ENSEMBLES * each + ORBITS * sum(self.evaluations_per_orbit))
        check_affordable("trained.proof.systems", self.systems, problem)
        check_affordable("trained.proof.steps", self.steps, LONG)


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """Effort of the search for trained methods; all budgets are numbers of tried methods."""

    __pydantic_config__ = STRICT

    seed: int = setting(
        "Seed of the systems and of the search; the same seed gives the same methods", default=1, **whole_from(0, 10**6)
    )
    systems: int = setting("Problems that a method is trained on", default=64, **whole_from(2, 10**5))
    held_out: int = setting(
        "Problems that the choice is made on, and as many others that it is tested on", default=256,
        **whole_from(2, 10**5),
    )  # fmt: skip
    trials: int = setting("Methods tried from each start", default=6000, **whole_from(20, 10**7))
    random: int = setting("Random starts for each family", default=1, **whole_from(0, 10**6))
    refinements: int = setting("Searches around the best of each family", default=8, **whole_from(0, 10**6))


@dataclass(frozen=True, kw_only=True)
class TrainedSettings:
    """The experiment on trained methods."""

    __pydantic_config__ = STRICT

    purposes: tuple[str, ...] = setting(
        "Purposes that methods are trained for", "a list of purposes, each named once", each="the name of a purpose",
        default=REGISTERED, min_length=1,
    )  # fmt: skip
    search: SearchSettings = setting("Effort of the search for trained methods", default=SearchSettings)
    proof: ProofSettings = setting("Problems on which trained and other methods are compared", default=ProofSettings)

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown purposes and too many evaluations; keys are named as in a config."""
        for i, purpose in enumerate(self.purposes):
            one_of(f"trained.purposes[{i}]", purpose, tuple(PURPOSES))
        self.proof.check()
