"""Settings of the experiment on samplers."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from nearharmonic.engine.settings import one_of
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import expanded, integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic_paper.entries import STRICT, PositiveDecimal, positive_numbers, setting, some_of, whole_from

#: Targets that are not Gaussian.
TARGETS = ("quartic", "lattice", "eight_schools", "gp_regr", "mesquite")

#: Families of methods that are searched, by their stages and their first move.
FAMILIES = tuple(f"{s}_{first}" for s in (3, 4, 5) for first in ("kick", "drift"))


@dataclass(frozen=True, kw_only=True)
class SamplersSettings:
    """Gradients of Hamiltonian Monte Carlo with each method."""

    __pydantic_config__ = STRICT

    integrators: tuple[str, ...] = setting(
        "Symmetric methods of plain kicks and drifts that are compared; the first is the reference",
        "a list of at least two integrators, each named once",
        each="the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS",
        default=(
            "leapfrog", "bcss_s2", "bcss_s3", "bcss_s4", "predescu_s3", "omelyan_v5", "abas5o6h", "babs7o7h",
            "trained_light", "trained_coarse",
        ),
        min_length=2,
    )  # fmt: skip
    dimensions: tuple[PositiveDecimal, ...] = positive_numbers(
        "Dimensions of the Gaussians", "100", "300", "1000", "3000", "10000", "30000", "100000"
    )
    targets: tuple[str, ...] = some_of("Targets that are not Gaussian", TARGETS)
    families: tuple[str, ...] = some_of(
        "Families of methods that are searched for coefficients, by stages and first move", FAMILIES
    )
    size: int = setting("Dimensions of the posterior, and most sites of the field", default=1024, **whole_from(9))
    points: int = setting("Step sizes that are tried for a method", default=12, **whole_from(2, 100))
    tuning: int = setting("Proposals of each chain that tunes step size and length", default=400, **whole_from(10))
    proposals: int = setting("Proposals of each chain that measures", default=1000, **whole_from(20))
    chains: int = setting("Chains that measure, a quarter of which tune before", default=24, **whole_from(8, 1000))
    starts: int = setting("Starts of trajectories on which a trained method is tried", default=2000, **whole_from(10))
    trials: int = setting("Members that each search for coefficients tries", default=300, **whole_from(20))
    random_starts: int = setting("Random starts of the search in each family", default=1, **whole_from(0))
    seed: int = setting("Chooses all random numbers", default=1, **whole_from(0))

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown integrators, and for integrators that cannot propose."""
        for name in self.targets:
            one_of("samplers.targets", name, TARGETS)
        for name in self.families:
            one_of("samplers.families", name, FAMILIES)
        for name in self.methods:
            tableau = integrators[name]
            if tableau.modified or tableau.processed or not tableau.symmetric:
                allowed = "symmetric methods of plain kicks and drifts, without modified potentials and processors"
                raise bad_setting("samplers.integrators", name, allowed)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, including those from files."""
        return expanded(self.integrators)
