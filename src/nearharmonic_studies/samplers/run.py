"""Gradients per effective sample of each method, and the search for methods that need the fewest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, NamedTuple, cast

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.math import erf, exp, log
from nearharmonic.numerics.compiled import Normal, compiled
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Contents, coordinate, method_coordinates, read, variable
from nearharmonic.theory.order_conditions import SymmetricSteps
from nearharmonic.training.objective import OUTSIDE, SLOPE
from nearharmonic.training.search import Effort, Found, Searcher, Start
from nearharmonic_studies.samplers.settings import SamplersSettings
from nearharmonic_studies.samplers.targets import (
    JITTER,
    LEAPFROG,
    POSTERIORS,
    RATIO,
    Chance,
    Target,
    chance,
    costs,
    efficiency,
    error_of,
    lattice,
    loop_for,
    quantiles,
    quartic,
    run,
    spectrum,
)

# --- Methods of order 2 with the fewest gradients for an accepted proposal on products of quartic oscillators.
#
# The modes are x'' = -w^2 (x + b x^3) at equilibrium. With many independent modes the energy error of a proposal is
# normal, with a variance twice its mean, and the acceptance is erfc(sqrt(<dH^2>/8)): A. Beskos et al., Bernoulli 19,
# 1501 (2013), doi:10.3150/12-BEJ414. A trial of a method needs <dH^2> of one mode of each kind, from starts that are
# the same for all methods.

#: Strengths b, the number of modes, with the frequencies of the quartic target, and the mean length.
STRENGTHS, MODES, LENGTH = (0.1, 0.5, 2.0), 1000, 8.0

#: Step sizes per stage times the highest frequency, of which each method takes its best.
TAUS = tuple(0.15 * 8 ** (k / 15) for k in range(16))
#: Ratios of a sequence of points that fill a cube evenly: powers of 1/x with x^5 = x + 1.
EVEN = (0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101)
#: Starts are at a higher temperature, with weights: rare starts of large energies decide <dH^2>.
HOT = 4.0
#: Largest sum of the absolute values of all coefficients, and dH^2 above which a mode rejects a proposal by itself.
LARGEST_SUM, REJECTS = 8.0, 4.0


@dataclass(frozen=True, kw_only=True)
class SecondOrder(SymmetricSteps):
    """Symmetric steps of s stages, which need no equations for order 2."""

    stages: int
    first: First

    def project(self, points: Floats) -> tuple[Floats, np.ndarray]:
        """Return the points: all are members."""
        return np.array(points, float), np.ones(len(points), bool)

    def method(self, x: Floats, name: str, label: str) -> Tableau:
        """Return the method of the unknowns x."""
        kicks, drifts, _ = self.rows(list(map(float, x)))
        kick, drift = (tuple(repr(c) for c in row) for row in (kicks, drifts))
        return Tableau(
            name=name, label=label, order=2, first=self.first, kick=kick, drift=drift, source="samplers", digits=14
        )


class Proposals:
    """Starts of trajectories at equilibrium, evenly spread, and the gradients that a method needs on them.

    ``seed``: shifts the starts. ``starts``: starts for each strength. ``strengths``: strengths b of the targets.
    """

    def __init__(self, seed: int, starts: int, strengths: Sequence[float] = STRENGTHS) -> None:
        self.strengths = np.array(strengths, float)
        shifts = np.random.default_rng([seed, 300]).random((4, 1))
        ranks, momenta, lengths, frequencies = (np.array(EVEN)[:, None] * np.arange(starts) + shifts) % 1.0
        self.x, self.p = np.array([quantiles(b, ranks, HOT) for b in strengths]), quantiles(0.0, momenta, HOT)
        energies = self.p**2 / 2 + self.x**2 / 2 + self.strengths[:, None] * self.x**4 / 4
        weights = exp(-(1 - 1 / HOT) * energies)
        self.weights = weights / weights.sum(axis=1, keepdims=True)
        low, high = JITTER
        self.lengths = LENGTH * (low + (high - low) * lengths)
        self.frequencies = np.array(exp(-log(RATIO) * frequencies))

    def gradients(self, method: Tableau) -> Floats:
        """Return the gradients for an accepted proposal on each target (b,), at the best step size."""
        outer, inner = (np.array(row) for row in method.rows_double())
        squares = _squares(
            method.first == "kick", outer, inner, method.stages, np.array(TAUS), self.strengths, self.frequencies,
            self.x, self.p, self.lengths, self.weights,
        )  # fmt: skip
        accepted = 1 - erf(np.sqrt(MODES * squares / 8))
        cost = log(LENGTH / np.array(TAUS) / np.maximum(accepted, 1e-9))
        return np.array(exp(np.array([_lowest(row) for row in cost])))


def _lowest(values: Floats) -> float:
    """Return the lowest point of a parabola through the lowest of equally spaced values and its neighbours."""
    k = int(np.clip(values.argmin(), 1, len(values) - 2))
    left, middle, right = values[k - 1 : k + 2]
    curvature = left - 2 * middle + right
    if not 0 < curvature < 20 or middle > min(left, right):
        return float(min(left, middle, right))
    return float(middle - (right - left) ** 2 / (8 * curvature))


@compiled
def _squares(kicks_first, outer, inner, stages, taus, strengths, frequencies, x0, p0, lengths, weights):  # type: ignore[no-untyped-def]
    found = np.zeros((len(strengths), len(taus)))
    for a in range(len(strengths)):
        b = strengths[a]
        for c in range(len(taus)):
            tau = taus[c] * stages
            for m in range(len(lengths)):
                w, x, p = frequencies[m] * tau, x0[a, m], p0[m]
                before = p * p / 2 + x * x / 2 + b * x * x * x * x / 4
                for _ in range(max(1, round(lengths[m] / tau))):
                    for i in range(len(inner)):
                        if kicks_first:
                            p -= outer[i] * w * x * (1 + b * x * x)
                            x += inner[i] * w * p
                        else:
                            x += outer[i] * w * p
                            p -= inner[i] * w * x * (1 + b * x * x)
                    if kicks_first:
                        p -= outer[-1] * w * x * (1 + b * x * x)
                    else:
                        x += outer[-1] * w * p
                change = p * p / 2 + x * x / 2 + b * x * x * x * x / 4 - before
                square = min(change * change, REJECTS) if np.isfinite(change) else REJECTS
                found[a, c] += square * weights[a, m]
    return found


class Objective:
    """Mean logarithm of the gradients for an accepted proposal, relative to leapfrog."""

    def __init__(self, family: SecondOrder, proposals: Proposals) -> None:
        self.family, self.proposals, self.trials = family, proposals, 0
        self.reference = proposals.gradients(LEAPFROG)

    def __call__(self, points: Floats) -> Floats:
        """Return the objective (C,) of members (C, n)."""
        self.trials += len(points)
        return np.array([self._value(point) for point in points])

    def _value(self, point: Floats) -> float:
        kicks, drifts, _ = self.family.rows(list(map(float, point)))
        total = float(np.abs(kicks).sum() + np.abs(drifts).sum())
        if not total < LARGEST_SUM:
            return OUTSIDE + SLOPE * min(total, 100.0)
        return self.of(self.family.method(point, "tried", "tried"))

    def of(self, method: Tableau) -> float:
        """Return the objective of a method."""
        return float(log(self.proposals.gradients(method) / self.reference).mean())


def starts_of(family: SecondOrder, known: Sequence[str], count: int) -> list[Start]:
    """Return starts: equal steps of leapfrog, known methods of this shape, and random points."""
    s = family.stages
    points = {"leapfrog": [1 / (2 * s), *[1 / s] * (family.halves[0] - 1), *[1 / s] * family.halves[1]]}
    for name in known:
        method = integrators[name]
        if (method.stages, method.first, method.symmetric) == (s, family.first, True):
            points[name] = family.halved(*method.rows_double())
        elif method.stages == s and method.symmetric:  # the same rows in the other role
            points[f"{name}, exchanged"] = family.halved(*method.rows_double())
    found = [Start(origin=name, point=np.array(point), spread=0.03) for name, point in points.items()]
    return found + [Start(origin="random", point=None, spread=0.05)] * count


def trained(
    family: SecondOrder, proposals: Proposals, settings: SamplersSettings, seed: Sequence[int], random: int
) -> Found:
    """Return the best member of a family that CMA-ES finds, from known methods and random starts."""
    objective = cast("Any", Objective(family, proposals))
    effort = Effort(trials=settings.trials, population=12, random_points=100, small_step=1e-6)
    searcher = Searcher(effort, [settings.seed, *seed])
    for start in starts_of(family, settings.methods, random):
        searcher.search(objective, start)
    return searcher.best


def train(family: str, settings: SamplersSettings) -> dict[str, Contents]:
    """Return ``run``: ``unknowns``, ``objective``, ``tried`` and the ``origin`` of the best method of a family."""
    searched = family_of(family)
    proposals, seed = Proposals(settings.seed, settings.starts), (searched.stages, int(searched.first == "kick"))
    found = trained(searched, proposals, settings, seed, settings.random_starts)
    variables = {
        "unknowns": variable("unknown", found.unknowns, "first halves of both rows without the innermost values"),
        "objective": variable((), found.value, "log of gradients relative to leapfrog"),
        "tried": variable((), found.trials, "members tried in the search that found it"),
    }
    return {"run": Contents(variables=variables, attributes={"family": family, "origin": found.origin})}


def family_of(name: str) -> SecondOrder:
    """Return the family of a name such as 4_kick."""
    stages, _, first = name.partition("_")
    return SecondOrder(stages=int(stages), first=cast("First", first))


def methods_of(runs: Iterable[Any]) -> dict[str, Tableau]:
    """Return the best trained method of each number of stages, by name, from runs of :func:`train`."""
    found: dict[str, Tableau] = {}
    for searched in sorted(runs, key=lambda one: float(one.objective)):
        family = family_of(searched.attrs["family"])
        name = f"searched_s{family.stages}"
        if name not in found:
            found[name] = family.method(searched.unknowns.values, name, f"searched, {family.stages} stages")
    return dict(sorted(found.items()))


# --- Gain of a method that is trained for one strength of the anharmonicity alone, and its cost at other strengths.

#: Strengths of the quartic term, the family, and the sets of starts, and how much larger they are than in training.
STRENGTHS_ALONE, FAMILY, SETS, LARGER = (0.0, 0.1, 0.5, 2.0), SecondOrder(stages=4, first="kick"), 6, 4


def specialist(strength: float, settings: SamplersSettings) -> Tableau:
    """Return the best method of the family for one strength."""
    proposals = Proposals(settings.seed, settings.starts, (strength,))
    found = trained(FAMILY, proposals, settings, (400,), 0)
    return FAMILY.method(found.unknowns, f"for_{strength:g}", f"searched for b = {strength:g} alone")


def measure_limits(settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Contents]:
    """Return ``run``: ``gain`` over (strength, specialist, set), and of the methods trained for all strengths."""
    known = [integrators[name] for name in settings.methods]
    searched = methods_of(map(read, trained))
    special = {f"{b:g}": specialist(b, settings) for b in STRENGTHS_ALONE}
    every = [*special.values(), *searched.values()]
    gains = []
    for k in range(SETS):
        proposals = Proposals(settings.seed + 1000 + k, LARGER * settings.starts, STRENGTHS_ALONE)
        least = np.min([proposals.gradients(one) for one in known], axis=0)
        gains.append(least / np.array([proposals.gradients(one) for one in every]))
    plain = Objective(FAMILY, Proposals(settings.seed, settings.starts))
    variables = {
        **coordinate("strength", list(STRENGTHS_ALONE), "strength b of the quartic term"),
        **coordinate("trained_for", [*special, *searched], "strength that a method was trained for, or its name"),
        "trained_label": variable("trained_for", [one.label for one in every], "name in figures"),
        "special_gain": variable(
            ("strength", "trained_for", "set"),
            np.transpose(gains, (2, 1, 0)),
            "gain over the best known method, on starts not seen in training",
        ),
        **coordinate("known", [*settings.methods, *searched], "integrator"),
        "known_objective": variable(
            "known", [plain.of(one) for one in (*known, *searched.values())], "log of gradients relative to leapfrog"
        ),
    }
    return {"run": Contents(variables=variables, coordinates=("trained_label",))}


# --- Gradients per effective sample of each method, on Gaussians exactly and on other targets from chains.

MADE: dict[str, Callable[[int], Target]] = {
    "quartic": quartic,
    "lattice": lattice,
    **{name: lambda _, made=made: made() for name, made in POSTERIORS.items()},  # type: ignore[misc]
}
#: Step sizes per stage times the highest frequency on Gaussians: bounds, and their number over the chains' number.
LEAST, MOST, FINER = 0.15, 1.6, 3
#: Lengths of trajectories on Gaussians, times the highest frequency.
LENGTHS = (4.0, 8.0, 12.0, 16.0, 24.0)
#: Factors of the settings' numbers of proposals, on targets with cheap gradients.
MORE = {"eight_schools": 16, "mesquite": 8}
#: Targets with rare states at which large steps are rejected many times: all chains tune, not a quarter.
RARE = ("eight_schools",)
#: A step size is not tried further if fewer proposals than this are accepted; number of proposals of a first look.
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
    """Return all methods by name, from the settings and from the run of the searches."""
    return {name: integrators[name] for name in settings.methods} | methods_of(map(read, trained))


def gaussians(settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Contents]:
    """Return ``run``: ``gradients``, ``acceptance``, ``tau`` and ``length`` over (dimension, integrator)."""
    methods = compared(settings, trained)
    dimensions = [float(one) for one in settings.dimensions]
    grid = taus(FINER * settings.points)
    places = [(tau, length) for length in LENGTHS for tau in grid]
    values = np.array([
        [min(((*efficiency(m, tau * m.stages, length, on), tau, length) for tau, length in places), key=itemgetter(0))
         for m in methods.values()]
        for on in (spectrum(int(n)) for n in dimensions)
    ])  # fmt: skip
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
    over, means, cost = ("integrator", "observable"), [], []
    for chains in series.values():
        observed = np.array([one.observed for one in chains])
        means.append(observed.mean(axis=1))
        cost.append(costs(observed, np.array([one.gradients for one in chains])))
    accepted = [np.mean([one.acceptance() for one in chains]) for chains in series.values()]
    errors = np.std(means, axis=1, ddof=1) / np.sqrt(settings.chains)
    variables = {
        **method_coordinates(methods.values()),
        **coordinate("observable", list(on.observables), "observable"),
        "cost": variable(("integrator", "part"), cost, COST),
        "acceptance": variable("integrator", accepted, "mean acceptance of the proposals"),
        "tau": variable("integrator", [p.tau * on.highest for p in places.values()], "step size per stage, scaled"),
        "length": variable("integrator", [p.length * on.highest for p in places.values()], "length, scaled"),
        "mean": variable(over, np.mean(means, axis=1), "mean of the observable"),
        "mean_error": variable(over, errors, "standard error of the mean"),
    }
    contents = Contents(variables=variables, coordinates=("label",), attributes={"target_label": on.label})
    return {"run": contents}


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

    All methods have the same grid, the same starts and the same random numbers, which the measurement does not use.
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
