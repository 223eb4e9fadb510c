"""Many runs of one system and one method through the compiled kernel: exact settings in, named arrays out."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import cache, cached_property
from math import inf, isnan, nan, prod
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core import layout
from nearharmonic.engine.kernels import STANDARD, cost_of, kernel_of, physics_of, with_lanes
from nearharmonic.engine.numbers import moves_of, parameters_at_run_time, standard_parameters, standard_start
from nearharmonic.engine.settings import DEVICES, Numerics, check_fit, one_of
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Composition, Tableau
from nearharmonic.numerics.portable import Bools, Floats, Integers
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    from nearharmonic.core.native import PreparedCall


# --- Interrupt handling and progress bars for long kernel calls.

#: Product of steps, stages and the cost of a force below which a call takes less than about 20 ms and is not watched.
SHORT = 5_000_000
#: Seconds between looks at the keyboard, and seconds after which a progress bar is shown.
PATIENCE, LONG = 0.05, 2.0
#: Largest product of steps and cost between two looks of a kernel at its control array.
STRETCH = 2_000_000


def execute(call: Callable[[], Any], state: NDArray[np.int64], steps: int, cost: int) -> None:
    """Make the call of a kernel with the control array ``state``; its runs have ``steps`` in all, each at ``cost``.

    Ctrl-C stops it within a stretch: KeyboardInterrupt is raised when the kernel has stopped, and its results must not
    be used. A call of more than two seconds shows its progress. A call inside of :class:`Blocks` is stopped and shown
    together with the blocks.
    """
    if (blocks := getattr(_OWN, "blocks", None)) is not None:
        blocks.call(call, state)
    elif steps * cost < SHORT or not _in_main_thread():
        call()
    else:
        Blocks(lambda _: execute(call, state, steps, cost), 1, steps=steps, cost=cost).execute(1)


#: Blocks that the current thread works for.
_OWN = threading.local()


class Blocks:
    """Blocks of runs that threads take from a queue.

    ``compute`` computes the block of an index below ``count``, and calls kernels by :func:`execute`. ``steps``:
    number of steps of all runs of all blocks together. ``cost``: cost of a step.
    """

    def __init__(self, compute: Callable[[int], None], count: int, *, steps: int, cost: int) -> None:
        self._compute, self._count, self._steps, self._cost = compute, count, steps, cost
        self._stopped, self._done, self._controls = False, 0, dict[int, NDArray[np.int64]]()

    def execute(self, threads: int) -> None:
        """Compute all blocks; Ctrl-C stops them all, and is raised when every thread has stopped."""
        if self._steps * self._cost < SHORT or (threads == 1 and not _in_main_thread()):
            for i in range(self._count):
                self._compute(i)
            return
        from concurrent.futures import ThreadPoolExecutor, wait

        begin, bar = time.monotonic(), None
        with ThreadPoolExecutor(threads) as pool, ExitStack() as shown:
            futures = [pool.submit(self._one, i) for i in range(self._count)]
            try:
                for future in futures:
                    while not future.done():
                        wait([future], PATIENCE)
                        if bar is None and time.monotonic() - begin > LONG and sys.stderr.isatty():
                            from tqdm import tqdm

                            bar = tqdm(total=self._steps, unit=" steps", unit_scale=True, leave=False)
                            shown.enter_context(bar)
                        if bar is not None:
                            bar.update(
                                self._done + sum(int(x[layout.PROGRESS]) for x in self._controls.values()) - bar.n
                            )
                    future.result()
            except BaseException:
                self._stopped = True
                for state in list(self._controls.values()):
                    state[layout.STOP] = 1
                pool.shutdown(cancel_futures=True)
                raise

    def call(self, call: Callable[[], Any], state: NDArray[np.int64]) -> None:
        """Make a call of one of the blocks, unless they have been stopped."""
        key = threading.get_ident()
        self._controls[key] = state
        # In this order: a stop is seen here, or by the kernel.
        if not self._stopped:
            call()
        self._done += int(state[layout.PROGRESS])
        del self._controls[key]

    def _one(self, i: int) -> None:
        if not self._stopped:
            _OWN.blocks = self
            self._compute(i)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


# --- Results of a batch of runs as named arrays: states, energy errors, divergence flags.

#: Samples at which the energy of a processed method is measured if its errors alone are wanted.
SAMPLES_OF_PROCESSED = 1000


@dataclass(frozen=True, kw_only=True)
class Trajectories:
    """R runs of up to S samples each, of a system with d coordinates.

    ``marks`` (R, S): the step of each sample, -1 where a run has fewer. ``q``, ``p``, ``q_low``, ``p_low`` (R, S, d):
    the states and what compensation or double-double keeps below them; NaN where there is no sample, or where the run
    had left before. ``energy_error`` (R, S): (H - H0)/|H0|, or over the scale asked for. ``block_max``, ``block_mean``
    (R, S): of its modulus over the steps since the previous sample, as far as it was measured. ``max_energy_error``,
    ``mean_energy_error`` (R,): over every step, or over the samples, as :class:`Numerics` says, infinite if the run
    left; maxima over looks have no means. ``steps`` (R,) asked for; ``done`` (R,) taken; ``left_at`` (R,) step at
    which the run left its energy surface, 0 if it did not; ``evaluations`` (R,) of the force; ``energy``,
    ``energy_low`` (R,): H0. ``running`` (R, 5 d or more): the states of the last forces, from which the runs may go on,
    or (R, 0). ``unsolved`` (R,): True where the equations of an implicit step could not be solved at ``left_at``.
    """

    marks: Integers
    q: Floats
    p: Floats
    q_low: Floats
    p_low: Floats
    energy_error: Floats
    block_max: Floats
    block_mean: Floats
    max_energy_error: Floats
    mean_energy_error: Floats
    steps: Integers
    done: Integers
    left_at: Integers
    evaluations: Integers
    energy: Floats
    energy_low: Floats
    running: Floats
    unsolved: Bools

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Positions at the last sample of each run and the digits below them, (R, d) each."""
        place = np.arange(len(self.marks)), np.count_nonzero(self.marks >= 0, axis=1) - 1
        return self.q[place], self.q_low[place]

    def take(self, runs: Integers) -> Trajectories:
        """The runs at these indices, in this order."""
        return Trajectories(**{field.name: getattr(self, field.name)[runs] for field in fields(self)})


def least_samples(tableau: Tableau) -> int:
    """Return the samples of a run whose energy errors alone are wanted: its ends, unless only samples are measured."""
    return SAMPLES_OF_PROCESSED if tableau.processed else 2


def joined(parts: Sequence[Trajectories]) -> Trajectories:
    """Return the runs of several batches, one behind the other."""
    if len(parts) == 1:
        return parts[0]
    columns = {field.name: [getattr(part, field.name) for part in parts] for field in fields(Trajectories)}
    return Trajectories(**{name: np.concatenate(arrays) for name, arrays in columns.items()})


def energy_unit(energy: Floats, scale: float) -> Floats:
    """Return the divisor of energy errors: |H0| (R,), 1 where H0 = 0, or ``scale`` if it is not 0."""
    unit = np.abs(energy) if scale == 0 else np.full(energy.size, scale)
    unit[unit == 0] = 1.0
    return unit


class Filled(SimpleNamespace):
    """Arrays that a call fills for R runs of S samples each, of D coordinates, with the names that the kernel declares.

    ``marks`` (R, S): the step of each sample, -1 where a run has fewer. ``left_at`` (R,): the step at which a run left
    its energy surface, or 0. ``states`` (R, S, 4 D). ``energy_error``, ``worst`` and ``total`` (R, S): H - H0, and
    maximum and sum of its modulus over the block before each sample. ``energy`` (R, 2): H0 as pairs. ``running`` (R,
    5 D): the states of the last forces; where runs land on physical times, it begins with the steps of each, and those
    made to land.
    """

    def without_start(self, cut: bool = True) -> Filled:
        """These arrays without the first sample of each run, or as they are."""
        sampled = {name: array[:, 1:] for name, array in vars(self).items() if cut and name in ("marks", *SAMPLED)}
        return Filled(**vars(self) | sampled)


#: Arrays of doubles that a call fills, as the kernel declares them, and those with a number or a state a sample.
_NAMES = [argument.name for argument in layout.RUN.arguments]
RESULTS = {x.name: x.lengths for x in layout.RUN.arguments[_NAMES.index("control") + 1 : _NAMES.index("left_at")]}
SAMPLED = tuple(name for name, lengths in RESULTS.items() if "samples" in lengths)


def shapes(marks: tuple[int, ...], d: int, running: int = 0) -> dict[str, tuple[int, ...]]:
    """Return the shapes of :data:`RESULTS` for marks (R, S) of this shape, and so many numbers of a running state."""
    lengths = {"total_runs": marks[0], "samples": marks[1], "size": 4 * d, "pair": 2, "running_rows": running}
    return {name: tuple(lengths[length] for length in names) for name, names in RESULTS.items()}


def doubles(marks: tuple[int, ...], d: int, running: int = 0) -> int:
    """Return the number of doubles of all :data:`RESULTS`."""
    return sum(map(prod, shapes(marks, d, running).values()))


def sample_size(d: int) -> int:
    """Return the number of doubles that a sample takes."""
    return doubles((1, 1), d) - doubles((1, 0), d)


def views_of(marks: Integers, results: Floats, left_at: Integers, d: int) -> Filled:
    """Return views of the ``results`` of runs of ``d`` coordinates with these ``marks``, an array in one piece."""
    begin, views = 0, {}
    for name, shape in shapes(marks.shape, d, (results.size - doubles(marks.shape, d)) // len(marks)).items():
        views[name] = results[begin : (begin := begin + prod(shape))].reshape(shape)
    return Filled(marks=marks, left_at=left_at, **views)


def trajectories_of(
    system: System, tableau: Tableau, steps: Integers, arrays: Filled, numerics: Numerics, scale: float
) -> Trajectories:
    """Return the results of a kernel by name, energies relative to |H0|, to ``scale``, or to 1."""
    marks, left_at, states, running = arrays.marks, arrays.left_at, arrays.states, arrays.running
    unit = energy_unit(arrays.energy[:, 0], scale)[:, None]
    error, worst, total = (getattr(arrays, name) / unit for name in ("energy_error", "worst", "total"))
    if numerics.energy == "none":
        error[:] = worst[:] = total[:] = arrays.energy[:] = np.nan
    d = states.shape[-1] // 4
    left = left_at > 0
    done = taken = np.where(left, left_at, steps)
    weight, landed, counters = steps, system.regularisation is not None, running
    if landed:
        done, taken = np.maximum(running[:, :2], 1).T.astype(np.int64)
        weight, running = done, running[:, :0]
    evaluations, failed = evaluations_of(tableau, taken, counters)
    largest = np.fmax.reduce(worst, axis=1)  # which passes NaN over
    mean = _means(total, weight, marks, numerics)
    if left.any():
        mean[left] = largest[left] = np.inf
    if landed:
        total[:] = np.nan
    elif numerics.energy == "every":
        total /= np.maximum(np.diff(marks, axis=1, prepend=0), 1)
    return Trajectories(
        marks=marks, q=states[:, :, :d], q_low=states[:, :, d : 2 * d], p=states[:, :, 2 * d : 3 * d],
        p_low=states[:, :, 3 * d :], energy_error=error, block_max=worst, block_mean=total, max_energy_error=largest,
        mean_energy_error=mean, steps=steps, done=done, left_at=left_at, evaluations=evaluations,
        energy=arrays.energy[:, 0], energy_low=arrays.energy[:, 1], running=running, unsolved=left & failed,
    )  # fmt: skip


def evaluations_of(tableau: Tableau, steps: Integers, running: Floats) -> tuple[Integers, Bools]:
    """Return the force evaluations (R,) of runs, and where an implicit step was not solved.

    ``steps`` (R,) were made; implicit methods have their iterations among the counters that end ``running``.
    """
    if not tableau.implicit:
        return tableau.evaluations(steps), np.zeros(len(steps), bool)
    counters = running[:, -layout.COUNTERS :]
    return tableau.evaluations(counters[:, layout.ITERATIONS].astype(np.int64)), counters[:, layout.FAILED] != 0


def _means(total: Floats, steps: Integers, marks: Integers, numerics: Numerics) -> Floats:
    """Mean of |H - H0| over the steps, or over the samples; NaN if it was measured at other times."""
    if numerics.look is not None and numerics.energy == "samples":  # sums over looks are no means over steps
        total[:] = np.nan
        return np.full(steps.size, np.nan)
    weight = steps if numerics.energy == "every" else np.maximum(np.count_nonzero(marks > 0, axis=1), 1)
    mean: Floats = np.add.reduce(total, axis=1) / weight
    if np.isnan(mean).any():  # blocks without a step, or behind the end of a run, count for nothing
        unknown = np.isnan(total)
        mean = np.add.reduce(np.where(unknown, 0, total), axis=1) / weight
        mean[unknown.all(axis=1)] = np.nan
    return mean


def surface_limit(system: System, scale: float) -> float:
    """Return the largest energy error of a run, in units of |H0| or of ``scale``, beyond which it has diverged.

    The energy of a system that depends on time has no surface: unless its ``scale`` is one that was asked for, only a
    state that is not finite has diverged.
    """
    return inf if system.time_dependent and scale == system.typical_energy else system.surface_limit


# --- A queue of runs with their arrays, ready to run.
@dataclass(frozen=True, kw_only=True)
class Batch:
    """A queue of R runs with their arrays, which may be filled anew and run again.

    ``marks`` (R, S): steps at which to sample, first 0, padded with -1. ``scheme`` (R,): the row of ``moves`` (schemes,
    s + 2, columns) that each run takes, from :func:`nearharmonic.engine.numbers.moves_of`. ``start`` (R, 4
    D): initial states of the D coordinates of the kernel. ``parameters`` (R or 1, 2 P). ``results``: states, blocks,
    energies and running states in one piece, which :attr:`filled` splits. ``left_at`` (R,): step at which a run left
    its energy surface, or 0. ``control`` (2,): control array of ``call``, which fills ``results`` and ``left_at``.
    ``cost``: cost of a step.
    """

    numerics: Numerics
    marks: Integers
    scheme: Integers
    start: Floats
    parameters: Floats
    moves: Floats
    results: Floats
    left_at: Integers
    control: Integers
    call: Callable[[], object]
    cost: int

    @cached_property
    def filled(self) -> Filled:
        """Arrays that :meth:`run` fills, as views of ``results``."""
        return views_of(self.marks, self.results, self.left_at, self.start.shape[1] // 4)

    def clear(self) -> None:
        """Forget what an earlier call computed, and that it was told to stop."""
        self.results.fill(nan)
        self.left_at.fill(0)
        self.control.fill(0)

    def run(self, steps: int | None = None) -> None:
        """Compute the results; ``steps`` is the number of steps of all runs together, if it is known."""
        self.clear()
        execute(self.call, self.control, int(self.marks.max(axis=1).sum()) if steps is None else steps, self.cost)


# --- Runs of regularised systems: equal steps of a fictitious time, samples that land on physical times.
@remembered
def landing_of(system: System, numerics: Numerics, stages: int = 0) -> Callable[..., PreparedCall]:
    """Return a function that prepares calls of the compiled runs of ``system``, cached on disk.

    ``stages`` is the number of stages of a collocation method, or 0.
    """
    from nearharmonic.core.kernel import build_landing

    return build_landing(
        physics_of(system, stages=stages),
        system.formulas().regularised,
        extended=numerics.precision == "extended",
        compensated=numerics.compensated,
        energy=numerics.energy,
    )


@remembered
def unperturbed(system: System) -> System:
    """Return ``system`` without its perturbation: an oscillator, whose forces are cheap."""
    assert system.regularisation is not None
    return replace(system, regularisation=replace(system.regularisation, perturbation=None))


def landing_call(
    system: System, numerics: Numerics, stages: int, parameters: Floats, arguments: tuple[Any, ...]
) -> Callable[[], None]:
    """Return a call of the runs of a regularised system: with the perturbation, or without it if its strength is 0.

    ``parameters`` (R or 1, 2 P) may change from call to call. ``arguments`` go to the function that
    :func:`nearharmonic.core.kernel.build_landing` returns.
    """
    strength = None if system.regularisation is None else system.regularisation.strength
    place = None if strength is None else 2 * list(system.parameters).index(strength)

    @cache
    def prepared(perturbed: bool) -> PreparedCall:
        return landing_of(system if perturbed else unperturbed(system), numerics.compiled, stages)(*arguments)

    def call() -> None:
        prepared(place is None or bool(parameters[:, place].any()))()

    return call


def check_bound(system: System, start: Floats, parameters: Floats) -> None:
    """Raise an error for starts (R, 4 d) of a regularised system whose orbit is not bound: H is not below 0."""
    if system.regularisation is None:
        return
    rows = start.reshape(len(start), 4, -1)
    with np.errstate(all="ignore"):
        H = np.broadcast_to(system.energy(tuple(rows[:, 0].T), tuple(rows[:, 2].T), list(parameters.T[::2])), len(rows))
    (wrong,) = np.nonzero(~(H < 0))
    if wrong.size:
        q0, p0 = (rows[wrong[0], k].tolist() for k in (0, 2))
        what = f"a state of {system.name} with an energy below 0, on a bound orbit; its energy is {H[wrong[0]]:g}"
        raise bad_setting("(q0, p0)", f"({q0}, {p0})", what)


def sample_marks(steps: Integers, samples: int) -> Integers:
    """Return the steps (R, S) at which to sample runs of ``steps`` (R,), first 0 and last ``steps``, padded with -1.

    A run has at most so many ``samples``, as evenly spaced as whole steps allow; S is 2 or more.
    """
    width = max(2, min(samples, int(steps.max()) + 1))
    if width == 2:  # as for every sweep
        marks = np.zeros((steps.size, 2), np.int64)
        marks[:, 1] = steps
        return marks
    index, last = np.arange(width, dtype=np.int64), np.minimum(steps + 1, width)[:, None] - 1
    return np.where(index <= last, index * steps[:, None] // np.maximum(last, 1), -1)


def single_steps(runs: int) -> Integers:
    """Return the marks (R, 2) of runs of one step."""
    return np.tile(np.array([[0, 1]]), (runs, 1))


def prepared_batch(
    system: System, step: Composition, numerics: Numerics, *, marks: Integers, scheme: Integers, moves: Floats,
    start: Floats, parameters: Floats, scale: float = 0.0, reference: tuple[float, float] = (nan, nan),
    resumed: Floats | None = None, own_frequencies: bool = True,
) -> Batch:  # fmt: skip
    """Return a batch that is ready to run, of arrays that :class:`Batch` describes.

    ``step`` is a method, or a single composition of one. Errors are relative to the energy ``scale``; 0 means |H0|, or
    the unit of energy where H0 = 0. ``reference`` is a pair H0 for all runs in place of the energy of each start.
    ``resumed`` (R, 5 D) are the running states of runs that go on from ``start`` with the same moves.
    ``own_frequencies`` is False if ``moves`` solve oscillators with the frequencies of each run's parameters, not with
    the system's.
    """
    if isinstance(step, Tableau) and step.processed:
        return _prepared_processed(
            system, step, numerics, marks=marks, scheme=scheme, moves=moves, start=start, parameters=parameters,
            scale=scale, reference=reference, resumed=resumed,
        )  # fmt: skip
    cost = step.stages * cost_of(system, numerics.compiled, **step.kernel_options)
    runs, d, stages = len(marks), start.shape[1] // 4, step.stages if step.implicit else 0
    rows = layout.running_rows(d, stages)
    left_at, control, results = np.zeros(runs, np.int64), np.zeros(2, np.int64), np.empty(doubles(marks.shape, d, rows))
    arrays = views_of(marks, results, left_at, d)
    measured = {
        "every": layout.EVERY_STEP,
        "samples": layout.LOOKS if numerics.look else layout.SAMPLES,
        "none": layout.NEVER,
    }
    given = vars(arrays) | {
        "measured": measured[numerics.energy], "order": np.argsort(-marks.max(axis=1), kind="stable"), "scheme": scheme,
        "start": start, "parameters": parameters, "limit": surface_limit(system, scale), "scale": scale,
        "reference": np.array(reference), "stretch": numerics.look or max(1, STRETCH // cost),
        "stages": step.moves_per_step, "kick_first": step.first_same_as_last, "moves": moves, "control": control,
        "ends": arrays.running,
    }  # fmt: skip
    call: Callable[[], object]
    if system.regularisation is not None:
        call = landing_call(system, numerics, stages, parameters, _in_order(layout.LAND, given))
    else:
        given["parameters"] = parameters_at_run_time(system, numerics, parameters, own_frequencies=own_frequencies)
        given["resumed"] = np.empty((0, rows)) if resumed is None else resumed.copy()
        if stages:  # iterations count from the start of a run
            given["resumed"][:, layout.ITERATIONS - layout.COUNTERS] = 0.0
        if numerics.device == "gpu":
            from nearharmonic.engine.device import DeviceCall, gpu, member_kernel

            call = DeviceCall(gpu(), member_kernel(system, numerics.compiled, **step.kernel_options), given)
        else:
            call = kernel_of(system, numerics.compiled, **step.kernel_options).prepared(*_in_order(layout.RUN, given))
    return Batch(
        numerics=numerics, marks=marks, scheme=scheme, start=start, parameters=given["parameters"], moves=moves,
        results=results, left_at=left_at, control=control, call=call, cost=cost,
    )  # fmt: skip


def _in_order(signature: layout.Signature, given: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the arguments of a compiled function that are ``given`` by name, in the order of its declaration."""
    return tuple(given[argument.name] for argument in signature.arguments if argument.name in given)


def _prepared_processed(
    system: System, tableau: Tableau, numerics: Numerics, *, moves: Floats, start: Floats, parameters: Floats,
    marks: Integers, scheme: Integers, reference: tuple[float, float], **given: Any,
) -> Batch:  # fmt: skip
    """Return the batch of a processed method: the kernel starts from the inverse-processed state."""
    numerics = replace(numerics, look=None, energy="none" if numerics.energy == "none" else "samples")

    def part(step: Composition, members: Integers | slice, marks: Integers, **given: Any) -> Batch:
        rows = np.empty((len(moves), step.stages + 2, moves.shape[2]))
        shared = parameters if len(parameters) == 1 else parameters[members]
        return prepared_batch(
            system, step, numerics, marks=marks, scheme=scheme[members], moves=rows, start=start[members].copy(),
            parameters=shared, **given,
        )  # fmt: skip

    every, each = slice(None), np.repeat(np.arange(len(marks)), marks.shape[1])
    step, before, behind = tableau.compositions
    kernel = part(step, every, marks, **given)
    first = part(before, every, single_steps(len(marks)))
    last = part(behind, each, single_steps(each.size))
    batch = replace(kernel, moves=moves, start=start.copy(), results=np.empty_like(kernel.results))
    parts = kernel, first, last
    columns = np.split(moves, np.cumsum([part.moves.shape[1] for part in parts[:-1]]), axis=1)
    found, at_start, at_samples = batch.filled, first.filled, last.filled

    def call() -> None:
        """Start from the inverse processor, make the steps of the kernel, and process each sample."""
        for part, rows in zip(parts, columns, strict=True):
            part.moves[:] = rows
        first.start[:] = batch.start
        first.clear()
        first.call()
        kernel.start[:] = at_start.states[:, 1]
        kernel.results.fill(nan)
        kernel.call()
        last.start[:] = kernel.filled.states.reshape(last.start.shape)
        if len(batch.parameters) > 1:  # one row is shared by all batches
            last.parameters[:] = np.repeat(batch.parameters, marks.shape[1], axis=0)
        last.clear()
        last.call()
        found.states[:] = at_samples.states[:, 1].reshape(found.states.shape)
        found.states[:, 0] = batch.start
        found.running[:] = kernel.filled.running
        # Energies of processed states are measured at the samples.
        found.energy[:] = at_start.energy if isnan(reference[0]) else reference
        high, low = (at_samples.energy[:, k].reshape(marks.shape) - found.energy[:, k, None] for k in (0, 1))
        found.energy_error[:] = (high + low) + at_samples.energy_error[:, 1].reshape(marks.shape)
        begin = at_start.energy - found.energy
        found.energy_error[:, 0] = begin[:, 0] + begin[:, 1]
        found.worst[:] = np.abs(found.energy_error)
        found.total[:] = np.where(marks > 0, found.worst, 0.0)
        found.worst[:, 0] = 0.0

    return replace(batch, call=call)


def placed(numerics: Numerics, device: str, system: System, step: Composition, runs: int, steps: int) -> Numerics:
    """Return ``numerics`` with the device for so many runs, of so many steps together: "cpu", "gpu" or "auto"."""
    if one_of("device", device, DEVICES) == "cpu":
        return numerics
    from nearharmonic.engine.device import device_of

    return replace(numerics, device=device_of(device, system, step, numerics, runs, steps))


def integrate_batch(
    system: System, tableau: Tableau, *, t_end: Fraction, steps: Sequence[int] | Integers, samples: int,
    numerics: Numerics = STANDARD, start: Floats | None = None, parameters: Floats | None = None,
    marks: Integers | None = None, scale: float = 0.0, **given: Any,
) -> Trajectories:  # fmt: skip
    """Integrate R runs over [0, t_end], run i in ``steps[i]`` equal steps; ``t_end`` is negative to run backwards.

    Each run keeps at most so many ``samples``; a single one is the end. ``marks`` (R, S) of :func:`sample_marks`
    replace them. ``start`` (R or 1, 4 d) and ``parameters`` (R or 1, 2 P) replace the system's own, laid out as by
    :func:`nearharmonic.engine.numbers.start_row` and ``parameter_row``. All else is as for
    :func:`prepared_batch`. Ctrl-C ends a call within a fraction of a second.
    """
    if tableau.modified:
        check_fit(system, tableau, numerics.split, "tableau")
    count = np.asarray(steps, dtype=np.int64)
    distinct, scheme = count, np.zeros(1, np.int64)
    if count.size > 1:  # sorting takes longer than a short run
        distinct, scheme = np.unique(count, return_inverse=True)
    first = standard_start(system, not numerics.compensated) if start is None else start
    rows = np.empty((count.size, first.shape[-1]))
    rows[:] = first
    numerics = with_lanes(numerics, count, system, tableau)
    taus = [t_end / n for n in distinct.tolist()]
    batch = prepared_batch(
        system, tableau, numerics, marks=sample_marks(count, samples) if marks is None else marks, scheme=scheme,
        moves=moves_of(system, tableau, taus, numerics), start=rows,
        parameters=standard_parameters(system)[None, :] if parameters is None else parameters,
        scale=scale, **given,
    )  # fmt: skip
    batch.run()
    only_end = samples == 1 and marks is None
    return trajectories_of(system, tableau, count, batch.filled.without_start(only_end), numerics, scale)
