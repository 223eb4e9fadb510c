"""Derivatives of runs: linearised systems, frames of deviations, and their evolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import Any

import numpy as np

from nearharmonic.core.number import Constant
from nearharmonic.engine import execution
from nearharmonic.engine.batch import sample_marks
from nearharmonic.engine.execution import Batch, Filled, evaluations_of, sample_size
from nearharmonic.engine.kernels import with_lanes
from nearharmonic.engine.numbers import rows_of
from nearharmonic.engine.setup import Setup, Start
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, Integers, quasi_random
from nearharmonic.numerics.written import is_real
from nearharmonic.systems.energy import MassKineticEnergy, takes_parameters
from nearharmonic.systems.quantities import Vector
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

# --- Systems whose runs are derivatives of runs of another system.
#
# The derivative of a splitting step is the same step applied to a separable Hamiltonian of twice as many coordinates,
# K = grad T(p).w + grad V(q).u, with coordinates (q, u) and momenta (w, p): q and p follow the orbit, u and w are the
# exact derivative of the discrete map times the initial deviation. Deviations therefore use the kernels of ordinary
# systems. Poisson brackets commute with this extension, so that kicks of a modified potential have the same property.


@remembered
def tangent_system(system: System) -> System:
    """Return the system K of a ``system`` of d coordinates.

    It has 2 d coordinates and the same parameters. If V depends on time, K is that of the extended system with the
    coordinates (q, t). Its initial deviation has length 1, along the first coordinate.
    """
    formulas, (q0, p0) = system.formulas(), system.extended_start(str)
    d = formulas.dimension

    def V(x: Vector, *parameters: Any) -> Any:
        return _product(formulas.grad_V(x[:d], *parameters), x[d:])

    def T(y: Vector, *parameters: Any) -> Any:
        return _product(formulas.grad_T(y[d:], *parameters), y[:d])

    rest = ("0",) * d
    return System(
        name=f"{system.name}_tangent", V=V, T=T, q0=(*q0, "1", *rest[1:]), p0=(*rest, *p0), t_end=system.t_end,
        parameters=system.parameters, source=system.source,
    )  # fmt: skip


@remembered
def sensitive_system(system: System) -> System:
    """Return the system K of a ``system`` of d coordinates in which the P parameters are coordinates.

    A parameter theta of V is a coordinate without kinetic energy; its momentum collects -dK/dtheta. Its coordinates are
    (q, u, theta) and its momenta (w, p, pi). Where T has parameters too, a second copy of them are momenta, whose
    coordinates chi collect dK/dtheta: (q, u, theta, chi) and (w, p, pi, theta). The derivative with respect to theta is
    then pi - chi.
    """
    formulas, (q0, p0), own = system.formulas(), system.extended_start(str), system.constants(str)
    d, count, constants = formulas.dimension, len(own), system.constants(Constant)
    moving = kinetic_parameters(system)

    def V(x: Vector) -> Any:
        return _product(formulas.grad_V(x[:d], *x[2 * d : 2 * d + count]), x[d : 2 * d])

    def T(y: Vector) -> Any:
        parameters = y[2 * d + count :] if moving else constants
        return _product(formulas.grad_T(y[d : 2 * d], *parameters), y[:d])

    rest, none = ("0",) * d, ("0",) * count
    return System(
        name=f"{system.name}_sensitive", V=V, T=T, t_end=system.t_end, source=system.source,
        q0=(*q0, "1", *rest[1:], *own, *(none if moving else ())), p0=(*rest, *p0, *none, *(own if moving else ())),
    )  # fmt: skip


def kinetic_parameters(system: System) -> bool:
    """Return True if T is a function of parameters."""
    if isinstance(system.T, MassKineticEnergy):
        return any(isinstance(mass, int) for mass in system.T.masses)
    return bool(system.parameters) and takes_parameters(system.T)


def check_differentiable(system: System) -> None:
    """Raise an error for a system whose step has no derivative here: it is regularised, or its V is a function of
    numba.
    """
    if system.regularisation is not None:
        what = "it is regularised, and its steps are those of a fictitious time, which depends on the orbit"
        raise bad_setting("system", system.name, what)
    if not system.energies[0].traced:
        what = "its V is a function of numba, which has no second derivatives: write it as a formula"
        raise bad_setting("system", system.name, what)


def _product(one: Vector, other: Vector) -> Any:
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
    logarithms of the factors by which each deviation has grown, and ``stretching`` (k, M) of the factors of the
    volumes: the sum of the first j is that of the volume of j deviations.
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
    """Orbits (M) at samples (S) with k deviations of n = 2 d components, to be filled by :class:`Deviations`.

    ``states`` (M, S, 4, D) of the integrated coordinates, as a kernel lays them out; ``growth`` and ``stretching``
    (M, S, k), logarithms as those of :class:`Frame`; ``sali`` (M, S) and ``gali`` (M, S, k - 1), if k > 1; ``megno``
    (M, S); ``blocks`` (M, 10), growth of the first deviation in each block; ``deviations`` (M, k, n) at the end;
    ``left_at`` (M,), the step at which a state or deviation was not finite, or 0; ``unsolved`` (M,), True where the
    equations of an implicit step could not be solved there; ``evaluations`` (M,) of the gradient by all lanes;
    ``running`` (M, f + 3), the frame at the end, the time since the deviations began, and the means of MEGNO.
    """

    def __init__(self, schedule: Schedule, M: int, k: int, D: int, n: int) -> None:
        self.schedule, S = schedule, schedule.kept.size
        self.states, self.growth, self.stretching, self.sali, self.gali, self.megno = (
            np.full((M, S, *shape), np.nan) for shape in ((4, D), (k,), (k,), (), (k - 1,), ())
        )
        self.blocks, self.deviations, self.running = (
            np.full((M, *shape), np.nan) for shape in ((len(schedule.bounds) - 1,), (k, n), (running_size(k, n),))
        )
        self.left_at, self.evaluations = np.zeros(M, np.int64), np.zeros(M, np.int64)
        self.unsolved = np.zeros(M, bool)


def running_size(count: int, n: int) -> int:
    """Return the numbers of a member that a continuation of ``count`` deviations of n components needs."""
    return count * (n + count + 2) + 3


@dataclass(frozen=True)
class Deviations:
    """Runs of a tangent system of 2 D coordinates with deviations, without energies.

    ``dimension``: coordinates d of the deviations, D without the time if V depends on it. ``begin``: initial states of
    the M orbits. ``initial`` (k, 2 d): initial deviations, in place of which ``earlier`` (M, f + 3) is ``running`` of
    the evolution that goes on.
    """

    problem: Setup
    dimension: int
    begin: Start
    initial: Floats
    earlier: Floats | None = None

    def follow(self, schedule: Schedule, threads: int) -> Evolution:
        """Return the orbits and their indicators at the samples of a schedule."""
        members, k, D = self.begin.members, len(self.initial), self.begin.state.shape[1] // 4
        found = Evolution(schedule, members, k, D, self.initial.shape[1])
        size = max(1, min(LANES, BYTES // (8 * schedule.readings * sample_size(2 * D))) // k)
        count, rows = -(-members // size), (self.begin.state, self.begin.parameters)

        def compute(i: int) -> None:
            block = slice(i * size, min((i + 1) * size, members))
            start, parameters = (given[block] if len(given) > 1 else given for given in rows)
            with np.errstate(all="ignore"):  # a diverged orbit is a result
                _Block(self, schedule, found, block, start, parameters).follow()

        execution.Blocks(compute, count, steps=members * k * schedule.steps, cost=self.problem.cost).execute(threads)
        return found


@dataclass
class _Block:
    """A block of orbits, with a lane for each deviation of each orbit."""

    runs: Deviations
    schedule: Schedule
    found: Evolution
    block: slice
    start: Floats
    parameters: Floats
    batches: dict[tuple[int, ...], Batch] = field(default_factory=dict)

    def follow(self) -> None:
        """Fill the rows of the results that belong to this block."""
        members, k, kept = self.block.stop - self.block.start, len(self.runs.initial), self.schedule.kept.tolist()
        frame, D = Frame(self.runs.initial, members), self.start.shape[1] // 4
        rows = np.zeros((members, k, 4, 2 * D))
        rows[:, :, :2, :D] = (orbit := self.start.reshape(-1, 1, 4, D))[:, :, :2]
        rows[:, :, 2:, D:] = orbit[:, :, 2:]
        megno, step, sample = _Megno(members, self.schedule.bounds), 0, 1
        tau = float(self.runs.problem.end) / self.schedule.steps
        if self.runs.earlier is not None:
            *state, time, integral, mean = self.runs.earlier[self.block].T
            frame.resume(np.array(state))
            megno.resume(time / tau, frame.growth[0], integral, mean)
        self._keep(0, rows, frame, megno.mean)
        moves = self.runs.problem.moves([self.runs.problem.end / self.schedule.steps])
        for part in self.schedule.parts:
            self._insert(rows, frame.basis)
            batch = self._batch(part, rows.reshape(members * k, -1), moves)
            batch.run(members * k * part[-1])
            filled = batch.filled
            states = filled.states.reshape(members, k, len(part), 4, 2 * D)
            self._note_left(filled, step, part[-1])
            megno.read(step, part, frame.growth[0] + log(self._lengths(states[:, 0, 1:])).T)
            rows = states[:, :, 1].copy()  # the end of all lanes but the first
            rows[:, 0] = states[:, 0, -1]
            frame.advance(self._vectors(rows))
            step += part[-1]
            if step == kept[sample]:
                self._keep(sample, rows, frame, megno.mean)
                sample += 1
        self.found.blocks[self.block] = np.diff(megno.at_bounds, axis=0).T
        self.found.deviations[self.block] = frame.deviations.transpose(2, 1, 0)
        self.found.running[self.block] = np.concatenate([frame.state, megno.state(tau)]).T

    def _batch(self, part: tuple[int, ...], start: Floats, moves: Floats) -> Batch:
        """Return a batch for a part of the run that starts at these rows."""
        batch = self.batches.get(part)
        if batch is not None:
            batch.start[:] = start
            return batch
        problem, lanes = self.runs.problem, len(start)
        shared = self.parameters
        parameters = shared if len(shared) == 1 else np.repeat(shared, len(self.runs.initial), axis=0)
        numerics = with_lanes(problem.numerics, np.full(lanes, part[-1]), problem.system, problem.tableau)
        marks = np.full((lanes, len(part)), -1)
        marks[:, :2] = 0, part[-1]
        marks[:: len(self.runs.initial)] = part  # MEGNO reads the first deviation alone
        scheme = np.zeros(lanes, np.int64)
        batch = problem.batch(moves.copy(), marks, scheme, start.copy(), parameters.copy(), numerics)
        self.batches[part] = batch
        return batch

    def _insert(self, rows: Floats, basis: Floats) -> None:
        """Write a basis (n, k, M) into the rows (M, k, 4, 2 D); deviations of the time remain 0."""
        d, D = self.runs.dimension, rows.shape[-1] // 2
        rows[:, :, :2, D:] = rows[:, :, 2:, :D] = 0.0
        rows[:, :, 0, D : D + d], rows[:, :, 2, :d] = basis[:d].T, basis[d:].T

    def _vectors(self, rows: Floats) -> Floats:
        """Return the deviations (n, k, M) in rows (M, k, 4, 2 D)."""
        d, D = self.runs.dimension, rows.shape[-1] // 2
        high = np.concatenate([rows[:, :, 0, D : D + d], rows[:, :, 2, :d]], axis=-1)
        low = np.concatenate([rows[:, :, 1, D : D + d], rows[:, :, 3, :d]], axis=-1)
        return np.ascontiguousarray((high + low).T)

    def _lengths(self, rows: Floats) -> Floats:
        """Return the lengths (...) of the deviations in rows (..., 4, 2 D), summed in a fixed order."""
        d, D = self.runs.dimension, rows.shape[-1] // 2
        total = np.zeros(rows.shape[:-2])
        for part, column in [(0, D + i) for i in range(d)] + [(2, i) for i in range(d)]:
            total += rows[..., part, column] * rows[..., part, column]
        return np.sqrt(total)

    def _note_left(self, filled: Filled, step: int, steps: int) -> None:
        """Note where lanes left, and count the evaluations of a part of so many steps."""
        tableau, k, never = self.runs.problem.tableau, len(self.runs.initial), np.iinfo(np.int64).max
        left_at = filled.left_at.reshape(-1, k)
        lanes = np.where(left_at > 0, left_at, never).min(axis=1)
        known = self.found.left_at[self.block]
        new = (known == 0) & (lanes < never)
        known[new] = step + lanes[new]
        made, failed = evaluations_of(tableau, np.full(left_at.size, steps), filled.running)
        self.found.unsolved[self.block] |= new & failed.reshape(-1, k).any(axis=1)
        self.found.evaluations[self.block] += made.reshape(-1, k).sum(axis=1)

    def _keep(self, sample: int, rows: Floats, frame: Frame, megno: Floats) -> None:
        found, D = self.found, rows.shape[-1] // 2
        place = self.block, sample
        found.states[place][:, :2], found.states[place][:, 2:] = rows[:, 0, :2, :D], rows[:, 0, 2:, D:]
        found.growth[place], found.stretching[place], found.megno[place] = frame.growth.T, frame.stretching.T, megno
        if len(frame.growth) > 1:
            found.sali[place], found.gali[place] = frame.sali, frame.gali.T


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


# --- Derivatives of an observable with respect to the coefficients of a tableau.
#
# Along the run backwards u = -lambda_p and w = lambda_q are the derivatives of the observable at the end with respect
# to the state of each operator. A kick by c tau adds -c tau grad V(q) to p; the derivative with respect to c is
# therefore tau u.grad V(q), which is tau times the potential of the sensitive system. For a drift it is tau times its
# kinetic energy. All steps are reversed at once, from the states at their ends.

#: Maximum number of numbers of the states at all steps, 1 GB.
MOST_NUMBERS = 125_000_000


def check_coefficients(system: System, tableau: Tableau, steps: int, members: int) -> None:
    """Raise an error for implicit and modified methods, and for runs whose states need too much memory.

    ``system`` is the sensitive system of the run backwards.
    """
    if tableau.implicit or tableau.modified:
        what = "it has no kicks and drifts by V and T alone, with respect to whose coefficients it could be derived"
        raise bad_setting("integrator", tableau.name, what)
    if 4 * system.dimension * steps * members > MOST_NUMBERS:
        most = MOST_NUMBERS // (4 * system.dimension * members)
        raise bad_setting("coefficients", True, f"up to {most} steps here, whose states are in memory, not {steps}")


def coefficient_derivatives(system: System, tableau: Tableau, tau: float, q: Floats, p: Floats) -> dict[str, Floats]:
    """Return the derivatives (M, K) of the observable with respect to the K kicks and to the drifts of a tableau.

    ``q``, ``p`` (M, N, D) are the states of the sensitive ``system`` at the ends of the N steps of size ``tau`` that
    are reversed.
    """
    rows = {"kick": list(map(float, tableau.kick)), "drift": list(map(float, tableau.drift))}
    found = {name: np.empty((len(q), len(row))) for name, row in rows.items()}
    outer, inner = ("kick", "drift") if tableau.first == "kick" else ("drift", "kick")
    formulas = system.formulas()
    states = {"kick": list(np.moveaxis(q, -1, 0)), "drift": list(np.moveaxis(p, -1, 0))}
    energy, slope = {"kick": formulas.V, "drift": formulas.T}, {"kick": formulas.grad_V, "drift": formulas.grad_T}
    sign = {"kick": 1.0, "drift": -1.0}  # backwards, kicks add the gradient to p
    for i in reversed(range(len(rows[outer]))):
        for name in (outer, inner) if i else (outer,):
            j = i if name == outer else i - 1
            moved = states["drift" if name == "kick" else "kick"]
            found[name][:, j] = tau * np.broadcast_to(energy[name](tuple(states[name])), q.shape[:2]).sum(axis=1)
            _add(moved, slope[name](tuple(states[name])), sign[name] * rows[name][j] * tau)
    return found


def _add(components: list[Floats], slopes: Sequence[Any], factor: float) -> None:
    """Add multiples of ``slopes`` to the components of a state; some slopes may be constants."""
    for i, slope in enumerate(slopes):
        components[i] = components[i] + factor * slope
