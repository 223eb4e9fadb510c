"""Arguments of compiled functions and layout of the arrays of a kernel, for callers and for compiled code.

An :class:`Argument` is a number or an array. A :class:`Signature` holds the arguments and the result of a function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Scalar = Literal["int64", "float64", "bool"]

#: Entries of the tally behind the 4 d rows of the state, in this order.
WORST, TOTAL, TOTAL_CARRY, LATEST, ENERGY, ENERGY_LOW, LIMIT, NEAR, CONDITION = range(9)
TALLY = 9

#: Entries of a row of coefficients: of the kick, of the next drift, their product PRODUCT, and REST, the product of the
#: rounded coefficients minus PRODUCT. In extended precision a row holds kick and drift, each as a pair.
KICK, DRIFT, PRODUCT, REST = range(4)
#: Number of doubles in such a row.
COLUMNS = 4
#: If the oscillator is solved exactly, a row holds the kick and, from ``TURN`` on, ``TURNS`` coefficients for each
#: distinct frequency: see :mod:`nearharmonic.core.step`.
TURN, TURNS = 1, 7
#: If kicks use a modified potential k V - m |grad V|^2, a row holds k, the next drift, m, and a flag: the next force
#: needs the gradient of the square, which costs more than the force.
SQUARE = 2
#: Rows of coefficients: of the next first move of a lane, of the first moves of all steps but the first, of the other
#: moves, and of the move that closes a step.
OPENING, MERGED, INNER = range(3)

#: Last rows of the running state of a collocation method, COUNTERS in number: 1 if the rows before them hold the forces
#: of a step, iterations made, and a number other than 0 if the iterations of a step failed.
READY, ITERATIONS, FAILED = range(3)
COUNTERS = 3

#: Times of energy measurements: at every step, after a fixed number of steps, only at the samples, never.
EVERY_STEP, LOOKS, SAMPLES, NEVER = range(4)
#: Entries of a control array: STOP, where a number other than 0 stops a queue of runs, and PROGRESS, the steps done.
STOP, PROGRESS = range(2)

#: Doubles in a cache line.
CACHE_LINE = 8
#: Numbers of many coordinates in SIMD lanes: the doubles of the widest registers. The order of sums depends on it, so
#: it is the same on every processor.
BLOCK = 8
#: A number of steps that no run reaches.
FAR = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Argument:
    """A number, or a C-contiguous array of numbers with named ``lengths``; lengths of one name are equal."""

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

    A ``packed`` function takes the address of a block of 8-byte slots that hold its arguments in order. The block is
    filled once for many calls with the same arrays.
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


#: Arguments of ``advance``: see :class:`nearharmonic.core.kernel.Kernel`.
_STEPS = (integers("stages"), flags("kick_first"), floats("moves", "coefficients"))
ADVANCE = Signature((integers("count"), *_STEPS, floats("rows", "numbers")), result="int64")

#: Arguments of ``begin``: the rows of a kernel. It resets their tallies, with the energies of their states as H0.
BEGIN = Signature((floats("rows", "numbers"),))

#: Arguments of ``step``, which makes one step on arrays of d doubles, in place. It reads and writes the carries only if
#: sums are compensated.
_STATE = tuple(floats(name, "d") for name in ("q", "carry_q", "p", "carry_p"))
STEP = Signature((*_STEPS, floats("parameters", "parameter_columns"), *_STATE))

#: Arguments that the two functions below share: the queue of runs,
_QUEUE = (
    integers("measured"),  # EVERY_STEP, LOOKS, SAMPLES or NEVER
    integers("order", "queued"),  # the queue
    integers("marks", "total_runs", "samples"),  # steps at which to sample, first 0, padded with -1
    integers("scheme", "total_runs"),  # row of the coefficient arrays
    floats("start", "total_runs", "size"),
)
#: the problem and the method,
_METHOD = (
    floats("parameters", "parameter_sets", "parameter_columns"),  # pairs, for each run or once for all runs
    floats("limit"),  # largest energy error, in units of ``scale``
    floats("scale"),  # reference of relative errors; 0 for |H0|
    floats("reference", "pair"),  # H0 of all runs as a pair; NaN for the energy of each start
    integers("stretch"),  # largest number of steps between looks at ``control``; with LOOKS, at the energy
    integers("stages"),
    flags("kick_first"),
    floats("moves", "schemes", "move_rows", "columns"),  # coefficients times step size
    integers("control", "entries"),  # STOP and PROGRESS
)
#: and results, filled in place.
_RESULTS = (
    floats("states", "total_runs", "samples", "size"),
    floats("energy_error", "total_runs", "samples"),  # H - H0
    floats("worst", "total_runs", "samples"),  # maximum and
    floats("total", "total_runs", "samples"),  # sum of |H - H0| over the steps since the last sample
    floats("energy", "total_runs", "pair"),  # H0
)

#: Arguments of ``run``, for states of ``size`` = 4 d doubles.
RUN = Signature(
    (
        integers("advance"),  # addresses of the kernel's functions
        integers("begin"),
        *_QUEUE,
        floats("resumed", "resumptions", "running_rows"),  # running states of continued runs, or none
        *_METHOD,
        *_RESULTS,
        floats("running", "total_runs", "running_rows"),  # running states at the end
        integers("left_at", "total_runs"),  # step at which a run diverged, or 0
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

#: Arguments of ``land``, in physical space of d coordinates. ``marks`` are times of the samples, in steps of physical
#: time; ``moves`` are pairs of kick, drift and product, with the step size in the last row.
LAND = Signature(
    (
        integers("advance"),
        integers("look"),  # kernel that measures the energy at the landing
        integers("begin"),
        *_QUEUE,
        *_METHOD,
        *_RESULTS,
        floats("ends", "total_runs", "running_rows"),  # steps of the run, without and with the landings
        integers("left_at", "total_runs"),
        # The states and the coefficients of a run and of a trial step.
        floats("rows", "numbers"),
        floats("lanes", "coefficient_count"),
        floats("trial", "numbers"),
        floats("trial_lanes", "coefficient_count"),
    ),
    packed=True,
)

#: Arguments of ``member``, which advances the run of a thread of a GPU. Arrays have the run as their last axis, so that
#: neighbouring threads read and write neighbouring numbers. ``work`` holds the rows of a kernel with one lane, and
#: ``at`` and ``mark`` the steps and the samples done, 0 at the start: a later call goes on from there.
MEMBER = Signature(
    (
        integers("first"),  # run of the first thread
        integers("count"),  # runs
        integers("stride"),  # between neighbours of another axis
        integers("most"),  # steps of a call
        integers("look"),  # with LOOKS, steps between looks at the energy
        integers("measured"),
        integers("samples"),
        integers("marks", "samples_of_runs"),
        integers("scheme", "runs"),
        floats("start", "states_of_runs"),
        floats("parameters", "parameters_of_sets"),
        integers("parameter_sets"),
        floats("limit"),
        floats("scale"),
        floats("reference", "pair"),
        integers("stages"),
        flags("kick_first"),
        floats("moves", "coefficients"),
        *(
            floats(name, f"{name}_of_runs")
            for name in ("states", "energy_error", "worst", "total", "energy", "running")
        ),
        integers("left_at", "runs"),
        floats("work", "work_of_runs"),
        integers("at", "runs"),
        integers("mark", "runs"),
    )
)


def parameter_rows(parameters: int) -> int:
    """Number of rows behind the tally for the parameters: two for each, and one unused row if there are none."""
    return max(1, 2 * parameters)


def columns(frequencies: int) -> int:
    """Number of doubles in a row of coefficients for an oscillator that is solved exactly."""
    return TURN + TURNS * frequencies if frequencies else COLUMNS


def collocation_columns(stages: int, frequencies: int) -> int:
    """Number of doubles in a row for a collocation method: the step size as a pair, and more for each frequency.

    For oscillators of a frequency w inside the equations these are w^2 as a pair, ``stages`` factors of q and of v, and
    the matrix of the other forces, column by column (:mod:`nearharmonic.core.collocation`).
    """
    return COLUMNS + frequencies * (2 + 2 * stages + stages * stages)


def modified_columns(parts: int) -> int:
    """Number of doubles in a row for kicks of a modified potential: three numbers of ``parts`` doubles, and a flag."""
    return (SQUARE + 1) * parts + 1


def running_rows(dimension: int, stages: int = 0) -> int:
    """Number of rows of a running state: 4 d of the state, and d of the rest, which the next move adds.

    For a collocation method of so many ``stages``, the forces at the stages and :data:`COUNTERS` numbers follow.
    """
    return 5 * dimension + (stages * dimension + COUNTERS if stages else 0)


def running_at(dimension: int, parameters: int) -> int:
    """The first row of the running state, behind the output state, the tally and the parameters."""
    return 4 * dimension + TALLY + parameter_rows(parameters)


def workspace(
    dimension: int, moves: int, *, parameters: int, width: int, room: int = 0, columns: int = COLUMNS, stages: int = 0
) -> tuple[NDArray[Any], ...]:
    """The flat arrays of ``run``: two row blocks, coefficients, and for each lane its run, step and sample.

    Each row block ends with ``room`` doubles of working memory. ``moves``: moves in a step. ``stages``: stages of a
    collocation method.
    """
    rows = (running_at(dimension, parameters) + running_rows(dimension, stages)) * width + room
    coefficients = (moves + 2) * columns * width
    doubles = tuple(aligned_zeros(n) for n in (rows, rows, coefficients))
    return (*doubles, *(np.zeros(width, np.int64) for _ in range(3)))


def aligned_zeros(count: int) -> NDArray[np.float64]:
    """Return ``count`` zeros that begin at a cache line; otherwise kernels take a fifth longer."""
    room = np.zeros(count + CACHE_LINE - 1)
    skip = -room.ctypes.data // room.itemsize % CACHE_LINE
    return room[skip : skip + count]


# --- Coefficients of a collocation method as pairs of doubles, in the form in which rounded numbers stay symplectic.
#
# With the increments L_j = h b_j f(Q_j) of the momentum, the stages of q'' = a(f(q)) are Q_i = q + h (c_i v + sum_j
# alpha_ij a(L_j)), and the step is p += sum_j L_j, q += h (v + sum_j (1 - c_j) a(L_j)). It is symplectic for any
# weights b_j if alpha_ij - alpha_ji = c_i - c_j. For a kinetic energy that is not quadratic, P_i = p + sum_j mu_ij
# L_j and Q_i = q + sum_j mu_ij M_j with M_j = h b_j v(P_j), which is symplectic if mu_ij + mu_ji = 1. Both hold
# exactly for the numbers of a :class:`StageTable`: Antonana, Makazaga & Murua (2017), arXiv:1702.03354, and for
# second order arXiv:2511.03655.

#: A double and the digits below it.
Number = tuple[float, float]
Vector = tuple[Number, ...]


@dataclass(frozen=True)
class StageTable:
    """Coefficients of a method of s stages."""

    nodes: Vector  # c_i
    rest: Vector  # 1 - c_i
    weights: Vector  # b_i
    position: tuple[Vector, ...]  # alpha_ij
    momentum: tuple[Vector, ...]  # mu_ij
    guess: tuple[Vector, ...]  # extrapolates forces to the stages of the next step

    @property
    def stages(self) -> int:
        return len(self.nodes)


# --- Forms of compiled loops: systems of one form share the loops, for all numbers of coordinates and lanes.
@dataclass(frozen=True, kw_only=True)
class Form:
    """Arithmetic and order of a step."""

    extended: bool = False  # states are double-doubles
    compensated: bool = False  # sums are compensated
    ahead: bool = False  # the position is ready one operation after the force
    modified: bool = False  # kicks use a modified potential
    turning: bool = False  # an oscillator is solved exactly
    resting: bool = False  # some coordinates never move; they are not updated
    quick: bool = False  # energies are measured in double wherever that is accurate enough
    large: bool = False  # states are in memory
    unit_masses: bool = False  # T = p.p / 2, for states in memory
    stages: bool = False  # a collocation method, one move of which is a step
    timed: bool = False  # a coordinate is the time, whose sum is compensated, and other sums are plain

    @property
    def parts(self) -> int:
        return 2 if self.extended else 1


class Motion(NamedTuple):
    """Functions that the loops of a form call; f denotes the forces that moves take.

    ``load(rows, moves, parameters)`` returns the running state and the output state, ``first(state, moves,
    parameters)`` the forces of the first move, ``move(state, row, f, parameters)`` the next state, ``behind(state,
    moves, row, parameters)`` the forces after the move of a row, ``last(state, moves, row, parameters)`` these forces
    and V, ``closed(state, row, f, parameters)`` the state at the end of a step. ``save(rows, state, seen)`` stores both
    states.
    """

    load: Any
    first: Any
    move: Any
    behind: Any
    last: Any
    closed: Any
    save: Any
