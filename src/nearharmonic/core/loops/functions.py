"""The compiled functions of a kernel whose formulas are loops: one trajectory, its state in memory.

They take the arguments of :data:`nearharmonic.core.layout.ADVANCE` and :data:`nearharmonic.core.layout.BEGIN`; the rows
end with room for what the loops keep, see :func:`room`. Steps, energies and their rounding are those of
:mod:`nearharmonic.core.rules`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from llvmlite import binding, ir

from nearharmonic.core.layout import LATEST, LIMIT, TALLY, parameter_rows
from nearharmonic.core.loops.emission import Emission
from nearharmonic.core.loops.energy import LoopedEnergy
from nearharmonic.core.loops.memory import (
    DOUBLE,
    INDEX,
    Array,
    ConditionedDoubles,
    DoubleDoubles,
    Doubles,
    Writer,
)
from nearharmonic.core.loops.tables import BLOCK
from nearharmonic.core.native import target_machine
from nearharmonic.core.rules import Rules, fresh_tally, tallied, uncertain
from nearharmonic.core.tracing import LLVMValue

_POINTER = DOUBLE.as_pointer()


def room(V: LoopedEnergy, T: LoopedEnergy, extended: bool) -> int:
    """Return the doubles behind the parameters that the loops of a kernel keep numbers in."""
    planes = 2 if extended or max(len(V.levels), len(T.levels)) > 1 else 1
    return BLOCK + planes * max(V.room, T.room)


def machine_code(text: str, name: str) -> tuple[str, bytes]:
    """Name and object code of a function, from the text of its module."""
    module = binding.parse_assembly(text)
    module.verify()
    machine = target_machine()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = options.loop_vectorization = False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return name, machine.emit_object(module)


def advance(rules: Rules, energy: str) -> tuple[str, str]:
    """Text and name of the inner kernel: see :class:`nearharmonic.core.kernel.Kernel`."""
    return _Functions(rules).advance(energy)


def begin(rules: Rules) -> tuple[str, str]:
    """Text and name of a function of the rows: the tally anew, with the energy of the state as H0."""
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
        behind = self.parameters_at + parameter_rows(physics.parameters)
        self.kept_at = -(-behind // BLOCK) * BLOCK
        self.stride = max(self.V.room, self.T.room)
        self.state_kind: Doubles = DoubleDoubles() if rules.extended else Doubles()
        self.module = ir.Module("loops")
        self._made: dict[str, ir.Function] = {}

    def begin(self) -> tuple[str, str]:
        name = "loops.begin"
        function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), [_POINTER, INDEX]), name)
        writer = Writer(ir.IRBuilder(function.append_basic_block()))
        rows = function.args[0]
        T, V = (self._value(writer, rows, energy, DoubleDoubles()) for energy in (self.T, self.V))
        conditions = [writer.zero(1)] * 2
        if self.rules.quick_energy:
            conditions = self.rules.rounding_of(
                *(self._value(writer, rows, energy, ConditionedDoubles()) for energy in (self.T, self.V))
            )
        for i, entry in enumerate(fresh_tally(T + V, T, conditions)):
            writer.store(entry, writer.place(rows, self.tally_at + i))
        writer.builder.ret_void()
        return str(self.module), name

    def advance(self, energy: str) -> tuple[str, str]:
        name = "loops.advance"
        flag = ir.IntType(8)
        kinds = [INDEX, INDEX, flag, _POINTER, INDEX, _POINTER, INDEX, _POINTER, INDEX]
        function = ir.Function(self.module, ir.FunctionType(INDEX, kinds), name)
        count, stages, flagged, drifts, _, kicks, _, rows, _ = function.args
        writer = Writer(ir.IRBuilder(function.append_basic_block()))
        builder = writer.builder
        kick_first = builder.icmp_unsigned("!=", flagged, ir.Constant(flag, 0))
        shift = builder.zext(kick_first, INDEX)
        quick = energy == "every" and self.rules.quick_energy
        done, height = writer.variable(writer.index(0)), writer.variable(writer.zero(1).value)
        self._call(writer, "force", rows)
        behind = function.append_basic_block("behind")
        with writer.repeated(count):
            with builder.if_then(kick_first):
                self._call(writer, "kick", rows, self._coefficient(writer, kicks, writer.index(0)))
            with writer.repeated(stages) as i:
                self._call(writer, "drift", rows, self._coefficient(writer, drifts, i))
                if quick:
                    last = builder.icmp_signed("==", builder.add(i, writer.index(1)), stages)
                    with builder.if_else(last) as (then, otherwise):
                        with then:
                            builder.store(self._call(writer, "pull", rows), height)
                        with otherwise:
                            self._call(writer, "force", rows)
                else:
                    self._call(writer, "force", rows)
                self._call(writer, "kick", rows, self._coefficient(writer, kicks, builder.add(i, shift)))
            with builder.if_then(builder.not_(kick_first)):
                self._call(writer, "drift", rows, self._coefficient(writer, drifts, stages))
                if quick:
                    builder.store(self._call(writer, "potential", rows), height)
            builder.store(builder.add(builder.load(done), writer.index(1)), done)
            if energy == "every":
                left = self._measured(writer, rows, LLVMValue(builder, builder.load(height)) if quick else None)
                going_on = function.append_basic_block("going_on")
                builder.cbranch(left, behind, going_on)
                builder.position_at_end(going_on)
        builder.branch(behind)
        builder.position_at_end(behind)
        if energy == "samples":
            self._measured(writer, rows, None)
        builder.ret(builder.load(done))
        return str(self.module), name

    def _coefficient(self, writer: Writer, rows: ir.Value, i: ir.Value) -> ir.Value:
        return writer.place(rows, writer.builder.mul(i, writer.index(self.rules.parts)))

    def _measured(self, writer: Writer, rows: ir.Value, potential: LLVMValue | None) -> ir.Value:
        """Count the energy of the state in the tally; whether it is beyond the limit."""
        places = [writer.place(rows, self.tally_at + i) for i in range(TALLY)]
        tally = [writer.load(place, 1) for place in places]
        if potential is None:
            latest = self.rules.difference(*self._exact(writer, rows), tally)
        else:
            T = LLVMValue(writer.builder, self._call(writer, "kinetic", rows))
            quick, bound = self.rules.quick_difference(T, potential, tally)
            chosen = writer.variable(quick.value)
            with writer.builder.if_then(uncertain(quick, bound), likely=False):
                writer.builder.store(self.rules.difference(*self._exact(writer, rows), tally).value, chosen)
            latest = LLVMValue(writer.builder, writer.builder.load(chosen))
        tally = tallied(tally, latest)
        for entry, place in zip(tally[: LATEST + 1], places, strict=False):
            writer.store(entry, place)
        return tally[LATEST].absolute().any_not_within(tally[LIMIT])

    def _exact(self, writer: Writer, rows: ir.Value) -> tuple[LLVMValue, LLVMValue]:
        """H of the state in double-double."""
        pair = self._call(writer, "energy", rows)
        high, low = (writer.builder.extract_value(pair, i) for i in range(2))
        return LLVMValue(writer.builder, high), LLVMValue(writer.builder, low)

    def _call(self, writer: Writer, name: str, *arguments: ir.Value) -> ir.Value:
        """Call a function of the module, which is written at its first use."""
        if name not in self._made:
            self._made[name] = getattr(self, f"_{name}")()
        return writer.builder.call(self._made[name], arguments)

    @contextmanager
    def _function(self, name: str, result: ir.Type, more: int = 0) -> Iterator[tuple[ir.Function, Writer]]:
        kind = ir.FunctionType(result, [_POINTER] * (1 + more))
        function = ir.Function(self.module, kind, f"loops.{name}")
        function.linkage = "internal"
        function.attributes.add("nounwind")
        writer = Writer(ir.IRBuilder(function.append_basic_block()))
        yield function, writer

    def _force(self) -> ir.Function:
        with self._function("force", ir.VoidType()) as (function, writer):
            self._emission(writer, function.args[0], self.V, self.state_kind).gradient()
            writer.builder.ret_void()
        return function

    def _pull(self) -> ir.Function:
        """The force, and V from operations that they share."""
        with self._function("pull", DOUBLE) as (function, writer):
            V = self._emission(writer, function.args[0], self.V, self.state_kind).gradient()
            writer.builder.ret(self._double(writer, V))
        return function

    def _potential(self) -> ir.Function:
        return self._scalar("potential", self.V)

    def _kinetic(self) -> ir.Function:
        return self._scalar("kinetic", self.T)

    def _scalar(self, name: str, energy: LoopedEnergy) -> ir.Function:
        with self._function(name, DOUBLE) as (function, writer):
            value = self._value(writer, function.args[0], energy, self.state_kind)
            writer.builder.ret(self._double(writer, value))
        return function

    def _double(self, writer: Writer, number: Any) -> ir.Value:
        return self.state_kind.written(number)[0].value

    def _energy(self) -> ir.Function:
        """H in double-double."""
        pair = ir.LiteralStructType([DOUBLE, DOUBLE])
        with self._function("energy", pair) as (function, writer):
            T, V = (self._value(writer, function.args[0], energy, DoubleDoubles()) for energy in (self.T, self.V))
            result = ir.Constant(pair, ir.Undefined)
            for i, half in enumerate((T + V).pair):
                result = writer.builder.insert_value(result, half.value, i)
            writer.builder.ret(result)
        function.attributes.add("noinline")  # seldom needed, and long
        return function

    def _kick(self) -> ir.Function:
        """p += coefficient * rate."""
        with self._function("kick", ir.VoidType(), 1) as (function, writer):
            rows, coefficient = function.args
            self._update(writer, rows, coefficient, 2 * self.d, self._kept(writer, rows))
            writer.builder.ret_void()
        return function

    def _drift(self) -> ir.Function:
        """q += coefficient * dT/dp."""
        with self._function("drift", ir.VoidType(), 1) as (function, writer):
            rows, coefficient = function.args
            if self.rules.physics.unit_masses:
                velocity = Array(writer.place(rows, 2 * self.d), self.d)
            else:
                self._emission(writer, rows, self.T, self.state_kind).gradient()
                velocity = self._kept(writer, rows)
            self._update(writer, rows, coefficient, 0, velocity)
            writer.builder.ret_void()
        return function

    def _kept(self, writer: Writer, rows: ir.Value) -> Array:
        return Array(writer.place(rows, self.kept_at), self.stride)

    def _update(self, writer: Writer, rows: ir.Value, coefficient: ir.Value, at: int, rates: Array) -> None:
        """Add a multiple of the rates to the coordinates or the momenta, in blocks and then one by one."""
        parts, d = self.rules.parts, self.d
        step = [writer.load(writer.place(coefficient, i), 1) for i in range(parts)]
        values = [writer.place(rows, at), writer.place(rows, at + d)]
        changes = [writer.place(rates.address, i * rates.stride) for i in range(parts)]

        def one(first: ir.Value, width: int) -> None:
            places = [writer.place(address, first) for address in values]
            high, low = (writer.load(place, width) for place in places)
            rate = [writer.load(writer.place(address, first), width) for address in changes]
            new = self.rules.update([(high, low)], [writer.broadcast(x, width) for x in step], rate)
            for value, place in zip(new, places, strict=True):
                writer.store(value, place)

        with writer.repeated(d // BLOCK) as i:
            one(writer.builder.mul(i, writer.index(BLOCK)), BLOCK)
        with writer.repeated(d % BLOCK) as i:
            one(writer.builder.add(i, writer.index(d - d % BLOCK)), 1)

    def _value(self, writer: Writer, rows: ir.Value, energy: LoopedEnergy, kind: Doubles) -> Any:
        return self._emission(writer, rows, energy, kind).value()

    def _emission(self, writer: Writer, rows: ir.Value, energy: LoopedEnergy, kind: Doubles) -> Emission:
        at = 2 * self.d if energy is self.T else 0
        state = Array(writer.place(rows, at), self.d)
        count = 2 * self.rules.physics.parameters
        given = [writer.load(writer.place(rows, self.parameters_at + i), 1) for i in range(count)]
        return Emission(writer, energy, kind, state, self._kept(writer, rows), given)
