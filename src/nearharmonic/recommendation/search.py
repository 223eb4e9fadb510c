"""Question that a recommendation answers, checked before any method is run.

Frequencies along orbits, which bound the step sizes with which a method is linearly stable.

The squared frequencies at a point are the eigenvalues of T'' V''. Products with both Hessians are differences of the
gradients that kernels compute, so that they need no expression and no code of their own.

Result of a recommendation: one setting of each method, and its description in words.

Choice of a method for an error bound: the largest step of each method that meets the bound, run and timed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from math import inf, isfinite, isnan, nan, sqrt
from numbers import Rational
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nearharmonic.engine.batch import check_bound, integrate_batch
from nearharmonic.engine.execution import Trajectories, joined, least_samples
from nearharmonic.engine.kernels import NEAR_FLOOR, floor_in_words
from nearharmonic.engine.numbers import standard_parameters, start_array
from nearharmonic.engine.reference import Reference, position_t_end, reference
from nearharmonic.engine.settings import (
    MOST_STEPS,
    Numerics,
    checked_count,
    checked_t_end,
    checked_tau,
    misfit,
    one_of,
    positive,
    steps_of,
)
from nearharmonic.engine.setup import ANY, Setup, as_python, checked_scale
from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import blanes_moan_2002, integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.integrators.user_file import load_tableaus
from nearharmonic.numerics.clock import Patience, interleaved, machine, pinned
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.statistics import quasi_random
from nearharmonic.numerics.written import exact_value
from nearharmonic.output.dataset import Attributes
from nearharmonic.recommendation.measure import (
    LOSSLESS,
    MARGIN,
    MEASURES,
    NAMES,
    POSITION_ROUNDING,
    ROUNDING,
    fewest_for_good,
    ladder,
    measured_errors,
    of_kind,
    prepared_calls,
    read_parts,
)
from nearharmonic.registry.registry import is_path, split_path
from nearharmonic.systems import System, systems
from nearharmonic.systems.quantities import is_list
from nearharmonic.theory.linear_stability import stability_limit

if TYPE_CHECKING:
    import xarray as xr


#: Evaluations of the force in a run that may be recommended, unless another budget is given.
EVALUATIONS = 200_000
#: Quantile of the errors of an ensemble that is bounded.
QUANTILE = 0.99


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

    @cached_property
    def scale(self) -> float:
        """Energy that errors are relative to; 0 for |H0|, or for the unit of energy where H0 = 0."""
        return checked_scale(self.system.energy_scale)


def question(
    system: str | System,
    error: object,
    *,
    measure: object = "max",
    t_end: object = None,
    q0: object = None,
    p0: object = None,
    methods: object = None,
    budget: object = None,
) -> Question:
    """Validate a question; arguments and errors as for :func:`nearharmonic.recommend`."""
    bound = checked_tau(error, "error")
    kind = one_of("measure", measure, tuple(MEASURES))
    most = EVALUATIONS if budget is None else checked_count("budget", budget, MOST_STEPS)
    if t_end is not None:
        positive("t_end", t_end)
    problem = Setup(system, ANY, t_end=t_end)  # type: ignore[arg-type]
    positive("t_end", problem.t_end)  # the system's own may run backwards
    chosen = _methods(methods)
    starts = start_array(problem.system, q0, p0, plain=False)
    check_bound(problem.system, starts, standard_parameters(problem.system)[None, :])
    subject = problem.system if q0 is None and p0 is None else _started(problem.system, starts[0])
    if len(starts) > 1 and kind == "position":
        raise bad_setting("measure", kind, "max or mean for several starts: exact positions are known of one")
    # A run of one step refuses a start where the energy is no number, and says what errors are relative to.
    told = sweep(subject, ANY, [float(problem.end)], t_end=problem.t_end)
    for i in np.flatnonzero(~np.isfinite(problem.run([1] * len(starts), 2, start=starts).energy)):
        raise bad_setting(f"(q0, p0) of start {i}", starts[i, ::2].tolist(), "a start where the energy is finite")
    return Question(
        system=subject,
        arguments=_arguments(system, q0=q0, p0=p0),
        t_end=position_t_end(subject, problem.t_end) if kind == "position" else problem.t_end,
        measure=kind,
        error=bound,
        budget=most,
        methods=chosen,
        energy_attributes={name: told[name].attrs for name in (MEASURES["max"], MEASURES["mean"])},
        starts=starts,
        every=methods is None,
        floor=told.attrs.get("energy_floor", 0.0),
    )


def _arguments(system: str | os.PathLike[str] | System, **start: Any) -> tuple[str, ...]:
    """Return Python code of a system, which is its name if it is an object, and of initial values."""
    if not (isinstance(system, System) or system in systems.registered or is_path(os.fspath(system))):
        return ()
    many = {key: np.ndim(x) > 1 and len(x) > 1 for key, x in start.items()}
    texts = {key: key if many[key] else repr(_numbers(x)) for key, x in start.items() if x is not None}
    return (as_python(system), *(f"{key}={text}" for key, text in texts.items()))


def _numbers(given: Any) -> list[int | float | str]:
    """Return initial values as Python writes them: fractions and the like as text."""
    values = np.array(given, dtype=object).ravel().tolist()
    plain = (x.item() if isinstance(x, np.generic) else x for x in values)
    return [
        x if isinstance(x, int | float) else str(x if isinstance(x, str | Decimal | Rational) else exact_value(x))
        for x in plain
    ]


def _started(system: System, start: Floats) -> System:
    """Return the system with other initial values: the exact pairs of doubles of its runs."""
    q, q_low, p, p_low = start.reshape(4, -1)[:, : system.dimension].tolist()
    return replace(system, q0=_decimals(q, q_low), p0=_decimals(p, p_low))


def _decimals(values: Sequence[float], low: Sequence[float]) -> tuple[str, ...]:
    """Return the sums of two doubles in all their digits: the denominators are powers of two."""
    texts = []
    for pair in zip(values, low, strict=True):
        number = sum(map(Fraction, pair))
        places = number.denominator.bit_length() - 1
        texts.append(f"{number.numerator * 5**places}e-{places}")
    return tuple(texts)


def _methods(asked: Any) -> dict[str, Tableau]:
    """Return the methods by name, methods of users' files by path."""
    if asked is None:
        return dict(integrators)
    key, allowed = "methods", "a list of at least one name, file path or Tableau"
    if isinstance(asked, Tableau) or not is_list(asked):
        raise bad_setting(key, asked, allowed)
    found: dict[str, Tableau] = {}
    for one in asked:
        for name, tableau in _entries(one).items():
            if found.setdefault(name, tableau) is not tableau:
                raise bad_setting(key, name, "two methods have this name")
    if not found:
        raise bad_setting(key, asked, allowed)
    return found


def _entries(one: Any) -> dict[str, Tableau]:
    """Return the methods that one entry of a list stands for; for a path, all methods of its file."""
    if isinstance(one, Tableau):
        return {one.name: one}
    name = os.fspath(one) if isinstance(one, os.PathLike) else one
    if is_path(name) and not split_path(name)[1]:
        several = load_tableaus(name)
        if len(several) > 1:
            return {f"{name}:{key}": tableau for key, tableau in several.items()}
    return {integrators.name_of(name): integrators[name]}


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


@dataclass(frozen=True)
class Orbits:
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
    tableau = ACCURATE
    steps = max(1, evaluations // members // tableau.stages)
    paths = integrate_batch(
        system, tableau, t_end=t_end, steps=[steps] * members, start=start,
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
    diagonal, beside = np.zeros((count, M)), np.zeros((count, M))
    zs, xs = np.zeros((2, count, M, D))
    z = np.tile(quasi_random(1, D, 0) - 0.5, (M, 1))
    size = np.zeros(M)
    for k in range(count):
        x = _hessian_times(system, points, extents, 1, z)
        length = np.sqrt(np.maximum((z * x).sum(axis=1), 0))
        if k:
            beside[k - 1] = length
        usable = length > NOTHING * size
        zs[k], xs[k] = (np.where(usable[:, None], one / np.where(usable, length, 1)[:, None], 0) for one in (z, x))
        z = _hessian_times(system, points, extents, 0, xs[k])
        diagonal[k] = (xs[k] * z).sum(axis=1)
        for _ in range(2):  # a second time for what rounding leaves
            z = z - np.einsum("jmd,jm->md", zs[: k + 1], np.einsum("jmd,md->jm", xs[: k + 1], z))
        size = np.maximum(size, np.abs(diagonal[k]))
    x = _hessian_times(system, points, extents, 1, z)
    beside[-1] = np.sqrt(np.maximum((z * x).sum(axis=1), 0))
    matrices = np.zeros((M, count, count))
    matrices[:, range(count), range(count)] = diagonal.T
    for k in range(1, count):
        matrices[:, k, k - 1] = matrices[:, k - 1, k] = beside[k - 1]
    usable = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(beside[-1])
    values, vectors = np.linalg.eigh(matrices[usable])
    found: Floats = values[:, -1] + beside[-1, usable] * np.abs(vectors[:, -1, -1])
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


#: Significant digits of a printed step, unless another number of steps would come of it.
DIGITS = 4


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


@dataclass(frozen=True, kw_only=True)
class Recommendation:
    """Methods for an error bound, ranked by the wall time of the run that is recommended.

    ``choices`` are the methods that meet the bound, the fastest first, behind them those whose step is not confirmed,
    then the others. ``basis`` is the origin of runs and times, as text.
    """

    question: Question
    choices: tuple[Choice, ...]
    basis: str

    @property
    def floor_in_words(self) -> str:
        """Sentence about choices whose error is marked as rounding, "" if there is none."""
        marked = any(is_rounding(choice, self.question) for choice in self.choices)
        return f"*: {floor_in_words(self.question.floor)}" if marked else ""

    @property
    def ranked(self) -> tuple[Choice, ...]:
        """The methods that meet the bound, the fastest first."""
        return tuple(choice for choice in self.choices if choice.status == "met")

    @property
    def call(self) -> str:
        """Python code of the run of the best method of this package; "" without one, and for a system of a config."""
        asked = self.question
        best = next((choice for choice in self.ranked if choice.kind == "splitting"), None)
        if best is None or not asked.arguments:
            return ""
        system, *start = asked.arguments
        more = [] if asked.t_end == checked_t_end(asked.system.t_end) else [f"t_end={asked.t_end!r}"]
        more += ["summation='plain'"] if best.summation == "plain" else []
        function = "ensemble" if len(asked.starts) > 1 else "integrate"
        return f"nh.{function}({', '.join([system, repr(best.method), repr(best.tau), *start, *more])})"

    @property
    def unconfirmed(self) -> str:
        """The methods that meet the bound and are not confirmed, each with its error there."""
        return "; ".join(f"{one.shown} ({one.further_error:.1e})" for one in self.ranked if not one.confirmed)

    def missed(self, kind: str) -> str:
        """Return the methods of one kind that miss the bound, each with its smallest error."""
        missed = [choice for choice in self.choices if (choice.status, choice.kind) == ("missed", kind)]
        return "; ".join(_at_best(choice, self.question) for choice in missed)

    def not_run(self) -> str:
        """Return the methods that were not run, those of one reason together with it."""
        absent: dict[str, list[str]] = {}
        for choice in self.choices:
            if choice.status == "not run":
                absent.setdefault(choice.reason, []).append(choice.shown)
        return "; ".join(f"{', '.join(names)} ({reason})" for reason, names in absent.items())


def is_rounding(choice: Choice, asked: Question) -> bool:
    """Return True if the energy error of a choice is near the rounding of V."""
    return asked.measure != "position" and choice.error <= NEAR_FLOOR * asked.floor


def printed_step(t_end: str, tau: float, steps: int) -> str:
    """Return ``tau`` in the fewest digits, four at least, that give ``steps`` steps over [0, ``t_end``] again."""
    texts = (f"{tau:.{digits}g}" for digits in range(DIGITS, 18))
    return next(text for text in texts if steps_of(t_end, float(text)) == steps)


def step_text(choice: Choice, t_end: str) -> str | None:
    """Return the step of a choice as :func:`printed_step` prints it, or None if it has a tolerance in its place."""
    if not isfinite(choice.tau):
        return None
    return printed_step(t_end, choice.tau, int(choice.steps)) if isfinite(choice.steps) else f"{choice.tau:.{DIGITS}g}"


def _at_best(choice: Choice, asked: Question) -> str:
    if not isfinite(choice.error):
        says = "every run fails"
    else:
        step = step_text(choice, asked.t_end)
        mark = " *" if is_rounding(choice, asked) else ""
        says = f"{choice.error:.1e}{mark} at {f'tolerance {choice.tolerance:.1g}' if step is None else f'tau {step}'}"
        says += ", but not at all finer ones" if choice.error <= asked.error else " at best"
    return f"{choice.shown} ({says}" + (f"; {choice.reason})" if choice.reason else ")")


#: The ranking compares least times, most of them below 1 ms: more repeats than for curves.
REPEATS = Patience(least=15, most=25, seconds=0.01)
#: Timings of other libraries in a folder of results, and the mode that is compared: one trajectory.
CUBE, TIMED = Path("cubes/work_precision.h5"), "trajectory"
#: Values of a setting of another library that a choice takes over.
SHARED = ("tau", "tolerance", "steps", "evaluations", "max_energy_error", "mean_energy_error")
#: Relative margin of the mean below the bound: its last digits depend on the number of samples of a run.
MEAN_ROUNDING = 1e-9
#: Where all registered methods are asked, the coarse runs end at so many times the evaluations of the best method, and
#: not before so many methods meet the bound: others would take longer.
DROPPED, RANKED = 2, 10
#: Finest steps of a search: so many times as many as those of the coarse run that meets the bound.
REACH = 8
#: Starts of an ensemble that the search runs, and starts at most whose errors are taken in the end.
SEARCHED, MOST_STARTS = 8, 1024
#: Numbers that one call keeps at most.
KEPT = 2**22
#: Perturbed starts, the length of the longer interval over that of the first, and the ratio of their errors to the
#: bound at which a step is confirmed.
PERTURBED, LONGER, CONFIRMED = 3, 4, 2
#: Ratio of numbers of steps that are tried one after the other until a step is confirmed.
FINER = 1.1


def to_terminal(line: str) -> None:
    """Write a line to standard error if that is a terminal."""
    if sys.stderr.isatty():
        print(line, file=sys.stderr, flush=True)


def recommendation(
    asked: Question, results: str | Path | None = None, report: Callable[[str], None] = to_terminal
) -> Recommendation:
    """Rank methods by the wall time of the cheapest run of each method that meets an error bound.

    Each recommended step was run over the whole interval and meets the bound, as do all finer steps that were run. It
    is linearly stable at the largest frequency along the orbit. Times are measured during the call. Choices of other
    libraries are read from the folder ``results`` of a finished target ``work_precision``, and left out if it is None.
    ``report`` is given a line of text for each method that was tried.

    Raises NearharmonicError: an unusable file of timings, or positions that cannot be compared with any reference.
    """
    libraries, origin = ([], "") if results is None else library_choices(asked, Path(results))
    exact = reference(asked.system, asked.t_end) if asked.measure == "position" else None
    with pinned() as core:
        facts = machine(core)
        search = Search(asked, exact)
        choices = _timed(asked, list(search.choices(report))) + libraries
    basis = (
        f"measured on the spot, {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; each step "
        f"listed was run over the whole interval and meets the error, as do all finer steps that were run (these with "
        f"compensated sums), up to {REACH} times as many and {asked.longest} evaluations; {search.checks}"
        f"{origin and f'; other libraries: {origin}'}"
    )
    order = sorted(choices, key=lambda choice: (not choice.confirmed, inf if isnan(choice.time) else choice.time))
    return Recommendation(question=asked, choices=tuple(order), basis=basis)


@dataclass(frozen=True)
class Search:
    """Search for the largest step of each method that answers a question."""

    asked: Question
    exact: Reference | None

    @cached_property
    def starts(self) -> Floats:
        """The starts (M, 4 D) whose errors are taken: all, or as many of a larger ensemble in even distances."""
        return _evenly(self.asked.starts, MOST_STARTS)

    @cached_property
    def orbits(self) -> Orbits:
        """Orbits from the starts that the search runs."""
        asked = self.asked
        return orbits(asked.system, Fraction(asked.t_end), _evenly(self.starts, SEARCHED), asked.budget)

    @cached_property
    def perturbation(self) -> float:
        """Relative change of a perturbed start, too small for its energy to matter unless it grows."""
        return min(max(sqrt(self.asked.error) / 100, 1e-9), 1e-3)

    @property
    def bound(self) -> float:
        """Largest error of a run of the search."""
        return self.asked.error * (1 - MEAN_ROUNDING) if self.asked.measure == "mean" else self.asked.error

    @property
    def checks(self) -> str:
        """Checks beside the error of the run, as text."""
        asked, omega = self.asked, self.orbits.frequency
        where = "along the orbit" if len(asked.starts) == 1 else f"along {min(SEARCHED, len(asked.starts))} orbits"
        stable = f"the largest frequency {where}, {omega:.3g}, times the step is below the limit of linear stability"
        if asked.system.regularisation is not None:
            stable = "linear stability is not checked for regularised systems"
        elif not omega:
            stable = f"there is no frequency {where} that bounds a step"
        others = f"{PERTURBED} starts perturbed by {self.perturbation:.0e}"
        if len(asked.starts) > 1:
            others = f"all of {len(self.starts)} starts"
            stable += f"; the search ran {min(SEARCHED, len(asked.starts))} of them, and the {QUANTILE:g} quantile of "
            stable += f"{len(self.starts)} meets the error"
        kind = "an energy error at most twice its own" if self.exact else "at most twice the error"
        return f"{stable}; confirmed by {kind} from {others} and over {LONGER} times the interval"

    def choices(self, report: Callable[[str], None]) -> Iterable[Choice]:
        """Return a choice for each method, not timed yet; those of the fewest evaluations from a denser search."""
        coarse, unrun = self._coarse(report)
        few, found = sum(name not in unrun for name in coarse) <= RANKED, dict[str, Choice]()
        for i, (name, tableau) in enumerate(self.asked.methods.items(), 1):
            choice = Choice(method=name, label=tableau.label, kind="splitting", status="not run")
            if name in unrun:
                choice = replace(choice, reason=unrun[name])
            else:
                choice = self._choice(choice, coarse[name], dense=few)
            found[name] = choice
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
            reason, _ = misfit(asked.system, tableau)
            one_step = tableau.evaluations(1)
            if reason:
                unrun[name] = f"does not fit: {reason}"
            elif one_step > asked.budget:
                unrun[name] = f"a single step takes {one_step} evaluations"
            else:
                coarse[name] = {}
        going, evaluations, met, last = list(coarse), 2, list[tuple[int, str]](), asked.longest
        while going and evaluations < last:
            evaluations = min(2 * evaluations, last)
            for name in tuple(going):
                errors, tableau = coarse[name], asked.methods[name]
                steps = evaluations // tableau.stages
                # No method is stable at a step above 2 a stage.
                if steps < 1 or self._radians(steps) > 2 * tableau.stages:
                    continue
                run = self._runs(tableau, [steps], _evenly(self.starts, SEARCHED))
                errors[steps] = float(self._each(run).max())
                if errors[steps] <= self.bound and steps >= self._least(tableau):
                    going.remove(name)
                    # Those of an implicit method depend on its iterations.
                    met = sorted([*met, (max(evaluations, int(run.evaluations.max())), name)])
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
            finest = min(most, REACH * last)
            rungs = sorted({max(least, last // 2), last, finest, *ladder(most if dense else finest)})
            rungs = [n for n in rungs if max(least, last // 2) <= n <= finest]
            floor = POSITION_ROUNDING if asked.measure == "position" else ROUNDING
            errors |= measured_errors(lambda steps: self._errors(tableau, steps), rungs, self.bound, floor)
            first = fewest_for_good({n: error for n, error in errors.items() if n >= least}, self.bound)
            if first is not None:
                found = self._confirmed(choice, first, [n for n in errors if n > first])
                if found.status == "met":
                    plain = self._measured(found, "plain")
                    harmless = plain.error <= self.bound and _loses_nothing(plain, found)
                    return plain if harmless else found
        within = [n for n in errors if tableau.evaluations(n) <= asked.budget]
        if least > asked.budget // tableau.stages:
            reason = f"a stable step is below {float(asked.t_end) / least:.2g}"
            choice = replace(choice, reason=reason)
        if not within:
            return replace(choice, status="not run", reason=choice.reason or "its steps are not stable")
        return self._measured(self._with_steps(choice, min(within, key=errors.__getitem__)), "compensated")

    def _with_steps(self, choice: Choice, steps: int) -> Choice:
        evaluations = self.asked.methods[choice.method].evaluations(steps)
        return replace(choice, tau=float(Fraction(self.asked.t_end) / steps), steps=steps, evaluations=evaluations)

    def _confirmed(self, choice: Choice, first: int, finer: Sequence[int]) -> Choice:
        """Return a choice of ``first`` or more steps that meets the bound from all starts, confirmed if one is.

        Its status is that of ``choice`` if there is none within the budget.
        """
        asked, met = self.asked, choice
        steps, known = first, sorted(finer)
        while asked.methods[choice.method].evaluations(steps) <= asked.budget:
            if met.status == "met" and steps > MARGIN * met.steps:
                break
            one = self._measured(self._with_steps(choice, steps), "compensated")
            # The iterations of an implicit method are known afterwards.
            if one.evaluations <= asked.budget and one.error <= self.bound:
                own = one.max_energy_error if self.exact else asked.error
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
        asked, tableau, steps = self.asked, self.asked.methods[choice.method], int(choice.steps)
        name = MEASURES["max" if self.exact else asked.measure]
        longer = self._runs(tableau, [LONGER * steps], _evenly(self.starts, SEARCHED), times=LONGER)
        others = self._runs(tableau, [steps], self.starts if len(self.starts) > 1 else self._perturbed())
        errors = np.concatenate([getattr(paths, name) for paths in (longer, others)])
        return float(np.where(np.isnan(errors), inf, errors).max())

    def _perturbed(self) -> Floats:
        """Return starts (3, 4 D) near the one start."""
        D, d = self.starts.shape[1] // 4, self.asked.system.dimension
        rows = np.repeat(self.starts, PERTURBED, axis=0).reshape(PERTURBED, 4, D)
        change = (2 * quasi_random(PERTURBED, 2 * d, 0) - 1).reshape(PERTURBED, 2, d)
        rows[:, ::2, :d] += self.perturbation * change * self.orbits.extents[:, :d]
        return rows.reshape(PERTURBED, -1)

    def _measured(self, choice: Choice, summation: str) -> Choice:
        """Return ``choice`` with the errors of its run, of several starts their quantile."""
        run = self._runs(self.asked.methods[choice.method], [int(choice.steps)], self.starts, summation)
        return replace(
            choice,
            summation=summation,
            evaluations=int(run.evaluations.max()),
            error=_quantile(self._each(run)),
            max_energy_error=_quantile(run.max_energy_error),
            mean_energy_error=_quantile(run.mean_energy_error),
        )

    def _errors(self, tableau: Tableau, steps: Sequence[int]) -> list[float]:
        """Return errors of runs with these numbers of steps, the largest of the starts that are searched."""
        starts = _evenly(self.starts, SEARCHED)
        errors: list[float] = (
            self._each(self._runs(tableau, steps, starts)).reshape(len(steps), -1).max(axis=1).tolist()
        )
        return errors

    def _each(self, paths: Trajectories) -> Floats:
        """Return the error of each run in the requested measure, infinite where it failed."""
        if self.exact is None:
            found = getattr(paths, MEASURES[self.asked.measure])
        else:
            found = np.where(paths.left_at > 0, inf, self.exact.error(*paths.ends))
        return np.where(np.isnan(found), inf, found)

    def _runs(
        self, tableau: Tableau, steps: Sequence[int], starts: Floats, summation: str = "compensated", times: int = 1
    ) -> Trajectories:
        """Return runs from each of ``starts`` with each number of steps, over so many times the interval."""
        asked, samples = self.asked, least_samples(tableau)
        rows = np.tile(starts, (len(steps), 1))
        if summation == "plain":
            rows.reshape(len(rows), 4, -1)[:, 1::2] = 0.0
        count = np.repeat(np.array(steps), len(starts))
        size = max(1, KEPT // (samples * rows.shape[1]))
        parts = [
            integrate_batch(
                asked.system, tableau, t_end=times * Fraction(asked.t_end), steps=count[i : i + size], samples=samples,
                start=rows[i : i + size], scale=asked.scale, numerics=Numerics(summation=summation),
            )
            for i in range(0, len(rows), size)
        ]  # fmt: skip
        return parts[0] if len(parts) == 1 else joined(parts)


def _evenly(rows: Floats, most: int) -> Floats:
    """Return at most so many of ``rows``, in even distances."""
    chosen: Floats = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)]
    return chosen


def _quantile(errors: Floats) -> float:
    """Return the quantile of the errors of several starts that is bounded, one of them."""
    return float(np.sort(errors)[int(np.ceil(QUANTILE * len(errors))) - 1])


def _loses_nothing(plain: Choice, careful: Choice) -> bool:
    errors = ("error", "max_energy_error", "mean_energy_error")
    return all(getattr(plain, name) <= LOSSLESS * getattr(careful, name) for name in errors)


def _timed(asked: Question, choices: Sequence[Choice]) -> list[Choice]:
    """Return ``choices`` with the least time of each run that meets the bound, from interleaved repeats."""
    calls: dict[str, Callable[[], object]] = {}
    for choice in choices:
        if choice.status == "met":
            tableau, steps = asked.methods[choice.method], int(choice.steps)
            made = prepared_calls(asked.system, tableau, asked.t_end, steps, choice.summation, modes=(TIMED,))
            calls[choice.method] = made[TIMED]
    repeats = interleaved(list(calls.values()), REPEATS)
    least = {method: min(times) for method, times in zip(calls, repeats, strict=True)}
    return [replace(choice, time=least.get(choice.method, nan)) for choice in choices]


def library_choices(asked: Question, results: Path) -> tuple[list[Choice], str]:
    """Return the choices of other libraries from the timings in a folder of results, and their origin as text.

    Raises ResultFileError: the file of timings cannot be read.
    """
    path, system = results / CUBE, asked.system
    if system.name not in systems or systems[system.name] is not system:
        return [], "not timed for a system of your own"
    if not path.is_file():
        return [], f"not timed ({path} does not exist; snakemake work_precision makes it)"
    parts, facts = read_parts(path, system.name)
    for end, measures, curves in parts:
        if asked.measure in measures and Fraction(end) == Fraction(asked.t_end):
            choices = [_library_choice(curve, asked) for curve in of_kind(curves, "peer")]
            return choices, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return [], f"not timed ({path} has no timings of this measure over this interval)"


def _library_choice(curve: xr.Dataset, asked: Question) -> Choice:
    """Return the fastest setting that meets the bound, if all finer settings meet it too."""
    method, label, status = (curve[name].item() for name in ("solver", "label", "status"))
    reason = "" if status == "ok" else status
    choice = Choice(method=method, label=label, kind="peer", status="not run", reason=reason)
    if not curve.sizes["point"]:
        return choice
    errors = dict(enumerate(curve[MEASURES[asked.measure]].values.tolist()))
    times = curve[f"time_{TIMED}"].values.tolist()
    first = fewest_for_good(errors, asked.error)
    settings = [] if first is None else [i for i in errors if i >= first and not isnan(times[i])]
    # A looser tolerance may cost more: the coarsest setting is not always the fastest.
    best = (
        min(settings, key=times.__getitem__) if settings else min(errors, key=lambda i: (isnan(errors[i]), errors[i]))
    )
    return replace(
        choice,
        status="met" if settings else "missed",
        error=errors[best],
        time=times[best] if settings else nan,
        **{name: curve[name].values[best].item() for name in SHARED},
    )
