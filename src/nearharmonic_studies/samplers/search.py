"""Search for methods with the fewest gradients for an accepted proposal, and its limits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.math import erf, exp, log
from nearharmonic.numerics.compiled import compiled
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Contents, coordinate, read, variable
from nearharmonic.theory.order_conditions import SymmetricSteps
from nearharmonic.training.objective import OUTSIDE, SLOPE
from nearharmonic.training.search import Effort, Found, Start
from nearharmonic.training.searcher import Searcher
from nearharmonic_studies.samplers.chains import JITTER, LEAPFROG
from nearharmonic_studies.samplers.settings import SamplersSettings
from nearharmonic_studies.samplers.targets import quantiles

#: Strengths b, ratio of the frequencies, the number of modes, and the mean length.
STRENGTHS, RATIO, MODES, LENGTH = (0.1, 0.5, 2.0), 10.0, 1000, 8.0
# --- Methods of order 2 with the fewest gradients for an accepted proposal on products of quartic oscillators.
#
# The modes are x'' = -w^2 (x + b x^3) at equilibrium. With many independent modes the energy error of a proposal is
# normal, with a variance twice its mean, and the acceptance is erfc(sqrt(<dH^2>/8)): A. Beskos et al., Bernoulli 19,
# 1501 (2013), doi:10.3150/12-BEJ414. A trial of a method needs <dH^2> of one mode of each kind, from starts that are
# the same for all methods.

#: Step sizes per stage times the highest frequency, of which each method takes its best.
TAUS = tuple(0.15 * 8 ** (k / 15) for k in range(16))
#: Ratios of a sequence of points that fill a cube evenly: powers of 1/x with x^5 = x + 1.
EVEN = (0.8566748838545029, 0.733891856627126, 0.6287067210378087, 0.5385972572236101)
#: Starts are those of a higher temperature, with weights: rare starts of large energies decide <dH^2>.
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
    """Mean logarithm of the gradients for an accepted proposal over those of leapfrog."""

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


def trained(family: SecondOrder, proposals: Proposals, settings: SamplersSettings) -> Found:
    """Return the best member of a family that CMA-ES finds."""
    objective = cast("Any", Objective(family, proposals))
    effort = Effort(trials=settings.trials, population=12, random_points=100, small_step=1e-6)
    searcher = Searcher(effort, [settings.seed, family.stages, int(family.first == "kick")])
    for start in starts_of(family, settings.methods, settings.random_starts):
        searcher.search(objective, start)
    return searcher.best


def train(family: str, settings: SamplersSettings) -> dict[str, Contents]:
    """Return ``run``: ``unknowns``, ``objective``, ``tried`` and the ``origin`` of the best method of a family."""
    searched = family_of(family)
    found = trained(searched, Proposals(settings.seed, settings.starts), settings)
    variables = {
        "unknowns": variable("unknown", found.unknowns, "first halves of both rows without the innermost values"),
        "objective": variable((), found.value, "log of gradients over those of leapfrog"),
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
    for run in sorted(runs, key=lambda one: float(one.objective)):
        family = family_of(run.attrs["family"])
        name = f"searched_s{family.stages}"
        if name not in found:
            found[name] = family.method(run.unknowns.values, name, f"searched, {family.stages} stages")
    return dict(sorted(found.items()))


# --- Gain of a method that is trained for one strength of the anharmonicity alone, and its cost at other strengths.

#: Strengths of the quartic term, the family, and the sets of starts, and how much larger they are than in training.
STRENGTHS_ALONE, FAMILY, SETS, LARGER = (0.0, 0.1, 0.5, 2.0), SecondOrder(stages=4, first="kick"), 6, 4


def specialist(strength: float, settings: SamplersSettings) -> Tableau:
    """Return the best method of the family for one strength."""
    objective = cast("Any", Objective(FAMILY, Proposals(settings.seed, settings.starts, (strength,))))
    effort = Effort(trials=settings.trials, population=12, random_points=100, small_step=1e-6)
    searcher = Searcher(effort, [settings.seed, 400])
    for start in starts_of(FAMILY, settings.methods, 0):
        searcher.search(objective, start)
    name = f"for_{strength:g}"
    return FAMILY.method(searcher.best.unknowns, name, f"searched for b = {strength:g} alone")


def gains(methods: list[Tableau], known: list[Tableau], seed: int, starts: int) -> Floats:
    """Return the gains (methods, b) over the best known method at each strength, on starts not seen in training."""
    proposals = Proposals(seed, starts, STRENGTHS_ALONE)
    best = np.min([proposals.gradients(one) for one in known], axis=0)
    found: Floats = best / np.array([proposals.gradients(one) for one in methods])
    return found


def measure(settings: SamplersSettings, trained: Sequence[str]) -> dict[str, Contents]:
    """Return ``run``: ``gain`` over (strength, specialist, set), and of the methods trained for all strengths."""
    known = [integrators[name] for name in settings.methods]
    searched = methods_of(map(read, trained))
    special = {f"{b:g}": specialist(b, settings) for b in STRENGTHS_ALONE}
    every = [*special.values(), *searched.values()]
    found = np.array([gains(every, known, settings.seed + 1000 + k, LARGER * settings.starts) for k in range(SETS)])
    values = found.transpose(2, 1, 0)
    plain = Objective(FAMILY, Proposals(settings.seed, settings.starts))
    variables = {
        **coordinate("strength", list(STRENGTHS_ALONE), "strength b of the quartic term"),
        **coordinate("trained_for", [*special, *searched], "strength that a method was trained for, or its name"),
        "trained_label": variable("trained_for", [one.label for one in every], "name in figures"),
        "special_gain": variable(
            ("strength", "trained_for", "set"),
            values,
            "gain over the best known method, on starts not seen in training",
        ),
        **coordinate("known", [*settings.methods, *searched], "integrator"),
        "known_objective": variable(
            "known", [plain.of(one) for one in (*known, *searched.values())], "log of gradients over those of leapfrog"
        ),
    }
    return {"run": Contents(variables=variables, coordinates=("trained_label",))}
