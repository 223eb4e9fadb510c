"""States at times that the caller chooses: those between two steps by one shorter step from the step before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from sys import float_info

import numpy as np

from nearharmonic.engine.batch.batch import single_steps
from nearharmonic.engine.batch.results import Trajectories, energy_unit
from nearharmonic.engine.numbers.arrays import exact, list_of
from nearharmonic.engine.runs.setup import Setup
from nearharmonic.engine.settings import MOST_SAMPLES
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.types import Floats, Integers


def checked_times(t: object, problem: Setup) -> list[Fraction]:
    """Return output times exactly, sorted from 0 towards the end of the interval, which may be negative.

    Floats mean their binary value, and one within a rounding of the end, in its own precision, is the end.

    Raises
    ------
    SettingError
        No list of one dimension, no times, too many, a masked one, one outside the interval, or one before another.
    """
    given, end = list_of("t", t, "a list of output times", MOST_SAMPLES), problem.end
    if not 1 <= len(given) <= MOST_SAMPLES:
        raise bad_setting("t", f"{len(given)} times", f"from 1 to {MOST_SAMPLES} output times")
    times = [exact(f"t[{i}]", value) for i, value in enumerate(given)]
    last = float(end)
    near = [abs(float(time) - last) <= _rounding(value) * abs(last) for value, time in zip(given, times, strict=True)]
    times = [end if is_end else time for is_end, time in zip(near, times, strict=True)]
    sign, before = (1 if end > 0 else -1), Fraction(0)
    for i, time in enumerate(times):
        if not 0 <= sign * time <= sign * end:
            narrow = isinstance(given[i], np.floating) and given[i].dtype.itemsize < 8
            what = f"; {given[i].dtype} has {np.finfo(given[i].dtype).precision} digits" if narrow else ""
            raise bad_setting(f"t[{i}]", given[i], f"a time from 0 to t_end = {problem.t_end}{what}")
        if sign * time < sign * before:
            raise bad_setting(f"t[{i}]", given[i], "a time not earlier than the time before it")
        before = time
    return times


def _rounding(value: object) -> float:
    """Relative rounding of a time of this type; text and fractions have none."""
    if isinstance(value, np.floating):
        return float(np.finfo(value.dtype).eps)
    return float_info.epsilon if isinstance(value, float) else 0.0


def run_at(
    problem: Setup,
    steps: Sequence[int],
    times: Sequence[Fraction],
    *,
    start: Floats,
    parameters: Floats,
    reference: tuple[float, float],
    resumed: Floats | None = None,
) -> Trajectories:
    """Integrate R runs and return their states at K times; blocks between samples are not measured.

    Parameters
    ----------
    problem : Setup
        System of d coordinates, method and settings.
    steps : (R,) sequence of int
        Steps of each run.
    times : (K,) sequence of Fraction
        Output times, from :func:`checked_times`.
    start, parameters, reference, resumed
        As for :func:`nearharmonic.engine.batch.batch.integrate_batch`.
    """
    count = np.asarray(steps, np.int64)
    # Members of an ensemble take equal steps: exact arithmetic, which is slow, is done once for all of them.
    different, which = np.unique(count, return_inverse=True)
    exact_before = [[int(time * n / problem.end) for time in times] for n in different.tolist()]
    rests = [[time - problem.end * k / n for k, time in zip(row, times, strict=True)]
             for row, n in zip(exact_before, different.tolist(), strict=True)]  # fmt: skip
    lengths = {rest: i for i, rest in enumerate(dict.fromkeys(rest for row in rests for rest in row if rest))}
    shorter = np.array([[lengths.get(rest, -1) for rest in row] for row in rests])[which]
    before = np.array(exact_before, np.int64)[which]
    marks, where = (rows[which] for rows in _marks(np.array(exact_before, np.int64), different))
    paths = problem.run(steps, 2, start=start, parameters=parameters, marks=marks, reference=reference, resumed=resumed)
    rows = np.arange(len(count))[:, None]
    columns = {name: getattr(paths, name)[rows, where] for name in ("q", "q_low", "p", "p_low", "energy_error")}
    if lengths:
        _step_on(problem, paths, columns, shorter, list(lengths), parameters)
    unknown = np.full(before.shape, np.nan)
    found = replace(paths, marks=before, block_max=unknown, block_mean=unknown, **columns)
    return _over_samples(found) if problem.numerics.energy == "samples" else found


def _marks(before: Integers, count: Integers) -> tuple[Integers, Integers]:
    """Steps at which a run has to be sampled, padded with -1, and where among them each of ``before`` is."""
    rows = [np.unique([0, *row, n]) for row, n in zip(before.tolist(), count.tolist(), strict=True)]
    marks = np.full((len(rows), max(map(len, rows))), -1, np.int64)
    for line, row in zip(marks, rows, strict=True):
        line[: len(row)] = row
    return marks, np.stack([np.searchsorted(row, wanted) for row, wanted in zip(rows, before, strict=True)])


def _step_on(
    problem: Setup,
    paths: Trajectories,
    columns: dict[str, Floats],
    shorter: Integers,
    lengths: Sequence[Fraction],
    parameters: Floats,
) -> None:
    """Replace states of the step before by those one shorter step later.

    ``shorter`` (R, K) says which of ``lengths`` that step has, -1 where a state is that of a step itself.
    """
    members, samples = np.nonzero(shorter >= 0)
    first = [columns[name][members, samples] for name in ("q", "q_low", "p", "p_low")]
    batch = problem.batch(
        problem.moves(lengths), single_steps(members.size), shorter[members, samples], np.concatenate(first, axis=1),
        parameters if len(parameters) == 1 else parameters[members],
    )  # fmt: skip
    batch.run()
    found = batch.filled
    d = first[0].shape[1]
    for i, name in enumerate(("q", "q_low", "p", "p_low")):
        columns[name][members, samples] = found.states[:, 1, i * d : (i + 1) * d]
    gained = (found.energy[:, 0] - paths.energy[members]) + (found.energy[:, 1] - paths.energy_low[members])
    unit = energy_unit(paths.energy[members], problem.scale)
    columns["energy_error"][members, samples] = (gained + found.blocks[0, :, 1]) / unit


def _over_samples(paths: Trajectories) -> Trajectories:
    """Dataset with errors over the output times in place of the steps before them."""
    sizes = np.abs(paths.energy_error)
    largest, mean = np.fmax.reduce(sizes, axis=1), sizes.mean(axis=1)
    largest[paths.left_at > 0] = mean[paths.left_at > 0] = np.inf
    return replace(paths, max_energy_error=largest, mean_energy_error=mean)
