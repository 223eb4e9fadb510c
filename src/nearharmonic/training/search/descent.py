"""Descents from a start to a minimum, by Gauss-Newton steps or an evolution strategy.

Evolution: N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772; library: pycma,
doi:10.5281/zenodo.2559634. It runs among all points near the start, each of which is projected onto the family, or in
the tangent space of the family at the best member so far. The latter has fewer dimensions by the number of equations.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from nearharmonic.errors import MissingPackageError
from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective
from nearharmonic.training.search.effort import Effort, Start
from nearharmonic.training.search.gauss_newton import Descent


def descend(objective: Objective, start: Start, effort: Effort, seed: int) -> tuple[float, Floats]:
    """Return the smallest objective that a descent from a start finds, and its member (n,)."""
    family, point = objective.family, start.point
    random = np.random.default_rng(seed)
    if point is None:
        stages, shape = family.stages, (effort.random_points, family.unknowns)
        points = random.normal(effort.mean / stages, effort.spread / stages, shape)
        points[:, stages - 1 :] *= 1 / stages**2  # squares are coefficients of tau^3
        point = points[objective(points).argmin()]
    if effort.descent == "gauss_newton":
        if start.point is not None:
            point = point + start.spread * random.standard_normal(len(point))
        point = Descent(objective).minimise(point, effort.trials, effort.small_value)
        value = float(objective(point[None])[0])
    elif effort.descent == "tangent_evolution":
        value, point = _tangent_evolution(objective, point, start.spread, effort, random)
    else:
        value, point = _evolution(objective, point, start.spread, effort, random)
    return value, family.project(point[None])[0][0] if value < OUTSIDE else point


def _evolution(
    objective: Objective, point: Floats, spread: float, effort: Effort, random: np.random.Generator
) -> tuple[float, Floats]:
    """Return the best value and point of CMA-ES around a point."""
    more = {"maxfevals": effort.trials, "popsize": effort.population, "CMA_stds": _scales(objective.family)}
    value, best = _minimum(objective, point, spread, effort, random, more)
    return value, point if best is None else best


def _tangent_evolution(
    objective: Objective, point: Floats, spread: float, effort: Effort, random: np.random.Generator
) -> tuple[float, Floats]:
    """Return the best value and member of runs of CMA-ES, each in the tangent space at the best member so far."""
    family = objective.family
    x: Floats = family.project(point[None])[0][0]
    value, free = float(objective(x[None])[0]), family.unknowns - len(family.equations)
    for _ in range(effort.tangents):
        directions = np.linalg.svd(np.atleast_2d(family.slopes(x)))[2][len(family.equations) :]
        more = {"maxfevals": -(-effort.trials // effort.tangents)}

        def along(steps: Floats, x: Floats = x, directions: Floats = directions) -> Floats:
            return objective(x + steps[:, :free] @ directions)

        # pycma needs two dimensions.
        found, steps = _minimum(along, np.zeros(max(2, free)), spread, effort, random, more)
        if steps is not None and found < value:
            value, x = found, family.project((x + steps[:free] @ directions)[None])[0][0]
    return value, x


def _minimum(
    objective: Callable[[Floats], Floats],
    point: Floats,
    spread: float,
    effort: Effort,
    random: np.random.Generator,
    more: Mapping[str, Any],
) -> tuple[float, Floats | None]:
    """Return the best value and point of CMA-ES around a point; None if there is no best one."""
    options = {
        "verbose": -9, "tolfun": effort.small_value, "tolx": effort.small_step,
        # If cma gets a seed, it seeds the global generator of NumPy.
        "seed": np.nan, "randn": lambda *shape: random.standard_normal(shape), **more,
    }  # fmt: skip
    strategy = library().CMAEvolutionStrategy(point, spread, options)
    while not strategy.stop():
        points = strategy.ask()
        strategy.tell(points, objective(np.array(points)).tolist())
    best = strategy.result.xbest
    return float(strategy.result.fbest), None if best is None else np.array(best)


def library() -> Any:
    """Import pycma, which takes a second.

    Raises
    ------
    MissingPackageError
        It is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings about optional packages
            import cma
    except ModuleNotFoundError as error:
        raise MissingPackageError("a search for coefficients", "cma", "tailor") from error
    return cma


def _scales(family: Family) -> Floats:
    """Return factors of the initial standard deviation: coefficients of squares are small."""
    scales = np.ones(family.unknowns)
    scales[family.stages - 1 :] = 1 / family.stages
    return scales
