"""Many runs of one system and one tableau through the compiled kernel: exact settings in, numpy arrays out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from math import isnan, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.layout import (
    COUNTERS,
    EVERY_STEP,
    ITERATIONS,
    LAND,
    LOOKS,
    NEVER,
    RUN,
    SAMPLES,
    Signature,
    running_rows,
)
from nearharmonic.engine import execution
from nearharmonic.engine.execution import Batch, Trajectories, doubles, filled, surface_limit, trajectories_of
from nearharmonic.engine.kernels import STANDARD, cost_of, kernel_of, physics_of, with_lanes
from nearharmonic.engine.numbers import moves_of, parameters_at_run_time, standard_parameters, standard_start
from nearharmonic.engine.settings import Numerics, check_fit
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    from nearharmonic.core.native import PreparedCall


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

    ``parameters`` (R or 1, 2 P) may change from call to call. ``arguments`` are those of the function that
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
    system: System,
    step: Composition,
    numerics: Numerics,
    *,
    marks: Integers,
    scheme: Integers,
    moves: Floats,
    start: Floats,
    parameters: Floats,
    scale: float = 0.0,
    reference: tuple[float, float] = (nan, nan),
    resumed: Floats | None = None,
    own_frequencies: bool = True,
) -> Batch:
    """Return a batch that is ready to run, of arrays that :class:`Batch` describes.

    ``step`` is a method, or a single composition of one. Errors are relative to the energy ``scale``; 0 means |H0|, or
    the unit of energy where H0 = 0. ``reference`` is a pair H0 for all runs in place of the energy of each start.
    ``resumed`` (R, 5 D) are the running states of runs that go on from ``start`` with the same moves.
    ``own_frequencies`` is False if ``moves`` solve oscillators of other frequencies than the system's, those of each
    run's parameters.
    """
    if isinstance(step, Tableau) and step.processed:
        return _prepared_processed(
            system, step, numerics, marks=marks, scheme=scheme, moves=moves, start=start, parameters=parameters,
            scale=scale, reference=reference, resumed=resumed,
        )  # fmt: skip
    cost = step.stages * cost_of(system, numerics.compiled, **step.kernel_options)
    runs, d, stages = len(marks), start.shape[1] // 4, step.stages if step.implicit else 0
    rows = running_rows(d, stages)
    left_at, control, results = np.zeros(runs, np.int64), execution.control(), np.empty(doubles(marks.shape, d, rows))
    arrays = filled(marks, results, left_at, d)._asdict()
    given = arrays | {
        "measured": measured(numerics), "order": np.argsort(-marks.max(axis=1), kind="stable"), "scheme": scheme,
        "start": start, "parameters": parameters, "limit": surface_limit(system, scale), "scale": scale,
        "reference": np.array(reference), "stretch": numerics.look or execution.stretch(cost),
        "stages": step.moves_per_step, "kick_first": step.first_same_as_last, "moves": moves, "control": control,
        "ends": arrays["running"],
    }  # fmt: skip
    call: Callable[[], object]
    if system.regularisation is not None:
        call = landing_call(system, numerics, stages, parameters, _in_order(LAND, given))
    else:
        given["parameters"] = parameters_at_run_time(system, numerics, parameters, own_frequencies=own_frequencies)
        given["resumed"] = np.empty((0, rows)) if resumed is None else resumed.copy()
        if stages:  # iterations count from the start of a run
            given["resumed"][:, ITERATIONS - COUNTERS] = 0.0
        call = kernel_of(system, numerics.compiled, **step.kernel_options).prepared(*_in_order(RUN, given))
    return Batch(
        numerics=numerics, marks=marks, scheme=scheme, start=start, parameters=given["parameters"], moves=moves,
        results=results, left_at=left_at, control=control, call=call, cost=cost,
    )  # fmt: skip


def _in_order(signature: Signature, given: Mapping[str, Any]) -> tuple[Any, ...]:
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
        # The energy is that of the processed states, and is measured at the samples.
        found.energy[:] = at_start.energy if isnan(reference[0]) else reference
        high, low = (at_samples.energy[:, k].reshape(marks.shape) - found.energy[:, k, None] for k in (0, 1))
        found.energy_error[:] = (high + low) + at_samples.energy_error[:, 1].reshape(marks.shape)
        begin = at_start.energy - found.energy
        found.energy_error[:, 0] = begin[:, 0] + begin[:, 1]
        found.worst[:] = np.abs(found.energy_error)
        found.total[:] = np.where(marks > 0, found.worst, 0.0)
        found.worst[:, 0] = 0.0

    return replace(batch, call=call)


def integrate_batch(
    system: System,
    tableau: Tableau,
    *,
    t_end: Fraction,
    steps: Sequence[int] | Integers,
    samples: int,
    numerics: Numerics = STANDARD,
    start: Floats | None = None,
    parameters: Floats | None = None,
    marks: Integers | None = None,
    scale: float = 0.0,
    reference: tuple[float, float] = (nan, nan),
    resumed: Floats | None = None,
) -> Trajectories:
    """Integrate R runs over [0, t_end], run i in ``steps[i]`` equal steps; ``t_end`` is negative to run backwards.

    Each run keeps at most so many ``samples``; a single one is the end. ``marks`` (R, S) of :func:`sample_marks`
    replace them. ``start`` (R or 1, 4 d) and ``parameters`` (R or 1, 2 P) replace the system's own, laid out as by
    :func:`nearharmonic.engine.numbers.start_row` and ``parameter_row``. All else is as for
    :func:`prepared_batch`. Ctrl-C ends a call within a fraction of a second.
    """
    if tableau.modified:
        check_fit(system, tableau, numerics.split, "tableau")
    count = np.asarray(steps, dtype=np.int64)
    distinct, scheme = _distinct(count)
    first = standard_start(system, not numerics.compensated) if start is None else start
    rows = np.empty((count.size, first.shape[-1]))
    rows[:] = first
    numerics = with_lanes(numerics, count, system, tableau)
    taus = [t_end / n for n in distinct]
    batch = prepared_batch(
        system, tableau, numerics, marks=sample_marks(count, samples) if marks is None else marks, scheme=scheme,
        moves=moves_of(system, tableau, taus, numerics), start=rows,
        parameters=standard_parameters(system)[None, :] if parameters is None else parameters,
        scale=scale, reference=reference, resumed=resumed,
    )  # fmt: skip
    batch.run()
    only_end = samples == 1 and marks is None
    return trajectories_of(system, tableau, count, batch.filled.without_start(only_end), numerics, scale)


def measured(numerics: Numerics) -> int:
    """Return when the kernel measures the energy, as :data:`nearharmonic.core.layout.RUN` has it."""
    if numerics.energy == "samples":
        return SAMPLES if numerics.look is None else LOOKS
    return EVERY_STEP if numerics.energy == "every" else NEVER


def _distinct(count: Integers) -> tuple[list[int], Integers]:
    """The different numbers of steps, ascending, and the place of each run's among them."""
    if count.size == 1:  # sorting takes longer than a short run
        return count.tolist(), np.zeros(1, np.int64)
    distinct, where = np.unique(count, return_inverse=True)
    return distinct.tolist(), where.astype(np.int64).reshape(-1)
