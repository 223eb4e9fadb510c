"""Searches on the surface of the order conditions: settings, descents, random members, and starts.

All budgets are numbers of trials, and all random numbers come from one seed: one seed always gives the same rows on the
same type of processor.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from math import log
from typing import Any, Literal

import numpy as np

from nearharmonic.errors import MissingPackageError, SettingError
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.objective import LEAST, LOST, OUTSIDE, WEIGHT_OF_MEAN, Objective

# --- Settings of searches, their starts and their results.

#: Names of the ways from a start to a minimum.
DescentName = Literal["evolution", "tangent_evolution", "gauss_newton"]


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Settings of searches.

    Attributes
    ----------
    trials : int
        Number of members tried from each start.
    random : int
        Number of random starts in each family.
    refinements : int
        Number of searches around the best member so far.
    descent : {"evolution", "tangent_evolution", "gauss_newton"}
        Way from a start to a minimum.
    tangents : int
        Number of tangent spaces in a tangent evolution, which share its trials.
    population : int
        Number of members per generation, and of those that an objective integrates at once.
    around_known, around_found, at_random : tuple of float
        Initial standard deviations around a known method, around the result of a search, and around random points; used
        in turn.
    random_points, mean, spread : int and float
        Number of random points, whose best one is a start, and their mean and standard deviation in units of 1/s.
    members, member_starts : int
        Number of random points near which members are sought, and of the best of these that are starts.
    screened : int
        Inverse of the fraction of the problems on which a start is tried first; 1 to omit this.
    behind : float
        Largest distance to the best start so far at which a screened start continues with all problems.
    bases : int
        Number of best members that take turns as centres of refinements.
    same_value, same_unknowns : float
        Tolerances of the objective and of the unknowns within which two searches have found the same member.
    small_value, small_step : float
        Changes of the objective and of the unknowns below which a search ends.
    """

    trials: int
    random: int = 0
    refinements: int = 0
    descent: DescentName = "evolution"
    tangents: int = 4
    population: int = 20
    around_known: tuple[float, ...] = (0.01, 0.003)
    around_found: tuple[float, ...] = (0.003, 0.01, 0.03)
    at_random: tuple[float, ...] = (0.03,)
    random_points: int = 400
    mean: float = 1.0
    spread: float = 1.0
    members: int = 0
    member_starts: int = 5
    screened: int = 1
    behind: float = 0.5
    bases: int = 1
    same_value: float = 0.02
    same_unknowns: float = 0.02
    small_value: float = 1e-4
    small_step: float = 1e-8

    def same(self, one: Found, best: Found) -> bool:
        """Return True if two searches have found the same member."""
        near = one.family == best.family and one.value < best.value + self.same_value
        return near and bool(np.abs(one.unknowns - best.unknowns).max(initial=0) < self.same_unknowns)


@dataclass(frozen=True, kw_only=True)
class Start:
    """Start of a search: a point, or None for the best of random points, and the standard deviation around it.

    An evolution begins with points around it, and a Gauss-Newton descent at one such point.
    """

    origin: str
    point: Floats | None
    spread: float


@dataclass(frozen=True, kw_only=True)
class Found:
    """Result of a search: the objective and the unknowns of the best, its origin, and the number of trials."""

    family: Family
    value: float
    unknowns: Floats
    origin: str
    trials: int


# --- Descent by Gauss-Newton steps on energy errors, within the surface of the order conditions.
#
# The mean logarithm of energy errors has narrow valleys, because each error is close to a linear function of the
# coefficients that passes through 0. A Gauss-Newton step uses this. It needs the signed errors at samples of each run
# and their derivatives along the surface, which are differences between a member and its neighbours. With the weight
# 1/|e|^2 for the errors e of each run it is a step for the sum of their logarithms, as in iteratively reweighted
# least squares; damping is as by Levenberg & Marquardt. Nocedal & Wright (2006), Numerical Optimization, chapter
# 10.

#: Samples of a run, and the distance to the neighbours whose differences are derivatives.
SAMPLES, DISTANCE = 65, 3e-5
#: Sharpness of the smooth maximum over the step sizes, in 1/decades.
SHARPNESS = 10.0
#: First damping, ratio of the dampings that are tried at once, and the damping at which a descent ends.
DAMPING, RATIO, LARGEST_DAMPING = 1e-2, 6.0, 1e8
#: Longest change of an unknown in a step; fewest steps that are tried at once.
LONGEST, FEWEST = 0.1, 5
#: Steps in succession that gain less than the smallest gain before a descent ends.
PATIENCE = 5


@dataclass
class Descent:
    """A descent in the family of an objective, whose smooth form is minimised.

    It has rms errors over samples in place of maxima over all steps, and a smooth maximum over the step sizes. Every
    member that is integrated counts as one of the trials of the objective.
    """

    objective: Objective

    def __post_init__(self) -> None:
        family = self.objective.family
        self.free = family.unknowns - len(family.equations)
        self.size = max(self.free + 1, FEWEST)
        self._populations = self.objective.populations(self.size, SAMPLES)

    def minimise(self, point: Floats, trials: int, small: float) -> Floats:
        """Return the member (n,) at which a descent from the member next to ``point`` ends.

        Points without a member next to them, or with one of too large coefficients, are returned as projected. No step
        is made after this number of trials; a gain of ``small`` counts as none.
        """
        last, damping, waiting = self.objective.trials + trials, DAMPING, 0
        x: Floats = self.objective.family.project(point[None])[0][0]
        value = self._values(x[None])[0]
        if not np.isfinite(value):
            return x
        while self.objective.trials < last and waiting < PATIENCE and damping < LARGEST_DAMPING and self.free:
            dampings = damping * RATIO ** np.arange(-1.0, self.size - 1)
            candidates = self._steps(x, dampings)
            values = self._values(candidates)
            best = int(values.argmin())
            if not values[best] < value:
                damping = dampings[-1] * RATIO
                continue
            waiting = waiting + 1 if value - values[best] < small else 0
            x, value, damping = candidates[best], values[best], dampings[best]
        return x

    def _steps(self, x: Floats, dampings: Floats) -> Floats:
        """Return the members (C, n) to which steps with these dampings lead."""
        family = self.objective.family
        directions = np.linalg.svd(np.atleast_2d(family.slopes(x)))[2][len(family.equations) :]
        near = family.project(np.vstack([x, x + DISTANCE * directions]))[0]
        gradient, curvature = self._derivatives(near)
        scale = np.diag(curvature) + 1e-12 * np.trace(curvature) + np.finfo(float).tiny
        matrices = curvature + dampings[:, None, None] * np.diag(scale)
        steps = np.linalg.solve(matrices, np.tile(-gradient, (len(dampings), 1))[..., None])[..., 0] @ directions
        longest = np.abs(steps).max(axis=1, keepdims=True)
        found: Floats = family.project(x + steps * np.minimum(1.0, LONGEST / np.maximum(longest, LONGEST)))[0]
        return found

    def _derivatives(self, near: Floats) -> tuple[Floats, Floats]:
        """Return the gradient (f,) and the Gauss-Newton matrix (f, f) from a member and its f neighbours."""
        errors = self._errors(near)
        weights = self._weights(self._by_tau(errors)[0])
        gradient, curvature = np.zeros(len(near) - 1), np.zeros((len(near) - 1, len(near) - 1))
        for e in errors:
            own = np.where(np.isfinite(e[0]), e[0], 0.0)
            with np.errstate(all="ignore"):  # diverged runs have no derivatives
                J = np.nan_to_num((e[1:] - e[0]) / DISTANCE, posinf=0.0, neginf=0.0)
            count = len(errors) * e.shape[2] * e.shape[3] * log(10)
            weight = weights[:, None] / ((own * own).mean(axis=-1) + LEAST**2) / count
            weighted = J * weight[..., None]
            gradient += np.einsum("itms,tms->i", weighted, own)
            curvature += np.einsum("itms,jtms->ij", weighted, J)
        return gradient, curvature

    def _values(self, members: Floats) -> Floats:
        """Return the smooth objective (C,) of at most ``size`` members; infinite for those outside."""
        inside = self.objective.inside(members)
        found = np.full(len(members), np.inf)
        if inside.any():
            by_tau = self._by_tau(self._errors(members[inside]))
            largest = by_tau.max(axis=1)
            smooth = np.log(np.exp(SHARPNESS * (by_tau - largest[:, None])).mean(axis=1)) / SHARPNESS
            found[inside] = largest + smooth + WEIGHT_OF_MEAN * by_tau.mean(axis=1)
        return found

    def _weights(self, by_tau: Floats) -> Floats:
        """Return the derivatives (T,) of the smooth objective by the differences at each step size."""
        weights = np.exp(SHARPNESS * (by_tau - by_tau.max()))
        found: Floats = weights / weights.sum() + WEIGHT_OF_MEAN / len(by_tau)
        return found

    def _errors(self, members: Floats) -> list[Floats]:
        """Return the signed errors (C, T, M, S) of members on each ensemble."""
        self.objective.trials += len(members)
        rows = self.objective.rows(members)
        return [population.energies(*rows) for population in self._populations]

    def _by_tau(self, errors: list[Floats]) -> Floats:
        """Return the mean logarithm of the rms errors minus the reference (C, T), over problems and ensembles."""
        found = []
        for e, reference in zip(errors, self.objective.references, strict=True):
            with np.errstate(all="ignore"):
                rms = np.sqrt((e * e).mean(axis=-1) + LEAST**2)
            found.append(np.log10(np.where(rms < LOST, rms, LOST)).mean(axis=-1) - reference)
        mean: Floats = np.mean(found, axis=0)
        return mean


# --- Descents from a start to a minimum, by Gauss-Newton steps or an evolution strategy.
#
# Evolution: N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772; library: pycma,
# doi:10.5281/zenodo.2559634. It runs among all points near the start, each of which is projected onto the family, or in
# the tangent space of the family at the best member so far. The latter has fewer dimensions by the number of equations.


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
    """Import pycma, which takes a second."""
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


# --- Members of a family near random points, for families with so many equations that a projection hardly ever
# converges.
#
# The method of Levenberg and Marquardt (Marquardt 1963, J. SIAM 11, 431) lowers the sum of the squared residuals.
# Points that stay behind others are given up early.

#: Number of points whose equations are evaluated together.
AT_ONCE = 250


@dataclass(frozen=True, kw_only=True)
class Pursuit:
    """Settings of the way from random points to members.

    Attributes
    ----------
    batch, steps : int
        Points that are followed together, and steps from each.
    spreads : tuple of float
        Standard deviations of the unknowns around 1/s, one for each batch in turn.
    longest, largest : float
        Largest change of an unknown per step, and largest unknown of a point that is followed.
    kept : tuple of (int, float)
        Numbers of steps, counted from 0, after which only this share of the points with the smallest residuals is
        followed on; members always are.
    met : float
        Sum of the squared residuals from which a projection converges.
    """

    batch: int = 2000
    steps: int = 60
    spreads: tuple[float, ...] = (0.5, 0.7)
    longest: float = 0.5
    largest: float = 3.0
    kept: tuple[tuple[int, float], ...] = ((10, 0.5), (20, 0.5), (30, 0.4), (45, 0.4))
    met: float = 1e-16


def random_members(family: Family, count: int, random: np.random.Generator, settings: Pursuit = Pursuit()) -> Floats:
    """Return members (N, n) of a family near ``count`` random points; N may be 0."""
    found = [np.zeros((0, family.unknowns))]
    for turn, begin in enumerate(range(0, count, settings.batch)):
        size = min(settings.batch, count - begin), family.unknowns
        spread = settings.spreads[turn % len(settings.spreads)]
        points = _pursued(family, random.normal(1 / family.stages, spread, size), settings)
        members, inside = family.project(points)
        found.append(members[inside])
    return np.concatenate(found)


def _pursued(family: Family, x: Floats, settings: Pursuit) -> Floats:
    """Return the points whose residuals became small."""
    with np.errstate(all="ignore"):
        values, slopes, cost = _linearised(family, x)
        damping, kept = np.full(len(x), 0.01), dict(settings.kept)
        for step in range(settings.steps):
            moved = x + _steps(values, slopes, damping, settings.longest)
            there = _linearised(family, moved)
            better = there[2] < cost
            x[better] = moved[better]
            for now, new in zip((values, slopes, cost), there, strict=True):
                now[better] = new[better]
            damping = np.where(better, np.maximum(damping / 5, 1e-12), np.minimum(damping * 5, 1e6))
            if step in kept:
                ahead = cost <= max(settings.met, float(np.quantile(cost, kept[step])))
                ahead &= np.abs(x).max(axis=1) < settings.largest
                x, values, slopes, cost, damping = (one[ahead] for one in (x, values, slopes, cost, damping))
            if not len(x):
                break
    return x[cost < settings.met]


def _linearised(family: Family, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Residuals (C, e), their derivatives (C, e, n), and the sum of the squared residuals (C,), infinite for NaN."""
    # Arrays of so many points stay in the cache of a processor.
    parts = [family.linearised(x[i : i + AT_ONCE].T) for i in range(0, len(x), AT_ONCE)]
    values, slopes = np.concatenate([v.T for v, _ in parts]), np.concatenate([one for _, one in parts])
    cost = (values * values).sum(axis=1)
    return values, slopes, np.where(np.isfinite(cost), cost, np.inf)


def _steps(values: Floats, slopes: Floats, damping: Floats, longest: float) -> Floats:
    """Return the damped Gauss-Newton steps (C, n), no unknown of which changes by more than ``longest``."""
    transposed = slopes.transpose(0, 2, 1)
    square = transposed @ slopes
    size = 1e-3 + np.trace(square, axis1=1, axis2=2)
    square += (damping * size)[:, None, None] * np.eye(square.shape[1])
    step: Floats = -np.nan_to_num(np.linalg.solve(square, transposed @ values[..., None])[..., 0])
    shorter: Floats = step * np.minimum(1, longest / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
    return shorter


# --- Searches from published methods, methods with one stage less, and random points.


class Searcher:
    """Successive searches with the settings ``effort`` and one random generator, and their results."""

    def __init__(self, effort: Effort, seed: int | Sequence[int]) -> None:
        self.effort, self._random = effort, np.random.default_rng(seed)
        self.found: list[Found] = []

    @property
    def best(self) -> Found:
        """The result with the smallest objective."""
        return min(self.found, key=lambda one: one.value)

    @property
    def trials(self) -> int:
        """Members tried."""
        return sum(one.trials for one in self.found)

    @property
    def again(self) -> int:
        """Number of searches that ended at the best member."""
        return sum(self.effort.same(one, self.best) for one in self.found)

    def centre(self, turn: int) -> Found:
        """Return a result around which a search begins, from the best different ones in rotation."""
        different: list[Found] = []
        for one in sorted(self.found, key=lambda one: one.value):
            if not any(self.effort.same(one, other) for other in different):
                different.append(one)
            if len(different) == self.effort.bases:
                break
        return different[turn % len(different)]

    def search(self, objective: Objective, start: Start, trials: int | None = None) -> Found:
        """Search from a start, with this number of ``trials`` or the number in the settings."""
        before, seed = objective.trials, int(self._random.integers(1, 2**31))
        effort = self.effort if trials is None else replace(self.effort, trials=trials)
        value, unknowns = descend(objective, start, effort, seed)
        self.found.append(
            Found(
                family=objective.family, value=value, unknowns=unknowns, origin=start.origin,
                trials=objective.trials - before,
            )
        )  # fmt: skip
        return self.found[-1]

    def near(self, best: Found, turn: int, origin: str) -> Start:
        """Return a start near a member, at a distance that depends on ``turn``."""
        spread = self.spread(turn)
        if self.effort.descent != "evolution":
            return Start(origin=origin, point=best.unknowns, spread=spread)
        point = best.unknowns + spread * self._random.normal(size=len(best.unknowns))
        return Start(origin=origin, point=point, spread=spread)

    def spread(self, turn: int) -> float:
        """Return the standard deviation around a result, which depends on ``turn``."""
        return self.effort.around_found[turn % len(self.effort.around_found)]


def starts_in(family: Family, known: Sequence[Tableau], before: Sequence[Found], effort: Effort) -> Iterator[Start]:
    """Yield the starts in a family: known methods, the best method with one stage less, random points.

    Symmetric methods of the shape of the family are starts. Methods with one stage less are extended by a stage, those
    that are known, and the best member of their family among those found ``before``.
    """
    for one in known:
        if _has_shape(one, family):
            yield from (Start(origin=one.name, point=family.unknowns_of(one), spread=s) for s in effort.around_known)
    try:
        smaller = replace(family, stages=family.stages - 1)
    except SettingError:
        smaller = None
    for one in known:
        if smaller and _has_shape(one, smaller):
            point = smaller.grown(smaller.unknowns_of(one))[1]
            yield Start(origin=f"{one.name}, grown", point=point, spread=effort.around_known[0])
    for found in before:
        if found.family == smaller:
            point = found.family.grown(found.unknowns)[1]
            yield from (Start(origin="grown", point=point, spread=s) for s in effort.around_found)
    for i in range(effort.random):
        yield Start(origin="random", point=None, spread=effort.at_random[i % len(effort.at_random)])


def search(objective: Objective, starts: Iterator[Start], effort: Effort, seed: int) -> Searcher:
    """Search from the best members near random points, from all ``starts``, and then around the best result."""
    searcher, screen = Searcher(effort, seed), _Screen(objective, effort, np.random.default_rng([seed, 1]))
    refined = (
        searcher.near(searcher.centre(turn), turn, "refined") for turn in range(effort.refinements) if searcher.found
    )
    for start in chain(_best_members(objective, effort, seed), starts, refined):
        promising = screen(start) if effort.screened > 1 else start
        if promising is not None:
            searcher.search(objective, promising)
    return searcher


def _best_members(objective: Objective, effort: Effort, seed: int) -> list[Start]:
    """Return the best members near random points as starts."""
    members = random_members(objective.family, effort.members, np.random.default_rng([seed, 2]))
    parts = [members[i : i + effort.population] for i in range(0, len(members), effort.population)]
    order = np.argsort(np.concatenate([np.zeros(0), *map(objective, parts)]), kind="stable")
    chosen = members[order[: effort.member_starts]]
    return [Start(origin="random member", point=one, spread=effort.around_found[0]) for one in chosen]


class _Screen:
    """Short descents from starts on a part of the problems, of which the better ones continue."""

    def __init__(self, objective: Objective, effort: Effort, random: np.random.Generator) -> None:
        self._objective, self._random = objective, random
        self._effort = replace(effort, trials=-(-effort.trials // effort.screened))
        self._part, self._share, self._best = objective.part(effort.screened), effort.screened, OUTSIDE

    def __call__(self, start: Start) -> Start | None:
        """Return the end of a descent as a start, or None if it is too far behind the best one."""
        before = self._part.trials
        value, unknowns = descend(self._part, start, self._effort, int(self._random.integers(1, 2**31)))
        # A trial is the integration of all problems.
        self._objective.trials += -(-(self._part.trials - before) // self._share)
        self._best = min(self._best, value)
        if value > self._best + self._effort.behind:
            return None
        again = 0.0 if self._effort.descent == "gauss_newton" else start.spread
        return replace(start, point=unknowns, spread=again)


def _has_shape(method: Tableau, family: Family) -> bool:
    """Return True if a method has the stages and the role of a family, and no squares outside the family."""
    squares = {i for i, m in enumerate(getattr(method, "square", ())) if Fraction(m) and 2 * i < len(method.kick)}
    return (
        method.symmetric
        and (method.first, method.stages) == (family.first, family.stages)
        and squares <= set(family.squares)
    )
