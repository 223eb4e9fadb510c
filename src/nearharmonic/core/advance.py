"""The inner kernel of formulas that are written out: the states of all lanes stay in registers from step to step."""

from __future__ import annotations

import functools
import operator
from collections.abc import Sequence
from typing import Any

from llvmlite import ir

from nearharmonic.core.assembly import Array, Index, Variable, Writer, function
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    INNER,
    KICK,
    LIMIT,
    MERGED,
    OPENING,
    SQUARE,
    TALLY,
    parameter_rows,
    running_at,
    running_rows,
)
from nearharmonic.core.modified_kick import gradient_follows, square
from nearharmonic.core.rotation import opened
from nearharmonic.core.rules import Entries, Rules, tallied, uncertain
from nearharmonic.core.tracing import LLVMValue


class Block:
    """Neighbouring rows of numbers, one for each lane, in a flat array."""

    def __init__(self, array: Array, width: int, first: Index | int, count: int) -> None:
        self._array, self._width, self._first, self._count = array, width, first, count

    def load(self) -> Entries:
        """The rows."""
        return [self._array.lanes(self._place(i), self._width) for i in range(self._count)]

    def store(self, entries: Sequence[LLVMValue]) -> None:
        """Replace the rows."""
        for i, entry in enumerate(entries):
            self._array.store_lanes(self._place(i), entry)

    def _place(self, i: int) -> Index | int:
        return (self._first + i) * self._width


class _Registers:
    """Entries that change in loops."""

    def __init__(self, writer: Writer, entries: Entries) -> None:
        self._variables = [Variable(writer.builder, entry) for entry in entries]

    def get(self) -> Entries:
        return [variable.value for variable in self._variables]

    def set(self, entries: Entries) -> None:
        for variable, entry in zip(self._variables, entries, strict=True):
            variable.value = entry


class _Lanes:
    """The numbers of all lanes in a kernel that is being written."""

    def __init__(self, rules: Rules, width: int, rows: Array) -> None:
        d, given = rules.physics.dimension, parameter_rows(rules.physics.parameters)
        self.state = Block(rows, width, 0, 4 * d)
        self.tally = Block(rows, width, 4 * d, TALLY)
        self.parameters = Block(rows, width, 4 * d + TALLY, given)
        self.running = Block(rows, width, running_at(d, rules.physics.parameters), running_rows(d))


def advance(rules: Rules, width: int, energy: str) -> tuple[ir.Module, str]:
    """Module and name of the inner kernel: see :class:`nearharmonic.core.kernel.Kernel`."""
    module, name = ir.Module("advance"), "advance"
    writer, given = function(module, name, ADVANCE)
    _Advance(rules, width, energy, writer, given).write()
    return module, name


def begin(rules: Rules, width: int) -> tuple[ir.Module, str]:
    """Module and name of a function of the rows: each lane's tally anew, with the energy of its state as H0."""
    module, name = ir.Module("begin"), "begin"
    writer, given = function(module, name, BEGIN)
    lanes = _Lanes(rules, width, given["rows"])
    lanes.tally.store(rules.begin(lanes.state.load(), lanes.parameters.load()))
    writer.builder.ret_void()
    return module, name


class _Advance:
    """Writes the inner kernel."""

    def __init__(self, rules: Rules, width: int, energy: str, writer: Writer, given: dict[str, Any]) -> None:
        self.rules, self.width, self.energy, self.writer, self.given = rules, width, energy, writer, given
        self.quick = energy == "every" and rules.quick_energy
        self.lanes = _Lanes(rules, width, given["rows"])
        self.stages: Index = given["stages"]
        self.parameters = self.lanes.parameters.load()
        self.running = _Registers(writer, self._first_state())
        self.tally = _Registers(writer, self.lanes.tally.load())
        self.state = _Registers(writer, self.lanes.state.load())
        self.rates = _Registers(writer, self._first_rates())
        self.height = _Registers(writer, [self.parameters[0].constant(0.0)])

    def write(self) -> None:
        """The steps, and what they leave."""
        writer, done, first = self.writer, self.writer.variable(self.writer.index(0)), self._place(OPENING)
        row = writer.variable(first)
        with writer.forever() as behind:
            self._step(row)
            done.value = done.value + 1
            if self.energy == "every":
                self._see()
                writer.leave(self._measured(), behind)
            writer.leave(done.value >= self.given["count"], behind)
            row.value = self._place(MERGED)
        if self.energy != "every":
            self._see()
        if self.energy == "samples":
            self._measured()
        self.lanes.running.store(self.running.get())
        self.lanes.state.store(self.state.get())
        self.lanes.tally.store(self.tally.get())
        self._row(OPENING).store(self._row(MERGED).load())
        writer.builder.ret(done.value.value)

    def _first_state(self) -> Entries:
        """The state that runs; where an oscillator is solved exactly, a first move of its own is done already."""
        state, row = self.lanes.running.load(), self._row(OPENING)
        if self.rules.physics.turning is None:
            return state
        state, left = opened(self.rules, state, row.load())
        row.store(left)
        return state

    def _first_rates(self) -> Entries:
        """The forces at the positions that run; where no kick comes first they do not matter, and need not exist."""
        row = self._row(OPENING).load()
        rates = self.rules.force(self.running.get(), self.parameters) + self._square(self.rules.part(row, SQUARE))
        none = self.rules.part(row, KICK)[0].equals(0.0)
        return [none.choose(0.0, rate) for rate in rates]

    def _step(self, first: Variable) -> None:
        """All moves of a step but the one that closes it, and the force behind each."""
        writer, place = self.writer, self.writer.variable(first.value)
        last = self.stages - 1
        with writer.repeated(last if self.quick else self.stages) as i:
            row = self._move(place.value)
            force = self.rules.force(self.running.get(), self.parameters)
            self.rates.set(force + self._square(gradient_follows(row)))
            place.value = writer.either(i > 0, place.value + self.rules.columns, self._place(INNER))
        if self.quick:
            row = self._move(place.value)
            *force, height = self.rules.force_and_potential(self.running.get(), self.parameters)
            self.rates.set(force + self._square(gradient_follows(row)))
            self.height.set([height])

    def _square(self, needed: Entries) -> Entries:
        """The gradient of the square of the force, where one of ``needed`` is not 0; nothing if kicks are plain.

        Operations that it has in common with the force are found by the compiler.
        """
        if self.rules.physics.modified is None:
            return []
        wanted = ~functools.reduce(operator.and_, (x.equals(0.0) for x in needed))
        zero = self.parameters[0].constant(0.0)
        found = _Registers(self.writer, [zero] * (self.rules.physics.dimension * self.rules.parts))
        with self.writer.when(wanted.anywhere()):
            gradient = square(self.rules, self.running.get(), self.parameters)
            found.set([wanted.choose(x, 0.0) for x in gradient])
        return found.get()

    def _move(self, place: Index) -> Entries:
        row = Block(self.given["moves"], self.width, place, self.rules.columns).load()
        self.running.set(self.rules.move(self.running.get(), row, self.rates.get(), self.parameters))
        return row

    def _see(self) -> None:
        """The state at the end of the step."""
        row = self._row(self.stages + 1).load()
        self.state.set(self.rules.closed(self.running.get(), row, self.rates.get(), self.parameters))

    def _measured(self) -> Any:
        """Count the energy of the states in the tallies; whether one of them is beyond its limit."""
        rules, state, tally = self.rules, self.state.get(), self.tally.get()
        latest = self._quick_energy(state, tally) if self.quick else rules.latest(state, tally, self.parameters)
        self.tally.set(tallied(tally, latest))
        return latest.absolute().any_not_within(tally[LIMIT])

    def _quick_energy(self, state: Entries, tally: Entries) -> LLVMValue:
        """H - H0 in double where that is certain; V is known behind the last force if a step ends with a kick."""
        rules, writer = self.rules, self.writer
        with writer.when(~self.given["kick_first"]):
            self.height.set(rules.potential(state, self.parameters))
        look = _Registers(writer, rules.quick(state, self.height.get(), tally, self.parameters))
        with writer.when(uncertain(*look.get()), likely=False):
            look.set(rules.sharpened(state, tally, look.get(), self.parameters))
        return look.get()[0]

    def _place(self, row: Index | int) -> Index:
        index = self.writer.index(row) if isinstance(row, int) else row
        return index * self.rules.columns

    def _row(self, row: Index | int) -> Block:
        return Block(self.given["moves"], self.width, self._place(row), self.rules.columns)
