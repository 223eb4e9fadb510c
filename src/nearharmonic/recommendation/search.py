"""Search for the largest step of each method whose run meets an error bound, by runs over the whole interval."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from math import ceil, inf, nan, sqrt
from numbers import Rational
from typing import Any, Literal, NamedTuple

import numpy as np

from nearharmonic.engine.batch import check_bound, integrate_batch
from nearharmonic.engine.numbers import standard_parameters, start_array
from nearharmonic.engine.reference import position_t_end, reference
from nearharmonic.engine.settings import MOST_STEPS, Numerics, checked_count, checked_tau, misfit, one_of, positive
from nearharmonic.engine.setup import ANY, Setup, as_python, checked_scale
from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import blanes_moan_2002, integrators, load_tableaus
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, quasi_random
from nearharmonic.numerics.written import ALL_DIGITS, exact_value
from nearharmonic.recommendation import measure as engine
from nearharmonic.registry import is_path, split_path
from nearharmonic.systems import System, systems
from nearharmonic.systems.quantities import is_list
from nearharmonic.theory.oscillator import stability_limit

#: Evaluations of the force in a run that may be recommended, unless another budget is given.
EVALUATIONS = 200_000
#: Quantile of the errors of an ensemble that is bounded.
QUANTILE = 0.99
#: Relative margin of the mean below the bound: its last digits depend on the number of samples of a run.
MEAN_ROUNDING = 1e-9
#: Where all registered methods are asked, the coarse runs end at so many times the evaluations of the best method, and
#: not before so many methods meet the bound: others would take longer.
DROPPED, RANKED = 2, 10
#: Finest steps of a search: so many times the number of steps of the coarse run that meets the bound.
REACH = 8
#: Starts of an ensemble that the search runs, and starts at most whose errors are taken in the end.
SEARCHED, MOST_STARTS = 8, 1024
#: Perturbed starts, the ratio of the longer interval to the first, and the ratio of their errors to the bound at which
#: a step is confirmed.
PERTURBED, LONGER, CONFIRMED = 3, 4, 2
#: Errors of a run: the error in the requested measure, and both errors of energies.
ERRORS = ("error", engine.MEASURES["max"], engine.MEASURES["mean"])
#: Ratio of numbers of steps that are tried one after the other until a step is confirmed.
FINER = 1.1


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One method at its recommended setting, or at its most accurate setting if none meets the bound.

    ``method`` is its name in the registry, or the path of the file that defines it. ``status`` is "met" if the run and
    all finer runs meet the bound; "missed" if no run within the budget does, and the setting has the smallest
    error; or "not run", for the given ``reason``. ``tau`` is in the system's unit of time, NaN for adaptive methods,
    ``tolerance`` NaN for others. ``summation`` is "plain" where this does not increase the error, else "compensated",
    empty for other libraries. ``error`` is in the requested measure, ``time`` is the run's smallest wall time in s,
    NaN unless the bound is met. ``further_error`` is the largest error of the runs that confirm the choice, from
    perturbed starts or all members and over a longer interval, of energies if positions are asked for.
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"] = "splitting"
    status: Literal["met", "missed", "not run"] = "not run"
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
    """Search for the largest step of each method that meets an error bound; arguments as for
    :func:`nearharmonic.recommend`, refused before any method runs.

    ``system`` begins at the first of ``starts`` (M, 4 d), laid out as by
    :func:`nearharmonic.engine.numbers.start_array`. ``taken`` are those whose errors are taken, all or as many of a
    larger ensemble in even distances, and ``few`` those that are searched. ``arguments``: the system as the first
    argument of :func:`nearharmonic.integrate`, and the initial values, as Python code; empty for a system of a config.
    ``methods`` by name, or by path if from users' files. ``energy_attributes`` of ``max_energy_error`` and
    ``mean_energy_error``: what they are relative to. ``floor``: energy error that is the rounding of a V in doubles, 0
    if V is measured more precisely. ``perturbation``: relative change of a perturbed start, too small for its energy to
    matter unless it grows.
    """

    def __init__(
        self, system: Any, error: object, *, measure: object = "max", t_end: Any = None, q0: object = None,
        p0: object = None, methods: object = None, budget: object = None,
    ) -> None:  # fmt: skip
        self.error = checked_tau(error, "error")
        self.measure = one_of("measure", measure, tuple(engine.MEASURES))
        self.budget = EVALUATIONS if budget is None else checked_count("budget", budget, MOST_STEPS)
        if t_end is not None:
            positive("t_end", t_end)
        problem = Setup(system, ANY, t_end=t_end)
        positive("t_end", problem.t_end)  # the system's own may run backwards
        self.every, self.methods = methods is None, _methods(methods)
        self.starts = start_array(problem.system, q0, p0, plain=False)
        check_bound(problem.system, self.starts, standard_parameters(problem.system)[None, :])
        own = q0 is None and p0 is None
        self.system = problem.system if own else _started(problem.system, self.starts[0])
        if len(self.starts) > 1 and self.measure == "position":
            allowed = "max or mean for several starts: exact positions are known of one"
            raise bad_setting("measure", self.measure, allowed)
        # A run of one step refuses a start where the energy is no number, and says what errors are relative to.
        run = sweep(self.system, ANY, [float(problem.end)], t_end=problem.t_end)
        self.energy_attributes = {name: run[name].attrs for name in (engine.MEASURES["max"], engine.MEASURES["mean"])}
        self.floor: float = run.attrs.get("energy_floor", 0.0)
        energies = problem.run([1] * len(self.starts), 2, start=self.starts).energy
        for i in np.flatnonzero(~np.isfinite(energies)):
            state = self.starts[i, ::2].tolist()
            raise bad_setting(f"(q0, p0) of start {i}", state, "a start where the energy is finite")
        self.t_end = position_t_end(self.system, problem.t_end) if self.measure == "position" else problem.t_end
        self.arguments = _arguments(system, q0=q0, p0=p0)
        self.taken = _evenly(self.starts, MOST_STARTS)
        self.few = _evenly(self.taken, SEARCHED)
        self.perturbation = min(max(sqrt(self.error) / 100, 1e-9), 1e-3)
        #: Largest error of a run of the search, and evaluations of the longest: steps near the budget, too, have finer
        #: ones beside them.
        self.bound = self.error * (1 - MEAN_ROUNDING) if self.measure == "mean" else self.error
        self.longest = self.budget * 5 // 4

    @cached_property
    def problem(self) -> engine.Interval:
        """The interval, with its exact position if that is measured; SettingError: there is no reference for it."""
        exact = reference(self.system, self.t_end) if self.measure == "position" else None
        return engine.Interval(self.system, self.t_end, exact, checked_scale(self.system.energy_scale))

    @cached_property
    def orbits(self) -> Orbits:
        """Orbits from the starts that are searched."""
        return orbits(self.system, Fraction(self.t_end), self.few, self.budget)

    @property
    def settings(self) -> dict[str, Any]:
        """The question, as results tell it."""
        return {"system": self.system.name} | {x: getattr(self, x) for x in ("t_end", "measure", "error", "budget")}

    @property
    def over_members(self) -> str:
        """Words before an error of several starts: the quantile over them; "" for one start."""
        return f"{QUANTILE:g} quantile over {len(self.starts)} starts of " if len(self.starts) > 1 else ""

    @property
    def quantity(self) -> str:
        """Bounded quantity: relative to |H0|, or to an energy that the system chooses, or in a unit."""
        if self.measure == "position":
            return engine.NAMES[self.measure]
        notes = self.energy_attributes[engine.MEASURES[self.measure]]
        words, unit = notes["long_name"].partition(" over every step")[0], notes["units"]
        return self.over_members + (words if unit == "1" else f"{words} in {unit}")

    @property
    def checks(self) -> str:
        """Checks beside the error of the run, as text."""
        omega, several = self.orbits.frequency, len(self.starts) > 1
        where = f"along {len(self.few)} orbits" if several else "along the orbit"
        stable = f"the largest frequency {where}, {omega:.3g}, times the step is below the limit of linear stability"
        if self.system.regularisation is not None:
            stable = "linear stability is not checked for regularised systems"
        elif not omega:
            stable = f"there is no frequency {where} that bounds a step"
        others = f"{PERTURBED} starts perturbed by {self.perturbation:.0e}"
        if several:
            others, few = f"all of {len(self.taken)} starts", f"the search ran {len(self.few)} of them"
            stable += f"; {few}, and the {QUANTILE:g} quantile of {len(self.taken)} meets the error"
        kind = "an energy error at most twice its own" if self.problem.exact else "at most twice the error"
        return f"{stable}; confirmed by {kind} from {others} and over {LONGER} times the interval"

    def choices(self, report: Callable[[str], None]) -> list[Choice]:
        """Return a choice for each method, not timed yet; a denser search refines choices with few evaluations."""
        coarse, reasons = self._coarse(report)
        few, choices = len(coarse.keys() - reasons.keys()) <= RANKED, dict[str, Choice]()
        for i, (name, tableau) in enumerate(self.methods.items(), 1):
            unrun = Choice(method=name, label=tableau.label, reason=reasons.get(name, ""))
            choices[name] = choice = unrun if name in reasons else self._choice(unrun, coarse[name], dense=few)
            result = choice.reason or f"error {choice.error:.1e} at tau {choice.tau:.4g}"
            report(f"{i} of {len(self.methods)}: {choice.shown}: {choice.status}, {result}")
        met = sorted((c for c in choices.values() if c.status == "met"), key=lambda choice: choice.evaluations)
        for choice in [] if few else met[:RANKED]:
            unrun = Choice(method=choice.method, label=choice.label)
            choices[choice.method] = self._choice(unrun, coarse[choice.method], dense=True)
            report(f"{choice.shown}: searched with more step sizes")
        return list(choices.values())

    def _coarse(self, report: Callable[[str], None]) -> tuple[dict[str, dict[int, float]], dict[str, str]]:
        """Return the errors of coarse runs by method, the last of which meets the bound, and why others are not run."""
        coarse, reasons = dict[str, dict[int, float]](), dict[str, str]()
        for name, tableau in self.methods.items():
            if reason := misfit(self.system, tableau)[0]:
                reasons[name] = f"does not fit: {reason}"
            elif (cheapest := tableau.evaluations(1)) > self.budget:
                reasons[name] = f"a single step takes {cheapest} evaluations"
            else:
                coarse[name] = {}
        going, evaluations, met, last = list(coarse), 2, list[tuple[int, str]](), self.longest
        while going and evaluations < last:
            evaluations = min(2 * evaluations, last)
            for name in tuple(going):
                tableau = self.methods[name]
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
            if self.every and len(met) >= RANKED:
                last = min(last, max(DROPPED * met[0][0], met[RANKED - 1][0]))
            if met:
                report(f"runs of {evaluations} evaluations: {len(met)} of {len(self.methods)} methods meet the error")
        if last < self.longest:
            reason = f"more than {evaluations} evaluations, and {met[0][1]} takes at most {met[0][0]}"
            reasons |= dict.fromkeys(going, reason)
        return coarse, reasons

    def _radians(self, steps: int) -> float:
        """Product of the largest frequency and the step size of so many steps."""
        return float(self.t_end) / steps * self.orbits.frequency

    def _least(self, tableau: Tableau) -> int:
        """Fewest steps that are linearly stable at the largest frequency."""
        return int(self._radians(1) / float(stability_limit(tableau))) + 1  # infinite for an implicit method

    def _choice(self, unrun: Choice, coarse: Mapping[int, float], *, dense: bool) -> Choice:
        """Return the largest step of a method that meets the bound, after its coarse runs."""
        tableau, errors = self.methods[unrun.method], dict(coarse)
        choice, most = replace(unrun, status="missed"), self.longest // tableau.stages
        least, last = self._least(tableau), max(errors, default=0)
        if least <= last and errors[last] <= self.bound:
            first, finest = max(least, last // 2), min(most, REACH * last)
            rungs = sorted({first, last, finest, *engine.ladder(most if dense else finest)})

            def largest(steps: Sequence[int]) -> list[float]:
                error = self._errors(tableau, steps, self.few)["error"]
                return list(map(float, error.reshape(len(steps), -1).max(axis=1)))

            floor = engine.POSITION_ROUNDING if self.measure == "position" else engine.ROUNDING
            errors |= engine.measured_errors(largest, [n for n in rungs if first <= n <= finest], self.bound, floor)
            fewest = engine.fewest_for_good({n: error for n, error in errors.items() if n >= least}, self.bound)
            met = choice if fewest is None else self._confirmed(choice, fewest, sorted(n for n in errors if n > fewest))
            if met.status == "met":
                plain = self._run(met, int(met.steps), "plain")
                lossless = all(getattr(plain, name) <= engine.LOSSLESS * getattr(met, name) for name in ERRORS)
                return plain if lossless and plain.error <= self.bound else met
        within = [n for n in errors if tableau.evaluations(n) <= self.budget]
        if least > self.budget // tableau.stages:
            choice = replace(choice, reason=f"a stable step is below {float(self.t_end) / least:.2g}")
        if not within:
            return replace(choice, status="not run", reason=choice.reason or "its steps are not stable")
        return self._run(choice, min(within, key=errors.__getitem__))

    def _run(self, choice: Choice, steps: int, summation: str = "compensated") -> Choice:
        """Return ``choice`` with the errors of its run of so many steps, of several starts a quantile, one of them."""
        run = self._errors(self.methods[choice.method], [steps], self.taken, summation)
        rank = ceil(QUANTILE * len(self.taken)) - 1
        error, worst, mean = (float(np.sort(run[name])[rank]) for name in ERRORS)
        return replace(
            choice, tau=float(Fraction(self.t_end) / steps), steps=steps, summation=summation, error=error,
            evaluations=int(run["evaluations"].max()), max_energy_error=worst, mean_energy_error=mean,
        )  # fmt: skip

    def _confirmed(self, missed: Choice, steps: int, finer: Sequence[int]) -> Choice:
        """Return a choice of so many ``steps`` or more that meets the bound from all starts, confirmed if one is.

        It is ``missed`` if there is none within the budget; ``finer`` are larger numbers of steps that were run.
        """
        met = missed
        while self.methods[missed.method].evaluations(steps) <= self.budget:
            if met.status == "met" and steps > engine.MARGIN * met.steps:
                break
            choice = self._run(missed, steps)
            # The iterations of an implicit method are known afterwards.
            if choice.evaluations <= self.budget and choice.error <= self.bound:
                own = choice.max_energy_error if self.problem.exact else self.error
                limit = CONFIRMED * max(own, 10 * engine.ROUNDING) + 10 * self.floor
                error = self._further_error(choice)
                choice = replace(choice, status="met", further_error=error, confirmed=error <= limit)
                if choice.confirmed:
                    return choice
                met = choice if met.status != "met" else met
            wanted = max(steps + 1, int(steps * FINER))
            steps = next((n for n in finer if n >= wanted), wanted)
        return met

    def _further_error(self, choice: Choice) -> float:
        """Largest energy error of the runs that confirm a choice."""
        tableau, steps = self.methods[choice.method], int(choice.steps)
        name = engine.MEASURES["max" if self.problem.exact else self.measure]
        longer = self._errors(tableau, [LONGER * steps], self.few, times=LONGER)
        others = self._errors(tableau, [steps], self.taken if len(self.taken) > 1 else self._perturbed())
        errors = np.concatenate([longer[name], others[name]])
        return float(np.where(np.isnan(errors), inf, errors).max())

    def _perturbed(self) -> Floats:
        """Return starts (3, 4 D) near the one start."""
        D, d = self.taken.shape[1] // 4, self.system.dimension
        rows = np.repeat(self.taken, PERTURBED, axis=0).reshape(PERTURBED, 4, D)
        change = (2 * quasi_random(PERTURBED, 2 * d, 0) - 1).reshape(PERTURBED, 2, d)
        rows[:, ::2, :d] += self.perturbation * change * self.orbits.extents[:, :d]
        return rows.reshape(PERTURBED, -1)

    def _errors(
        self, tableau: Tableau, steps: Sequence[int], starts: Floats, summation: str = "compensated", times: int = 1
    ) -> dict[str, Floats]:
        """Return the errors by measure, and the requested one as ``error``, infinite where it is no number."""
        errors = engine.errors_of(self.problem, tableau, steps, summation, starts, times)
        error = errors[engine.MEASURES[self.measure]]
        return {**errors, "error": np.where(np.isnan(error), inf, error)}


def _evenly(rows: Floats, most: int) -> Floats:
    """Return at most so many of ``rows``, in even distances."""
    return np.asarray(rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)])


# --- What a user may give: methods and starts, and their Python code --------------------------------------------------


def _methods(given: Any) -> dict[str, Tableau]:
    """Return the methods by name, methods of users' files by path; a path stands for all methods of its file."""
    if given is None:
        return dict(integrators)
    entries = list(given) if is_list(given) else []
    if not entries:
        raise bad_setting("methods", given, "a list of at least one name, file path or Tableau")
    methods: dict[str, Tableau] = {}
    for entry in entries:
        place = os.fspath(entry) if isinstance(entry, os.PathLike) else entry
        if isinstance(entry, Tableau):
            named = {entry.name: entry}
        elif is_path(place) and not split_path(place)[1] and len(several := load_tableaus(place)) > 1:
            named = {f"{place}:{name}": tableau for name, tableau in several.items()}
        else:
            named = {integrators.name_of(place): integrators[place]}
        for name, tableau in named.items():
            if methods.setdefault(name, tableau) is not tableau:
                raise bad_setting("methods", name, "two methods have this name")
    return methods


def _started(system: System, start: Floats) -> System:
    """Return the system with other initial values: the exact pairs of doubles of its runs, in all their digits."""
    q, q_low, p, p_low = start.reshape(4, -1)[:, : system.dimension].tolist()
    sums = (map(ALL_DIGITS.add, map(Decimal, high), map(Decimal, low)) for high, low in ((q, q_low), (p, p_low)))
    q0, p0 = (tuple(map(str, numbers)) for numbers in sums)
    return replace(system, q0=q0, p0=p0)


def _arguments(system: str | os.PathLike[str] | System, **start: Any) -> tuple[str, ...]:
    """Return Python code of a system, which is its name if it is an object, and of initial values."""
    if not (isinstance(system, System) or system in systems.registered or is_path(os.fspath(system))):
        return ()
    given = {key: values for key, values in start.items() if values is not None}
    texts = (key if np.ndim(x) > 1 and len(x) > 1 else repr(_numbers(x)) for key, x in given.items())
    return (as_python(system), *map("{}={}".format, given, texts))


def _numbers(given: Any) -> list[int | float | str]:
    """Return initial values as Python writes them: fractions and the like as text."""
    plain = (x.item() if isinstance(x, np.generic) else x for x in np.array(given, dtype=object).ravel())
    exact = (x if isinstance(x, int | float | str | Decimal | Rational) else exact_value(x) for x in plain)
    return [x if isinstance(x, int | float) else str(x) for x in exact]


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
#: Smallest extent of a coordinate in a difference, relative to the extent of all coordinates.
LEAST_EXTENT = 2.0**-10
#: Products with a Hessian at most, after which the largest eigenvalue is known within the error that is added to it.
PRODUCTS = 24
#: Relative size below which a vector is rounding.
NOTHING = 1e-7
#: Points of all orbits at most, and numbers in all of them.
POINTS, NUMBERS = 4096, 2**14


class Orbits(NamedTuple):
    """Orbits of an accurate method with small steps.

    ``extents`` (2, D) are the largest moduli of positions and momenta, or a small part of the largest of them all.
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
        zs[k], xs[k] = (
            np.where(usable[:, None], vectors / np.where(usable, length, 1)[:, None], 0) for vectors in (z, x)
        )
        z = _hessian_times(system, points, extents, 0, xs[k])
        matrices[:, k, k] = diagonal = (xs[k] * z).sum(axis=1)
        for _ in range(2):  # a second time for what rounding leaves
            z = z - np.einsum("jmd,jm->md", zs[: k + 1], np.einsum("jmd,md->jm", xs[: k + 1], z))
        size = np.maximum(size, np.abs(diagonal))
    usable = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(length)
    values, vectors = np.linalg.eigh(matrices[usable])
    return np.asarray(values[:, -1] + length[usable] * np.abs(vectors[:, -1, -1]))


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
    return np.asarray((ahead - behind) / (2 * DIFFERENCE) * np.where(size > 0, size, 1))
