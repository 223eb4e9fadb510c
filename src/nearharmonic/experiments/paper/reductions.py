"""Reductions: functions that take the runs of a method to one number for each step size, without the samples.

A reduction is a function below :func:`reduction`. What it returns stands in the run files and, with no further line of
code, in the cube. None of them loads xarray, because they run in the jobs that integrate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nearharmonic.engine import invariants
from nearharmonic.engine.statistics import linear_trend
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Variables, described, variable
from nearharmonic.systems.system import System


@dataclass(frozen=True, kw_only=True)
class Runs:
    """The runs of one method on one system.

    Attributes
    ----------
    variables : Variables
        What :func:`nearharmonic.engine.sampled.sampled` returns: arrays over tau_per_stage, most of them over sample
        as well; runs with fewer samples than the longest are padded with NaN.
    system : System
        The system.
    tableau : Tableau
        The method.
    """

    variables: Variables
    system: System
    tableau: Tableau

    def __getitem__(self, name: str) -> Any:
        """The values of a variable."""
        return np.asarray(self.variables[name][1])

    @property
    def diverged(self) -> Any:
        """Whether each run left its energy surface."""
        return self["status"] == "diverged"


#: The systems of the paper.
PAPER = ("sho", "henon_heiles", "kepler")

Reduction = Callable[[Runs], Variables]

#: Each reduction with the variables that it needs: it is left out where the runs lack one of them.
REDUCTIONS: list[tuple[tuple[str, ...], Reduction]] = []


def reduction(*needs: str) -> Callable[[Reduction], Reduction]:
    """Declare the decorated function a reduction that needs these variables of the runs."""

    def declare(function: Reduction) -> Reduction:
        REDUCTIONS.append((needs, function))
        return function

    return declare


def reduced(runs: Runs) -> Variables:
    """Return the results of all reductions that ``runs`` have the variables for, over tau_per_stage."""
    found: Variables = {}
    for needs, function in REDUCTIONS:
        if all(name in runs.variables for name in needs):
            found |= function(runs)
    return found


@reduction("block_max_energy_error")
def max_energy_error(runs: Runs) -> Variables:
    """Maximum over every step of |H - H0|/|H0|; infinite where the run left its energy surface."""
    # The first sample, that of the start, is a number in every run.
    largest = np.where(runs.diverged, np.inf, np.nanmax(runs["block_max_energy_error"], axis=1))
    return _energy_errors(runs, "maximum", largest)


@reduction("block_mean_energy_error", "block_steps")
def mean_energy_error(runs: Runs) -> Variables:
    """Mean over every step of |H - H0|/|H0|; infinite where the run left its energy surface."""
    blocks = runs["block_mean_energy_error"] * runs["block_steps"]
    # Without the padding: the order of numpy's pairwise sum, and so its rounding, depends on the length.
    sums = np.array([row[~np.isnan(row)].sum() for row in blocks])
    mean = np.where(runs.diverged, np.inf, sums / runs["steps"])
    return _energy_errors(runs, "mean", mean)


def _energy_errors(runs: Runs, what: str, values: Any) -> Variables:
    """The maximum or the mean of the energy errors, relative to what those of the samples are."""
    notes = runs.variables["energy_error"][2] if "energy_error" in runs.variables else described("(H - H0)/|H0|")
    error = notes["long_name"].replace("(H - H0)", "|H - H0|", 1)
    name = {"maximum": "max", "mean": "mean"}[what]
    text = f"{what} of {error} over every step, inf if diverged"
    return _number(f"{name}_energy_error", values, text, notes["units"])


@reduction("t", "perihelion_angle")
def perihelion_advance(runs: Runs) -> Variables:
    """Advance of the perihelion, signed, and the half width of its 95 % interval, by regression over all orbits."""
    period = orbital_period(runs.system)
    trends = [linear_trend(t, angle) for t, angle in zip(runs["t"], runs["perihelion_angle"], strict=True)]
    slope, width = (np.where(runs.diverged, np.nan, column) for column in np.array(trends).T * period)
    interval = "half width of the 95 % interval of the perihelion advance per orbit"
    evaluations = period / runs["tau"] * runs.tableau.stages
    return {
        **_number("perihelion_advance", slope, "perihelion advance per orbit", "rad"),
        **_number("perihelion_advance_interval", width, interval, "rad"),
        **_number("evaluations_per_orbit", evaluations, "force evaluations per orbit"),
    }


@reduction("q", "p")
def invariant_drifts(runs: Runs) -> Variables:
    """Drift of each invariant that the system declares, but for the paper's systems: their files hold what it shows."""
    if runs.system.name in PAPER:
        return {}
    found = invariants.invariant_variables(runs.system, runs["q"], runs["p"], runs.diverged)
    return {name: value for name, value in found.items() if value[0] == ("tau_per_stage",)}


def orbital_period(system: System) -> float:
    """Return the period of the exact orbit from the initial values of ``system``, in its unit of time; NaN if none."""
    if system.period is None:
        return float("nan")
    return system.period(*system.start(float), *system.constants(float))


def _number(name: str, values: Any, long_name: str, units: str = "1") -> Variables:
    return {name: variable("tau_per_stage", values, long_name, units)}
