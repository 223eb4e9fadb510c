"""The compiled text of a queue of runs through the lanes of a kernel: a lane that is done takes the next run.

One compilation serves all kernels, which are called by address. ``width`` lanes, states of ``size`` doubles.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from llvmlite import ir

from nearharmonic.core.assembly import Array, Index, Writer, function
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    ENERGY,
    ENERGY_LOW,
    FAR,
    LATEST,
    LIMIT,
    MERGED,
    NEVER,
    PROGRESS,
    RUN,
    SAMPLES,
    STOP,
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
)
from nearharmonic.core.values import LLVMMask, LLVMValue

#: An energy below this part of the kinetic energy is 0 to the rounding of double-doubles.
NEGLIGIBLE = 2.0**-98


def run() -> tuple[ir.Module, str]:
    """Module and name of a function of :data:`nearharmonic.core.layout.RUN`: all runs of the queue ``order``."""
    module, name = ir.Module("run"), "run"
    writer, given = function(module, name, RUN)
    _Scheduler(writer, given).write()
    return module, name


class Runs:
    """What functions that pass runs through kernels have in common; their arguments are attributes of ``a``."""

    def __init__(self, writer: Writer, given: dict[str, Any], *, width: Index, size: Index) -> None:
        self.writer, self.a, self.width, self.size = writer, SimpleNamespace(**given), width, size

    def _row(self, lane: Index, row: Index | int) -> Index:
        """The place of a row of a lane."""
        return (self.writer.index(row) if isinstance(row, int) else row) * self.width + lane

    def _tally(self, lane: Index, entry: int) -> Index:
        return self._row(lane, self.size + entry)

    def _parameters_of(self, r: Index) -> Array:
        """Those of a run, or the one row that is for all."""
        found: Array = self.a.parameters[r.at_most(self.a.parameters.shape[0] - 1)]
        return found

    def _begin(self, lane: Index) -> None:
        """The lane's tally begins; its limit becomes absolute.

        It is relative to |H0|, to |T| if H0 = 0, or to ``scale`` if that is not 0.
        """
        writer, a = self.writer, self.a
        high, low = self._tally(lane, ENERGY), self._tally(lane, ENERGY_LOW)
        for entry in range(TALLY):
            place = self._tally(lane, entry)
            a.rows[place] = a.fresh[place]
        kinetic: LLVMValue = a.rows[self._tally(lane, LIMIT)]
        H = writer.variable(a.rows[high].absolute())
        with writer.when((kinetic * NEGLIGIBLE).at_least(H.value)):
            a.rows[high] = a.rows[low] = 0.0
            H.value = H.value.constant(0.0)
        reference = a.reference[0]
        with writer.when(~reference.undefined()):
            lost = a.rows[low] - a.reference[1]
            a.rows[self._tally(lane, LATEST)] = (a.rows[high] - reference) + lost
            a.rows[high], a.rows[low] = reference, a.reference[1]
            H.value = reference.absolute()
        unit = a.scale.equals(0.0).choose(H.value.equals(0.0).choose(kinetic, H.value), a.scale)
        a.rows[self._tally(lane, LIMIT)] = unit.equals(0.0).choose(float("inf"), a.limit * unit)

    def _unless_finite(self, lane: Index, latest: Any) -> None:
        """0, or NaN for a state that is not finite."""
        latest.value = latest.value.constant(0.0)
        for k in self.writer.range(self.size):
            latest.value = latest.value + self.a.rows[self._row(lane, k)] * 0.0

    def _was_last(self, r: Index, sample: Index) -> LLVMMask:
        """Whether a run has no sample of this number."""
        marks: Array = self.a.marks
        last = marks.shape[1] - 1
        after: Index = marks[r, sample.at_most(last)]
        return (sample > last) | (after < 0)


class _Scheduler(Runs):
    """Writes the function."""

    def __init__(self, writer: Writer, given: dict[str, Any]) -> None:
        super().__init__(writer, given, width=given["runs"].shape[0], size=given["start"].shape[1])
        self.states = self.a.running.shape[1]
        first = self.a.order[0]
        self.rest, self.usual = self.a.start[first], self._parameters_of(first)
        self.queued = writer.variable(writer.index(0))

    def write(self) -> None:
        """The queue, until it is empty and all lanes are idle, or a stop is asked for."""
        writer, a = self.writer, self.a
        for lane in writer.range(self.width):
            a.runs[lane] = -1
            self._idle(lane)
        with writer.forever() as behind:
            writer.leave(~a.control[STOP].equals(0), behind)
            before = self.queued.value
            self._refill()
            with writer.when(self.queued.value > before):
                with writer.when(~a.measured.equals(NEVER)):
                    for place in writer.range(a.rows.size):
                        a.fresh[place] = a.rows[place]
                    writer.call(a.begin, BEGIN, [a.fresh])
                self._record_starts()
            count = self._next_stretch()
            writer.leave(count.equals(FAR), behind)
            moved = [count.at_most(a.stretch), a.stages, a.kick_first, a.lanes, a.rows]
            done = writer.call(a.advance, ADVANCE, moved)
            for lane in writer.range(self.width):
                with writer.when(a.runs[lane] >= 0):
                    self._settle(lane, done)
        writer.builder.ret_void()

    @property
    def _running(self) -> Index:
        """The first row of the states that run, the last rows but for the room behind them."""
        return self.size + TALLY + self._parameter_rows

    @property
    def _parameter_rows(self) -> Index:
        count = self.a.parameters.shape[1]
        rows: Index = self.writer.either(count > 0, count, self.writer.index(1))
        return rows

    def _refill(self) -> None:
        """Lanes without a run take the next ones of the queue."""
        writer, a = self.writer, self.a
        for lane in writer.range(self.width):
            with writer.when((a.runs[lane] < 0) & (self.queued.value < a.order.size)):
                r = a.order[self.queued.value]
                self.queued.value = self.queued.value + 1
                a.runs[lane], a.at[lane], a.mark[lane] = r, 0, 0
                self._fill(lane, r)

    def _fill(self, lane: Index, r: Index) -> None:
        """The lane takes up the state, the parameters and the coefficients of its run."""
        writer, a = self.writer, self.a
        self._place(lane, a.start[r], self._parameters_of(r))
        moves = a.moves[a.scheme[r]]
        for i in writer.range(moves.shape[0]):
            for column in writer.range(moves.shape[1]):
                a.lanes[self._row(lane, i * moves.shape[1] + column)] = moves[i, column]
        with writer.when(a.resumed.shape[0] > 0):
            for k in writer.range(self.states):
                a.rows[self._row(lane, self._running + k)] = a.resumed[r, k]
            for column in writer.range(moves.shape[1]):
                a.lanes[self._row(lane, column)] = moves[MERGED, column]

    def _place(self, lane: Index, start: Array, parameters: Array) -> None:
        writer, rows = self.writer, self.a.rows
        for k in writer.range(self.size):
            rows[self._row(lane, k)] = start[k]
            rows[self._row(lane, self._running + k)] = start[k]
        for k in writer.range(self.size, self.states):
            rows[self._row(lane, self._running + k)] = 0.0
        for entry in range(TALLY):
            rows[self._tally(lane, entry)] = float("inf") if entry == LIMIT else 0.0
        for k in writer.range(parameters.shape[0]):
            rows[self._row(lane, self.size + TALLY + k)] = parameters[k]

    def _idle(self, lane: Index) -> None:
        """The lane stands still at a regular point: a NaN in an idle lane would stop the others."""
        self._place(lane, self.rest, self.usual)
        lanes = self.a.lanes
        rows = self.a.moves.shape[1] * self.a.moves.shape[2]
        for i in self.writer.range(rows):
            lanes[self._row(lane, i)] = 0.0

    def _record_starts(self) -> None:
        """The first sample of each run that has none yet, whose lane of ``fresh`` has its energy as H0."""
        writer, a = self.writer, self.a
        for lane in writer.range(self.width):
            with writer.when((a.runs[lane] >= 0) & ~(a.mark[lane] > 0)):
                r = a.runs[lane]
                with writer.when(~a.measured.equals(NEVER)):
                    self._begin(lane)
                for half, entry in enumerate((ENERGY, ENERGY_LOW)):
                    a.energy[r, half] = a.rows[self._tally(lane, entry)]
                self._record(lane, r, a.mark[lane])
                a.mark[lane] = 1

    def _record(self, lane: Index, r: Index, sample: Index) -> None:
        """One sample of the lane, and what its block of steps since the last sample came to."""
        a = self.a
        for k in self.writer.range(self.size):
            a.states[r, sample, k] = a.rows[self._row(lane, k)]
        worst, total, carry = (self._tally(lane, entry) for entry in (WORST, TOTAL, TOTAL_CARRY))
        a.energy_error[r, sample] = a.rows[self._tally(lane, LATEST)]
        a.worst[r, sample] = a.rows[worst]
        a.total[r, sample] = a.rows[total] + a.rows[carry]
        a.rows[worst] = a.rows[total] = a.rows[carry] = 0.0

    def _next_stretch(self) -> Index:
        """Steps to the next sample of any lane; ``FAR`` if all lanes are idle."""
        writer, a, count = self.writer, self.a, self.writer.variable(self.writer.index(FAR))
        for lane in writer.range(self.width):
            with writer.when(a.runs[lane] >= 0):
                count.value = count.value.at_most(a.marks[a.runs[lane], a.mark[lane]] - a.at[lane])
        found: Index = count.value
        return found

    def _settle(self, lane: Index, done: Index) -> None:
        """Record the sample of the lane's run if one is due, or that the run has left.

        A run leaves when its energy is beyond its limit; where none is measured, when its state is not finite.
        """
        writer, a = self.writer, self.a
        r = a.runs[lane]
        a.at[lane] = a.at[lane] + done
        a.control[PROGRESS] = a.control[PROGRESS] + done
        due = a.at[lane] >= a.marks[r, a.mark[lane]]
        # What is measured at the samples alone must not depend on when the neighbours of a lane are sampled.
        looked = due | (a.measured < SAMPLES)
        left = writer.variable(LLVMMask(writer.builder, ir.Constant(ir.IntType(1), 0)))
        with writer.when(looked):
            latest = writer.variable(a.rows[self._tally(lane, LATEST)].absolute())
            with writer.when(a.measured.equals(NEVER)):
                self._unless_finite(lane, latest)
            left.value = latest.value.any_not_within(a.rows[self._tally(lane, LIMIT)])
            with writer.when(left.value):
                a.left_at[r] = a.at[lane]
                self._free(lane, r)
            with writer.when(a.measured.equals(SAMPLES)):
                a.rows[self._tally(lane, WORST)] = a.rows[self._tally(lane, TOTAL)] = latest.value
                a.rows[self._tally(lane, TOTAL_CARRY)] = 0.0
        with writer.when(due & ~left.value):
            self._record(lane, r, a.mark[lane])
            sample = a.mark[lane] + 1
            a.mark[lane] = sample
            with writer.when(self._was_last(r, sample)):
                self._free(lane, r)

    def _free(self, lane: Index, r: Index) -> None:
        """The run is over, and its state that runs is kept."""
        a = self.a
        for k in self.writer.range(self.states):
            a.running[r, k] = a.rows[self._row(lane, self._running + k)]
        a.runs[lane] = -1
        self._idle(lane)
