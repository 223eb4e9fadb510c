"""Deviations from orbits by the exact derivative of the discrete map, and the indicators of chaos that they give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import (
    Batch,
    Blocks,
    Filled,
    energy_unit,
    evaluations_of,
    sample_marks,
    sample_size,
    surface_limit,
)
from nearharmonic.engine.description import (
    parameter_variables,
    run_attributes,
    status_variable,
    step_used,
    without_members,
)
from nearharmonic.engine.kernels import with_lanes
from nearharmonic.engine.numbers import rows_of
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_THREADS, checked_count, checked_samples
from nearharmonic.engine.setup import CLOCK, STATE, Setup, Start, asked_steps, check_memory, members_are_given, start_of
from nearharmonic.engine.trajectory import Solution
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, Integers, quasi_random, student_975
from nearharmonic.numerics.written import is_real
from nearharmonic.output.store import Variables, assembled, described
from nearharmonic.systems.quantities import Vector
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr


# --- Systems whose runs are derivatives of runs of another system.
#
# The derivative of a splitting step is the same step applied to a separable Hamiltonian of twice as many coordinates,
# K = grad T(p).w + grad V(q).u, with coordinates (q, u) and momenta (w, p): q and p follow the orbit, u and w are the
# exact derivative of the discrete map times the initial deviation. Deviations therefore use the kernels of ordinary
# systems. Poisson brackets commute with this extension, so that kicks of a modified potential have the same property.


@remembered
def tangent_system(system: System) -> System:
    """Return the system K of a ``system`` of d coordinates.

    It has 2 d coordinates and the same parameters. If V depends on time, K belongs to the extended system with the
    coordinates (q, t). Its initial deviation has length 1, along the first coordinate.
    """
    formulas, (q0, p0) = system.formulas(), system.extended_start(str)
    d = formulas.dimension

    def V(x: Vector, *parameters: Any) -> Any:
        return product(formulas.grad_V(x[:d], *parameters), x[d:])

    def T(y: Vector, *parameters: Any) -> Any:
        return product(formulas.grad_T(y[d:], *parameters), y[:d])

    rest = ("0",) * d
    return System(
        name=f"{system.name}_tangent", V=V, T=T, q0=(*q0, "1", *rest[1:]), p0=(*rest, *p0), t_end=system.t_end,
        parameters=system.parameters, source=system.source,
    )  # fmt: skip


def check_differentiable(system: System) -> None:
    """Raise an error for a system whose step has no derivative here: it is regularised, or its V is a function of
    numba.
    """
    if system.regularisation is not None:
        what = "it is regularised, and its steps are in a fictitious time, which depends on the orbit"
        raise bad_setting("system", system.name, what)
    if not system.energies[0].traced:
        what = "its V is a function of numba, which has no second derivatives: write it as a formula"
        raise bad_setting("system", system.name, what)


def product(one: Vector, other: Vector) -> Any:
    """Return the sum of the products of components."""
    terms = [a * b for a, b in zip(one, other, strict=True)]
    return sum(terms[1:], terms[0])


# --- Frames of deviations: orthonormal bases that follow a tangent map, and the indicators of chaos that they give.
#
# Deviations of a chaotic orbit turn into one direction, and their differences would be lost in rounding errors. A
# frame keeps an orthonormal basis Q instead and the triangular factors R of each part of a run (Benettin, Galgani,
# Giorgilli & Strelcyn 1980, Meccanica 15, 9 and 21). The deviations themselves are Q C, with C the product of the
# factors and its columns scaled to length 1, so that their volumes are products of diagonal entries, without
# cancellation.

#: Smallest part of a deviation of length 1 that is perpendicular to those before it.
INDEPENDENT = 1e-10


def initial_deviations(given: object, dimension: int) -> Floats:
    """Return initial deviations (k, 2 d), q-parts and then p-parts: ``given``, finite and linearly independent.

    Their number k gives the first k of 2 d orthonormal ones in fixed directions, none of which is parallel to a
    coordinate or to a plane of symmetry.
    """
    n = 2 * dimension
    allowed = f"an integer from 1 to {n}, or an array (k, {n}) of {dimension} q-parts and {dimension} p-parts a row"
    if is_real(given) and isinstance(given, Integral):
        if not 1 <= int(given) <= n:
            raise bad_setting("deviations", given, allowed)
        return orthonormal(quasi_random(n, n, 0).T[:, :, None] - 0.5)[0][:, : int(given), 0].T.copy()
    rows = np.ascontiguousarray(rows_of("deviations", given, n, allowed)[..., 0])
    if len(rows) > n:
        raise bad_setting("deviations", f"array of shape {rows.shape}", allowed)
    with np.errstate(all="ignore"):
        triangle = orthonormal(unit_rows(rows).T[:, :, None])[1]
    if not (np.diagonal(triangle[..., 0]) > INDEPENDENT).all():
        raise bad_setting("deviations", f"rows of rank below {len(rows)}", "linearly independent rows")
    return rows


def unit_rows(rows: Floats) -> Floats:
    """Return rows (k, n) scaled to length 1; the squares of numbers of any size do not overflow."""
    scaled = rows / np.abs(rows).max(axis=1, keepdims=True)
    found: Floats = scaled / _lengths(scaled.T)[:, None]
    return found


def orthonormal(vectors: Floats) -> tuple[Floats, Floats]:
    """Return an orthonormal basis Q (n, k, M) and the triangular factor R (k, k, M) of ``vectors`` = Q R (n, k, M).

    Modified Gram-Schmidt, in a fixed order of operations: the diagonal of R is positive.
    """
    basis, k = vectors.copy(), vectors.shape[1]
    triangle = np.zeros((k, *vectors.shape[1:]))
    for j in range(k):
        triangle[j, j] = length = _lengths(basis[:, j])
        basis[:, j] /= length
        if j + 1 < k:
            triangle[j, j + 1 :] = along = (basis[:, j, None] * basis[:, j + 1 :]).sum(axis=0)
            basis[:, j + 1 :] -= basis[:, j, None] * along
    return basis, triangle


class Frame:
    """Frame of k ``deviations`` (k, n), scaled to length 1, from each of M = ``members`` orbits in n = 2 d dimensions.

    ``basis`` (n, k, M) is orthonormal; its first vector is parallel to the first deviation. ``growth`` (k, M) are the
    logarithms of the factors by which each deviation has grown. The first j numbers of ``stretching`` (k, M) have as
    their sum the logarithm of the factor by which the volume of j deviations has grown.
    """

    def __init__(self, deviations: Floats, members: int) -> None:
        k = len(deviations)
        units = np.repeat(unit_rows(deviations).T[:, :, None], members, axis=2)
        self.basis, self._columns = orthonormal(units)
        self.growth, self.stretching = np.zeros((k, members)), np.zeros((k, members))

    def advance(self, moved: Floats) -> None:
        """Follow a part of a run, which has mapped the basis to the vectors ``moved`` (n, k, M)."""
        self.basis, triangle = orthonormal(moved)
        columns = sum(triangle[:, j, None] * self._columns[j] for j in range(len(triangle)))
        lengths = _lengths(columns)
        self._columns = columns / lengths
        self.growth += log(lengths)
        self.stretching += log(np.einsum("jjm->jm", triangle))

    @property
    def state(self) -> Floats:
        """Basis, deviations in it, growth and stretching (f, M), from which :meth:`resume` goes on."""
        parts = self.basis, self._columns, self.growth, self.stretching
        return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts])

    def resume(self, state: Floats) -> None:
        """Go on from a :attr:`state`."""
        n, k, members = self.basis.shape
        parts = np.split(state, np.cumsum([n * k, k * k, k]))
        self.basis, self._columns = parts[0].reshape(n, k, members), parts[1].reshape(k, k, members)
        self.growth, self.stretching = parts[2].copy(), parts[3].copy()

    @property
    def deviations(self) -> Floats:
        """The deviations (n, k, M), scaled to length 1."""
        found: Floats = sum(self.basis[:, j, None] * self._columns[j] for j in range(self.basis.shape[1]))
        return found

    @property
    def sali(self) -> Floats:
        """The smaller of the lengths of the sum and of the difference of the first two deviations of length 1 (M,)."""
        along, across = self._columns[:2, 1]
        found: Floats = across * np.sqrt(2 / (1 + np.abs(along)))
        return found

    @property
    def gali(self) -> Floats:
        """Volumes (k - 1, M) of the parallelepipeds of the first 2, 3, ..., k deviations of length 1."""
        volumes: Floats = np.cumprod(np.einsum("jjm->jm", self._columns), axis=0)
        return volumes[1:]


def _lengths(vectors: Floats) -> Floats:
    """Lengths of vectors along the first axis, summed in a fixed order."""
    found: Floats = np.sqrt((vectors * vectors).sum(axis=0))
    return found


# --- Evolution of orbits with their deviations: short parts of a run, after each of which the deviations are rescaled.

#: Most steps between two rescalings. Methods take some ten steps a period, so that a deviation grows by few powers of
#: ten between them, of the hundreds that a double has, and the vectors of a frame remain apart.
PART = 100
#: Readings of a length in a run, at least, for the time integral of MEGNO, unless the run has fewer steps.
READINGS = 250
#: Blocks of equal length for the interval of the exponent.
BLOCKS = 10
#: Lanes that a thread integrates at a time, and bytes of their readings.
LANES, BYTES = 2048, 64_000_000


@dataclass(frozen=True)
class Schedule:
    """Times of a run of ``steps`` steps at which deviations are rescaled, read and kept.

    ``kept`` (S,) are the steps of the samples, first 0; ``parts`` the marks of each part of the run from its own start.
    """

    steps: int
    kept: Integers
    parts: tuple[tuple[int, ...], ...]

    @property
    def readings(self) -> int:
        """Most readings of a part."""
        return max(map(len, self.parts))

    @property
    def bounds(self) -> list[int]:
        """Steps (11,) of the ends of the blocks: the readings nearest to tenths of the run, fewer for short runs."""
        ends = np.cumsum([part[-1] for part in self.parts])
        begins = [0, *ends[:-1].tolist()]
        times = [begin + mark for begin, part in zip(begins, self.parts, strict=True) for mark in part[1:]]
        marks = np.array([0, *times])
        wanted = self.steps * np.arange(BLOCKS + 1) / BLOCKS
        return sorted({int(marks[np.abs(marks - x).argmin()]) for x in wanted})


def schedule_of(steps: int, samples: int) -> Schedule:
    """Return the schedule of a run of ``steps`` steps with at most so many ``samples``."""
    kept = sample_marks(np.array([steps]), samples)[0]
    parts: list[tuple[int, ...]] = []
    apart = max(1, steps // READINGS)
    for begin, end in zip(kept[:-1].tolist(), kept[1:].tolist(), strict=True):
        count = -(-(end - begin) // PART)
        edges = [(end - begin) * i // count for i in range(count + 1)]
        for size in np.diff(edges).tolist():
            readings = max(1, size // apart)
            parts.append(tuple(size * i // readings for i in range(readings + 1)))
    return Schedule(steps, kept, tuple(parts))


class Evolution:
    """Orbits (M) at samples (S) of a ``schedule`` with k deviations of n = 2 d components.

    ``problem``: runs of the tangent system of 2 D coordinates, without energies; D is d, and the time if V depends on
    it. ``begin``: initial states of the orbits. ``initial`` (k, n): initial deviations, in place of which ``earlier``
    (M, f + 3) is ``running`` of the evolution that goes on.

    :meth:`follow` fills ``states`` (M, S, 4, D) of the integrated coordinates, as a kernel lays them out; ``growth``
    and ``stretching`` (M, S, k), logarithms as in :class:`Frame`; ``sali`` (M, S) and ``gali`` (M, S, k - 1), if
    k > 1; ``megno`` (M, S); ``blocks`` (M, 10), growth of the first deviation in each block; ``deviations`` (M, k, n)
    at the end; ``left_at`` (M,), the step at which a state or deviation was not finite, or 0; ``unsolved`` (M,), True
    where the equations of an implicit step could not be solved there; ``evaluations`` (M,) of the gradient by all
    lanes; ``running`` (M, f + 3), the frame at the end, the time since the deviations began, and the means of MEGNO.
    """

    def __init__(
        self, problem: Setup, begin: Start, initial: Floats, earlier: Floats | None, schedule: Schedule
    ) -> None:
        self.problem, self.begin, self.initial, self.earlier, self.schedule = problem, begin, initial, earlier, schedule
        M, S, D, (k, n) = begin.members, schedule.kept.size, begin.state.shape[1] // 4, initial.shape
        self.states, self.growth, self.stretching, self.sali, self.gali, self.megno = (
            np.full((M, S, *shape), np.nan) for shape in ((4, D), (k,), (k,), (), (k - 1,), ())
        )
        self.blocks, self.deviations, self.running = (
            np.full((M, *shape), np.nan) for shape in ((len(schedule.bounds) - 1,), (k, n), (running_size(k, n),))
        )
        self.left_at, self.evaluations = np.zeros(M, np.int64), np.zeros(M, np.int64)
        self.unsolved = np.zeros(M, bool)

    def follow(self, threads: int) -> None:
        """Integrate all orbits, in blocks that threads share."""
        members, k = self.begin.members, len(self.initial)
        numbers = self.schedule.readings * sample_size(2 * self.states.shape[-1])
        size = max(1, min(LANES, BYTES // (8 * numbers)) // k)

        def compute(i: int) -> None:
            with np.errstate(all="ignore"):  # a diverged orbit is a result
                self._follow(slice(i * size, min((i + 1) * size, members)))

        steps = members * k * self.schedule.steps
        Blocks(compute, -(-members // size), steps=steps, cost=self.problem.cost).execute(threads)

    def _follow(self, block: slice) -> None:
        """Fill the rows of a block of orbits, with a lane for each deviation of each orbit."""
        members, k, kept = block.stop - block.start, len(self.initial), self.schedule.kept.tolist()
        frame, D = Frame(self.initial, members), self.states.shape[-1]
        begin = self.begin.state[block] if len(self.begin.state) > 1 else self.begin.state
        rows = np.zeros((members, k, 4, 2 * D))
        rows[:, :, :2, :D] = (orbit := begin.reshape(-1, 1, 4, D))[:, :, :2]
        rows[:, :, 2:, D:] = orbit[:, :, 2:]
        megno, step, sample = _Megno(members, self.schedule.bounds), 0, 1
        tau = float(self.problem.end) / self.schedule.steps
        if self.earlier is not None:
            *state, time, integral, mean = self.earlier[block].T
            frame.resume(np.array(state))
            megno.resume(time / tau, frame.growth[0], integral, mean)
        self._keep((block, 0), rows, frame, megno.mean)
        moves = self.problem.moves([self.problem.end / self.schedule.steps])
        batches: dict[tuple[int, ...], Batch] = {}
        for part in self.schedule.parts:
            self._insert(rows, frame.basis)
            batch = batches.get(part) or batches.setdefault(part, self._batch(part, block, rows, moves))
            batch.start[:] = rows.reshape(members * k, -1)
            batch.run(members * k * part[-1])
            filled = batch.filled
            states = filled.states.reshape(members, k, len(part), 4, 2 * D)
            self._note_left(filled, block, step, part[-1])
            squares = sum(x * x for x in self._vectors(states[:, 0, 1:], low=False))  # in a fixed order
            megno.read(step, part, frame.growth[0] + log(np.sqrt(squares)))
            rows = states[:, :, 1].copy()  # the end of all lanes but the first
            rows[:, 0] = states[:, 0, -1]
            frame.advance(self._vectors(rows))
            step += part[-1]
            if step == kept[sample]:
                self._keep((block, sample), rows, frame, megno.mean)
                sample += 1
        self.blocks[block] = np.diff(megno.at_bounds, axis=0).T
        self.deviations[block] = frame.deviations.transpose(2, 1, 0)
        self.running[block] = np.concatenate([frame.state, megno.state(tau)]).T

    def _batch(self, part: tuple[int, ...], block: slice, rows: Floats, moves: Floats) -> Batch:
        """Return a batch for a part of the run of a block of orbits."""
        problem, parameters, k, lanes = (
            self.problem,
            self.begin.parameters,
            rows.shape[1],
            rows.shape[0] * rows.shape[1],
        )
        parameters = parameters.copy() if len(parameters) == 1 else np.repeat(parameters[block], k, axis=0)
        numerics = with_lanes(problem.numerics, np.full(lanes, part[-1]), problem.system, problem.tableau)
        marks = np.full((lanes, len(part)), -1)
        marks[:, :2] = 0, part[-1]
        marks[::k] = part  # MEGNO reads the first deviation alone
        start = rows.reshape(lanes, -1).copy()
        return problem.batch(moves.copy(), marks, np.zeros(lanes, np.int64), start, parameters, numerics)

    def _insert(self, rows: Floats, basis: Floats) -> None:
        """Write a basis (n, k, M) into the rows (M, k, 4, 2 D); deviations of the time remain 0."""
        d, D = len(basis) // 2, rows.shape[-1] // 2
        rows[:, :, :2, D:] = rows[:, :, 2:, :D] = 0.0
        rows[:, :, 0, D : D + d], rows[:, :, 2, :d] = basis[:d].T, basis[d:].T

    def _vectors(self, rows: Floats, low: bool = True) -> Floats:
        """Return the deviations (n, ...) in rows (..., 4, 2 D), with the digits below doubles if ``low``."""
        d, D = self.initial.shape[1] // 2, rows.shape[-1] // 2
        high, below = (np.concatenate([rows[..., i, D : D + d], rows[..., i + 2, :d]], axis=-1) for i in (0, 1))
        return np.ascontiguousarray((high + below if low else high).T)

    def _note_left(self, filled: Filled, block: slice, step: int, steps: int) -> None:
        """Note where lanes left, and count the evaluations of a part of so many steps."""
        k, never, known = len(self.initial), np.iinfo(np.int64).max, self.left_at[block]
        left_at = filled.left_at.reshape(-1, k)
        lanes = np.where(left_at > 0, left_at, never).min(axis=1)
        new = (known == 0) & (lanes < never)
        known[new] = step + lanes[new]
        made, failed = evaluations_of(self.problem.tableau, np.full(left_at.size, steps), filled.running)
        self.unsolved[block] |= new & failed.reshape(-1, k).any(axis=1)
        self.evaluations[block] += made.reshape(-1, k).sum(axis=1)

    def _keep(self, place: tuple[slice, int], rows: Floats, frame: Frame, megno: Floats) -> None:
        D = rows.shape[-1] // 2
        self.states[place][:, :2], self.states[place][:, 2:] = rows[:, 0, :2, :D], rows[:, 0, 2:, D:]
        self.growth[place], self.stretching[place], self.megno[place] = frame.growth.T, frame.stretching.T, megno
        if len(frame.growth) > 1:
            self.sali[place], self.gali[place] = frame.sali, frame.gali.T


def running_size(count: int, n: int) -> int:
    """Return the numbers of a member that a continuation of ``count`` deviations of n components needs."""
    return count * (n + count + 2) + 3


class _Megno:
    """Time integrals of the logarithm of the length of a deviation, by the trapezoidal rule on its readings.

    With L = ln|delta|, Y(t) = (2/t) times the integral of s dL(s) = 2 L - (2/t) times the integral of L. Its mean over
    time is kept. Times are counted in steps, as both are ratios of times.
    """

    def __init__(self, members: int, bounds: Sequence[int]) -> None:
        self._begin, self._time, self._length = np.zeros(members), np.zeros(members), np.zeros(members)
        self._integral, self._last, self._total = np.zeros(members), np.zeros(members), np.zeros(members)
        self._bounds = {bound: i for i, bound in enumerate(bounds)}
        #: L at the ends of the blocks.
        self.at_bounds: Floats = np.zeros((len(bounds), members))

    def read(self, step: int, part: Sequence[int], lengths: Floats) -> None:
        """Take the readings ``lengths`` (n, M) of L at the n later marks of a part that begins at ``step``."""
        apart = np.diff(np.array(part, float))[:, None] / 2
        times = self._begin + (step + np.array(part[1:], float)[:, None])
        before = np.concatenate([self._length[None], lengths[:-1]])
        integral = np.cumsum(np.concatenate([self._integral[None], apart * (before + lengths)]), axis=0)[1:]
        values = 2 * (lengths - integral / times)
        earlier = np.concatenate([self._last[None], values[:-1]])
        self._total = np.cumsum(np.concatenate([self._total[None], apart * (earlier + values)]), axis=0)[-1]
        self._time, self._length, self._integral, self._last = times[-1], lengths[-1], integral[-1], values[-1]
        for mark, length in zip(part[1:], lengths, strict=True):
            if (place := self._bounds.get(step + mark)) is not None:
                self.at_bounds[place] = length

    @property
    def mean(self) -> Floats:
        """Mean of Y over the time so far (M,), NaN at its start."""
        return self._total / self._time

    def state(self, tau: float) -> Floats:
        """Return the time with its sign, the mean of L over it, and the mean of Y (3, M)."""
        return np.stack([self._time * tau, self._integral / self._time, self.mean])

    def resume(self, time: Floats, length: Floats, integral: Floats, mean: Floats) -> None:
        """Go on from L after so much ``time``, and the means of L and Y over it."""
        self._begin = self._time = time
        self._length, self._integral, self._total = length.copy(), integral * time, mean * time
        self._last = 2 * (length - integral)
        self.at_bounds[0] = length


# --- Results of deviations as described variables and Datasets.
def deviations_dataset(
    problem: Setup, found: Evolution, *, only_end: bool, several: bool, asked_tau: float
) -> xr.Dataset:
    """Return the Dataset of :func:`nearharmonic.tangent` from the arrays ``found``.

    ``only_end`` leaves out t = 0, and ``several`` gives a dimension of members.
    """
    begin, system, kept, steps = found.begin, problem.system, found.schedule.kept, found.schedule.steps
    unit = system.units["t"]
    times = kept * float(problem.end) / steps + 0.0
    elapsed = abs(times) if found.earlier is None else abs(times + found.earlier[0, -3])
    error, H0 = energy_errors(problem, found.states, begin.parameters, begin.reference[0])
    beyond = ~(np.abs(error) <= surface_limit(system, problem.scale))
    seen = np.where(beyond.any(axis=1), kept[beyond.argmax(axis=1)], 0)
    left_at = np.where((found.left_at > 0) & ((seen == 0) | (found.left_at < seen)), found.left_at, seen)
    gone = (left_at[:, None] > 0) & (kept >= left_at[:, None])
    rate = "1" if unit == "1" else f"1/{unit}"
    with np.errstate(all="ignore"):
        exponent, spectrum = found.growth[..., 0] / elapsed, found.stretching / elapsed[:, None]
        own = (found.growth[:, -1, 0] - found.growth[:, 0, 0]) / abs(times[-1])
    d = system.dimension
    q, p = found.states[..., 0, :d], found.states[..., 2, :d]
    timed = ", H = T + V + p_t" if system.time_dependent else ""
    over_sample: dict[str, tuple[tuple[str, ...], Any, dict[str, str]]] = {
        "q": (("component",), q, described("position", system.units["q"])),
        "p": (("component",), p, described("momentum", system.units["p"])),
        "energy_error": ((), error, described(f"(H - H0)/|H0|, or over the system's scale of energies{timed}")),
        "lyapunov_exponent": ((), exponent, described("ln|delta|/t of the first deviation delta up to the time", rate)),
        "lyapunov_spectrum": (("deviation",), spectrum, described("mean logarithmic growth of the axes", rate)),
        "growth": (("deviation",), found.growth, described("ln(|delta|/|delta(0)|)")),
        "megno": ((), found.megno, described("mean over time of the mean exponential growth of nearby orbits")),
    }
    if found.gali.shape[-1]:
        over_sample["sali"] = (), found.sali, described("smaller alignment index of the first two deviations")
        over_sample["gali"] = ("order",), found.gali, described("volume of so many deviations of length 1")
    for k, (name, clock) in enumerate(zip(STATE, CLOCK, strict=True)):
        if k % 2 and problem.numerics.compensated:
            notes = described(f"digits below {name[0]}", system.units[name[0]])
            over_sample[name] = ("component",), found.states[..., k, :d], notes
        if system.time_dependent:
            notes = described(clock.replace("_", " "), unit if k < 2 else system.units["energy"])
            over_sample[clock] = (), found.states[..., k, d], notes
    variables: Variables = {}
    for name, (dimensions, values, notes) in over_sample.items():
        kept_values = np.where(gone.reshape(*gone.shape, *(1,) * len(dimensions)), np.nan, values)[:, int(only_end) :]
        variables[name] = ("member", "sample", *dimensions), kept_values, notes
    bounds = np.diff(found.schedule.bounds) / steps * abs(float(problem.end))
    rates, half = found.blocks / bounds, np.full(len(own), np.nan)
    if (count := len(bounds)) > 1:
        spread = rates - rates.mean(axis=1, keepdims=True)
        half = student_975(count - 1) * np.sqrt((spread * spread).sum(axis=1)) / sqrt((count - 1) * count)
    half[left_at > 0] = np.nan
    deviations = np.where(left_at[:, None, None] > 0, np.nan, found.deviations)
    over, what = ("member", "deviation", "component"), "end of the 95 % interval of the exponent, from blocks of time"
    worst = np.where(left_at > 0, inf, np.fmax.reduce(np.abs(error), axis=1))
    variables |= {
        "lyapunov_low": (("member",), own - half, described(f"lower {what}", rate)),
        "lyapunov_high": (("member",), own + half, described(f"upper {what}", rate)),
        "deviation_q": (over, deviations[..., :d], described("q-part of the final deviation of length 1")),
        "deviation_p": (over, deviations[..., d:], described("p-part of the final deviation of length 1")),
        "max_energy_error": (("member",), worst, described("maximum of |energy_error| over the samples, inf if lost")),
        "initial_energy": (("member",), H0, described("energy H0 at the start", system.units["energy"])),
        "initial_energy_low": (("member",), 0 * H0, described("digits below initial_energy", system.units["energy"])),
        "running": (("member", "running_component"), found.running, described("frame, time and means", "unknown")),
        "status": status_variable("member", problem, left_at, found.unsolved),
        "evaluations": (("member",), found.evaluations, described("evaluations of the gradient by all lanes")),
        "diverged_at": (("member",), left_at, described("step at which divergence was seen, 0 if none was")),
    }
    variables |= {
        "t": (("sample",), times[int(only_end) :] + begin.t, described("time", unit)),
        "tau": step_used(problem, steps),
        "steps": ((), steps, described("steps that cover [0, t_end]")),
    }
    variables = variables | parameter_variables(problem, begin.parameters) if several else without_members(variables)
    if "gali" in variables:
        number = "number of the deviations of a volume"
        variables["order"] = ("order",), np.arange(2, len(found.initial) + 1), described(number)
    attributes = run_attributes(problem, begin, asked_tau) | {"energy": "samples"}
    coordinates = ["t", "order", *(name for name in variables if name.startswith("parameter_"))]
    return assembled(variables, coordinates, attributes)


def energy_errors(problem: Setup, states: Floats, parameters: Floats, reference: Any) -> tuple[Floats, Floats]:
    """Return relative energy errors (M, S) of states (M, S, 4, D) in double precision, and H0 (M,).

    H0 is ``reference``, or where this is NaN the energy of the first state.
    """
    system = problem.system
    d = system.dimension
    q, p = (tuple(np.moveaxis(states[..., part, :], -1, 0)) for part in (0, 2))
    constants: Sequence[Any] = [column[:, None] if len(column) > 1 else column[0] for column in parameters.T[::2]]
    with np.errstate(all="ignore"):
        t = q[d] if system.time_dependent else None
        H = np.broadcast_to(system.energy(q[:d], p[:d], constants, t), q[0].shape)
        H = H + p[d] if system.time_dependent else H
        H0 = np.where(np.isnan(reference), H[:, 0], reference)
        return (H - H0[:, None]) / energy_unit(H0, problem.scale)[:, None], H0


def tangent(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    t_end: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    samples: int = 100,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    deviations: object = 2,
    split: str = KINETIC_POTENTIAL,
    threads: int = 1,
    start: xr.Dataset | Solution | None = None,
) -> xr.Dataset:
    """Follow small deviations from orbits by the exact derivative of the discrete map, for indicators of chaos.

    The derivative of a step is the same step of a separable system of twice as many coordinates, whose formulas are
    derived from the formulas of ``system``. It is symplectic to rounding. The interval [0, t_end] has
    ``steps = max(1, round(|t_end| / tau))`` equal steps. A deviation is integrated in a SIMD lane of its own.
    Deviations are orthonormalised after at most a hundred steps, so that none overflows.

    Parameters
    ----------
    system, integrator : str, or System and Tableau
        Problem and method, or their names. V must be a formula, as it is differentiated twice.
    tau, t_end, precision, summation, first
        As for :func:`nearharmonic.integrate`. In extended precision the orbit has about 32 digits, and deviations are
        rounded to doubles after each part of a run.
    samples : int
        Most samples, first t = 0, as evenly spaced as whole steps allow; 1 keeps the end alone.
    q0, p0 : (d,) or (M, d) array of float, optional
        Initial values; rows are for M members, with a dimension ``member``. Rows of decimal strings are exact.
    parameters : mapping, optional
        Values by name: one for all members, or (M,) arrays of float.
    deviations : int or (k, 2 d) array of float
        Initial deviations from each orbit, d q-parts and then d p-parts a row; or their number k, from 1 to 2 d, for k
        orthonormal ones in fixed directions, the same in each call. An exponent needs one, SALI two, the spectrum 2 d.
    split : {"kinetic_potential"}
        As for :func:`nearharmonic.integrate`; no other split has deviations.
    threads : int
        Threads that share the members; bits do not depend on it.
    start : xarray.Dataset or Solution, optional
        Continue the orbits from the last sample of this result, as for :func:`nearharmonic.integrate`. The deviations
        and indicators of a result of this function go on as in one run, to rounding; others begin there.

    Returns
    -------
    xarray.Dataset
        Over sample, and over member if there are several. At t = 0 ratios over the time are NaN. Values
        after divergence are NaN. Lengths are of (q, p) as numbers in the units of the system:

        - ``q`` and ``p`` over component, and ``energy_error`` in double precision.
        - ``growth`` over deviation: logarithm of the length of a deviation over its initial length.
        - ``lyapunov_exponent``: growth of the first deviation over the time, the largest exponent for long times.
        - ``lyapunov_spectrum`` over deviation: mean growth of the axes of the frame, descending for long times.
        - ``sali``: smaller length of the sum and the difference of the first two deviations of length 1.
        - ``gali`` over order: volume of the parallelepiped of so many deviations of length 1.
        - ``megno``: mean over time of the mean exponential growth of nearby orbits. It tends to 2 for a quasi-periodic
          orbit, to 0 for a harmonic oscillator, and grows like half the exponent times t for a chaotic orbit.

        At the end, over member if there are several:

        - ``lyapunov_low``, ``lyapunov_high``: 95 % interval of Student's t from ten blocks of the time of this call. It
          covers the exponent of the chaotic region of the orbit if a block is longer than the memory of the orbit. It
          does not cover the 0 of a regular orbit, for which growth over time falls like (ln t)/t.
        - ``deviation_q``, ``deviation_p`` over (deviation, component): final deviations, scaled to length 1. Times
          exp(growth) and the initial length, they are the tangent map times the initial deviation.
        - ``max_energy_error`` over the samples, ``initial_energy``, ``status``, ``diverged_at``, ``evaluations`` of the
          gradient by all lanes of the orbit; and for all members ``steps`` and ``tau``.

    Raises
    ------
    NearharmonicError
        An unknown name, a setting outside what is allowed, or a system that cannot be differentiated twice, before any
        work.
    KeyboardInterrupt
        Ctrl-C.

    Notes
    -----
    Spectrum and frames: Benettin, Galgani, Giorgilli & Strelcyn (1980), Meccanica 15, 9. SALI: Skokos (2001), J. Phys.
    A 34, 10029. GALI: Skokos, Bountis & Antonopoulos (2007), Physica D 231, 30. MEGNO: Cincotta & Simo (2000), Astron.
    Astrophys. Suppl. 147, 205; Cincotta, Giordano & Simo (2003), Physica D 182, 151. Derivative of a step as a
    step: Skokos & Gerlach (2010), Phys. Rev. E 82, 036704.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> starts = {"q0": [[0, 0.1], [0, -0.15]], "p0": [[0.4, 0.1], [0.49, 0]]}
    >>> orbits = nh.tangent("henon_heiles", "babps8o7h", 0.5, t_end=2000, **starts)
    >>> (orbits.megno.isel(sample=-1) > 4).values.tolist()
    [False, True]
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy="none",
        split=checked_split(split),
    )  # fmt: skip
    subject = problem.system
    check_differentiable(subject)
    if isinstance(start, Solution):
        start = start.to_dataset()
    begin = start_of(problem, q0, p0, parameters, start, several=True)
    earlier = None if start is None else earlier_indicators(problem, start, deviations)
    rows = initial_deviations(deviations if earlier is None else earlier.sizes["deviation"], subject.dimension)
    kept, (steps, asked_tau) = checked_samples(samples), asked_steps(problem, tau)
    threads = checked_count("threads", threads, MOST_THREADS)
    schedule = schedule_of(steps, max(kept, 2))
    extended = Setup(
        tangent_system(subject), problem.tableau, t_end=problem.t_end, precision=precision, summation=summation,
        energy="none",
    )  # fmt: skip
    going_on = None if earlier is None else np.atleast_2d(earlier["running"].values)
    numbers = begin.members * schedule.kept.size * (4 * problem.states_dimension + 3 * len(rows) + 2)
    check_memory(f"the samples of {begin.members} members", numbers, samples)
    found = Evolution(extended, begin, rows, going_on, schedule)
    found.follow(threads)
    several = members_are_given(q0, p0, parameters, start)
    return deviations_dataset(problem, found, only_end=kept == 1, several=several, asked_tau=asked_tau)


def earlier_indicators(problem: Setup, start: xr.Dataset, deviations: object) -> xr.Dataset | None:
    """Return ``start``, a result of this function that goes on; None if it is a result without deviations.

    Other ``deviations``, the other direction of time and damaged numbers raise an error.
    """
    if "deviation" not in start.sizes:
        return None
    k = start.sizes["deviation"]
    if not (isinstance(deviations, int) and deviations in (2, k)):
        raise bad_setting("deviations", deviations, f"{k}, the number of deviations in start=")
    start = start.transpose("member", "sample", ..., missing_dims="ignore")
    n, running = 2 * problem.system.dimension, start.get("running", start.q)
    size, values = running_size(k, n), running.values
    if running.dims[-1] != "running_component" or values.shape[-1] != size or not np.isfinite(values).all():
        raise bad_setting("start.running", f"{values.dtype} of shape {values.shape}", f"{size} finite numbers a member")
    if not np.array_equal(start["growth"].isel(sample=-1).values, values[..., k * (n + k) : k * (n + k + 1)]):
        raise bad_setting("start", "a result without the last sample of the run", "one with its last sample")
    if (values[..., -3] * float(problem.end) <= 0).any():
        raise bad_setting("t_end", problem.t_end, "the sign of the time in start=: indicators go one way")
    return start


def checked_split(split: object) -> str:
    """Return ``split``, if a derivative is implemented for it."""
    if split != KINETIC_POTENTIAL:
        raise bad_setting("split", split, f"{KINETIC_POTENTIAL}: derivatives are of kicks and drifts alone")
    return KINETIC_POTENTIAL
