"""The compiled functions of a kernel whose formulas are loops: one trajectory, its state in memory.

They take the arguments of :data:`nearharmonic.core.layout.ADVANCE` and :data:`nearharmonic.core.layout.BEGIN`; the rows
end with room for what the loops keep, see :func:`room`. Moves, energies and their rounding are those of
:mod:`nearharmonic.core.rules`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import ir

from nearharmonic.core.assembly import DOUBLE, Array, Index, function
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    COLUMNS,
    DRIFT,
    INNER,
    KICK,
    LATEST,
    LIMIT,
    MERGED,
    OPENING,
    TALLY,
    running_at,
    running_rows,
)
from nearharmonic.core.loops.emission import Emission
from nearharmonic.core.loops.energy import LoopedEnergy
from nearharmonic.core.loops.memory import ConditionedDoubles, DoubleDoubles, Doubles, LoopWriter, Planes
from nearharmonic.core.loops.tables import BLOCK
from nearharmonic.core.rules import Entries, Rules, fresh_tally, tallied, uncertain
from nearharmonic.core.tracing import LLVMValue
from nearharmonic.core.values import LLVMMask

_POINTER = DOUBLE.as_pointer()


def room(V: LoopedEnergy, T: LoopedEnergy, extended: bool) -> int:
    """Return the doubles behind the state that runs in which the loops of a kernel keep numbers."""
    return BLOCK + _planes(V, T, extended) * (V.room + T.room)


def _planes(V: LoopedEnergy, T: LoopedEnergy, extended: bool) -> int:
    """Planes of the numbers that are kept: two where energies of several levels are computed in double-double."""
    return 2 if extended or max(len(V.levels), len(T.levels)) > 1 else 1


def advance(rules: Rules, energy: str) -> tuple[ir.Module, str]:
    """Module and name of the inner kernel: see :class:`nearharmonic.core.kernel.Kernel`."""
    return _Functions(rules).advance(energy)


def begin(rules: Rules) -> tuple[ir.Module, str]:
    """Module and name of a function of the rows: the tally anew, with the energy of the state as H0."""
    return _Functions(rules).begin()


class _Functions:
    """The functions of one module."""

    def __init__(self, rules: Rules) -> None:
        physics = rules.physics
        assert physics.loops is not None
        self.rules, (self.V, self.T) = rules, physics.loops
        self.d = physics.dimension
        self.tally_at = 4 * self.d
        self.parameters_at = self.tally_at + TALLY
        self.running_at = running_at(self.d, physics.parameters)
        behind = self.running_at + running_rows(self.d)
        self.kept_at = -(-behind // BLOCK) * BLOCK
        self.planes = _planes(self.V, self.T, rules.extended)
        self.state_kind: Doubles = DoubleDoubles() if rules.extended else Doubles()
        self.module = ir.Module("loops")
        self._made: dict[str, ir.Function] = {}

    def begin(self) -> tuple[ir.Module, str]:
        name = "loops.begin"
        plain, given = function(self.module, name, BEGIN)
        writer, rows = LoopWriter(plain.builder), given["rows"].address
        T, V = (self._value(writer, rows, energy, DoubleDoubles()) for energy in (self.T, self.V))
        conditions = [writer.zero(1)] * 2
        if self.rules.quick_energy:
            conditions = self.rules.rounding_of(
                *(self._value(writer, rows, energy, ConditionedDoubles()) for energy in (self.T, self.V))
            )
        for i, entry in enumerate(fresh_tally(T + V, T, conditions)):
            writer.store(entry, writer.place(rows, self.tally_at + i))
        writer.builder.ret_void()
        return self.module, name

    def advance(self, energy: str) -> tuple[ir.Module, str]:
        name = "loops.advance"
        plain, given = function(self.module, name, ADVANCE)
        writer, rows, moves = LoopWriter(plain.builder), given["rows"].address, given["moves"]
        stages, quick = given["stages"], energy == "every" and self.rules.quick_energy
        done, first = writer.variable(writer.index(0)), writer.variable(writer.index(OPENING))
        height = writer.variable(writer.zero(1))
        self._call(writer, "force", rows)
        with writer.when(moves[KICK * self.rules.parts].equals(0.0)):  # no kick comes first: it need not exist
            self._call(writer, "forget", rows)
        with writer.forever() as behind:
            place = writer.variable(first.value)
            with writer.repeated(stages - 1 if quick else stages) as i:
                self._call(writer, "move", rows, self._row(writer, moves, place.value))
                self._call(writer, "force", rows)
                place.value = writer.either(i > 0, place.value + 1, writer.index(INNER))
            if quick:
                self._call(writer, "move", rows, self._row(writer, moves, place.value))
                height.value = LLVMValue(writer.builder, self._call(writer, "pull", rows))
            done.value = done.value + 1
            if energy == "every":
                self._call(writer, "close", rows, self._row(writer, moves, stages + 1))
                if quick:
                    with writer.when(~given["kick_first"]):
                        height.value = LLVMValue(writer.builder, self._call(writer, "potential", rows))
                writer.leave(self._measured(writer, rows, height.value if quick else None), behind)
            writer.leave(done.value >= given["count"], behind)
            first.value = writer.index(MERGED)
        if energy != "every":
            self._call(writer, "close", rows, self._row(writer, moves, stages + 1))
        if energy == "samples":
            self._measured(writer, rows, None)
        for column in range(COLUMNS):
            moves[OPENING + column] = moves[COLUMNS * MERGED + column]
        writer.builder.ret(done.value.value)
        return self.module, name

    def _row(self, writer: LoopWriter, moves: Array, row: Index) -> ir.Value:
        return writer.place(moves.address, row * COLUMNS)

    def _measured(self, writer: LoopWriter, rows: ir.Value, potential: LLVMValue | None) -> LLVMMask:
        """Count the energy of the state in the tally; whether it is beyond the limit."""
        places = [writer.place(rows, self.tally_at + i) for i in range(TALLY)]
        tally = [writer.load(place, 1) for place in places]
        if potential is None:
            latest = self.rules.difference(*self._exact(writer, rows), tally)
        else:
            T = LLVMValue(writer.builder, self._call(writer, "kinetic", rows))
            quick, bound = self.rules.quick_difference(T, potential, tally)
            chosen = writer.variable(quick)
            with writer.when(uncertain(quick, bound), likely=False):
                chosen.value = self.rules.difference(*self._exact(writer, rows), tally)
            latest = chosen.value
        tally = tallied(tally, latest)
        for entry, place in zip(tally[: LATEST + 1], places, strict=False):
            writer.store(entry, place)
        return tally[LATEST].absolute().any_not_within(tally[LIMIT])

    def _exact(self, writer: LoopWriter, rows: ir.Value) -> tuple[LLVMValue, LLVMValue]:
        """H of the state in double-double."""
        pair = self._call(writer, "energy", rows)
        high, low = (writer.builder.extract_value(pair, i) for i in range(2))
        return LLVMValue(writer.builder, high), LLVMValue(writer.builder, low)

    def _call(self, writer: LoopWriter, name: str, *arguments: ir.Value) -> ir.Value:
        """Call a function of the module, which is written at its first use."""
        if name not in self._made:
            self._made[name] = getattr(self, f"_{name}")()
        return writer.builder.call(self._made[name], arguments)

    @contextmanager
    def _function(self, name: str, result: ir.Type, more: int = 0) -> Iterator[tuple[ir.Function, LoopWriter]]:
        kind = ir.FunctionType(result, [_POINTER] * (1 + more))
        made = ir.Function(self.module, kind, f"loops.{name}")
        made.linkage = "internal"
        made.attributes.add("nounwind")
        yield made, LoopWriter(ir.IRBuilder(made.append_basic_block()))

    def _force(self) -> ir.Function:
        with self._function("force", ir.VoidType()) as (made, writer):
            self._emission(writer, made.args[0], self.V, self.state_kind, self.running_at).gradient()
            writer.builder.ret_void()
        return made

    def _forget(self) -> ir.Function:
        """No force."""
        with self._function("forget", ir.VoidType()) as (made, writer):
            kept = self._kept(writer, made.args[0], self.V)
            for part in range(self.rules.parts):
                with writer.repeated(self.d) as i:
                    writer.store(writer.zero(1), writer.place(writer.place(kept.address, part * kept.stride), i))
            writer.builder.ret_void()
        return made

    def _pull(self) -> ir.Function:
        """The force, and V from operations that they share."""
        with self._function("pull", DOUBLE) as (made, writer):
            V = self._emission(writer, made.args[0], self.V, self.state_kind, self.running_at).gradient()
            writer.builder.ret(self._double(writer, V))
        return made

    def _potential(self) -> ir.Function:
        return self._scalar("potential", self.V)

    def _kinetic(self) -> ir.Function:
        return self._scalar("kinetic", self.T)

    def _scalar(self, name: str, energy: LoopedEnergy) -> ir.Function:
        """An energy of the state that is seen."""
        with self._function(name, DOUBLE) as (made, writer):
            value = self._value(writer, made.args[0], energy, self.state_kind)
            writer.builder.ret(self._double(writer, value))
        return made

    def _double(self, writer: LoopWriter, number: Any) -> ir.Value:
        return self.state_kind.written(number)[0].value

    def _energy(self) -> ir.Function:
        """H in double-double."""
        pair = ir.LiteralStructType([DOUBLE, DOUBLE])
        with self._function("energy", pair) as (made, writer):
            T, V = (self._value(writer, made.args[0], energy, DoubleDoubles()) for energy in (self.T, self.V))
            result = ir.Constant(pair, ir.Undefined)
            for i, half in enumerate((T + V).pair):
                result = writer.builder.insert_value(result, half.value, i)
            writer.builder.ret(result)
        made.attributes.add("noinline")  # seldom needed, and long
        return made

    def _move(self) -> ir.Function:
        """The state that runs, after a move."""
        return self._moving("move", self.running_at)

    def _close(self) -> ir.Function:
        """The state that is seen, a move from the one that runs."""
        return self._moving("close", 0)

    def _moving(self, name: str, to: int) -> ir.Function:
        with self._function(name, ir.VoidType(), 1) as (made, writer):
            rows, coefficients = made.args
            row = [writer.load(writer.place(coefficients, i), 1) for i in range(COLUMNS)]
            _Move(self, writer, rows, row, to).write()
            writer.builder.ret_void()
        return made

    def _kept(self, writer: LoopWriter, rows: ir.Value, energy: LoopedEnergy) -> Planes:
        """Where the loops of an energy keep numbers, the gradient first."""
        at = self.kept_at if energy is self.V else self.kept_at + self.planes * self.V.room
        return Planes(writer.place(rows, at), energy.room)

    def _value(self, writer: LoopWriter, rows: ir.Value, energy: LoopedEnergy, kind: Doubles) -> Any:
        return self._emission(writer, rows, energy, kind, 0).value()

    def _emission(
        self, writer: LoopWriter, rows: ir.Value, energy: LoopedEnergy, kind: Doubles, state_at: int
    ) -> Emission:
        at = state_at + (2 * self.d if energy is self.T else 0)
        state = Planes(writer.place(rows, at), self.d)
        count = 2 * self.rules.physics.parameters
        given = [writer.load(writer.place(rows, self.parameters_at + i), 1) for i in range(count)]
        return Emission(writer, energy, kind, state, self._kept(writer, rows, energy), given)


class _Move:
    """Writes a move from the state that runs to the rows from ``to`` on, in blocks and then one by one.

    Where masses are not 1 it is the kick, the velocity and the drift one after the other: such states are bound by what
    there is to compute, not by the time of a chain of operations.
    """

    def __init__(
        self, functions: _Functions, writer: LoopWriter, rows: ir.Value, row: list[LLVMValue], to: int
    ) -> None:
        self.functions, self.rules, self.writer, self.rows, self.row = functions, functions.rules, writer, rows, row
        self.to, self.start, self.d, self.parts = to, functions.running_at, functions.d, functions.rules.parts

    def write(self) -> None:
        functions, writer = self.functions, self.writer
        self.force = functions._kept(writer, self.rows, functions.V)
        if self.rules.physics.unit_masses:
            self._blocks(self._moved)
            return
        self._blocks(self._kicked)
        functions._emission(writer, self.rows, functions.T, functions.state_kind, self.to).gradient()
        self.velocity = functions._kept(writer, self.rows, functions.T)
        self._blocks(self._drifted)

    def _blocks(self, one: Callable[[Index, int], None]) -> None:
        with self.writer.repeated(self.d // BLOCK) as i:
            one(i * BLOCK, BLOCK)
        with self.writer.repeated(self.d % BLOCK) as i:
            one(i + (self.d - self.d % BLOCK), 1)

    def _load(self, plane: int, first: Index, width: int) -> LLVMValue:
        """Of the state that runs: positions, what is below them, momenta, what is below them, what is late."""
        return self.writer.load(self.writer.place(self.rows, first + (self.start + plane * self.d)), width)

    def _store(self, plane: int, first: Index, value: LLVMValue) -> None:
        self.writer.store(value, self.writer.place(self.rows, first + (self.to + plane * self.d)))

    def _rates(self, kept: Planes, first: Index, width: int) -> Entries:
        planes = (self.writer.place(kept.address, i * kept.stride) for i in range(self.parts))
        return [self.writer.load(self.writer.place(plane, first), width) for plane in planes]

    def _wide(self, width: int) -> Entries:
        return [self.writer.broadcast(x, width) for x in self.row]

    def _kicked(self, first: Index, width: int) -> None:
        momentum, force = [self._load(k, first, width) for k in (2, 3)], self._rates(self.force, first, width)
        kick = self.rules.part(self._wide(width), KICK)
        for k, value in enumerate(self.rules.update([(momentum[0], momentum[1])], kick, force)):
            self._store(2 + k, first, value)

    def _drifted(self, first: Index, width: int) -> None:
        position, velocity = [self._load(k, first, width) for k in (0, 1)], self._rates(self.velocity, first, width)
        drift = self.rules.part(self._wide(width), DRIFT)
        for k, value in enumerate(self.rules.update([(position[0], position[1])], drift, velocity)):
            self._store(k, first, value)

    def _moved(self, first: Index, width: int) -> None:
        row, force = self._wide(width), self._rates(self.force, first, width)
        q, q_low, p, p_low, late = (self._load(k, first, width) for k in range(5))
        momentum = self.rules.update([(p, p_low)], self.rules.part(row, KICK), force)
        if self.rules.looks_ahead:
            running = self.rules.looked_ahead([q, q_low], [late], row, [p], force, momentum)
        else:
            position = self.rules.update([(q, q_low)], self.rules.part(row, DRIFT), momentum[: self.parts])
            running = [*position, *momentum, late]
        for k, value in enumerate(self.rules.seen(running) if self.to == 0 else running):
            self._store(k, first, value)
