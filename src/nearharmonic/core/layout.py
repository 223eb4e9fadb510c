"""Arguments of compiled functions and layout of a kernel's arrays: known to callers and to compiled text alike.

An :class:`Argument` is a number or an array, a :class:`Signature` is what a compiled function takes and returns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Scalar = Literal["int64", "float64", "bool"]

#: Entries of the tally behind the 4 d rows of the state, in this order.
WORST, TOTAL, TOTAL_CARRY, LATEST, ENERGY, ENERGY_LOW, LIMIT, NEAR, CONDITION = range(9)
TALLY = 9

#: Entries of a row of coefficients: of the kick, of the drift behind it, their product, and by how much the product of
#: the two as rounded exceeds it. In extended precision kick and drift are pairs, and that is all.
KICK, DRIFT, PRODUCT, REST = range(4)
#: Doubles in such a row.
COLUMNS = 4
#: Where the oscillator is solved exactly, a row is the kick and, from ``TURN`` on, ``TURNS`` coefficients for each
#: distinct frequency: see :mod:`nearharmonic.core.rotation`.
TURN, TURNS = 1, 7
#: Where kicks are of a modified potential k V - m |grad V|^2, a row is k, the drift behind it and m, and whether the
#: force behind both needs the gradient of the square, which costs more than the force.
SQUARE = 2
#: Rows of coefficients: of a lane's next first move, of first moves but for the very first, of the other moves, and of
#: the one that closes a step.
OPENING, MERGED, INNER = range(3)

#: When the energy is measured: at every step, every so many steps, at the samples alone, never.
EVERY_STEP, LOOKS, SAMPLES, NEVER = range(4)
#: Entries of a control array: a number other than 0 stops a queue of runs; the steps done by then.
STOP, PROGRESS = range(2)

#: Doubles in a cache line.
CACHE_LINE = 8
#: More steps than any run has.
FAR = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Argument:
    """A number, or a C-contiguous array of numbers, whose ``lengths`` have names: the same are equal."""

    name: str
    scalar: Scalar
    lengths: tuple[str, ...] = ()

    @property
    def dimensions(self) -> int:
        """Dimensions of an array; 0 for a number."""
        return len(self.lengths)


@dataclass(frozen=True)
class Signature:
    """Arguments of a compiled function, and the type of its result, if it has one.

    A ``packed`` function takes the address of a block of 8-byte slots that hold its arguments in order: for many
    calls with the same arrays, the block is filled once.
    """

    arguments: tuple[Argument, ...]
    result: Scalar | None = None
    packed: bool = False


def integers(name: str, *lengths: str) -> Argument:
    """An argument of 64-bit integers."""
    return Argument(name, "int64", lengths)


def floats(name: str, *lengths: str) -> Argument:
    """An argument of doubles."""
    return Argument(name, "float64", lengths)


def flags(name: str, *lengths: str) -> Argument:
    """An argument of truth values."""
    return Argument(name, "bool", lengths)


#: Arguments of ``advance``: see :class:`nearharmonic.core.loops.kernel.Kernel`.
ADVANCE = Signature(
    (
        integers("count"),
        integers("stages"),
        flags("kick_first"),
        floats("moves", "coefficients"),
        floats("rows", "numbers"),
    ),
    result="int64",
)

#: Arguments of ``begin``: a kernel's rows, whose tallies begin anew with the energy of their states as H0.
BEGIN = Signature((floats("rows", "numbers"),))

#: Arguments of ``step``: a single step by itself, of arrays of d doubles that are changed in place. Unless sums are
#: compensated the carries are neither read nor written.
STEP = Signature(
    (
        integers("stages"),
        flags("kick_first"),
        floats("moves", "coefficients"),
        floats("parameters", "parameter_columns"),
        floats("q", "d"),
        floats("carry_q", "d"),
        floats("p", "d"),
        floats("carry_p", "d"),
    )
)

#: Arguments of ``run``, for states of ``size`` = 4 d doubles.
RUN = Signature(
    (
        integers("advance"),  # addresses of the kernel's functions
        integers("begin"),
        integers("measured"),  # EVERY_STEP, LOOKS, SAMPLES or NEVER
        integers("order", "queued"),  # the queue
        integers("marks", "total_runs", "samples"),  # steps at which to sample, first 0, padded with -1
        integers("scheme", "total_runs"),  # row of the coefficient arrays
        floats("start", "total_runs", "size"),
        floats("resumed", "resumptions", "running_rows"),  # states that run, of runs that go on, or none
        floats("parameters", "parameter_sets", "parameter_columns"),  # both parts of each, for each run or once for all
        floats("limit"),  # largest energy error, in units of ``scale``
        floats("scale"),  # energy that errors are relative to; 0 for |H0|
        floats("reference", "pair"),  # H0 as a pair for all runs; NaN for the energy of each start
        integers("stretch"),  # most steps between looks at ``control``; with LOOKS, between looks at the energy
        integers("stages"),
        flags("kick_first"),
        floats("moves", "schemes", "move_rows", "columns"),  # with the step size multiplied in
        integers("control", "entries"),  # STOP and PROGRESS
        # Results, filled in place.
        floats("states", "total_runs", "samples", "size"),
        floats("energy_error", "total_runs", "samples"),  # H - H0
        floats("worst", "total_runs", "samples"),  # maximum and
        floats("total", "total_runs", "samples"),  # sum of |H - H0| over the steps since the last sample
        floats("energy", "total_runs", "pair"),  # H0
        floats("running", "total_runs", "running_rows"),  # states that run at the end
        integers("left_at", "total_runs"),  # the step at which a run left its energy surface, or 0
        # The arrays of :func:`workspace`.
        floats("rows", "numbers"),
        floats("fresh", "numbers"),
        floats("lanes", "coefficient_count"),
        integers("runs", "width"),
        integers("at", "width"),
        integers("mark", "width"),
    ),
    packed=True,
)


#: Arguments of ``land``, in physical space of d coordinates; what is not explained is as for ``run``.
LAND = Signature(
    (
        integers("advance"),
        integers("look"),  # the kernel that measures the energy where it lands
        integers("begin"),
        integers("measured"),
        integers("order", "queued"),
        integers("marks", "total_runs", "samples"),  # times of the samples, in steps of physical time
        integers("scheme", "total_runs"),
        floats("start", "total_runs", "size"),
        floats("parameters", "parameter_sets", "parameter_columns"),
        floats("limit"),
        floats("scale"),
        floats("reference", "pair"),
        integers("stretch"),
        integers("stages"),
        flags("kick_first"),
        floats("moves", "schemes", "move_rows", "columns"),  # pairs of kick, drift, product; last the step size
        integers("control", "entries"),
        floats("states", "total_runs", "samples", "size"),
        floats("energy_error", "total_runs", "samples"),
        floats("worst", "total_runs", "samples"),
        floats("total", "total_runs", "samples"),
        floats("energy", "total_runs", "pair"),
        floats("ends", "total_runs", "running_rows"),  # steps of the run, and with the repeats of landing
        integers("left_at", "total_runs"),
        # The state of a run and the coefficients of its steps, and of one that is tried.
        floats("rows", "numbers"),
        floats("lanes", "coefficient_count"),
        floats("trial", "numbers"),
        floats("trial_lanes", "coefficient_count"),
    ),
    packed=True,
)


def parameter_rows(parameters: int) -> int:
    """Rows behind the tally that hold so many parameters: two doubles each, and one row that nobody reads if none."""
    return max(1, 2 * parameters)


def columns(frequencies: int) -> int:
    """Doubles in a row of coefficients where the oscillator is solved exactly, with so many distinct frequencies."""
    return TURN + TURNS * frequencies if frequencies else COLUMNS


def modified_columns(parts: int) -> int:
    """Doubles in a row where kicks are of a modified potential: three numbers of ``parts`` doubles, and a flag."""
    return (SQUARE + 1) * parts + 1


def running_rows(dimension: int) -> int:
    """Rows of a state that runs: those of a state, and d that the next move is late by."""
    return 5 * dimension


def running_at(dimension: int, parameters: int) -> int:
    """The first row of the state that runs, behind the state that is seen, the tally and the parameters."""
    return 4 * dimension + TALLY + parameter_rows(parameters)


def split_results(results: Floats, runs: int, samples: int, d: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Return ``states`` (R, S, 4 d), ``blocks`` (3, R, S), ``energy`` (R, 2) and ``running`` (R, 5 d) of one array.

    ``blocks`` are ``energy_error``, ``worst`` and ``total`` of :data:`RUN`.
    """
    states, blocks = 4 * d * runs * samples, 3 * runs * samples
    behind = states + blocks + 2 * runs
    return (
        results[:states].reshape(runs, samples, 4 * d),
        results[states : states + blocks].reshape(3, runs, samples),
        results[states + blocks : behind].reshape(runs, 2),
        results[behind:].reshape(runs, running_rows(d)),
    )


def workspace(
    dimension: int, stages: int, *, parameters: int, width: int, room: int = 0, columns: int = COLUMNS
) -> tuple[NDArray[Any], ...]:
    """The flat arrays that ``run`` works in: two row blocks, coefficients; and per lane its run, step and sample.

    Each row block ends with ``room`` doubles that the kernel works in.
    """
    rows = (running_at(dimension, parameters) + running_rows(dimension)) * width + room
    coefficients = (stages + 2) * columns * width
    doubles = tuple(aligned_zeros(n) for n in (rows, rows, coefficients))
    return (*doubles, *(np.zeros(width, np.int64) for _ in range(3)))


def aligned_zeros(count: int) -> NDArray[np.float64]:
    """Return so many zeros from a boundary of cache lines on: kernels that load across them take a fifth longer."""
    room = np.zeros(count + CACHE_LINE - 1)
    skip = -room.ctypes.data // room.itemsize % CACHE_LINE
    return room[skip : skip + count]
