"""Settings of the comparison, and limits of its cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from nearharmonic.engine.settings import MOST_STEPS
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
        "Of the test ensembles and all else that is random; training sets have others", default=1501, **whole_from(0)
    )
    systems: int = setting("Problems of each ensemble", default=192, **whole_from(4, 10**5))
    t_end: PositiveDecimal = setting(
        "Every run covers so many radians of the fastest small oscillation", POSITIVE, unit="rad", default="100"
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
