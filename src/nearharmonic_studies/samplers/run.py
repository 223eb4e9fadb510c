"""Gradients per effective sample of each method, on Gaussians exactly and on other targets from chains."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp, log
from nearharmonic.numerics.compiled import Normal
from nearharmonic.output.store import Contents, coordinate, method_coordinates, read, variable
from nearharmonic_studies.samplers.chains import LEAPFROG, Chance, chance, costs, error_of, loop_for, run
from nearharmonic_studies.samplers.gaussian import best, spectrum
from nearharmonic_studies.samplers.search import methods_of
from nearharmonic_studies.samplers.settings import SamplersSettings
from nearharmonic_studies.samplers.targets import POSTERIORS, RATIO, Target, lattice, quartic

MADE: dict[str, Callable[[int], Target]] = {
    "quartic": quartic,
    "lattice": lattice,
    **{name: lambda _, made=made: made() for name, made in POSTERIORS.items()},  # type: ignore[misc]
}
#: Step sizes per stage times the highest frequency on Gaussians, whose number is a multiple of that of the chains.
LEAST, MOST, FINER = 0.15, 1.6, 3
#: Lengths of trajectories on Gaussians, times the highest frequency.
LENGTHS = (4.0, 8.0, 12.0, 16.0, 24.0)
#: Proposals over those of the settings, on targets with cheap gradients.
MORE = {"eight_schools": 16, "mesquite": 8}
#: Targets with rare states at which large steps are rejected many times: all chains tune, not a quarter.
RARE = ("eight_schools",)
#: A step size is not tried further if fewer proposals than this are accepted, and those of a first look.
HOPELESS, LOOK = 0.15, 30
#: Step size, times the highest frequency, and length, over the shortest, of the proposals before the first that counts.
WARMING = (0.4, 1.0)
COST = "log of the gradients per effective sample, of all chains and without each of them"


class Place(NamedTuple):
    """A step size and a length of trajectories."""

    tau: float
    length: float


def taus(count: int) -> list[float]:
    """Return step sizes per stage, times the highest frequency."""
    return [float(one) for one in LEAST * exp(log(MOST / LEAST) * np.arange(count) / (count - 1))]


def compared(settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Tableau]:
    """Return all methods by name: those of the settings, and those of the run of the searches."""
    return {name: integrators[name] for name in settings.methods} | methods_of(map(read, trained))


def gaussians(settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Contents]:
    """Return ``run``: ``gradients``, ``acceptance``, ``tau`` and ``length`` over (dimension, integrator)."""
    methods = compared(settings, trained)
    dimensions = [float(one) for one in settings.dimensions]
    grid = taus(FINER * settings.points)
    found = [[best(m, grid, LENGTHS, spectrum(int(n), RATIO)) for m in methods.values()] for n in dimensions]
    values = np.array([[(*one, tau, length) for one, tau, length in row] for row in found])
    over = ("dimension", "integrator")
    variables = {
        **coordinate("dimension", dimensions, "dimension of the Gaussian"),
        **method_coordinates(methods.values()),
        "gradients": variable(over, values[..., 0], "gradients over the least mean squared jump, in 2 variances"),
        "acceptance": variable(over, values[..., 1], "mean acceptance of the proposals"),
        "tau": variable(over, values[..., 2], "best step size per stage, times the highest frequency"),
        "length": variable(over, values[..., 3], "best length of trajectories, times the highest frequency"),
    }
    return {"run": Contents(variables=variables, coordinates=("label",))}


def measure(target: str, settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Contents]:
    """Return ``run``: log of the gradients per effective sample of each method on a target, with an interval."""
    methods, on = compared(settings, trained), MADE[target](settings.size)
    loop = loop_for(on)
    starts = [warmed(on, loop, settings, k) for k in range(settings.chains)]
    places = tuned(on, loop, methods, starts, settings)
    series: dict[str, list[Any]] = {name: [] for name in methods}
    for k, start in enumerate(starts):
        drawn = chance(Normal([settings.seed, 2, k]), MORE.get(target, 1) * settings.proposals, on.dimension)
        for name, method in methods.items():
            place = places[name]
            series[name].append(run(on, loop, method, place.tau * method.stages, place.length, start, drawn))
    found = []
    for chains in series.values():
        observed = np.array([one.observed for one in chains])
        parts = costs(observed, np.array([one.gradients for one in chains]))
        found.append((np.mean([one.acceptance() for one in chains]), *_means(observed), *parts))
    return {"run": _contents(on, methods, places, found)}


def _means(observed: Any) -> tuple[float, ...]:
    """Means of the observables, and their standard errors from the means of the chains."""
    means = observed.mean(axis=1)
    return (*means.mean(axis=0), *(means.std(axis=0, ddof=1) / np.sqrt(len(means))))


def _contents(on: Target, methods: Mapping[str, Tableau], places: Mapping[str, Place], found: Any) -> Contents:
    values, count, over = np.array(found), len(on.observables), ("integrator", "observable")
    variables = {
        **method_coordinates(methods.values()),
        **coordinate("observable", list(on.observables), "observable"),
        "cost": variable(("integrator", "part"), values[:, 1 + 2 * count :], COST),
        "acceptance": variable("integrator", values[:, 0], "mean acceptance of the proposals"),
        "tau": variable("integrator", [p.tau * on.highest for p in places.values()], "step size per stage, scaled"),
        "length": variable("integrator", [p.length * on.highest for p in places.values()], "length, scaled"),
        "mean": variable(over, values[:, 1 : 1 + count], "mean of the observable"),
        "mean_error": variable(over, values[:, 1 + count : 1 + 2 * count], "standard error of the mean"),
    }
    return Contents(variables=variables, coordinates=("label",), attributes={"target_label": on.label})


def warmed(on: Target, loop: Callable[..., None], settings: SamplersSettings, k: int) -> Any:
    """Return the start of a chain, behind the proposals that do not count."""
    normal = Normal([settings.seed, 1, k])
    start = on.start(normal)
    tau, length = WARMING
    drawn = chance(normal, on.warm, on.dimension)
    return run(on, loop, LEAPFROG, tau / on.highest, length * min(on.lengths), start, drawn).last


def tuned(
    on: Target, loop: Callable[..., None], methods: Mapping[str, Tableau], starts: Any, settings: SamplersSettings
) -> dict[str, Place]:
    """Return the step size and the length of the fewest gradients per effective sample, for each method.

    All methods have the same grid, the same starts and the same random numbers, which are not those of the measurement.
    """
    few = starts if on.name in RARE else starts[: max(2, len(starts) // 4)]
    count = MORE.get(on.name, 1) * settings.tuning
    drawn = [chance(Normal([settings.seed, 3, k]), count, on.dimension) for k in range(len(few))]
    places = [Place(tau / on.highest, length) for tau in taus(settings.points) for length in on.lengths]
    return {
        name: min(places, key=lambda place, method=method: _tried(on, loop, method, place, few, drawn))  # type: ignore[misc]
        for name, method in methods.items()
    }


def _tried(
    on: Target, loop: Callable[..., None], method: Tableau, place: Place, starts: Any, drawn: list[Chance]
) -> float:
    """Log of the gradients per effective sample and its standard error, infinite if nearly nothing is accepted."""
    tau = place.tau * method.stages
    look = Chance(*(row[:LOOK] for row in drawn[0]))
    if run(on, loop, method, tau, place.length, starts[0], look).acceptance() < HOPELESS:
        return np.inf
    chains = [run(on, loop, method, tau, place.length, start, one) for start, one in zip(starts, drawn, strict=True)]
    observed, gradients = np.array([one.observed for one in chains]), np.array([one.gradients for one in chains])
    found = costs(observed, gradients)
    return float(found[0]) + error_of(found)
