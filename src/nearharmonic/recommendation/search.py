"""Search for the largest step of each method whose run meets an error bound, by runs over the whole interval."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import inf, nan, sqrt
from typing import Literal, NamedTuple

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.reference import reference
from nearharmonic.engine.settings import Numerics, misfit
from nearharmonic.engine.setup import checked_scale
from nearharmonic.integrators import blanes_moan_2002
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, quasi_random
from nearharmonic.output.store import Attributes
from nearharmonic.recommendation.measure import (
    LOSSLESS,
    MARGIN,
    MEASURES,
    NAMES,
    POSITION_ROUNDING,
    ROUNDING,
    Interval,
    errors_of,
    fewest_for_good,
    ladder,
    measured_errors,
)
from nearharmonic.systems.system import System
from nearharmonic.theory.oscillator import stability_limit

#: Quantile of the errors of an ensemble that is bounded.
QUANTILE = 0.99
#: Relative margin of the mean below the bound: its last digits depend on the number of samples of a run.
MEAN_ROUNDING = 1e-9
#: Where all registered methods are asked, the coarse runs end at so many times the evaluations of the best method, and
#: not before so many methods meet the bound: others would take longer.
DROPPED, RANKED = 2, 10
#: Finest steps of a search: so many times as many as those of the coarse run that meets the bound.
REACH = 8
#: Starts of an ensemble that the search runs, and starts at most whose errors are taken in the end.
SEARCHED, MOST_STARTS = 8, 1024
#: Perturbed starts, the length of the longer interval over that of the first, and the ratio of their errors to the
#: bound at which a step is confirmed.
PERTURBED, LONGER, CONFIRMED = 3, 4, 2
#: Errors of a run: that of the requested measure, and both of energies.
ERRORS = ("error", MEASURES["max"], MEASURES["mean"])
#: Ratio of numbers of steps that are tried one after the other until a step is confirmed.
FINER = 1.1


@dataclass(frozen=True, kw_only=True)
class Question:
    """A system over [0, ``t_end``], and the error bound of its runs in ``measure``, a key of :data:`MEASURES`.

    ``system`` begins at the first of ``starts`` (M, 4 d), laid out as by
    :func:`nearharmonic.engine.numbers.start_array`. ``arguments``: the system as the first argument of
    :func:`nearharmonic.integrate`, and the initial values, as Python code; empty for a system of a config. ``budget``:
    most evaluations of the force in a run that is recommended. ``methods`` by name, those of users' files by path.
    ``energy_attributes`` of ``max_energy_error`` and ``mean_energy_error``: what they are relative to. ``every``: True
    if all registered methods are candidates, of which those that take many more evaluations than others are dropped.
    ``floor``: energy error that is the rounding of a V in doubles, 0 if V is measured more precisely.
    """

    system: System
    arguments: tuple[str, ...]
    t_end: str
    measure: str
    error: float
    budget: int
    methods: Mapping[str, Tableau]
    energy_attributes: Mapping[str, Attributes]
    starts: Floats
    every: bool
    floor: float = 0.0

    @property
    def longest(self) -> int:
        """Evaluations of the longest run made: steps near the budget, too, have finer ones beside them."""
        return self.budget * 5 // 4

    @property
    def quantity(self) -> str:
        """Bounded quantity: relative to |H0|, or to an energy that the system chooses, or in a unit."""
        if self.measure == "position":
            return NAMES[self.measure]
        notes = self.energy_attributes[MEASURES[self.measure]]
        words, unit = notes["long_name"].partition(" over every step")[0], notes["units"]
        return self.over_members + (words if unit == "1" else f"{words} in {unit}")

    @property
    def over_members(self) -> str:
        """Words before an error of several starts: the quantile over them; "" for one start."""
        return f"{QUANTILE:g} quantile over {len(self.starts)} starts of " if len(self.starts) > 1 else ""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One method at its recommended setting, or at its most accurate setting if none meets the bound.

    ``method`` is its name in the registry, or the path of the file that defines it. ``status`` is "met" if the run and
    all finer runs meet the bound; "missed" if no run within the budget does, and the setting is that of the smallest
    error; or "not run", for the given ``reason``. ``tau`` is in the system's unit of time, NaN for adaptive methods,
    ``tolerance`` NaN for others. ``summation`` is "plain" where this does not increase the error, else "compensated",
    empty for other libraries. ``error`` is that of the run in the requested measure, ``time`` its least wall time in s,
    NaN unless the bound is met. ``further_error`` is the largest error of the runs that confirm the choice, from
    perturbed starts or all members and over a longer interval, of energies if positions are asked for.
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"]
    status: Literal["met", "missed", "not run"]
    tau: float = nan
    tolerance: float = nan
    summation: str = ""
    steps: float = nan
    evaluations: float = nan
    error: float = nan
    max_energy_error: float = nan
    mean_energy_error: float = nan
    time: float = nan
    further_error: float = nan
    confirmed: bool = True
    reason: str = ""

    @property
    def shown(self) -> str:
        """Name or path as :func:`nearharmonic.integrate` takes it; the label of another library."""
        return self.method if self.kind == "splitting" else self.label


class Search:
    """Search for the largest step of each method that answers a question.

    ``starts`` (M, 4 D) are those whose errors are taken: all, or as many of a larger ensemble in even distances, of
    which ``few`` are searched. ``perturbation`` is the relative change of a perturbed start, too small for its energy
    to matter unless it grows. SettingError: positions that cannot be compared with any reference.
    """

    def __init__(self, asked: Question) -> None:
        self.asked = asked
        exact = reference(asked.system, asked.t_end) if asked.measure == "position" else None
        self.problem = Interval(asked.system, asked.t_end, exact, checked_scale(asked.system.energy_scale))
        self.starts = _evenly(asked.starts, MOST_STARTS)
        self.few = _evenly(self.starts, SEARCHED)
        self.perturbation = min(max(sqrt(asked.error) / 100, 1e-9), 1e-3)
        #: Largest error of a run of the search.
        self.bound = asked.error * (1 - MEAN_ROUNDING) if asked.measure == "mean" else asked.error

    @cached_property
    def orbits(self) -> Orbits:
        """Orbits from the starts that are searched."""
        return orbits(self.asked.system, Fraction(self.asked.t_end), self.few, self.asked.budget)

    @property
    def checks(self) -> str:
        """Checks beside the error of the run, as text."""
        asked, omega, searched = self.asked, self.orbits.frequency, min(SEARCHED, len(self.asked.starts))
        where = "along the orbit" if len(asked.starts) == 1 else f"along {searched} orbits"
        stable = f"the largest frequency {where}, {omega:.3g}, times the step is below the limit of linear stability"
        if asked.system.regularisation is not None:
            stable = "linear stability is not checked for regularised systems"
        elif not omega:
            stable = f"there is no frequency {where} that bounds a step"
        others = f"{PERTURBED} starts perturbed by {self.perturbation:.0e}"
        if len(asked.starts) > 1:
            others = f"all of {len(self.starts)} starts"
            stable += f"; the search ran {searched} of them, and the {QUANTILE:g} quantile of "
            stable += f"{len(self.starts)} meets the error"
        kind = "an energy error at most twice its own" if self.problem.exact else "at most twice the error"
        return f"{stable}; confirmed by {kind} from {others} and over {LONGER} times the interval"

    def choices(self, report: Callable[[str], None]) -> Iterable[Choice]:
        """Return a choice for each method, not timed yet; those of the fewest evaluations from a denser search."""
        coarse, unrun = self._coarse(report)
        few, found = len(coarse.keys() - unrun.keys()) <= RANKED, dict[str, Choice]()
        for i, (name, tableau) in enumerate(self.asked.methods.items(), 1):
            choice = Choice(
                method=name, label=tableau.label, kind="splitting", status="not run", reason=unrun.get(name, "")
            )
            found[name] = choice = choice if name in unrun else self._choice(choice, coarse[name], dense=few)
            told = choice.reason or f"error {choice.error:.1e} at tau {choice.tau:.4g}"
            report(f"{i} of {len(self.asked.methods)}: {choice.shown}: {choice.status}, {told}")
        met = sorted((one for one in found.values() if one.status == "met"), key=lambda one: one.evaluations)
        for choice in [] if few else met[:RANKED]:
            found[choice.method] = self._choice(choice, coarse[choice.method], dense=True)
            report(f"{choice.shown}: searched with more step sizes")
        return found.values()

    def _coarse(self, report: Callable[[str], None]) -> tuple[dict[str, dict[int, float]], dict[str, str]]:
        """Return the errors of coarse runs by method, the last of which meets the bound, and why others are not run."""
        asked, coarse, unrun = self.asked, dict[str, dict[int, float]](), dict[str, str]()
        for name, tableau in asked.methods.items():
            if reason := misfit(asked.system, tableau)[0]:
                unrun[name] = f"does not fit: {reason}"
            elif (one_step := tableau.evaluations(1)) > asked.budget:
                unrun[name] = f"a single step takes {one_step} evaluations"
            else:
                coarse[name] = {}
        going, evaluations, met, last = list(coarse), 2, list[tuple[int, str]](), asked.longest
        while going and evaluations < last:
            evaluations = min(2 * evaluations, last)
            for name in tuple(going):
                tableau = asked.methods[name]
                steps = evaluations // tableau.stages
                # No method is stable at a step above 2 a stage.
                if steps < 1 or self._radians(steps) > 2 * tableau.stages:
                    continue
                run = self._errors(tableau, [steps], self.few)
                coarse[name][steps] = float(run["error"].max())
                if coarse[name][steps] <= self.bound and steps >= self._least(tableau):
                    going.remove(name)
                    # Those of an implicit method depend on its iterations.
                    met = sorted([*met, (max(evaluations, int(run["evaluations"].max())), name)])
            if asked.every and len(met) >= RANKED:
                last = min(last, max(DROPPED * met[0][0], met[RANKED - 1][0]))
            if met:
                report(f"runs of {evaluations} evaluations: {len(met)} of {len(asked.methods)} methods meet the error")
        if last < asked.longest:
            reason = f"more than {evaluations} evaluations, and {met[0][1]} takes at most {met[0][0]}"
            unrun |= dict.fromkeys(going, reason)
        return coarse, unrun

    def _radians(self, steps: int) -> float:
        """Product of the largest frequency and the step size of so many steps."""
        return float(self.asked.t_end) / steps * self.orbits.frequency

    def _least(self, tableau: Tableau) -> int:
        """Fewest steps that are linearly stable at the largest frequency."""
        limit = float(stability_limit(tableau))  # infinite for an implicit method
        return int(self._radians(1) / limit) + 1

    def _choice(self, unrun: Choice, coarse: Mapping[int, float], *, dense: bool) -> Choice:
        """Return the largest step of a method that meets the bound, after its coarse runs."""
        asked, tableau, errors = self.asked, self.asked.methods[unrun.method], dict(coarse)
        choice = Choice(method=unrun.method, label=tableau.label, kind="splitting", status="missed")
        most, least, last = asked.longest // tableau.stages, self._least(tableau), max(errors, default=0)
        if errors and errors[last] <= self.bound and least <= last:
            first, finest = max(least, last // 2), min(most, REACH * last)
            rungs = sorted({first, last, finest, *ladder(most if dense else finest)})
            rungs = [n for n in rungs if first <= n <= finest]

            def largest(steps: Sequence[int]) -> list[float]:
                found = self._errors(tableau, steps, self.few)["error"]
                return list(map(float, found.reshape(len(steps), -1).max(axis=1)))

            floor = POSITION_ROUNDING if asked.measure == "position" else ROUNDING
            errors |= measured_errors(largest, rungs, self.bound, floor)
            fewest = fewest_for_good({n: error for n, error in errors.items() if n >= least}, self.bound)
            if fewest is not None:
                found = self._confirmed(choice, fewest, [n for n in errors if n > fewest])
                if found.status == "met":
                    plain = self._run(found, int(found.steps), "plain")
                    errors_of_both = ((getattr(plain, name), getattr(found, name)) for name in ERRORS)
                    lossless = all(one <= LOSSLESS * other for one, other in errors_of_both)
                    return plain if lossless and plain.error <= self.bound else found
        within = [n for n in errors if tableau.evaluations(n) <= asked.budget]
        if least > asked.budget // tableau.stages:
            choice = replace(choice, reason=f"a stable step is below {float(asked.t_end) / least:.2g}")
        if not within:
            return replace(choice, status="not run", reason=choice.reason or "its steps are not stable")
        return self._run(choice, min(within, key=errors.__getitem__))

    def _run(self, choice: Choice, steps: int, summation: str = "compensated") -> Choice:
        """Return ``choice`` with the errors of its run of so many steps, of several starts their quantile."""
        run = self._errors(self.asked.methods[choice.method], [steps], self.starts, summation)
        error, worst, mean = (_quantile(run[name]) for name in ERRORS)
        return replace(
            choice, tau=float(Fraction(self.asked.t_end) / steps), steps=steps, summation=summation, error=error,
            evaluations=int(run["evaluations"].max()), max_energy_error=worst, mean_energy_error=mean,
        )  # fmt: skip

    def _confirmed(self, choice: Choice, first: int, finer: Sequence[int]) -> Choice:
        """Return a choice of ``first`` or more steps that meets the bound from all starts, confirmed if one is.

        Its status is that of ``choice`` if there is none within the budget.
        """
        asked, met = self.asked, choice
        steps, known = first, sorted(finer)
        while asked.methods[choice.method].evaluations(steps) <= asked.budget:
            if met.status == "met" and steps > MARGIN * met.steps:
                break
            one = self._run(choice, steps)
            # The iterations of an implicit method are known afterwards.
            if one.evaluations <= asked.budget and one.error <= self.bound:
                own = one.max_energy_error if self.problem.exact else asked.error
                limit = CONFIRMED * max(own, 10 * ROUNDING) + 10 * asked.floor
                error = self._further_error(one)
                one = replace(one, status="met", further_error=error, confirmed=error <= limit)
                met = one if met.status != "met" or one.confirmed else met
                if one.confirmed:
                    break
            wanted = max(steps + 1, int(steps * FINER))
            steps = next((n for n in known if n >= wanted), wanted)
        return met

    def _further_error(self, choice: Choice) -> float:
        """Largest energy error of the runs that confirm a choice."""
        tableau, steps = self.asked.methods[choice.method], int(choice.steps)
        name = MEASURES["max" if self.problem.exact else self.asked.measure]
        longer = self._errors(tableau, [LONGER * steps], self.few, times=LONGER)
        others = self._errors(tableau, [steps], self.starts if len(self.starts) > 1 else self._perturbed())
        errors = np.concatenate([longer[name], others[name]])
        return float(np.where(np.isnan(errors), inf, errors).max())

    def _perturbed(self) -> Floats:
        """Return starts (3, 4 D) near the one start."""
        D, d = self.starts.shape[1] // 4, self.asked.system.dimension
        rows = np.repeat(self.starts, PERTURBED, axis=0).reshape(PERTURBED, 4, D)
        change = (2 * quasi_random(PERTURBED, 2 * d, 0) - 1).reshape(PERTURBED, 2, d)
        rows[:, ::2, :d] += self.perturbation * change * self.orbits.extents[:, :d]
        return rows.reshape(PERTURBED, -1)

    def _errors(
        self, tableau: Tableau, steps: Sequence[int], starts: Floats, summation: str = "compensated", times: int = 1
    ) -> dict[str, Floats]:
        """Return :func:`errors_of`, and in the requested measure as ``error``, infinite where it is no number."""
        found = errors_of(self.problem, tableau, steps, summation, starts, times)
        error = found[MEASURES[self.asked.measure]]
        return {**found, "error": np.where(np.isnan(error), inf, error)}


def _evenly(rows: Floats, most: int) -> Floats:
    """Return at most so many of ``rows``, in even distances."""
    chosen: Floats = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)]
    return chosen


def _quantile(errors: Floats) -> float:
    """Return the quantile of the errors of several starts that is bounded, one of them."""
    return float(np.sort(errors)[int(np.ceil(QUANTILE * len(errors))) - 1])


# --- Frequencies along orbits, which bound the step sizes with which a method is linearly stable ----------------------
#
# The squared frequencies at a point are the eigenvalues of T'' V''. Products with both Hessians are differences of the
# gradients that kernels compute, so that they need no expression and no code of their own.

#: A kick by the gradient of V, then a drift; its other role begins with the drift.
KICK = Tableau(name="kick", order=1, first="kick", kick=("1", "0"), drift=("1",), source="Euler", digits=30)
#: Method of the orbits, for any T: near a saddle leapfrog would leave for where an orbit of the system does not go.
(ACCURATE,) = (tableau for tableau in blanes_moan_2002.TABLEAUS if tableau.name == "blanes_moan_s6o4")
#: Sizes of differences of gradients relative to the extent of an orbit, whose truncation and rounding are alike.
DIFFERENCE = 2.0**-17
#: Smallest extent of a coordinate in a difference, relative to that of all coordinates.
LEAST_EXTENT = 2.0**-10
#: Products with a Hessian at most, after which the largest eigenvalue is known within the error that is added to it.
PRODUCTS = 24
#: Relative size below which a vector is rounding.
NOTHING = 1e-7
#: Points of all orbits at most, and numbers in all of them.
POINTS, NUMBERS = 4096, 2**14


class Orbits(NamedTuple):
    """Orbits of an accurate method with small steps.

    ``extents`` (2, D) are the largest moduli of positions and momenta, or a small part of that of all coordinates.
    ``frequency`` is the largest frequency at their points, 0 without oscillations or for a regularised system, whose
    steps are of another time.
    """

    extents: Floats
    frequency: float


def orbits(system: System, t_end: Fraction, start: Floats, evaluations: int) -> Orbits:
    """Return the orbits from the states ``start`` (K, 4 D), with so many evaluations of the force together."""
    members, D = len(start), start.shape[1] // 4
    steps = max(1, evaluations // members // ACCURATE.stages)
    paths = integrate_batch(
        system, ACCURATE, t_end=t_end, steps=[steps] * members, start=start,
        samples=max(17, min(POINTS, NUMBERS // D) // members), numerics=Numerics(energy="samples"),
    )  # fmt: skip
    points = np.stack([paths.q, paths.p]).reshape(2, -1, D)
    points = points[:, np.isfinite(points).all(axis=(0, 2))]
    largest = np.abs(points).max(axis=1, initial=0.0)
    extents = np.maximum(largest, LEAST_EXTENT * largest.max(axis=1, keepdims=True))
    extents[extents == 0] = 1.0
    frequency = 0.0
    if system.regularisation is None and points.size:
        with np.errstate(all="ignore"):  # a gradient beside a singularity may be infinite
            frequency = float(np.sqrt(np.maximum(_largest_eigenvalues(system, points, extents), 0)).max(initial=0))
    return Orbits(extents, frequency)


def _largest_eigenvalues(system: System, points: Floats, extents: Floats) -> Floats:
    """Return the largest eigenvalues of T'' V'' at ``points`` (2, M, D) by the Lanczos algorithm, each with its error.

    T'' V'' is symmetric in the inner product of the inverse of T'': vectors x = T'' z are kept with their z.
    """
    M, D = points.shape[1:]
    count = min(D, PRODUCTS)
    matrices, size = np.zeros((M, count, count)), np.zeros(M)
    zs, xs = np.zeros((2, count, M, D))
    z = np.tile(quasi_random(1, D, 0) - 0.5, (M, 1))
    for k in range(count + 1):
        x = _hessian_times(system, points, extents, 1, z)
        length = np.sqrt(np.maximum((z * x).sum(axis=1), 0))
        if k == count:
            break
        if k:
            matrices[:, k, k - 1] = matrices[:, k - 1, k] = length
        usable = length > NOTHING * size
        zs[k], xs[k] = (np.where(usable[:, None], one / np.where(usable, length, 1)[:, None], 0) for one in (z, x))
        z = _hessian_times(system, points, extents, 0, xs[k])
        matrices[:, k, k] = diagonal = (xs[k] * z).sum(axis=1)
        for _ in range(2):  # a second time for what rounding leaves
            z = z - np.einsum("jmd,jm->md", zs[: k + 1], np.einsum("jmd,md->jm", xs[: k + 1], z))
        size = np.maximum(size, np.abs(diagonal))
    usable = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(length)
    values, vectors = np.linalg.eigh(matrices[usable])
    found: Floats = values[:, -1] + length[usable] * np.abs(vectors[:, -1, -1])
    return found


def _hessian_times(system: System, points: Floats, extents: Floats, which: int, vectors: Floats) -> Floats:
    """Return V'' (``which`` 0) or T'' (1) at ``points`` (2, M, D) times ``vectors`` (M, D).

    A step of length 1 of :data:`KICK`, or of its other role, adds the gradient to the momentum or to the position.
    """
    M, D = vectors.shape
    size = np.abs(vectors / extents[which]).max(axis=1, keepdims=True)
    change = DIFFERENCE * vectors / np.where(size > 0, size, 1)
    rows = np.zeros((2, M, 4, D))
    rows[:, :, 2 * which] = points[which]
    rows[0, :, 2 * which] += change
    rows[1, :, 2 * which] -= change
    paths = integrate_batch(
        system, KICK.role("drift") if which else KICK, t_end=Fraction(1), steps=[1] * (2 * M), samples=1,
        start=rows.reshape(2 * M, -1), numerics=Numerics(energy="none", summation="plain"),
    )  # fmt: skip
    ahead, behind = (paths.q if which else -paths.p).reshape(2, M, D)
    found: Floats = (ahead - behind) / (2 * DIFFERENCE) * np.where(size > 0, size, 1)
    return found
