"""What may be asked of the paper's experiment: step sizes of each system, and the runs that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nearharmonic.engine.settings import STRICT, PositiveDecimal, PositiveNumber, setting, whole_from

Precision = Literal["double", "extended"]
Summation = Literal["compensated", "plain"]

POSITIVE = "a finite number above 0"
AT_LEAST_LOWEST = "a finite number, at least that of lowest"


@dataclass(frozen=True, kw_only=True)
class StepSizes:
    """A grid of step sizes per stage, even in the logarithm."""

    __pydantic_config__ = STRICT

    lowest: PositiveNumber = setting("First step size per stage", POSITIVE, unit="the system's unit of time")
    highest: PositiveNumber = setting(
        "The grid ends at or just below this step size per stage", AT_LEAST_LOWEST, unit="the system's unit of time"
    )
    points_per_decade: int = setting("Step sizes in each factor of ten", **whole_from(1))


@dataclass(frozen=True, kw_only=True)
class SystemSettings:
    """What is asked of one system."""

    __pydantic_config__ = STRICT

    tau_per_stage: StepSizes = setting(
        "The step sizes, divided by the number of stages so that equal values cost equal work"
    )
    t_end: PositiveDecimal | None = setting(
        "End of the interval [0, t_end] that every run covers exactly; the system's own if not given",
        POSITIVE,
        unit="the system's unit of time (sho and henon_heiles 1, kepler h)",
        default=None,
    )
    precision: tuple[Precision, ...] = setting(
        "Arithmetic of the runs; beside double, sho runs extended only where the double curve nears its rounding floor",
        "a list of double, extended or both",
        each="one of double, extended",
        default=("double",),
        min_length=1,
    )
