"""Formulas of a system as functions of LLVM, linked to the loops of :mod:`nearharmonic.core.loops.advance`."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from functools import lru_cache
from hashlib import sha256
from typing import Any

from llvmlite import ir

from nearharmonic.core.formulas.number import Constant
from nearharmonic.core.formulas.tracing import DoubleDouble, Entries, LLVMValue, Rules
from nearharmonic.core.large.memory import LoopWriter
from nearharmonic.core.large.terms import BLOCK
from nearharmonic.core.layout import COUNTERS, TALLY, TURN, TURNS, parameter_rows, running_at, running_rows
from nearharmonic.core.machine.values import (
    DOUBLE,
    INDEX,
    PREFIX,
    Kinds,
    declare,
    packed,
    values_of,
    write_load,
    write_numbers,
)

#: Formulas that a system may lack, with the functions that they are made of.
_OPTIONAL = {"square": "modified", "acceleration": "acceleration"}
#: Formulas that determine all others.
_TELLING = frozenset(
    {"force", "square", "velocity", "acceleration", "energies", "force_and_potential", "kinetic", "rounding"}
)


@lru_cache(maxsize=1)  # for the functions of one kernel; more would keep systems that are no longer used
def fingerprint(rules: Rules) -> str:
    """Digest of the instructions that the formulas emit; compiled code depends on nothing else of a system."""
    physics = rules.physics
    if physics.loops is not None:
        digests = " ".join(energy.digest for energy in physics.loops)
        more = " timed" if physics.timed else ""
        return sha256(f"{digests} {physics.unit_masses}{more}".encode()).hexdigest()
    given = "" if physics.numba is None else f" {physics.numba.digest}"
    return sha256(f"{module_of(rules, 1, _TELLING)} {moving(rules)} {physics.turning}{given}".encode()).hexdigest()


def moving(rules: Rules) -> tuple[bool, ...]:
    """Return True for each coordinate that can move: its dT/dp is not the constant 0."""
    return tuple(v != 0 for v in _constant_velocities(rules))


def clocks(rules: Rules) -> tuple[bool, ...]:
    """Return True for each coordinate with a carry of its own: the time, whose dT/dp is the constant 1.

    If sums are not plain, all coordinates have carries, and the result is False for each.
    """
    if rules.extended or rules.compensated:
        return (False,) * rules.physics.dimension
    return tuple(v == 1 for v in _constant_velocities(rules))


def _constant_velocities(rules: Rules) -> tuple[Constant | None, ...]:
    """The velocities that are constants; None for the others."""
    d = rules.physics.dimension
    kinds = [DOUBLE] * (2 * d + parameter_rows(rules.physics.parameters))
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), kinds), "moving")
    builder = ir.IRBuilder(function.append_basic_block())
    values = [LLVMValue(builder, argument) for argument in function.args]
    velocity = rules.velocity(values[: 2 * d], values[2 * d :])
    return tuple(v if isinstance(v, Constant) else None for v in velocity)


def module_of(rules: Rules, lanes: int, needed: Container[str]) -> ir.Module:
    """Return a module with the functions of these names that loops call, for a system and a number of lanes."""
    physics, d = rules.physics, rules.physics.dimension
    if physics.loops is not None:
        from nearharmonic.core.large import emission as functions

        return functions.module_of(rules, kinds_of(rules, lanes), needed)
    written = _Formulas(rules, kinds_of(rules, lanes), needed)
    running = running_at(d, physics.parameters)
    write_numbers(written.module, {
        "dimension": d, "columns": rules.columns, "tally": 4 * d, "parameters": 4 * d + TALLY, "running": running,
    })  # fmt: skip
    written.write()
    if physics.stages is not None:
        from nearharmonic.core.collocation import formulas

        counters = running + running_rows(d, physics.stages.stages) - COUNTERS
        write_numbers(written.module, {"counters": counters, "lanes": lanes})
        formulas.write(written.module, rules, written.kinds, needed)
    if physics.turning is not None:
        for column in range(6 if rules.extended else TURNS):
            if f"turn{column}" in needed:
                written.coefficient(column)
    return written.module


def kinds_of(rules: Rules, lanes: int) -> Kinds:
    """Types of the numbers of a kernel."""
    block = 0 if rules.physics.loops is None else BLOCK
    stages = 1 if rules.physics.stages is None else rules.physics.stages.stages
    return Kinds(rules.physics.dimension, parameter_rows(rules.physics.parameters), lanes, block, stages)


class _Formulas:
    """Functions of one module."""

    def __init__(self, rules: Rules, kinds: Kinds, needed: Container[str]) -> None:
        # The context is new: a module lists all types of its context, and numba's context has more in some processes.
        self.module, self.rules, self.kinds, self.needed = ir.Module("formulas", ir.Context()), rules, kinds, needed
        self.real, self.point = kinds.of("R"), kinds.of("P")

    def write(self) -> None:
        """The formulas of the system."""
        rules, d, real, point = self.rules, self.rules.physics.dimension, self.real, self.point
        rates = ir.ArrayType(point, 2) if rules.extended else point

        def halves(entries: Entries) -> Any:
            return [entries[:d], entries[d:]] if rules.extended else entries

        def velocity(p: Entries, low: Entries, c: Entries) -> Any:
            return halves(rules.flat(rules.velocity(p + low, c), p[0]))

        self.define("force", rates, "PP", lambda q, low, c: halves(rules.force(q + low, c)))
        if rules.looks_ahead:
            self.define("velocity", rates, "P", lambda p, c: velocity(p, p, c))
            self.define("acceleration", point, "P", rules.acceleration)
        else:
            self.define("velocity", rates, "PP", velocity)
        self.define("square", rates, "PP", lambda q, low, c: halves(rules.square(q + low, c)))
        self.define("energy", ir.ArrayType(real, 2), "PPPP", lambda *x: _each(rules.energies(_joined(x), x[-1])[:2]))
        self.define("energies", ir.ArrayType(real, 4), "PPPP", lambda *x: _each(rules.energies(_joined(x), x[-1])))
        if rules.quick_energy:
            found = ir.LiteralStructType([point, real])
            self.define(
                "force_and_potential", found, "PP", lambda q, low, c: _split(rules.force_and_potential(q + low, c))
            )
            self.define("potential", real, "PP", lambda q, low, c: rules.potential(q + low, c))
            self.define("kinetic", real, "P", lambda p, c: rules.kinetic(p + p, c))
            self.define("rounding", ir.ArrayType(real, 2), "PPPP", lambda *x: _each(rules.rounding(_joined(x), x[-1])))
        if not all(moves := moving(rules)):
            self.define("moved", point, "PP", lambda new, old: [
                x if moves[i] else y for i, (x, y) in enumerate(zip(new, old, strict=True))
            ], given=False)  # fmt: skip
        if any(times := clocks(rules)):
            self.define("timed", point, "PP", lambda time, others: [
                x if times[i] else y for i, (x, y) in enumerate(zip(time, others, strict=True))
            ], given=False)  # fmt: skip

    def define(self, name: str, result: ir.Type, letters: str, body: Callable[..., Any], *, given: bool = True) -> None:
        """Write a function of points and, if they are ``given``, of the parameters."""
        if name not in self.needed or getattr(self.rules.physics, _OPTIONAL.get(name, "V")) is None:
            return
        kinds = [self.kinds.of(letter) for letter in (f"{letters}C" if given else letters)]
        function = declare(self.module, f"{PREFIX}{name}", kinds, result)
        if name == "energy" and self.rules.quick_energy:  # a call of long code that runs rarely: it takes no registers
            function.attributes.discard("alwaysinline")
            function.attributes.add("noinline")
        builder = ir.IRBuilder(function.append_basic_block())
        found = body(
            *(
                [LLVMValue(builder, builder.extract_value(x, i)) for i in range(len(x.type.elements))]
                for x in function.args
            )
        )
        builder.ret(packed(builder, values_of(found), result))

    def coefficient(self, column: int) -> None:
        """A function that loads one coefficient for each coordinate, for an oscillator that is solved exactly."""
        turning = self.rules.physics.turning
        assert turning is not None
        size, first = (6, 2 * TURN) if self.rules.extended else (TURNS, TURN)
        function = declare(self.module, f"{PREFIX}turn{column}", [DOUBLE.as_pointer(), INDEX], self.point)
        builder = ir.IRBuilder(function.append_basic_block())
        rows = [first + size * place + column for place in turning]
        array, row = function.args
        write_load(builder, array, row, self.kinds, self.point, rows)


def _joined(numbers: Sequence[Entries]) -> Entries:
    """The rows of a state, without the parameters that follow them."""
    return [entry for point in numbers[:-1] for entry in point]


def _each(numbers: Sequence[LLVMValue]) -> list[Entries]:
    return [[number] for number in numbers]


def _split(entries: Entries) -> list[Entries]:
    return [entries[:-1], entries[-1:]]


def maps_module(rules: Rules, maps: Any) -> ir.Module:
    """Return a module with the functions that :func:`nearharmonic.core.loops.landing.land` calls.

    Parameters
    ----------
    rules : Rules
        The regularised system, of D coordinates.
    maps : object
        ``from_physical(q, p, *parameters)``, ``to_physical(x, y)``, ``inverse_axis(x, *parameters)`` and
        ``largest_radius(x, y, *parameters)``, formulas of numbers; ``dimension`` d of physical space.
    """
    physics, d, D = rules.physics, maps.dimension, rules.physics.dimension
    written = _Formulas(rules, kinds_of(rules, 1), ())
    running, stages = running_at(D, physics.parameters), 0 if physics.stages is None else physics.stages.stages
    counters = running + running_rows(D, stages) - COUNTERS
    write_numbers(written.module, {"dimension": D, "running": running, "counters": counters})

    def departed(writer: LoopWriter, start: ir.Value, first: ir.Value, rows: ir.Value, to: ir.Value) -> None:
        pairs = (_pairs(writer, rows, 4 * D + TALLY + 2 * k, 1)[0] for k in range(physics.parameters))
        given: tuple[Any, ...] = physics.constants or tuple(pairs)
        start = writer.builder.gep(start, [first])
        x, y = maps.from_physical(_pairs(writer, start, 0, d), _pairs(writer, start, 2 * d, d), *given)
        inverse, radius = maps.inverse_axis(x, *given), maps.largest_radius(x, y, *given)
        _write(writer, to, [*_halves(x, y), *inverse.pair, radius.high * inverse.high])

    def physical(writer: LoopWriter, state: ir.Value, to: ir.Value, first: ir.Value) -> None:
        q, p = maps.to_physical(_pairs(writer, state, 0, D), _pairs(writer, state, 2 * D, D))
        _write(writer, writer.builder.gep(to, [first]), _halves(q, p))

    pointer = DOUBLE.as_pointer()
    for body, kinds in ((departed, [pointer, INDEX, pointer, pointer]), (physical, [pointer, pointer, INDEX])):
        function = declare(written.module, f"{PREFIX}{body.__name__}", kinds, ir.VoidType())
        builder = ir.IRBuilder(function.append_basic_block())
        body(LoopWriter(builder), *function.args)
        builder.ret_void()
    return written.module


def _pairs(writer: LoopWriter, array: ir.Value, at: int, count: int) -> tuple[DoubleDouble, ...]:
    """The numbers of ``count`` high halves in memory and of the low halves behind them."""
    halves = [writer.load(writer.place(array, at + k), 1) for k in range(2 * count)]
    return tuple(map(DoubleDouble, halves[:count], halves[count:]))


def _write(writer: LoopWriter, array: ir.Value, numbers: Sequence[LLVMValue]) -> None:
    for i, number in enumerate(numbers):
        writer.store(number, writer.place(array, i))


def _halves(*points: Sequence[DoubleDouble]) -> list[LLVMValue]:
    return [half for point in points for half in (*(n.high for n in point), *(n.low for n in point))]
