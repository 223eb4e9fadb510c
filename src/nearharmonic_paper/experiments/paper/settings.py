"""Settings of the paper's experiment: step sizes of each system, and the runs that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from math import isfinite
from typing import Annotated, Literal

from nearharmonic.numerics.written import ALL_DIGITS, decimal, decimal_of
from nearharmonic_paper.entries import (
    AT_LEAST_LOWEST,
    POSITIVE,
    STRICT,
    PositiveDecimal,
    PositiveNumber,
    Reading,
    setting,
    whole_from,
)

Precision = Literal["double", "extended"]
Summation = Literal["compensated", "plain"]
Split = Literal["kinetic_potential", "exact_oscillator"]

#: Systems of the paper, and the cubes of their orbits that only a config with one of them has.
PAPER = ("sho", "henon_heiles", "kepler")
ORBITS = ("henon_heiles_chaos", "substeps_displaced")

FINITE = "a finite number, or a decimal string, which keeps all its digits"


def _exact_decimal(value: object) -> str:
    """Convert a finite number of any sign, or a decimal string, to a plain decimal string."""
    text = decimal(value)
    if not isinstance(text, str | Decimal):
        raise TypeError
    number = decimal_of(str(text))
    if not isfinite(float(number)):
        raise ValueError
    return str(number.normalize(ALL_DIGITS) or 0)


_NUMBER = (("type", ("number", "string")),)
#: A finite number or its decimal string, as a decimal string with all digits.
ExactDecimal = Annotated[str, Reading(_exact_decimal, _NUMBER)]
ParameterValue = Annotated[
    str,
    Reading(
        _exact_decimal,
        (*_NUMBER, ("description", "Value"), ("allowed", FINITE), ("unit", "that of the parameter")),
    ),
]


@dataclass(frozen=True, kw_only=True)
class StepSizes:
    """A grid of logarithmically spaced step sizes per stage."""

    __pydantic_config__ = STRICT

    lowest: PositiveNumber = setting("First step size per stage", POSITIVE, unit="the system's unit of time")
    highest: PositiveNumber = setting(
        "The grid ends at or just below this step size per stage", AT_LEAST_LOWEST, unit="the system's unit of time"
    )
    points_per_decade: int = setting("Step sizes in each factor of ten", **whole_from(1, 10**9))


@dataclass(frozen=True, kw_only=True)
class SystemSettings:
    """Settings of one system."""

    __pydantic_config__ = STRICT

    file: str | None = setting(
        "Python file that defines SYSTEM, the system of this name; looked for from the working directory, then from "
        "the folder of the config",
        "the path of a Python file, for a name that is not that of a registered system",
        default=None,
    )
    system: str | None = setting(
        "Registered system that this one is, with other initial values or parameters",
        "the name of a registered system, for a name that is not registered",
        default=None,
    )
    label: str | None = setting(
        "Name of the system in titles; its own if not given",
        "a text of at most 100 characters, for a name that is not that of a registered system",
        default=None,
        min_length=1,
        max_length=100,
    )
    q0: tuple[ExactDecimal, ...] | None = setting(
        "Initial position; the system's own if not given",
        "a list of numbers, as many as the system has coordinates",
        unit="the system's unit of q",
        each=FINITE,
        default=None,
        min_length=1,
    )
    p0: tuple[ExactDecimal, ...] | None = setting(
        "Initial momentum; the system's own if not given",
        "a list of numbers, as many as the system has coordinates",
        unit="the system's unit of p",
        each=FINITE,
        default=None,
        min_length=1,
    )
    energy: ExactDecimal | None = setting(
        "Energy at the start: the initial momentum is multiplied by the factor that gives it",
        FINITE,
        unit="the system's unit of energy",
        default=None,
    )
    parameters: Mapping[str, ParameterValue] | None = setting(
        "Parameters of the system that have other values than its own",
        "a mapping of names of parameters to numbers",
        unit="that of the parameter",
        each=FINITE,
        default=None,
    )
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
    split: Split | None = setting(
        "Parts of H that drifts and kicks solve: T and V, if not given; or T with the oscillators whose frequencies "
        "the system declares, and the rest of V",
        "one of kinetic_potential, exact_oscillator, for a name that is not that of a registered system",
        default=None,
    )
