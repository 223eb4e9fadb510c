"""The loops of kernels: over steps, over a queue of runs, and to samples at physical times.

Rows of arrays are described in :mod:`nearharmonic.core.kernel`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isnan, nan
from typing import Any

from nearharmonic.core import collocation, step
from nearharmonic.core.arithmetic import dd_add_double, dd_mul, fma, two_sum
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    COLUMNS,
    CONDITION,
    COUNTERS,
    ENERGY,
    ENERGY_LOW,
    FAR,
    INNER,
    LATEST,
    LIMIT,
    MERGED,
    NEAR,
    NEVER,
    PROGRESS,
    SAMPLES,
    STOP,
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
    Form,
)
from nearharmonic.core.reals import (
    VOID,
    absolute,
    all_greater,
    all_within,
    at_address,
    larger,
    linked,
    linked_number,
    load_parameters,
    load_point,
    load_real,
    scratch,
    shifted,
    store,
    where_greater,
    zero_like,
)

# --- Scheduler: feeds a queue of runs to the SIMD lanes of a kernel; an idle lane takes the next run.
#
# The scheduler is compiled once for all kernels and calls them by address.

#: An energy below this fraction of the kinetic energy is 0 within the rounding of double-doubles.
NEGLIGIBLE = 2.0**-98
#: States of a lane without a run: it takes the next run; the queue is empty.
FREE, IDLE = -1, -2

advance_at, begin_at = at_address(ADVANCE), at_address(BEGIN)


def begin_tally(rows, fresh, lane, width, size, limit, scale, reference):
    """Start the tally of a lane with the tally ``fresh``, and make its limit absolute.

    The given limit is relative to |H0|, to |T| if H0 = 0, or to ``scale`` if that is not 0.
    """
    at = size * width + lane
    for entry in range(TALLY):
        rows[at + entry * width] = fresh[at + entry * width]
    high, low, kinetic = rows[at + ENERGY * width], rows[at + ENERGY_LOW * width], rows[at + LIMIT * width]
    if kinetic * NEGLIGIBLE >= abs(high):
        high = low = 0.0
    if not isnan(reference[0]):
        rows[at + LATEST * width] = (high - reference[0]) + (low - reference[1])
        high, low = reference[0], reference[1]
    rows[at + ENERGY * width], rows[at + ENERGY_LOW * width] = high, low
    unit = scale if scale != 0 else abs(high) if high != 0 else kinetic
    rows[at + LIMIT * width] = limit * unit if unit != 0 else inf


def latest_error(rows, lane, width, size, measured):
    """|H - H0| of a lane; if no energy is measured, 0, or NaN for a state that is not finite."""
    if measured != NEVER:
        return abs(rows[(size + LATEST) * width + lane])
    found = 0.0
    for k in range(size):
        found += rows[k * width + lane] * 0.0
    return found


def measure_alone(rows, lane, width, size, latest):
    """Set the tally to the latest error, if the energy is measured only at the samples."""
    at = size * width + lane
    rows[at + WORST * width] = rows[at + TOTAL * width] = latest
    rows[at + TOTAL_CARRY * width] = 0.0


def record_errors(rows, lane, width, size, at, latest, energy_error, worst, total):
    """Record the errors of the block of steps since the last sample, and start a new block."""
    first = size * width + lane
    energy_error[at] = latest
    worst[at] = rows[first + WORST * width]
    total[at] = rows[first + TOTAL * width] + rows[first + TOTAL_CARRY * width]
    rows[first + WORST * width] = rows[first + TOTAL * width] = rows[first + TOTAL_CARRY * width] = 0.0


def _record(rows, lane, width, size, at, states, energy_error, worst, total):
    for k in range(size):
        states[at * size + k] = rows[k * width + lane]
    latest = rows[(size + LATEST) * width + lane]
    record_errors(rows, lane, width, size, at, latest, energy_error, worst, total)


def _place(rows, lane, shape, start, r, parameters, row):
    """Load the state and the parameters of a run into a lane."""
    width, size, running_rows, first, parameter_columns = shape
    for k in range(running_rows):
        rows[(first + k) * width + lane] = 0.0
    for k in range(size):
        rows[k * width + lane] = rows[(first + k) * width + lane] = start[r * size + k]
    for entry in range(TALLY):
        rows[(size + entry) * width + lane] = 0.0
    rows[(size + LIMIT) * width + lane] = inf
    for k in range(parameter_columns):
        rows[(size + TALLY + k) * width + lane] = parameters[row * parameter_columns + k]


def _resume(rows, lanes, lane, shape, resumed, r, merged, columns):
    """Load the running state of a continued run into a lane, with the coefficients of a merged first move."""
    width, _, running_rows, first, _ = shape
    for k in range(running_rows):
        rows[(first + k) * width + lane] = resumed[r * running_rows + k]
    for column in range(columns):
        lanes[column * width + lane] = lanes[(merged * columns + column) * width + lane]


def _steps_to_next_sample(runs, at, mark, width, marks, samples):
    """Return the smallest number of steps of a lane to its next sample; :data:`FAR` if all lanes are idle."""
    count = FAR
    for lane in range(width):
        if runs[lane] >= 0:
            count = min(count, marks[runs[lane] * samples + mark[lane]] - at[lane])
    return count


def _run(  # noqa: PLR0912 (what a lane goes through, in order)
    advance, begin, measured, order, queued, marks, samples, scheme, start, size, resumed, resumptions, parameters,
    parameter_sets, parameter_columns, limit, scale, reference, stretch, stages, kick_first, moves, move_rows, columns,
    control, states, energy_error, worst, total, energy, running, running_rows, left_at, rows, numbers, fresh, lanes,
    coefficient_count, runs, width, at, mark,
):  # fmt: skip
    """Pass the runs of a queue through the lanes.

    An idle lane stays at a regular point, the start of the first run: a NaN in it would stop the other lanes. A run has
    diverged when its energy error exceeds its limit; if no energy is measured, when its state is not finite.
    """
    taken, per_run, first = 0, move_rows * columns, size + TALLY + max(1, parameter_columns)
    shape = width, size, running_rows, first, parameter_columns
    for lane in range(width):
        runs[lane] = FREE
    while control[STOP] == 0:
        before = taken
        for lane in range(width):
            if runs[lane] == FREE:
                idle = taken == queued
                r = order[0] if idle else order[taken]
                taken += not idle
                runs[lane], at[lane], mark[lane] = IDLE if idle else r, 0, 0
                _place(rows, lane, shape, start, r, parameters, min(r, parameter_sets - 1))
                for i in range(per_run):
                    lanes[i * width + lane] = 0.0 if idle else moves[scheme[r] * per_run + i]
                if resumptions > 0 and not idle:
                    _resume(rows, lanes, lane, shape, resumed, r, MERGED, columns)
        if taken > before and measured != NEVER:
            for i in range(numbers):
                fresh[i] = rows[i]
            begin_at(begin, fresh, numbers)
        for lane in range(width):
            r = runs[lane]
            if r >= 0 and mark[lane] == 0:
                if measured != NEVER:
                    begin_tally(rows, fresh, lane, width, size, limit, scale, reference)
                energy[2 * r] = rows[(size + ENERGY) * width + lane]
                energy[2 * r + 1] = rows[(size + ENERGY_LOW) * width + lane]
                _record(rows, lane, width, size, r * samples, states, energy_error, worst, total)
                mark[lane] = 1
        count = _steps_to_next_sample(runs, at, mark, width, marks, samples)
        if count == FAR:
            break
        done = advance_at(advance, min(count, stretch), stages, kick_first, lanes, coefficient_count, rows, numbers)
        for lane in range(width):
            r = runs[lane]
            if r < 0:
                continue
            at[lane] += done
            control[PROGRESS] += done
            sample, over = r * samples + mark[lane], False
            due = at[lane] >= marks[sample]
            # An energy that is measured only at the samples must not depend on the sample times of other lanes.
            if due or measured < SAMPLES:
                latest = latest_error(rows, lane, width, size, measured)
                if not latest <= rows[(size + LIMIT) * width + lane]:
                    left_at[r], over = at[lane], True
                if measured == SAMPLES:
                    measure_alone(rows, lane, width, size, latest)
            if due and not over:
                _record(rows, lane, width, size, sample, states, energy_error, worst, total)
                mark[lane] += 1
                over = mark[lane] == samples or marks[sample + 1] < 0
            if over:
                runs[lane] = FREE
                for k in range(running_rows):
                    running[r * running_rows + k] = rows[(first + k) * width + lane]


def run() -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.RUN`, to be compiled."""
    return _run


# --- The loops of the inner kernel: steps of one trajectory, or of one in each lane, and the energy after each step.
#
# :func:`advance` and :func:`begin` return the functions of :data:`nearharmonic.core.layout.ADVANCE` and ``BEGIN`` for a
# :class:`~nearharmonic.core.layout.Form`. States are points or in memory (:mod:`nearharmonic.core.step`).

#: Rows: of coefficients of a move; the first of the tally, and of the parameters.
_columns, _tally, _parameters = (linked_number(name) for name in ("columns", "tally", "parameters"))
#: 1 if the energy is measured, else 0; 1 if it is measured after every step, 0 if after the last one.
_measuring, _at_every_step = linked_number("measuring"), linked_number("at_every_step")


def _load_tally(rows, at):
    """The errors up to now, H0 as a pair, the rounding error of H in double, and the limit."""
    errors = load_real(rows, at + WORST), load_real(rows, at + TOTAL), load_real(rows, at + TOTAL_CARRY)
    H0 = load_real(rows, at + ENERGY), load_real(rows, at + ENERGY_LOW)
    rounding = load_real(rows, at + NEAR), load_real(rows, at + CONDITION)
    return (*errors, load_real(rows, at + LATEST)), H0, rounding, load_real(rows, at + LIMIT)


def _store_errors(rows, at, worst, total, carry, latest):
    store(rows, at + WORST, worst)
    store(rows, at + TOTAL, total)
    store(rows, at + TOTAL_CARRY, carry)
    store(rows, at + LATEST, latest)


def _tallied(worst, total, carry, latest):
    """The maximum and the sum of the energy errors, updated by the latest one."""
    size = absolute(latest)
    carried = carry + size
    new = total + carried
    return larger(size, worst), new, carried + (total - new)


def _measure(form: Form) -> Any:
    """``measure(seen, height, kick_first, H0, rounding, parameters)``: H - H0, in double if that is accurate enough.

    ``height`` is V at the position of the last force: the final position if the step ends with a kick.
    """
    energy, potential, kinetic = (step.measured(name, large=form.large) for name in ("energy", "potential", "kinetic"))

    def difference(high, low, H0):
        return (high - H0[0]) + (low - H0[1])

    def exact(seen, height, kick_first, H0, rounding, parameters):
        high, low = energy(seen, parameters)
        return difference(high, low, H0)

    def quick(seen, height, kick_first, H0, rounding, parameters):
        V = height if kick_first else potential(seen, parameters)
        T = kinetic(seen, parameters)
        high, low = two_sum(T, V)
        latest = difference(high, low, H0)
        bound = rounding[0] + rounding[1] * (absolute(T) + absolute(V))
        if not all_greater(absolute(latest), bound):
            latest = where_greater(absolute(latest), bound, latest, exact(seen, V, True, H0, rounding, parameters))
        return latest

    return quick if form.quick else exact


def _stretch(form: Form) -> Any:
    """``stretch(count, stages, kick_first, moves, rows, opening)``, which returns the steps done.

    ``opening`` is the row of the first move.
    """
    load, first, move, behind, last, closed, save = (collocation if form.stages else step).motion(form)
    row_of, measure, quick = step.row_loader(form), _measure(form), form.quick

    def stretch(count, stages, kick_first, moves, rows, opening):
        tally, columns, parameters = _tally(), _columns(), load_parameters(rows, _parameters())
        opened = shifted(moves, opening)
        state, seen = load(rows, opened, parameters)
        (worst, total, carry, latest), H0, rounding, limit = _load_tally(rows, tally)
        f, height = first(state, opened, parameters), zero_like(limit)
        done = 0
        while True:
            row = opening
            for i in range(stages - 1 if quick else stages):
                state = move(state, row_of(moves, row), f, parameters)
                f = behind(state, moves, row, parameters)
                row = row + columns if i > 0 else INNER * columns
            if quick:
                state = move(state, row_of(moves, row), f, parameters)
                f, height = last(state, moves, row, parameters)
            done += 1
            if done >= count or _at_every_step() != 0:
                seen = closed(state, row_of(moves, (stages + 1) * columns), f, parameters)
                if _measuring() != 0:
                    latest = measure(seen, height, kick_first, H0, rounding, parameters)
                    worst, total, carry = _tallied(worst, total, carry, latest)
                    if not all_within(absolute(latest), limit):
                        break
            if done >= count:
                break
            opening = MERGED * columns
        save(rows, state, seen)
        _store_errors(rows, tally, worst, total, carry, latest)
        return done

    return stretch


def advance(form: Form) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.ADVANCE`, to be compiled."""
    stretch = _stretch(form)

    def advance(count, stages, kick_first, moves, rows):
        done, columns = stretch(count, stages, kick_first, moves, rows, 0), _columns()
        for column in range(columns):
            store(moves, column, load_real(moves, MERGED * columns + column))
        return done

    return advance


def begin(*, large: bool, quick: bool) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.BEGIN`, to be compiled."""
    energies, rounding = (step.measured(name, large=large) for name in ("energies", "rounding"))
    load_state = step.load_state

    def begin(rows):
        tally, parameters = _tally(), load_parameters(rows, _parameters())
        seen = rows if large else load_state(rows, 0)
        H, H_low, T, zero = energies(seen, parameters)
        near, condition = rounding(seen, parameters) if quick else (zero, zero)
        for entry in range(LIMIT):
            store(rows, tally + entry, zero)
        store(rows, tally + ENERGY, H)
        store(rows, tally + ENERGY_LOW, H_low)
        store(rows, tally + LIMIT, absolute(T))
        store(rows, tally + NEAR, near)
        store(rows, tally + CONDITION, condition)

    return begin


# --- A run in a thread of a GPU: what :func:`_run` does for a lane, with its rows in registers during a call.

_thread, _running = linked_number("thread"), linked_number("running")


def member(form: Form) -> Callable[..., Any]:  # noqa: PLR0915 (the functions of a run, as in :func:`_run`)
    """Return the function of :data:`nearharmonic.core.layout.MEMBER`, to be compiled."""
    stretch, begin_rows = _stretch(form), begin(large=False, quick=form.quick)

    def place(rows, r, stride, start, parameters, parameter_sets):
        size, running, given = _tally(), _running(), _parameters()
        for k in range(running):
            rows[k] = 0.0
        for k in range(size):
            rows[k] = rows[running + k] = start[k * stride + r]
        for k in range(_tally() // 4):
            rows[running + size + k] = 0.0
        rows[size + LIMIT] = inf
        for k in range(running - given):
            rows[given + k] = parameters[k * parameter_sets + min(r, parameter_sets - 1)]

    def keep(rows, i, stride, states, energy_error, worst, total, sample):
        size, place = _tally(), sample * stride + i
        for k in range(size):
            states[(sample * size + k) * stride + i] = rows[k]
        record_errors(rows, 0, 1, size, place, rows[size + LATEST], energy_error, worst, total)

    def member(  # noqa: PLR0912 (what a run goes through, in order)
        first, count, stride, most, look, measured, samples, marks, scheme, start, parameters, parameter_sets, limit,
        scale, reference, stages, kick_first, moves, states, energy_error, worst, total, energy, running, left_at,
        work, at, mark,
    ):  # fmt: skip
        r = first + _thread()
        if r >= count:
            return
        size, running_at, columns, rows = _tally(), _running(), _columns(), scratch()
        numbers, sample, left, done = running_at + 5 * (size // 4), mark[r], most, at[r]
        coefficients = shifted(moves, scheme[r] * (stages + 2) * columns)
        if sample == 0:
            place(rows, r, stride, start, parameters, parameter_sets)
            if measured != NEVER:
                begin_rows(rows)
                begin_tally(rows, rows, 0, 1, size, limit, scale, reference)
            energy[r], energy[stride + r] = rows[size + ENERGY], rows[size + ENERGY_LOW]
            left_at[r] = 0
            keep(rows, r, stride, states, energy_error, worst, total, 0)
            sample = 1
        else:
            for k in range(numbers):
                rows[k] = work[k * stride + r]
        over = False
        while sample < samples:
            due = marks[sample * stride + r]
            over = due < 0
            if over or left == 0:
                break
            opening = 0 if done == 0 else MERGED * columns
            some = min(due - done, look)
            made = stretch(min(some, left), stages, kick_first, coefficients, rows, opening)
            done += made
            left -= made
            latest = latest_error(rows, 0, 1, size, measured)
            if done >= due or measured < SAMPLES:
                if not latest <= rows[size + LIMIT]:
                    left_at[r], over = done, True
                    break
                if measured == SAMPLES:
                    measure_alone(rows, 0, 1, size, latest)
            if done >= due:
                keep(rows, r, stride, states, energy_error, worst, total, sample)
                sample += 1
        while over and sample < samples:  # behind the end of a run, or where it has diverged
            for k in range(size):
                states[(sample * size + k) * stride + r] = nan
            place_of = sample * stride + r
            energy_error[place_of] = worst[place_of] = total[place_of] = nan
            sample += 1
        at[r], mark[r] = done, sample
        for k in range(numbers):
            work[k * stride + r] = rows[k]
        for k in range(5 * (size // 4)):
            running[k * stride + r] = rows[running_at + k]

    return member


# --- Sequential runs in a fictitious time, with samples at given physical times.
#
# A regularised system (:mod:`nearharmonic.systems.formulas`) is integrated in equal steps of a fictitious
# time s. A sample at the time t is the end of one shorter step from the last state before t. Newton's method finds the
# length of this step from dt/ds = r. The run itself does not take this step, except for the last sample.
#
# States at the start and at samples are physical positions and momenta, mapped in double-double. The step in s is the
# physical step size over the semi-major axis of the start, so that an orbit takes as many steps as in physical time.
# There is one lane, so that a row is a number. The last row of ``moves`` is the step size.

#: Largest number of Newton iterations. Four suffice in double, six in double-double; they end when no iteration comes
#: nearer.
MOST_REPEATS = 12
#: Fraction of the way to a sample that is advanced at once: a perturbed orbit may have a farther apoapsis than the
#: start's.
SAFETY = 0.98
#: Number of steps over which time grows, unless a method with negative coefficients is far beyond its stability limit.
ADVANCING = 8
#: Doubles in a row of coefficients: pairs of the kick, the drift and their product, for a step of scale 1.
PIECES = 6
#: A number of steps that no call makes.
MANY = 2.0**52

#: Number of coordinates of the regularised system, and the first rows of its running state and of its counters.
_dimension, _running, _counters = map(linked_number, ("dimension", "running", "counters"))
#: ``_departed(start, first, rows, to)`` computes the state x, y of a physical start, the scale of its steps as a pair,
#: and the largest |dt/ds| times a step of scale 1. ``_physical(state, to, first)``: the physical state.
_departed, _physical = linked("departed", VOID), linked("physical", VOID)


def _copy(source, to, count):
    for k in range(count):
        to[k] = source[k]


def _gap(rows, target):
    """The time from a state to a target, divided by 4: the last momentum of a state is -t/4."""
    D = _dimension()
    return (rows[3 * D - 1] + target[0]) + (rows[4 * D - 1] + target[1])


def _radius(rows):
    """|u|^2."""
    total = rows[0] * rows[0]
    for k in range(1, _dimension() - 1):
        total = fma(rows[k], rows[k], total)
    return total


def _coefficients(*, extended: bool) -> Any:
    """Return ``coefficients(lanes, moves, first, rows, scale)`` for a step ``scale`` times as long."""

    def coefficients(lanes, moves, first, rows, scale):
        square = dd_mul(scale, scale)
        for i in range(rows):
            at, to = first + PIECES * i, COLUMNS * i
            kick, drift = dd_mul((moves[at], moves[at + 1]), scale), dd_mul((moves[at + 2], moves[at + 3]), scale)
            product = dd_mul((moves[at + 4], moves[at + 5]), square)[0]
            lanes[to], lanes[to + 1] = kick[0], kick[1] if extended else drift[0]
            lanes[to + 2] = drift[0] if extended else product
            lanes[to + 3] = drift[1] if extended else fma(kick[0], drift[0], -product)

    return coefficients


def _set_out(start, first, parameters, row, count, rows, numbers, trial, keep):
    """Fill the rows at the start of a run; return the scale of its steps, and the largest |dt/ds| times the step."""
    D, running = _dimension(), _running()
    for k in range(numbers):
        rows[k] = 0.0
    rows[4 * D + LIMIT] = inf
    for k in range(count):
        rows[4 * D + TALLY + k] = parameters[row + k]
    _departed(start, first, rows, trial)
    for k in range(4 * D):
        rows[k] = rows[running + k] = trial[k] * (keep if k // D % 2 else 1.0)
    return (trial[4 * D], trial[4 * D + 1]), trial[4 * D + 2]


def _steps(advance, count, form, lanes, rows):
    stages, kick_first, coefficients, numbers = form
    return advance_at(advance, count, stages, kick_first, lanes, coefficients, rows, numbers)


def _approach(advance, form, target, tau, reach, look, control, rows, lanes, trial, trial_lanes):
    """Make all steps before a target; return their number, that with trial steps, and if the run diverged."""
    stretch, measured = look
    limited = measured < SAMPLES or measured == NEVER
    at, made, size = 0, 0, 4 * _dimension()
    direction = -1.0 if tau < 0 else 1.0
    while control[STOP] == 0:
        gap = direction * _gap(rows, target)
        if not gap > 0:
            break
        ahead = gap / (abs(tau) * 0.25 * reach) * SAFETY
        steps = int(ahead if ahead < MANY else MANY)
        if steps > 0:
            moved = _steps(advance, min(steps, stretch), form, lanes, rows)
            made += moved
        else:  # one step, unless it passes the target; a NaN does not pass it, and the run has diverged
            _copy(rows, trial, form[3])
            _copy(lanes, trial_lanes, form[2])
            made += _steps(advance, 1, form, trial_lanes, trial)
            if direction * _gap(trial, target) < 0:
                break
            _copy(trial, rows, form[3])
            _copy(trial_lanes, lanes, form[2])
            moved = 1
        at += moved
        control[PROGRESS] += moved
        left = limited and not latest_error(rows, 0, 1, size, measured) <= rows[size + LIMIT]
        # A run that does not approach the target never reaches it.
        if left or (moved >= ADVANCING and not direction * _gap(rows, target) < gap):
            return at, made, True
    return at, made, False


def _conclude(ends, first, count, state, at, made, rows):
    """Record the steps of a run, and the counters of an implicit method, which follow a state of so many rows."""
    ends[first], ends[first + 1] = at, made
    if count > state:
        for k in range(COUNTERS):
            ends[first + count - COUNTERS + k] = rows[_counters() + k]


def _landing(coefficients: Any) -> Any:
    """``land(...)``: one step from ``rows`` to the target, into ``trial``; return the number of trial steps."""

    def land(look, form, moves, first, count, scale, target, rows, trial, lanes):
        D, running = _dimension(), _running()
        unit = moves[first + PIECES * count] * 0.25 * scale[0]
        part = (_gap(rows, target) / (unit * _radius(rows)), 0.0)
        before, repeats = inf, 0
        while True:
            _copy(rows, trial, form[3])
            for k in range(5 * D):
                trial[running + k] = trial[k] if k < 4 * D else 0.0
            coefficients(lanes, moves, first, count, dd_mul(scale, part))
            _steps(look, 1, form, lanes, trial)
            gap = _gap(trial, target)
            repeats += 1
            if repeats >= MOST_REPEATS or not abs(gap) < before or gap == 0:
                return repeats
            before = abs(gap)
            part = dd_add_double(part, gap / (unit * _radius(trial)))

    return land


def land(*, extended: bool, compensated: bool) -> Callable[..., None]:
    """Return the function of :data:`nearharmonic.core.layout.LAND`, to be compiled.

    :func:`nearharmonic.core.emission.maps_module` writes the functions of the regularised system.
    """
    coefficients, keep = _coefficients(extended=extended), 1.0 if compensated else 0.0
    land_on = _landing(coefficients)

    def land(
        advance, look, begin, measured, order, queued, marks, samples, scheme, start, size, parameters, parameter_sets,
        parameter_columns, limit, scale, reference, stretch, stages, kick_first, moves, move_rows, columns, control,
        states, energy_error, worst, total, energy, ends, running_rows, left_at, rows, numbers, lanes,
        coefficient_count, trial, trial_lanes,
    ):  # fmt: skip
        d, count, tally = size // 4, move_rows - 1, 4 * _dimension()
        form = stages, kick_first, coefficient_count, numbers
        for i in range(queued):
            if control[STOP] != 0:
                break
            r, at, made = order[i], 0, 0
            first = scheme[r] * move_rows * columns
            tau, tau_low = moves[first + count * columns], moves[first + count * columns + 1]
            row = min(r, parameter_sets - 1) * parameter_columns
            step, reach = _set_out(start, r * size, parameters, row, parameter_columns, rows, numbers, trial, keep)
            coefficients(lanes, moves, first, count, step)
            if measured != NEVER:
                begin_at(begin, rows, numbers)
                begin_tally(rows, rows, 0, 1, tally, limit, scale, reference)
            energy[2 * r], energy[2 * r + 1] = rows[tally + ENERGY], rows[tally + ENERGY_LOW]
            for sample in range(r * samples, (r + 1) * samples):
                if marks[sample] < 0:
                    break
                target = dd_mul((tau * 0.25, tau_low * 0.25), (float(marks[sample]), 0.0))
                more, tried, left = _approach(
                    advance, form, target, tau, reach, (stretch, measured), control, rows, lanes, trial, trial_lanes
                )
                at, made = at + more, made + tried
                if left:
                    left_at[r] = at
                    break
                last = sample + 1 == (r + 1) * samples or marks[sample + 1] < 0
                _copy(rows, trial, numbers)
                lands = _gap(rows, target) < 0 if tau < 0 else _gap(rows, target) > 0
                if lands:
                    made += land_on(look, form, moves, first, count, step, target, rows, trial, trial_lanes)
                latest = abs(trial[tally + LATEST])
                if lands and last:
                    at += 1
                    if measured != NEVER:
                        rows[tally + WORST] = latest if latest > rows[tally + WORST] else rows[tally + WORST]
                        rows[tally + TOTAL] += latest
                if measured == SAMPLES:
                    measure_alone(rows, 0, 1, tally, latest)
                if measured != NEVER and not latest <= trial[tally + LIMIT]:
                    left_at[r] = at if last else at + 1
                    break
                _physical(trial, states, sample * size)
                for k in range(d):
                    states[sample * size + d + k] *= keep
                    states[sample * size + 3 * d + k] *= keep
                record_errors(rows, 0, 1, tally, sample, trial[tally + LATEST], energy_error, worst, total)
            _conclude(ends, r * running_rows, running_rows, 5 * d, at, made, rows)

    return land


# --- A single step on arrays of the caller, without energy or samples.
#
# It makes the moves of :func:`advance`, and is bitwise identical to a run of one step.


def single_step(form: Form) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.STEP`, to be compiled.

    A run computes a force at its start even if it drifts first, and does not use it; a step does not compute it.
    """
    row_of, steps = step.row_loader(form), step.motion(form)
    move, closed, first_force, force_behind = steps.move, steps.closed, steps.first, steps.behind
    modified, compensated = form.modified, form.compensated

    def step_alone(stages, kick_first, moves, parameters, q, carry_q, p, carry_p):
        columns, given = _columns(), load_parameters(parameters, 0)
        x, y = load_point(q, 0), load_point(p, 0)
        low, y_low = zero_like(x), zero_like(y)
        if compensated:
            low, y_low = load_point(carry_q, 0), load_point(carry_p, 0)
        state = x, low, y, y_low, zero_like(x)
        f = zero_like((x, x) if modified else x)
        if kick_first:
            f = first_force(state, moves, given)
        row = 0
        for i in range(stages):
            state = move(state, row_of(moves, row), f, given)
            f = force_behind(state, moves, row, given)
            row = (INNER + i) * columns
        x, low, y, y_low = closed(state, row_of(moves, (stages + 1) * columns), f, given)
        store(q, 0, x)
        store(p, 0, y)
        if compensated:
            store(carry_q, 0, low)
            store(carry_p, 0, y_low)

    return step_alone
