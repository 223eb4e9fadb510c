"""What the ensembles are asked: plain numbers, checked by :mod:`nearharmonic.stability.loading`."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True, kw_only=True)
class EnsembleSettings:
    """Henon-Heiles: ``trajectories`` on each surface H = ``energies``, over at least [0, ``t_end``].

    The step sizes per stage go from ``lowest`` to ``highest`` in steps of ``spacing``; all are decimal strings, the
    energies quotients.
    """

    trajectories: int
    energies: tuple[str, ...]
    t_end: str
    lowest: str
    highest: str
    spacing: str
    seed: int

    def grid(self) -> list[Fraction]:
        """The step sizes per stage."""
        lowest, highest, spacing = (Fraction(x) for x in (self.lowest, self.highest, self.spacing))
        return [lowest + i * spacing for i in range(int((highest - lowest) / spacing) + 1)]


@dataclass(frozen=True, kw_only=True)
class MapSettings:
    """Kepler: ``eccentricities`` values from 0 to ``highest_eccentricity``, over ``orbits`` periods.

    Force evaluations per orbit go from ``fewest`` to ``most``, ``points_per_decade`` of them.
    """

    eccentricities: int
    highest_eccentricity: float
    orbits: int
    fewest: float
    most: float
    points_per_decade: int


@dataclass(frozen=True, kw_only=True)
class RoundingSettings:
    """Long Kepler runs: ``ensemble`` orbits over ``steps`` steps or a few more, ``evaluations_per_orbit`` a period."""

    ensemble: int
    steps: int
    evaluations_per_orbit: int
    seed: int


#: By the name of the ensemble.
SETTINGS = {"henon_heiles": EnsembleSettings, "kepler": MapSettings, "rounding": RoundingSettings}
