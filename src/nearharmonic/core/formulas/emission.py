"""Formulas of a system as functions of LLVM, linked to the loops of :mod:`nearharmonic.core.loops.advance`."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
from typing import Any

from llvmlite import ir

from nearharmonic.core.formulas.number import Constant
from nearharmonic.core.formulas.tracing import DoubleDouble, Entries, LLVMValue, Rules
from nearharmonic.core.large.memory import LoopWriter
from nearharmonic.core.large.terms import BLOCK
from nearharmonic.core.layout import COUNTERS, TALLY, TURN, TURNS, parameter_rows, running_at, running_rows
from nearharmonic.core.machine.values import DOUBLE, INDEX, Kinds, loaded, write_function, write_numbers

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
    kinds, running = kinds_of(rules, lanes), running_at(d, physics.parameters)
    module = _module({
        "dimension": d, "columns": rules.columns, "tally": 4 * d, "parameters": 4 * d + TALLY, "running": running,
    })  # fmt: skip
    _write_formulas(module, rules, kinds, needed)
    if physics.stages is not None:
        from nearharmonic.core.collocation import formulas

        counters = running + running_rows(d, physics.stage_count) - COUNTERS
        write_numbers(module, {"counters": counters, "lanes": lanes})
        formulas.write(module, rules, kinds, needed)
    if physics.turning is not None:
        for column in range(6 if rules.extended else TURNS):
            if f"turn{column}" in needed:
                _write_coefficient(module, rules, kinds, column)
    return module


def _module(numbers: Mapping[str, int]) -> ir.Module:
    """Return a module with functions that return integers."""
    # The context is new: a module lists all types of its context, and numba's context has more in some processes.
    module = ir.Module("formulas", ir.Context())
    write_numbers(module, numbers)
    return module


def kinds_of(rules: Rules, lanes: int) -> Kinds:
    block = 0 if rules.physics.loops is None else BLOCK
    stages = max(1, rules.physics.stage_count)
    return Kinds(rules.physics.dimension, parameter_rows(rules.physics.parameters), lanes, block, stages)


def _write_formulas(module: ir.Module, rules: Rules, kinds: Kinds, needed: Container[str]) -> None:
    """Write the formulas of a system that are ``needed``: functions of points and, but for two, of the parameters."""
    physics, d, real, point = rules.physics, rules.physics.dimension, kinds.of("R"), kinds.of("P")
    rates = ir.ArrayType(point, 2) if rules.extended else point

    def define(name: str, result: ir.Type, letters: str, body: Callable[..., Any], *, given: bool = True) -> None:
        if name not in needed or getattr(physics, _OPTIONAL.get(name, "V")) is None:
            return
        arguments = [kinds.of(letter) for letter in (f"{letters}C" if given else letters)]
        rare = name == "energy" and rules.quick_energy  # a call of long code takes no registers from the rest
        write_function(module, name, arguments, result, lambda _, *x: body(*x), inlined=not rare)

    def halves(entries: Entries) -> Any:
        return [entries[:d], entries[d:]] if rules.extended else entries

    def velocity(p: Entries, low: Entries, c: Entries) -> Any:
        return halves(rules.flat(rules.velocity(p + low, c), p[0]))

    define("force", rates, "PP", lambda q, low, c: halves(rules.force(q + low, c)))
    if rules.looks_ahead:
        define("velocity", rates, "P", lambda p, c: velocity(p, p, c))
        define("acceleration", point, "P", rules.acceleration)
    else:
        define("velocity", rates, "PP", velocity)
    define("square", rates, "PP", lambda q, low, c: halves(rules.square(q + low, c)))
    define("energy", ir.ArrayType(real, 2), "PPPP", lambda *x: _each(rules.energies(_joined(x), x[-1])[:2]))
    define("energies", ir.ArrayType(real, 4), "PPPP", lambda *x: _each(rules.energies(_joined(x), x[-1])))
    if rules.quick_energy:
        found = ir.LiteralStructType([point, real])
        define("force_and_potential", found, "PP", lambda q, low, c: _split(rules.force_and_potential(q + low, c)))
        define("potential", real, "PP", lambda q, low, c: rules.potential(q + low, c))
        define("kinetic", real, "P", lambda p, c: rules.kinetic(p + p, c))
        define("rounding", ir.ArrayType(real, 2), "PPPP", lambda *x: _each(rules.rounding(_joined(x), x[-1])))
    if not all(moves := moving(rules)):
        define("moved", point, "PP", lambda new, old: [
            x if moves[i] else y for i, (x, y) in enumerate(zip(new, old, strict=True))
        ], given=False)  # fmt: skip
    if any(times := clocks(rules)):
        define("timed", point, "PP", lambda time, others: [
            x if times[i] else y for i, (x, y) in enumerate(zip(time, others, strict=True))
        ], given=False)  # fmt: skip


def _write_coefficient(module: ir.Module, rules: Rules, kinds: Kinds, column: int) -> None:
    """A function that loads one coefficient for each coordinate, for an oscillator that is solved exactly."""
    size, first = (6, 2 * TURN) if rules.extended else (TURNS, TURN)
    rows = [first + size * place + column for place in rules.physics.turning or ()]

    def load(builder: ir.IRBuilder, array: ir.Value, row: ir.Value) -> list[LLVMValue]:
        places = (builder.add(row, INDEX(behind)) for behind in rows)
        return [LLVMValue(builder, loaded(builder, array, at, kinds, kinds.real)) for at in places]

    write_function(module, f"turn{column}", [DOUBLE.as_pointer(), INDEX], kinds.of("P"), load)


def _joined(numbers: Sequence[Entries]) -> Entries:
    """The rows of a state, without the parameters that follow them."""
    return [entry for point in numbers[:-1] for entry in point]


def _each(numbers: Sequence[LLVMValue]) -> list[Entries]:
    return [[number] for number in numbers]


def _split(entries: Entries) -> list[Entries]:
    return [entries[:-1], entries[-1:]]


def maps_module(rules: Rules, maps: Any) -> ir.Module:
    """Return a module with the functions that :func:`nearharmonic.core.loops.landing.land` calls.

    ``rules`` are those of the regularised system, of D coordinates. ``maps`` has the formulas ``from_physical(q, p,
    *parameters)``, ``to_physical(x, y)``, ``inverse_axis(x, *parameters)`` and ``largest_radius(x, y, *parameters)``,
    and the ``dimension`` d of physical space.
    """
    physics, d, D = rules.physics, maps.dimension, rules.physics.dimension
    running = running_at(D, physics.parameters)
    counters = running + running_rows(D, physics.stage_count) - COUNTERS
    module = _module({"dimension": D, "running": running, "counters": counters})

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
        write_function(
            module, body.__name__, kinds, ir.VoidType(), lambda builder, *x, f=body: f(LoopWriter(builder), *x)
        )
    return module


def _pairs(writer: LoopWriter, array: ir.Value, at: int, count: int) -> tuple[DoubleDouble, ...]:
    """The numbers of ``count`` high halves in memory and of the low halves behind them."""
    halves = [writer.load(writer.place(array, at + k), 1) for k in range(2 * count)]
    return tuple(map(DoubleDouble, halves[:count], halves[count:]))


def _write(writer: LoopWriter, array: ir.Value, numbers: Sequence[LLVMValue]) -> None:
    for i, number in enumerate(numbers):
        writer.store(number, writer.place(array, i))


def _halves(*points: Sequence[DoubleDouble]) -> list[LLVMValue]:
    return [half for point in points for half in (*(n.high for n in point), *(n.low for n in point))]
