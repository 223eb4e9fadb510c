"""Many trajectories of one system with one step size, and the points where they cross a surface."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.layout import COLUMNS, COUNTERS
from nearharmonic.engine import batch as batches
from nearharmonic.engine import description
from nearharmonic.engine.description import over
from nearharmonic.engine.kernels import most_lanes_of, with_lanes
from nearharmonic.engine.numbers import parameter_array, rows_of, standard_parameters
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_THREADS, checked_count, checked_samples, one_of
from nearharmonic.engine.setup import Setup, Start, asked_steps, check_memory, parameter_attributes, start_of
from nearharmonic.engine.trajectory import check_single_step, coefficients_of
from nearharmonic.errors import bad_setting, warn_caller
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.numerics.written import is_real
from nearharmonic.output.store import Variables, assembled, described
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr


#: Members that a thread integrates at a time: so many that idle lanes at the end take little time.
BLOCK = 2048
#: Members that a GPU integrates at a time: several of its chunks, so that copies are made beside the work.
DEVICE_BLOCK = 2**21


def ensemble(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    t_end: float | str | None = None,
    t: object = None,
    samples: int = 2,
    energy: str = "every",
    energy_scale: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    split: str = KINETIC_POTENTIAL,
    threads: int = 1,
    device: str = "cpu",
) -> xr.Dataset:
    """Integrate many trajectories that differ in initial values or parameters.

    Each covers [0, t_end] in ``steps = max(1, round(|t_end| / tau))`` equal steps.

    Parameters
    ----------
    system, integrator, tau
        As for :func:`nearharmonic.integrate`.
    q0, p0 : (M, d) array of float, or one row, optional
        Initial values of each member, or of all; rows of decimal strings are exact.
    parameters : mapping, optional
        Values by name: (M,) arrays of float, or one value for all.
    t_end, t
        As for :func:`nearharmonic.integrate`.
    samples : int
        Most states that a member keeps; by default the first and the last, and 1 keeps the last alone.
    energy, energy_scale, precision, summation, first, split
        As for :func:`nearharmonic.integrate`.
    threads : int
        Threads that share the members; bits do not depend on it.
    device : {"cpu", "gpu", "auto"}
        Where members are integrated, with the same bits: "gpu" needs one of NVIDIA and the extra ``gpu``; "auto" takes
        it if it is there and faster.

    Returns
    -------
    xarray.Dataset
        Over (member, sample, component): ``t``, ``q``, ``p``, ``energy_error``; and over member ``max_energy_error``,
        ``mean_energy_error``, ``initial_energy``, ``status``, ``diverged_at`` and the parameters that vary. Each member
        has the bits of a run by :func:`nearharmonic.integrate`. Samples that a member did not reach are NaN.

    Raises
    ------
    NearharmonicError
        An unknown name, arrays of different lengths, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.ensemble("henon_heiles", "ruth", 0.1, q0=[[0.1, 0], [0.2, 0], [0.3, 0]], t_end=10)
    >>> [f"{error:.1e}" for error in found.max_energy_error.values]
    ['2.0e-05', '1.9e-05', '1.4e-05']
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy=energy,
        energy_scale=energy_scale, split=split,
    )  # fmt: skip
    begin = start_of(problem, q0, p0, parameters, several=True)
    (steps, asked_tau), kept = asked_steps(problem, tau), checked_samples(samples)
    threads, members = checked_count("threads", threads, MOST_THREADS), begin.members
    problem.numerics = batches.placed(
        problem.numerics, device, problem.system, problem.tableau, members, members * steps
    )
    asked = None if t is None else description.checked_times(t, problem)
    times = None if asked is None else np.array([float(time) for time in asked])
    count = max(2, min(kept, steps + 1)) if asked is None else len(asked)
    numbers = members * count * batches.sample_size(problem.system.dimension)
    check_memory(f"the states of {members} members", numbers, count)
    if asked is None:
        paths = _sampled(problem, steps, begin, kept, threads)
    else:
        parts: dict[int, batches.Trajectories] = {}

        def compute(block: slice, start: Floats, parameters: Floats) -> None:
            equal = [steps] * (block.stop - block.start)
            parts[block.start] = description.run_at(problem, equal, asked, start=start, parameters=parameters)

        _in_blocks(problem, steps, begin, threads, compute)
        paths = batches.joined([parts[i] for i in sorted(parts)])
    attributes = description.run_attributes(problem, begin, asked_tau) | problem.floor(
        begin.state, begin.parameters, paths.energy
    )
    variables = description.run_variables(problem, paths, begin, times, steps)
    used = variables.pop("tau")
    renamed = over("member", variables) | description.parameter_variables(problem, begin.parameters) | {"tau": used}
    coordinates = [name for name in renamed if name.startswith("parameter_")]
    return assembled(renamed, coordinates, attributes)


def _in_blocks(
    problem: Setup, steps: int, begin: Start, threads: int, compute: Callable[[slice, Floats, Floats], None]
) -> None:
    """Call ``compute`` with each block of members, their starts and parameters; one row is for all members."""
    members, size = begin.members, _block_of(problem)

    def one(i: int) -> None:
        block = slice(i * size, min((i + 1) * size, members))
        compute(block, *(rows[block] if len(rows) > 1 else rows for rows in (begin.state, begin.parameters)))

    batches.Blocks(one, -(-members // size), steps=members * steps, cost=problem.cost).execute(threads)


def _block_of(problem: Setup) -> int:
    """Members of a batch."""
    return DEVICE_BLOCK if problem.numerics.device == "gpu" else BLOCK


def _sampled(problem: Setup, steps: int, begin: Start, samples: int, threads: int) -> batches.Trajectories:
    """Return all members, sampled at whole steps; batches of whole blocks are used again."""
    members, marks, only_end = begin.members, batches.sample_marks(np.array([steps]), samples), samples == 1
    kept = marks[0, only_end:]
    counters = [0, 1] * (problem.system.regularisation is not None) + [*range(-COUNTERS, 0)] * problem.tableau.implicit
    shown = batches.shapes((members, kept.size), problem.states_dimension, len(counters))
    arrays = batches.Filled(
        marks=np.broadcast_to(kept, (members, kept.size)), left_at=np.empty(members, np.int64),
        **{name: np.empty(shape) for name, shape in shown.items()},
    )  # fmt: skip
    lanes = replace(problem.numerics, width=most_lanes_of(problem.system, problem.numerics, problem.tableau))
    moves, free, whole = problem.moves([problem.end / steps]), list[batches.Batch](), _block_of(problem)

    def compute(block: slice, start: Floats, parameters: Floats) -> None:
        size = block.stop - block.start
        try:
            batch = free.pop() if size == whole else None
        except IndexError:
            batch = None
        if batch is None:
            batch = problem.batch(
                moves.copy(), np.repeat(marks, size, axis=0), np.zeros(size, np.int64),
                np.resize(start, (size, start.shape[1])), parameters.copy(), lanes,
            )  # fmt: skip
        else:
            batch.start[:] = start
            if batch.parameters.size:  # none if they are compiled in
                batch.parameters[:] = parameters
        batch.run(size * steps)
        found = batch.filled.without_start(only_end)
        found.running = found.running[:, counters]
        for name in (*shown, "left_at"):
            getattr(arrays, name)[block] = getattr(found, name)
        if size == whole:
            free.append(batch)

    _in_blocks(problem, steps, begin, threads, compute)
    return problem.trajectories(np.full(members, steps), arrays)


# --- Poincare sections: the states of many trajectories where they cross a surface, to rounding.

#: Signs of the surface function before a crossing.
DIRECTIONS = {"up": (-1,), "down": (1,), "both": (-1, 1)}
#: Trajectories whose periods are looked at, over so many steps, in so many short ones, and the largest ratio of a
#: momentum to the momenta of the other coordinates that is rounding noise.
WATCHED, WINDOW, FINE, NOISE = 64, 8, 128, 1e-10
#: Bytes of states at a time, and of the numbers of one state per coordinate.
MOST_BYTES, PER_COORDINATE = 200_000_000, 8 * 8
#: Most steps of a search for a crossing, twice as many as halve an interval to rounding; and steps in a row after
#: which a search ends because the function came no nearer to zero: it is then at its own rounding errors.
MOST_TRIALS, MOST_IN_VAIN = 106, 4

Surface = Callable[..., Any]


def section(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    surface: int | Surface,
    direction: str = "up",
    starts: object = None,
    parameters: Mapping[str, Any] | None = None,
    t_end: float | str | None = None,
    first: str | None = None,
    threads: int = 1,
    device: str = "cpu",
) -> xr.Dataset:
    """Return the states at which trajectories cross a surface in phase space, a Poincare section.

    The trajectories run with the step size ``tau``, in SIMD lanes. Where the surface function changes its sign in a
    step, this step is repeated with a smaller size, aside of the trajectory, so that it ends on the surface (after
    M. Henon, 1982, Physica D 5, 412, with steps of the integrator in place of another variable of integration). Such a
    step is symplectic as all others, so that crossings conserve the energy as well as the trajectory does. Two
    crossings in one step are not seen: a step above a quarter of the shortest period that the orbits show is warned of.

    Parameters
    ----------
    system, integrator, tau
        As for :func:`nearharmonic.integrate`.
    surface : int or callable
        The coordinate whose zero is the surface, counted from 0; or a function ``g(q, p, *parameters)`` that is zero on
        the surface. It is called with tuples of floats and of arrays.
    direction : {"up", "down", "both"}
        Crossings from negative to positive values of the function, the reverse, or all.
    starts : (M, 2 d) array of float, optional
        Start of each trajectory, positions and then momenta; by default the system's start. A section shows one energy
        if all starts have it.
    parameters : mapping, optional
        One value by name for all trajectories.
    t_end, first
        As for :func:`nearharmonic.integrate`.
    threads, device
        Threads that share the trajectories, and where they run, as for :func:`nearharmonic.ensemble`.

    Returns
    -------
    xarray.Dataset
        Over (member, crossing, component): ``q`` and ``p``; over (member, crossing): ``t``, ``energy_error``, ``(H -
        H0)/|H0|`` in double precision, or H - H0 if a start has H0 = 0, and ``surface``, the value of the function,
        zero to rounding; over member ``crossings``, their number, ``status`` and ``diverged_at``. Members with fewer
        crossings than others end with NaN. A trajectory that diverges has the crossings before.

    Raises
    ------
    NearharmonicError
        An unknown name, a setting outside what is allowed, or a surface that cannot be evaluated, before any work; or
        too many steps to keep.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.section("henon_heiles", "babps8o7h", 0.4, surface=0, t_end=50)
    >>> found.crossings.item()
    7
    """
    problem = Setup(system, integrator, t_end=t_end, first=first)
    subject, d = problem.system, problem.system.dimension
    if subject.time_dependent:
        remedy = "of a force of period T, states at t=[k * T for k in range(n)] of nearharmonic.integrate are one"
        raise bad_setting("system", subject.name, f"a section is of a system that does not depend on time; {remedy}")
    signs = DIRECTIONS[one_of("direction", direction, tuple(DIRECTIONS))]
    if starts is None:
        rows = np.concatenate(subject.start(float))[None, :]
    else:
        allowed = f"an array (M, {2 * d}) of finite numbers, {d} positions and {d} momenta a row"
        rows = rows_of("starts", starts, 2 * d, allowed)[..., 0]
    given = standard_parameters(subject)[None, :] if parameters is None else parameter_array(subject, parameters)
    if len(given) > 1:
        raise bad_setting("parameters", f"{len(given)} values", "one value of each parameter for all trajectories")
    constants = given[0, ::2].tolist()
    function = _Function(surface, subject, constants)
    function(rows[:, :d], rows[:, d:])  # a surface that cannot be evaluated ends the call here
    step = _ShortenedStep(problem, given)
    steps, asked_tau = asked_steps(problem, tau)
    size = float(problem.end) / steps
    block = max(1, MOST_BYTES // (PER_COORDINATE * d * (steps + 1)))

    def runs(some: Floats, tau: float, t_end: str, samples: int) -> xr.Dataset:
        return ensemble(
            subject, problem.tableau, tau, q0=some[:, :d], p0=some[:, d:], parameters=parameters, t_end=t_end,
            samples=samples, threads=threads, device=device,
        )  # fmt: skip

    _warn_of_period(problem, size, runs, rows[:: -(-len(rows) // WATCHED)])
    found, ended = [], []
    for begin in range(0, len(rows), block):
        orbits = runs(rows[begin : begin + block], tau, problem.t_end, steps + 1)
        found.append(_crossings(step, function, orbits, signs, size, begin))
        ended.append(orbits[["status", "diverged_at"]])
    attributes = description.problem_attributes(problem) | parameter_attributes(subject, parameters or {})
    attributes |= {"direction": direction, "surface_name": function.name, "tau_requested": asked_tau}
    variables = _variables(problem, found, rows, function, constants)
    for name in ("status", "diverged_at"):
        values = np.concatenate([one[name].values for one in ended])
        variables[name] = ("member",), values, ended[0][name].attrs
    variables["tau"] = (), np.array(size), described("step size as used, t_end / steps", subject.units["t"])
    return assembled(variables, [], attributes)


def _warn_of_period(problem: Setup, size: float, runs: Callable[..., xr.Dataset], rows: Floats) -> None:
    """Warn of steps above a quarter of a period: the mean time between every other change of sign of a momentum."""
    span = min(abs(float(problem.end)), WINDOW * abs(size))
    p = runs(rows, span / FINE, repr(span), FINE + 1)["p"].values
    with np.errstate(invalid="ignore"):
        turns = np.sign(p[:, 1:]) * np.sign(p[:, :-1]) < 0
        turns &= (sizes := abs(p).max(axis=1, keepdims=True)) > NOISE * sizes.max(axis=2, keepdims=True)
    count = turns.sum(axis=1)
    between = (FINE - 1 - turns[:, ::-1].argmax(axis=1) - turns.argmax(axis=1)) * span / FINE
    if (shortest := (2 * between / np.maximum(count - 1, 1))[count > 2]).size and abs(size) > shortest.min() / 4:
        message = f"nearharmonic.section misses crossings: its step {abs(size):.3g} is above a quarter of the shortest"
        warn_caller(f"{message} period that the orbits show, {shortest.min():.2g}")


class _Function:
    """The function that is zero on a surface, of states (..., d)."""

    def __init__(self, surface: int | Surface, system: System, constants: Sequence[float]) -> None:
        allowed = f"a coordinate from 0 to {system.dimension - 1}, or a function g(q, p, *parameters)"
        whole = is_real(surface) and isinstance(surface, Integral)
        if not callable(surface) and not (whole and 0 <= int(surface) < system.dimension):
            raise bad_setting("surface", surface, allowed)
        self._constants = constants
        self._function: Surface = surface if callable(surface) else (lambda q, p, *_: q[surface])
        self.name = getattr(surface, "__name__", "surface") if callable(surface) else f"q_{int(surface) + 1}"

    def __call__(self, q: Floats, p: Floats) -> Floats:
        shape = q.shape[:-1]
        try:
            with np.errstate(all="ignore"):  # a state may be too large for it
                value = self._function(tuple(np.moveaxis(q, -1, 0)), tuple(np.moveaxis(p, -1, 0)), *self._constants)
            return np.array(np.broadcast_to(np.asarray(value).astype(float, casting="same_kind"), shape))
        except Exception as error:
            what = f"a function g(q, p, *parameters) of numbers and arrays; it raises {type(error).__name__}: {error}"
            raise bad_setting("surface", self.name, what) from error


class _ShortenedStep:
    """A single step of its own size from each of many states, with plain sums, in SIMD lanes."""

    def __init__(self, problem: Setup, parameters: Floats) -> None:
        check_single_step(problem)
        self._problem = replaced = copy(problem)
        replaced.numerics = replace(problem.numerics, summation="plain", energy="none")
        self._parameters, self._coefficients = parameters, coefficients_of(problem.tableau)

    def __call__(self, q: Floats, p: Floats, sizes: Floats) -> tuple[Floats, Floats]:
        """Return the states (N, d) behind steps of ``sizes`` (N,)."""
        from nearharmonic.core.stepper import fill_all

        table, flags, power = self._coefficients
        moves = np.zeros((len(sizes), len(flags), COLUMNS))
        fill_all(table, flags, power, sizes, moves.reshape(len(sizes), len(flags) * COLUMNS))
        start = np.concatenate([q, np.zeros_like(q), p, np.zeros_like(p)], axis=1)
        marks, problem = batches.single_steps(len(sizes)), self._problem
        numerics = with_lanes(problem.numerics, marks[:, 1], problem.system, problem.tableau)
        batch = problem.batch(moves, marks, np.arange(len(sizes)), start, self._parameters.copy(), numerics)
        batch.run()
        end, d = batch.filled.states[:, 1], q.shape[1]
        return end[:, :d].copy(), end[:, 2 * d : 3 * d].copy()


def _crossings(
    step: _ShortenedStep, function: _Function, orbits: xr.Dataset, signs: Sequence[int], size: float, begin: int
) -> tuple[Integers, Floats, Floats, Floats]:
    """Return member, time, position and momentum (N, ...) where shortened steps of orbits end on the surface.

    A step crosses it if the function changes its sign from one of ``signs`` on; zero counts as behind it.
    """
    q, p = orbits["q"].values, orbits["p"].values
    values = function(q, p)
    before, after = values[:, :-1], values[:, 1:]
    member, number = np.nonzero(np.any([(sign * before > 0) & (sign * after <= 0) for sign in signs], axis=0))
    q, p, f_low = q[member, number], p[member, number], before[member, number]
    if not number.size:
        return member, f_low, q, p
    low, high, turn, in_vain = 0 * f_low, 0 * f_low + 1, 0 * number, 0 * number
    share, (best_q, best_p) = high.copy(), step(q, p, high * size)
    best = function(best_q, best_p)
    f_high, going = best.copy(), np.arange(len(number))
    smallest = np.finfo(float).eps * (abs(f_low) + abs(f_high))
    for _ in range(MOST_TRIALS):
        going = going[(abs(best[going]) > smallest[going]) & (in_vain[going] < MOST_IN_VAIN)]
        a, b, f_a, f_b = low[going], high[going], f_low[going], f_high[going]
        with np.errstate(all="ignore"):
            middle = b - f_b * (b - a) / (f_b - f_a)  # regula falsi, as modified at the Illinois computer
        middle = np.where((a < middle) & (middle < b), middle, (a + b) / 2)
        inside = (a < middle) & (middle < b)
        going, middle = going[inside], middle[inside]
        if not going.size:
            break
        trial_q, trial_p = step(q[going], p[going], middle * size)
        value = function(trial_q, trial_p)
        in_vain[going] += 1
        nearer = abs(value) < abs(best[going])
        found = going[nearer]
        best[found], share[found], in_vain[found] = value[nearer], middle[nearer], 0
        best_q[found], best_p[found] = trial_q[nearer], trial_p[nearer]
        for side, near, f_near, f_far in ((-1, low, f_low, f_high), (1, high, f_high, f_low)):
            here = ((value < 0) == (f_low[going] < 0)) == (side < 0)
            at = going[here]
            f_far[at] = np.where(turn[at] == side, f_far[at] / 2, f_far[at])
            near[at], f_near[at], turn[at] = middle[here], value[here], side
    return member + begin, (number + share) * size, best_q, best_p


def _variables(
    problem: Setup, found: Sequence[tuple[Any, ...]], rows: Floats, function: _Function, constants: Sequence[float]
) -> Variables:
    d, units = problem.system.dimension, problem.system.units
    member, t, q, p = map(np.concatenate, zip(*found, strict=True))
    crossings = np.bincount(member, minlength=len(rows))
    place = member, np.arange(len(member)) - (np.cumsum(crossings) - crossings)[member]
    over, shape = ("member", "crossing"), (len(rows), int(crossings.max()))

    def table(values: Floats) -> Floats:
        filled = np.full((*shape, *values.shape[1:]), np.nan)
        filled[place] = values
        return filled

    def energy(q: Floats, p: Floats) -> Floats:
        return np.broadcast_to(problem.system.energy(tuple(q.T), tuple(p.T), constants), len(q))

    starts = energy(rows[:, :d], rows[:, d:])
    relative = bool(starts.all())  # one unit for all members
    error = (energy(q, p) - starts[member]) / (abs(starts[member]) if relative else 1.0)
    unit = "1" if relative else units["energy"]
    q, p = table(q), table(p)
    return {
        "t": (over, table(t), described("time of the crossing", units["t"])),
        "q": ((*over, "component"), q, described("position", units["q"])),
        "p": ((*over, "component"), p, described("momentum", units["p"])),
        "energy_error": (over, table(error), described(f"(H - H0){'/|H0|' if relative else ''} at the crossing", unit)),
        "surface": (over, function(q, p), described("function that is zero on the surface", "unknown")),
        "crossings": (("member",), crossings, described("number of crossings")),
    }
