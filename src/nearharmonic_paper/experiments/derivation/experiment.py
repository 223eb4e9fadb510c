"""The derivation: the effort of its search, and its results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from nearharmonic_paper.entries import STRICT, Reading, setting, whole_between, whole_from
from nearharmonic_paper.tasks.experiment import Experiment

MOST_STARTS = 10**7

GrowthStages = Annotated[int, Reading(*whole_between(3, 12))]
SimplexStages = Annotated[int, Reading(*whole_between(5, 7))]


@dataclass(frozen=True, kw_only=True)
class DerivationSettings:
    """Effort of the search for the coefficients of Table 4."""

    __pydantic_config__ = STRICT

    seed: int = setting("Seed of all random starts; the same seed gives the same tables", default=1, **whole_from(0))
    starts: int = setting(
        "Random starts for each case that its conditions isolate", default=20_000, **whole_from(1, MOST_STARTS)
    )
    family_starts: int = setting(
        "Random starts in each family with free parameters", default=20_000, **whole_from(1, MOST_STARTS)
    )
    growth_starts: int = setting(
        "Random starts for each number of stages whose highest harmonic order is sought",
        default=5000,
        **whole_from(1, MOST_STARTS),
    )
    growth_stages: tuple[GrowthStages, ...] = setting(
        "The numbers of stages whose highest harmonic order is sought",
        "a list of integers from 3 to 12, each named once",
        each="an integer from 3 to 12",
        default=tuple(range(3, 11)),
    )
    simplex_stages: tuple[SimplexStages, ...] = setting(
        "The cases, by their stages, that the route of the paper solves as well",
        "a list of integers from 5 to 7, each named once",
        each="an integer from 5 to 7",
        default=(5,),
    )
    simplex_starts: int = setting(
        "Random points from which a short simplex is tried; points that lead near a solution are followed",
        default=1500,
        **whole_from(1, 10**6),
    )
    simplex_evaluations: int = setting(
        "Most evaluations of the objective that the simplex takes from one start",
        default=25_000,
        **whole_from(1, MOST_STARTS),
    )


EXPERIMENT = Experiment(
    name="derivation",
    title="Derivation",
    about="Derivation of the coefficients of Table 4 from random starts, with proofs.",
    target="derive",
    place=1,
    duration="50 s",
    settings=DerivationSettings,
    key="derive",
    effect="Effort of the search of `derive` for Table 4",
    tables=(
        "table4_derived",
        "derived_counts",
        "derived_errors",
        "derived_families",
        "derived_orders",
        "derived_routes",
        "derived_solutions",
    ),
    others=("derived/coefficients.toml",),
)
