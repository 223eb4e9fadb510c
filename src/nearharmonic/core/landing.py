"""The compiled text of runs in a fictitious time, one after the other, whose samples land on given physical times.

A regularised system (:mod:`nearharmonic.systems.regularisation`) is integrated in equal steps of a fictitious time s. A
sample at the time t is one shorter step from the last step before t, whose length Newton's method finds from dt/ds = r.
The run itself does not take that step, but for the last one.

States come and go as physical positions and momenta, mapped in double-double. The step sizes are those of physical time
over the semi-major axis of each start, so that an orbit takes as many steps as in physical time.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from nearharmonic.core import arithmetic
from nearharmonic.core.assembly import Array, Index, Writer, function
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    COLUMNS,
    ENERGY,
    ENERGY_LOW,
    LAND,
    LATEST,
    LIMIT,
    NEVER,
    PROGRESS,
    SAMPLES,
    STOP,
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
    running_at,
    running_rows,
)
from nearharmonic.core.rules import Rules
from nearharmonic.core.scheduler import Runs
from nearharmonic.core.tracing import DoubleDouble
from nearharmonic.core.values import LLVMValue

#: Repeats of Newton's method, which ends before where no repeat comes nearer: four in double, six in double-double.
MOST_REPEATS = 12
#: Part of the way to a sample that is gone at once: the apoapsis of a perturbed orbit may be farther than the start's.
SAFETY = 0.98
#: Over so many steps time grows, unless a method with negative coefficients is far beyond its stability.
ADVANCING = 8

Pair = tuple[LLVMValue, LLVMValue]


def land(rules: Rules, maps: Any) -> tuple[ir.Module, str]:
    """Module and name of a function of :data:`nearharmonic.core.layout.LAND`.

    Parameters
    ----------
    rules : Rules
        The regularised system, of D coordinates.
    maps : object
        ``from_physical(q, p, *parameters)``, ``to_physical(x, y)``, ``inverse_axis(x, *parameters)`` and
        ``largest_radius(x, y, *parameters)``, formulas of numbers; ``dimension`` of physical space.
    """
    module, name = ir.Module("land"), "land"
    writer, given = function(module, name, LAND)
    _Landing(writer, given, rules, maps).write()
    return module, name


class _Landing(Runs):
    """Writes the function. There is one lane, so that a row is a number."""

    def __init__(self, writer: Writer, given: dict[str, Any], rules: Rules, maps: Any) -> None:
        self.rules, self.maps, self.D = rules, maps, rules.physics.dimension
        super().__init__(writer, given, width=writer.index(1), size=writer.index(4 * self.D))
        self.a.fresh = self.a.rows
        self.lane = writer.index(0)
        self.running_at = running_at(self.D, rules.physics.parameters)
        self.block = self.running_at + running_rows(self.D)
        zero = LLVMValue(writer.builder, ir.Constant(ir.DoubleType(), 0.0))
        #: Scale of the run's step, as a pair; the largest |dt/ds| times the step; and steps made.
        self.scale = [writer.variable(zero), writer.variable(zero)]
        self.reach, self.at = writer.variable(zero), writer.variable(writer.index(0))
        self.made, self.over = writer.variable(writer.index(0)), writer.variable(writer.index(0))

    def write(self) -> None:
        writer, a = self.writer, self.a
        for i in writer.range(a.order.shape[0]):
            with writer.when(a.control[STOP].equals(0)):
                self._run(a.order[i])
        writer.builder.ret_void()

    def _run(self, r: Index) -> None:
        writer, a = self.writer, self.a
        for count in (self.at, self.made, self.over):
            count.value = writer.index(0)
        parameters = self._parameters_of(r)
        self._start(a.start[r], parameters)
        pieces = a.moves[a.scheme[r]]
        self._coefficients(a.lanes, pieces, self._value(self.scale))
        with writer.when(~a.measured.equals(NEVER)):
            writer.call(a.begin, BEGIN, [a.rows])
            self._begin(self.lane)
        for half, entry in enumerate((ENERGY, ENERGY_LOW)):
            a.energy[r, half] = a.rows[self._tally(self.lane, entry)]
        sample = writer.variable(writer.index(0))
        with writer.forever() as behind:
            number = sample.value
            writer.leave(number >= a.marks.shape[1], behind)
            mark = a.marks[r, number.at_most(a.marks.shape[1] - 1)]
            writer.leave(mark < 0, behind)
            self._advance_to(r, mark, pieces)
            writer.leave(self.over.value > 0, behind)
            self._sample(r, number, mark, pieces, self._last(r, number))
            writer.leave(self.over.value > 0, behind)
            sample.value = number + 1
        a.ends[r, 0] = writer.number(self.at.value)
        a.ends[r, 1] = writer.number(self.made.value)

    def _last(self, r: Index, number: Index) -> Any:
        return self._was_last(r, number + 1)

    def _value(self, pair: list[Any]) -> Pair:
        return pair[0].value, pair[1].value

    def _pairs_at(self, array: Array, first: int, count: int, apart: int) -> tuple[DoubleDouble, ...]:
        return tuple(DoubleDouble(array[first + i], array[first + apart + i]) for i in range(count))

    def _given(self) -> tuple[Any, ...]:
        """The parameters of the run, in the rows."""
        if self.rules.physics.constants:
            return self.rules.physics.constants
        at, rows = 4 * self.D + TALLY, self.a.rows
        return tuple(DoubleDouble(rows[at + 2 * k], rows[at + 2 * k + 1]) for k in range(self.rules.physics.parameters))

    def _start(self, start: Array, parameters: Array) -> None:
        """The rows at the start of a run, and the scale of its steps."""
        d, D, rows = self.maps.dimension, self.D, self.a.rows
        for k in self.writer.range(rows.shape[0]):
            rows[k] = 0.0
        rows[self._tally(self.lane, LIMIT)] = float("inf")
        for k in self.writer.range(parameters.shape[0]):
            rows[self.size + TALLY + k] = parameters[k]
        given = self._given()
        q, p = self._pairs_at(start, 0, d, d), self._pairs_at(start, 2 * d, d, d)
        x, y = self.maps.from_physical(q, p, *given)
        keep = 1.0 if self.rules.compensated else 0.0
        for i, number in enumerate((*x, *y)):
            place = i if i < D else D + i
            for at in (0, self.running_at):
                rows[at + place], rows[at + D + place] = number.high, number.low * keep
        inverse = self.maps.inverse_axis(x, *given)
        self.scale[0].value, self.scale[1].value = inverse.pair
        self.reach.value = self.maps.largest_radius(x, y, *given).high * inverse.high

    def _coefficients(self, lanes: Array, pieces: Array, scale: Pair) -> None:
        """The rows of coefficients of a step that is ``scale`` times that of the pieces."""
        square = arithmetic.dd_mul(scale, scale)
        for i in self.writer.range(pieces.shape[0] - 1):
            kick, drift, product = ((pieces[i, 2 * k], pieces[i, 2 * k + 1]) for k in range(3))
            kick, drift = arithmetic.dd_mul(kick, scale), arithmetic.dd_mul(drift, scale)
            high = arithmetic.dd_mul(product, square)[0]
            rest = arithmetic.fma(kick[0], drift[0], -high)
            row = [*kick, *drift] if self.rules.extended else [kick[0], drift[0], high, rest]
            for column, number in enumerate(row):
                lanes[i * COLUMNS + column] = number

    def _gap(self, rows: Array, target: Pair) -> LLVMValue:
        """The time from a state to a target, over 4: its conjugate momentum is -t/4."""
        high, low = 3 * self.D - 1, 4 * self.D - 1
        gap: LLVMValue = (rows[high] + target[0]) + (rows[low] + target[1])
        return gap

    def _target(self, pieces: Array, mark: Index) -> Pair:
        """A quarter of the time of a mark, which counts physical time in steps."""
        last = pieces.shape[0] - 1
        steps = self.writer.number(mark)
        quarter = pieces[last, 0] * 0.25, pieces[last, 1] * 0.25
        return arithmetic.dd_mul(quarter, (steps, steps.constant(0.0)))

    def _radius(self, rows: Array) -> LLVMValue:
        """|u|^2."""
        total: LLVMValue = rows[0] * rows[0]
        for k in range(1, self.D - 1):
            total = arithmetic.fma(rows[k], rows[k], total)
        return total

    def _step(self, rows: Array, lanes: Array, count: Index, advance: Index) -> Index:
        done: Index = self.writer.call(advance, ADVANCE, [count, self.a.stages, self.a.kick_first, lanes, rows])
        self.made.value = self.made.value + done
        return done

    def _ahead(self, target: Pair, pieces: Array) -> tuple[LLVMValue, LLVMValue]:
        """The gap to the target and the change of the gap by a step of radius 1, both in the direction of the run."""
        tau = pieces[pieces.shape[0] - 1, 0]
        backwards = tau.less(0.0)
        gap = self._gap(self.a.rows, target)
        return backwards.choose(-gap, gap), tau.absolute() * 0.25

    def _advance_to(self, r: Index, mark: Index, pieces: Array) -> None:
        """All steps before a mark, and none behind it."""
        writer, a = self.writer, self.a
        target = self._target(pieces, mark)
        with writer.forever() as behind:
            gap, change = self._ahead(target, pieces)
            writer.leave(~gap.greater(0.0), behind)
            writer.leave(~a.control[STOP].equals(0), behind)
            steps = writer.whole(gap / (change * self.reach.value) * SAFETY)
            with writer.when(steps > 0):
                moved = self._step(a.rows, a.lanes, steps.at_most(a.stretch), a.advance)
                self._count(r, moved)
                left, _ = self._ahead(target, pieces)
                # Such a run would never arrive.
                with writer.when((moved >= ADVANCING) & ~left.less(gap)):
                    a.left_at[r] = self.at.value
                    self.over.value = writer.index(1)
            writer.leave(self.over.value > 0, behind)
            with writer.when(~(steps > 0)):
                self._try_one(r, target, pieces, behind)

    def _try_one(self, r: Index, target: Pair, pieces: Array, behind: ir.Block) -> None:
        """One step, unless it passes the target: then none."""
        writer, a = self.writer, self.a
        self._copy(a.rows, a.trial)
        self._copy(a.lanes, a.trial_lanes)
        self._step(a.trial, a.trial_lanes, writer.index(1), a.advance)
        backwards = pieces[pieces.shape[0] - 1, 0].less(0.0)
        gap = self._gap(a.trial, target)
        # What is no number does not pass: the run has left.
        writer.leave(backwards.choose(-gap, gap).less(0.0), behind)
        self._copy(a.trial, a.rows)
        self._copy(a.trial_lanes, a.lanes)
        self._count(r, writer.index(1))
        writer.leave(self.over.value > 0, behind)

    def _copy(self, source: Array, to: Array) -> None:
        for k in self.writer.range(source.shape[0]):
            to[k] = source[k]

    def _count(self, r: Index, moved: Index) -> None:
        """Steps of the run are done; it is over if it has left its energy surface."""
        writer, a = self.writer, self.a
        self.at.value = self.at.value + moved
        a.control[PROGRESS] = a.control[PROGRESS] + moved
        with writer.when((a.measured < SAMPLES) | a.measured.equals(NEVER)):
            self._leave_surface(r, a.rows, self.at.value)

    def _leave_surface(self, r: Index, rows: Array, step: Index) -> None:
        writer, a = self.writer, self.a
        latest = writer.variable(rows[self._tally(self.lane, LATEST)].absolute())
        with writer.when(a.measured.equals(NEVER)):
            self._unless_finite(self.lane, latest)
        with writer.when(latest.value.any_not_within(rows[self._tally(self.lane, LIMIT)])):
            a.left_at[r] = step
            self.over.value = writer.index(1)

    def _sample(self, r: Index, number: Index, mark: Index, pieces: Array, last: Any) -> None:
        """Land on the mark, and record the state there."""
        writer, a = self.writer, self.a
        target = self._target(pieces, mark)
        self._copy(a.rows, a.trial)
        gap, _ = self._ahead(target, pieces)
        landed = gap.greater(0.0)
        with writer.when(landed):
            self._newton(target, pieces)
        with writer.when(landed & last):
            self.at.value = self.at.value + 1
            with writer.when(~a.measured.equals(NEVER)):
                latest = a.trial[self._tally(self.lane, LATEST)].absolute()
                total = self._tally(self.lane, TOTAL)
                a.rows[self._tally(self.lane, WORST)] = latest.larger(a.rows[self._tally(self.lane, WORST)])
                a.rows[total] = a.rows[total] + latest
        with writer.when(a.measured.equals(SAMPLES)):
            latest = a.trial[self._tally(self.lane, LATEST)].absolute()
            a.rows[self._tally(self.lane, WORST)] = a.rows[self._tally(self.lane, TOTAL)] = latest
            a.rows[self._tally(self.lane, TOTAL_CARRY)] = 0.0
        with writer.when(~a.measured.equals(NEVER)):
            before: Index = self.at.value
            self._leave_surface(r, a.trial, writer.either(last, before, before + 1))
        with writer.when(self.over.value.equals(0)):
            self._record_physical(r, number)

    def _newton(self, target: Pair, pieces: Array) -> None:
        """The state ``trial`` at the target, one step of the right length from ``rows``."""
        writer, a = self.writer, self.a
        tau = pieces[pieces.shape[0] - 1, 0]
        one = tau.constant(1.0)
        whole = self._value(self.scale)
        part = [writer.variable(one), writer.variable(one.constant(0.0))]
        unit = tau * 0.25 * whole[0]
        part[0].value = self._gap(a.rows, target) / (unit * self._radius(a.rows))
        repeats, before = writer.variable(writer.index(0)), writer.variable(one.constant(float("inf")))
        with writer.forever() as behind:
            self._copy(a.rows, a.trial)
            for k in writer.range(self.size):
                a.trial[k + self.running_at] = a.trial[k]
            for k in writer.range(self.D):
                a.trial[k + (self.running_at + 4 * self.D)] = 0.0
            self._coefficients(a.trial_lanes, pieces, arithmetic.dd_mul(whole, self._value(part)))
            self._step(a.trial, a.trial_lanes, writer.index(1), a.look)
            gap = self._gap(a.trial, target)
            size = gap.absolute()
            repeats.value = repeats.value + 1
            writer.leave(repeats.value >= MOST_REPEATS, behind)
            writer.leave(~size.less(before.value), behind)
            before.value = size
            writer.leave(size.equals(0.0), behind)
            change = gap / (unit * self._radius(a.trial))
            high, low = arithmetic.dd_add_double(self._value(part), change)
            part[0].value, part[1].value = high, low

    def _record_physical(self, r: Index, number: Index) -> None:
        """One sample: the physical state of ``trial``, and what the block of steps since the last one came to."""
        a, d, D = self.a, self.maps.dimension, self.D
        x, y = self._pairs_at(a.trial, 0, D, D), self._pairs_at(a.trial, 2 * D, D, D)
        q, p = self.maps.to_physical(x, y)
        keep = 1.0 if self.rules.compensated else 0.0
        for first, vector in ((0, q), (2 * d, p)):
            for i, component in enumerate(vector):
                a.states[r, number, first + i] = component.high
                a.states[r, number, first + d + i] = component.low * keep
        worst, total, carry = (self._tally(self.lane, entry) for entry in (WORST, TOTAL, TOTAL_CARRY))
        a.energy_error[r, number] = a.trial[self._tally(self.lane, LATEST)]
        a.worst[r, number] = a.rows[worst]
        a.total[r, number] = a.rows[total] + a.rows[carry]
        a.rows[worst] = a.rows[total] = a.rows[carry] = 0.0
