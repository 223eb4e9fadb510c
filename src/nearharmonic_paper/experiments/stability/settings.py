"""Settings of the stress tests, and the limits of a machine."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log10
from typing import Annotated, Any, Literal

from nearharmonic.engine.settings import MOST_STEPS
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.written import decimal_of, fraction_of
from nearharmonic_paper.entries import (
    AT_LEAST_LOWEST,
    POSITIVE,
    STRICT,
    PositiveDecimal,
    PositiveNumber,
    Reading,
    check_affordable,
    setting,
    whole_from,
)

#: The energy of the three saddle points of the Henon-Heiles potential: above it, the exact motion may escape.
ESCAPE_ENERGY = Fraction(1, 6)

#: Maximum number of step sizes of one map.
MOST_POINTS = 10**4
#: Maximum size of the states in one run file in bytes; memory needs twice this.
MOST_BYTES = 10**9


def _energy(value: object) -> str:
    energy = fraction_of(str(value))
    if not 0 < energy <= ESCAPE_ENERGY:
        raise ValueError
    return str(energy)


def _eccentricity(value: object) -> float:
    number = float(decimal_of(str(value)))
    if not 0 < number < 1:
        raise ValueError
    return number


Energy = Annotated[str, Reading(_energy, (("type", ("number", "string")),))]
Eccentricity = Annotated[
    float, Reading(_eccentricity, (("type", "number"), ("exclusiveMinimum", 0), ("exclusiveMaximum", 1)))
]


@dataclass(frozen=True, kw_only=True)
class EvenStepSizes:
    """A grid of evenly spaced step sizes per stage, decimal strings."""

    __pydantic_config__ = STRICT

    lowest: PositiveDecimal = setting("First step size per stage", POSITIVE, unit="1", default="0.05")
    highest: PositiveDecimal = setting(
        "The grid ends at or just below this step size per stage", AT_LEAST_LOWEST, unit="1", default="0.7"
    )
    spacing: PositiveDecimal = setting("From one step size per stage to the next", POSITIVE, unit="1", default="0.0025")

    def grid(self) -> list[Fraction]:
        """Return the step sizes per stage, exact, ascending."""
        lowest, highest, spacing = (Fraction(x) for x in (self.lowest, self.highest, self.spacing))
        return [lowest + i * spacing for i in range(int((highest - lowest) / spacing) + 1)]


@dataclass(frozen=True, kw_only=True)
class EnsembleSettings:
    """Ensembles on energy surfaces of the Henon-Heiles system."""

    __pydantic_config__ = STRICT

    trajectories: int = setting(
        "Quasi-random initial conditions on each energy surface", default=4096, **whole_from(1, 10**6)
    )
    energies: tuple[Energy, ...] = setting(
        "The energies H of the surfaces",
        "a list of quotients or decimals above 0 and at most 1/6, the energy of escape",
        unit="1",
        each=f"a quotient or decimal above 0 and at most {ESCAPE_ENERGY}, such as 1/8",
        default=("1/24", "1/12", "1/8", "1/6"),
        min_length=1,
    )
    t_end: PositiveDecimal = setting(
        "Every run covers [0, t_end], or up to a 25th more, since its step size is kept exactly",
        POSITIVE,
        unit="1",
        default="250",
    )
    tau_per_stage: EvenStepSizes = setting(
        "The step sizes, divided by the number of stages; evenly spaced, for resonances are narrow",
        default=EvenStepSizes,
    )
    seed: int = setting("Chooses the quasi-random points", default=1, **whole_from(0))
    device: Literal["cpu", "gpu", "auto"] = setting(
        "Device of the trajectories; results are bitwise identical", "one of cpu, gpu, auto", default="cpu"
    )


@dataclass(frozen=True, kw_only=True)
class EvaluationsGrid:
    """A grid of logarithmically spaced force evaluations per period."""

    __pydantic_config__ = STRICT

    lowest: PositiveNumber = setting("Smallest number", POSITIVE, unit="1", default=10.0)
    highest: PositiveNumber = setting(
        "The grid ends at or just below this number", AT_LEAST_LOWEST, unit="1", default=320_000.0
    )
    points_per_decade: int = setting("Numbers of evaluations in each factor of ten", default=20, **whole_from(1, 1000))


@dataclass(frozen=True, kw_only=True)
class MapSettings:
    """Maps over eccentricity and step size for the Kepler problem."""

    __pydantic_config__ = STRICT

    eccentricities: int = setting(
        "Number of orbits, from a circle on, evenly in the logarithm of the perihelion distance",
        default=64,
        **whole_from(2, 10**4),
    )
    highest_eccentricity: Eccentricity = setting(
        "Eccentricity of the last orbit", "a number above 0 and below 1", unit="1", default=0.99
    )
    orbits: int = setting(
        "Periods of the exact orbit that each run covers",
        default=10,
        **whole_from(2, 10**6) | {"unit": "period"},
    )
    evaluations_per_orbit: EvaluationsGrid = setting(
        "Force evaluations per period, the inverse of the step size per stage in periods", default=EvaluationsGrid
    )


@dataclass(frozen=True, kw_only=True)
class RoundingSettings:
    """Growth of round-off over many Kepler orbits of small eccentricity."""

    __pydantic_config__ = STRICT

    ensemble: int = setting(
        "Orbits over which errors are averaged; sixteen run at a time", default=32, **whole_from(3, 10**5)
    )
    steps: int = setting(
        "Steps of each run, up to an integer number of samples",
        "an integer from 100 to 1000000000, and at least 20 times the evaluations per orbit",
        unit="1",
        default=1_000_000,
        ge=100,
        le=10**9,
    )
    evaluations_per_orbit: int = setting(
        "Force evaluations in a period, the same for all methods", default=400, **whole_from(1, 10**6)
    )
    seed: int = setting("Chooses the quasi-random orbits", default=1, **whole_from(0))


@dataclass(frozen=True, kw_only=True)
class StabilitySettings:
    """Settings of the stress tests."""

    __pydantic_config__ = STRICT

    henon_heiles: EnsembleSettings = setting(
        "Ensembles on energy surfaces of the Henon-Heiles system", default=EnsembleSettings
    )
    kepler: MapSettings = setting("Maps over eccentricity and step size for the Kepler problem", default=MapSettings)
    rounding: RoundingSettings = setting(
        "Growth of round-off over many Kepler orbits of small eccentricity", default=RoundingSettings
    )

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for settings that exceed the limits of a machine; keys are named as in a config."""
        _check_ensemble(self.henon_heiles, len(methods))
        _check_map(self.kepler, len(methods))
        _check_rounding(self.rounding, sum(tableau.stages for tableau in methods))


def _check_ensemble(asked: EnsembleSettings, methods: int) -> None:
    here = "stability.henon_heiles"
    grid = asked.tau_per_stage
    lowest, highest, spacing = (Fraction(x) for x in (grid.lowest, grid.highest, grid.spacing))
    _check_ends(f"{here}.tau_per_stage", lowest, highest, grid.lowest)
    if (points := int((highest - lowest) / spacing) + 1) > MOST_POINTS:
        allowed = f"the grid would have {points} step sizes, and may have {MOST_POINTS}"
        raise bad_setting(f"{here}.tau_per_stage.spacing", _number(grid.spacing), allowed)
    each = sum(float(asked.t_end) / float(tau) for tau in grid.grid())
    check_affordable(f"{here}.trajectories", asked.trajectories, each * len(asked.energies) * methods)


def _check_map(asked: MapSettings, methods: int) -> None:
    here = "stability.kepler"
    grid = asked.evaluations_per_orbit
    _check_ends(f"{here}.evaluations_per_orbit", grid.lowest, grid.highest, f"{grid.lowest:g}")
    if grid.highest * asked.orbits > MOST_STEPS:
        raise bad_setting(f"{here}.orbits", asked.orbits, f"one run may take {MOST_STEPS:.0e} evaluations")
    points = 1 + grid.points_per_decade * log10(grid.highest / grid.lowest)
    size = 32 * asked.eccentricities * points * asked.orbits
    if size > MOST_BYTES:
        allowed = f"the states of a method would take {size:.1e} bytes, and may take {MOST_BYTES:.0e}"
        raise bad_setting(f"{here}.orbits", asked.orbits, allowed)
    each = grid.highest * asked.orbits * (1 + grid.points_per_decade / 2.3)
    check_affordable(f"{here}.eccentricities", asked.eccentricities, each * methods)


def _check_rounding(asked: RoundingSettings, stages: int) -> None:
    here = "stability.rounding"
    if asked.steps < 20 * asked.evaluations_per_orbit:
        allowed = "at least 20 times the evaluations per orbit: growth is fitted over more than a decade of time"
        raise bad_setting(f"{here}.steps", asked.steps, allowed)
    # Three runs in double-double, which costs about eight times as much as double.
    check_affordable(f"{here}.ensemble", asked.ensemble, asked.steps * 24 * stages)


def _check_ends(key: str, lowest: Fraction | float, highest: Fraction | float, told: str) -> None:
    if highest < lowest:
        raise bad_setting(f"{key}.highest", _number(highest), f"a finite number, at least lowest = {told}")


def _number(value: Any) -> float | int:
    """Return a number in the form of a config."""
    number = float(value)
    return int(number) if number.is_integer() else number
