"""Formulas of a system, and products of stages, as functions of LLVM that compiled loops call."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from functools import lru_cache, reduce
from hashlib import sha256
from typing import Any

from llvmlite import ir

from nearharmonic.core.arithmetic import dd_add, dd_mul
from nearharmonic.core.layout import (
    BLOCK,
    COUNTERS,
    TALLY,
    TURN,
    TURNS,
    Vector,
    collocation_columns,
    parameter_rows,
    running_at,
    running_rows,
)
from nearharmonic.core.number import Constant
from nearharmonic.core.tracing import DoubleDouble, Entries, Rules
from nearharmonic.core.values import (
    DOUBLE,
    INDEX,
    Kinds,
    LLVMValue,
    LoopWriter,
    folded,
    in_every_lane,
    loaded,
    shuffled,
    stage,
    write_function,
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
    return sha256(
        f"{module_of(rules, kinds_of(rules, 1), _TELLING)} {moving(rules)} {physics.turning}{given}".encode()
    ).hexdigest()


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


def module_of(rules: Rules, kinds: Kinds, needed: Container[str]) -> ir.Module:
    """Return a module with the functions of these names that loops call, for a system and a number of lanes."""
    physics, d = rules.physics, rules.physics.dimension
    running = running_at(d, physics.parameters)
    module = module_with({
        "dimension": d, "columns": rules.columns, "tally": 4 * d, "parameters": 4 * d + TALLY, "running": running,
    })  # fmt: skip
    _write_formulas(module, rules, kinds, needed)
    if physics.stages is not None:
        counters = running + running_rows(d, physics.stage_count) - COUNTERS
        write_numbers(module, {"counters": counters, "lanes": kinds.lanes})
        write_stages(module, rules, kinds, needed)
    if physics.turning is not None:
        for column in range(6 if rules.extended else TURNS):
            if f"turn{column}" in needed:
                _write_coefficient(module, rules, kinds, column)
    return module


def module_with(numbers: Mapping[str, int]) -> ir.Module:
    """Return a module with functions that return integers."""
    # The context is new: a module lists all types of its context, and the global one has more in some processes.
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

    def of_state(formula: Callable[..., Entries], x: Sequence[Entries]) -> list[Entries]:
        *points, c = x
        return [[number] for number in formula([entry for point in points for entry in point], c)]

    def pull(q: Entries, low: Entries, c: Entries) -> list[Entries]:
        *force, V = rules.force_and_potential(q + low, c)
        return [force, [V]]

    def velocity(p: Entries, low: Entries, c: Entries) -> Any:
        return halves(rules.flat(rules.velocity(p + low, c), p[0]))

    define("force", rates, "PP", lambda q, low, c: halves(rules.force(q + low, c)))
    if rules.looks_ahead:
        define("velocity", rates, "P", lambda p, c: velocity(p, p, c))
        define("acceleration", point, "P", rules.acceleration)
    else:
        define("velocity", rates, "PP", velocity)
    define("square", rates, "PP", lambda q, low, c: halves(rules.square(q + low, c)))
    define("energy", ir.ArrayType(real, 2), "PPPP", lambda *x: of_state(rules.energies, x)[:2])
    define("energies", ir.ArrayType(real, 4), "PPPP", lambda *x: of_state(rules.energies, x))
    if rules.quick_energy:
        found = ir.LiteralStructType([point, real])
        define("force_and_potential", found, "PP", pull)
        define("potential", real, "PP", lambda q, low, c: rules.force_and_potential(q + low, c)[-1:])
        define("kinetic", real, "P", lambda p, c: rules.kinetic(p + p, c))
        define("rounding", ir.ArrayType(real, 2), "PPPP", lambda *x: of_state(rules.rounding, x))
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


def maps_module(rules: Rules, maps: Any) -> ir.Module:
    """Return a module with the functions that :func:`nearharmonic.core.loops.land` calls.

    ``rules`` belong to the regularised system, of D coordinates. ``maps`` has the formulas ``from_physical(q, p,
    *parameters)``, ``to_physical(x, y)``, ``inverse_axis(x, *parameters)`` and ``largest_radius(x, y, *parameters)``,
    and the ``dimension`` d of physical space.
    """
    physics, d, D = rules.physics, maps.dimension, rules.physics.dimension
    running = running_at(D, physics.parameters)
    counters = running + running_rows(D, physics.stage_count) - COUNTERS
    module = module_with({"dimension": D, "running": running, "counters": counters})

    def departed(writer: LoopWriter, start: ir.Value, first: ir.Value, rows: ir.Value, to: ir.Value) -> None:
        pairs = (_pairs_at(writer, rows, 4 * D + TALLY + 2 * k, 1)[0] for k in range(physics.parameters))
        given: tuple[Any, ...] = physics.constants or tuple(pairs)
        start = writer.builder.gep(start, [first])
        x, y = maps.from_physical(_pairs_at(writer, start, 0, d), _pairs_at(writer, start, 2 * d, d), *given)
        inverse, radius = maps.inverse_axis(x, *given), maps.largest_radius(x, y, *given)
        _write(writer, to, [*_halves_of(x, y), *inverse.pair, radius.high * inverse.high])

    def physical(writer: LoopWriter, state: ir.Value, to: ir.Value, first: ir.Value) -> None:
        q, p = maps.to_physical(_pairs_at(writer, state, 0, D), _pairs_at(writer, state, 2 * D, D))
        _write(writer, writer.builder.gep(to, [first]), _halves_of(q, p))

    pointer = DOUBLE.as_pointer()
    for body, kinds in ((departed, [pointer, INDEX, pointer, pointer]), (physical, [pointer, pointer, INDEX])):
        write_function(
            module, body.__name__, kinds, ir.VoidType(), lambda builder, *x, f=body: f(LoopWriter(builder), *x)
        )
    return module


def _pairs_at(writer: LoopWriter, array: ir.Value, at: int, count: int) -> tuple[DoubleDouble, ...]:
    """The numbers of ``count`` high halves in memory and of the low halves behind them."""
    halves = [writer.load(writer.place(array, at + k), 1) for k in range(2 * count)]
    return tuple(map(DoubleDouble, halves[:count], halves[count:]))


def _write(writer: LoopWriter, array: ir.Value, numbers: Sequence[LLVMValue]) -> None:
    for i, number in enumerate(numbers):
        writer.store(number, writer.place(array, i))


def _halves_of(*points: Sequence[DoubleDouble]) -> list[LLVMValue]:
    return [half for point in points for half in (*(n.high for n in point), *(n.low for n in point))]


# --- Functions of the stages of a collocation method: products with its matrices, and formulas.
#
# A coordinate of the stages is one vector of all lanes of all stages (:mod:`nearharmonic.core.values`). A product with
# a matrix is two chains of operations, for the first and for the second half of the stages, so that its bits do not
# depend on the number of lanes.

Matrix = tuple[Vector, ...]


def write_stages(module: ir.Module, rules: Rules, kinds: Kinds, needed: Container[str]) -> None:
    """Write the functions of stages that are ``needed`` into a module."""
    table = rules.physics.stages
    assert table is not None
    stages, point = kinds.of("S"), kinds.of("R" if kinds.block else "P")
    both = ir.ArrayType(stages, 2)
    extended, d = rules.extended, len(stages.elements)

    def define(name: str, letters: str, result: ir.Type, body: Callable[..., Any]) -> None:
        if name in needed:
            write_function(module, name, [kinds.of(letter) for letter in letters], result, body)

    def of_stages(formula: Callable[[Entries, Entries], Entries]) -> Callable[..., Any]:
        """A formula at positions or momenta of the stages; in extended precision low halves follow the high ones."""

        def body(builder: ir.IRBuilder, x: Entries, low: Entries, parameters: Entries) -> Any:
            found = formula(x + low, [_of_every_stage(builder, c, kinds) for c in parameters])
            return [found[:d], found[d:]] if extended else found

        return body

    rates = both if extended else stages
    force = rules.force if rules.physics.numba is None else _one_by_one(rules.force, kinds)
    define("stage_force", "SSC", rates, of_stages(force))
    define("stage_velocity", "SSC", rates, of_stages(lambda p, C: rules.flat(rules.velocity(p, C), p[0])))
    if rules.looks_ahead:
        define("stage_acceleration", "SC", stages, lambda builder, f, C: rules.acceleration(
            f, [_of_every_stage(builder, c, kinds) for c in C]
        ))  # fmt: skip
    define("at_stages", "P", stages, lambda builder, x: [_of_every_stage(builder, one, kinds) for one in x])
    for name, matrix in (("by_position", table.position), ("by_momentum", table.momentum), ("by_guess", table.guess)):
        define(name, "S", stages, lambda builder, x, m=matrix: [_product(m, one, kinds) for one in x])
    for name, vector in (("times_nodes", table.nodes), ("times_rest", table.rest)):
        define(name, "S", stages, lambda builder, x, v=vector: [_constant(builder, v, kinds) * one for one in x])
    define("weights", "R", stages, lambda builder, h: [
        _constant(builder, table.weights, kinds) * _of_every_stage(builder, h[0], kinds)
    ] * d)  # fmt: skip
    define("summed", "S", point, lambda builder, x: [
        LLVMValue(builder, folded(builder, one.value, kinds, lambda b, y, z: b.fadd(y, z))) for one in x
    ])  # fmt: skip
    if rules.physics.turning is not None:
        _write_oscillators(define, kinds, rules.physics.turning)
    if extended:
        define("weights_pairs", "RR", both, lambda builder, h, low: _both_halves([dd_mul(
            _constant_pair(builder, table.weights, kinds),
            (_of_every_stage(builder, h[0], kinds), _of_every_stage(builder, low[0], kinds)),
        )] * d))  # fmt: skip
        define("by_momentum_pairs", "SS", both, lambda builder, x, low: _both_halves(
            [_product_of_pairs(table.momentum, pair, kinds) for pair in zip(x, low, strict=True)]
        ))  # fmt: skip
        define("summed_pairs", "SS", ir.ArrayType(point, 2), lambda builder, x, low: _both_halves(
            [_sum_of_pairs(builder, pair, kinds) for pair in zip(x, low, strict=True)]
        ))  # fmt: skip


def _write_oscillators(define: Callable[..., None], kinds: Kinds, turning: Sequence[int]) -> None:
    """Functions of a row of :func:`nearharmonic.core.layout.collocation_columns` with oscillators in the equations."""
    s, stages = kinds.stages, kinds.of("S")
    one = ir.LiteralStructType([stages.elements[0]])

    def load(builder: ir.IRBuilder, row: tuple[Any, Any], coordinate: int, entry: int, kind: ir.Type) -> LLVMValue:
        array, at = row
        first = collocation_columns(s, turning[coordinate]) + entry
        return LLVMValue(builder, loaded(builder, array, builder.add(at, INDEX(first)), kinds, kind.elements[0]))

    def turned(builder: ir.IRBuilder, array: Any, at: Any, q: Entries, drift: Entries) -> Entries:
        row = array, at
        of_q, of_v = ([load(builder, row, k, entry, one) for k in range(len(q))] for entry in (2, 2 + s))
        return [a.fma(x, b * y) for a, x, b, y in zip(of_q, q, of_v, drift, strict=True)]

    def by_oscillators(builder: ir.IRBuilder, array: Any, at: Any, n: Entries) -> Entries:
        return [
            _combined([load(builder, (array, at), k, 2 + 2 * s + j * s, one) for j in range(s)], x, kinds)
            for k, x in enumerate(n)
        ]

    def squares(builder: ir.IRBuilder, array: Any, at: Any, half: int) -> Entries:
        real = kinds.of("R")
        return [
            _of_every_stage(builder, load(builder, (array, at), k, half, real), kinds) for k in range(kinds.dimension)
        ]

    def with_oscillators(builder: ir.IRBuilder, array: Any, at: Any, Q: Entries, n: Entries) -> Entries:
        return [w.fma(x, f) for w, x, f in zip(squares(builder, array, at, 0), Q, n, strict=True)]

    def with_pairs(builder: ir.IRBuilder, array: Any, at: Any, *x: Entries) -> list[list[Any]]:
        Q, Q_low, n, n_low = x
        w = zip(squares(builder, array, at, 0), squares(builder, array, at, 1), strict=True)
        return _both_halves([
            dd_add(dd_mul(square, position), force)
            for square, position, force in zip(
                w, zip(Q, Q_low, strict=True), zip(n, n_low, strict=True), strict=True
            )
        ])  # fmt: skip

    define("turned", "AISS", stages, turned)
    define("by_oscillators", "AIS", stages, by_oscillators)
    define("with_oscillators", "AISS", stages, with_oscillators)
    define("with_oscillators_pairs", "AISSSS", ir.ArrayType(stages, 2), with_pairs)


def _constant(builder: ir.IRBuilder, numbers: Vector, kinds: Kinds, half: int = 0) -> LLVMValue:
    """The high or low half of one number for each stage, in every lane."""
    kind = kinds.of("S").elements[0]
    return LLVMValue(builder, ir.Constant(kind, [x[half] for x in numbers for _ in range(kinds.lanes)]))


def _constant_pair(builder: ir.IRBuilder, numbers: Vector, kinds: Kinds) -> tuple[LLVMValue, LLVMValue]:
    return _constant(builder, numbers, kinds, 0), _constant(builder, numbers, kinds, 1)


def _of_every_stage(builder: ir.IRBuilder, x: LLVMValue, kinds: Kinds) -> LLVMValue:
    """A number of each lane in every stage."""
    return LLVMValue(builder, in_every_lane(builder, x.value, kinds.of("S").elements[0]))


def _from_stage(x: LLVMValue, j: int, kinds: Kinds) -> LLVMValue:
    places = [j * kinds.lanes + i % kinds.lanes for i in range(kinds.stages * kinds.lanes)]
    return LLVMValue(x.builder, shuffled(x.builder, x.value, places))


def _product(matrix: Matrix, x: LLVMValue, kinds: Kinds) -> LLVMValue:
    return _combined([_constant(x.builder, column, kinds) for column in zip(*matrix, strict=True)], x, kinds)


def _combined(columns: Sequence[LLVMValue], x: LLVMValue, kinds: Kinds) -> LLVMValue:
    """The sum of columns, each times the number of its stage, in two chains."""
    chains, middle = [], -(-kinds.stages // 2)
    for places in filter(None, (range(middle), range(middle, kinds.stages))):
        first, *others = places
        chain = columns[first] * _from_stage(x, first, kinds)
        for j in others:
            chain = columns[j].fma(_from_stage(x, j, kinds), chain)
        chains.append(chain)
    return chains[0] if len(chains) == 1 else chains[0] + chains[1]


def _product_of_pairs(matrix: Matrix, x: Sequence[LLVMValue], kinds: Kinds) -> tuple[Any, Any]:
    """A matrix times numbers of the stages, each a pair."""
    columns = [_constant_pair(x[0].builder, column, kinds) for column in zip(*matrix, strict=True)]
    numbers = [(_from_stage(x[0], j, kinds), _from_stage(x[1], j, kinds)) for j in range(kinds.stages)]
    return reduce(dd_add, map(dd_mul, columns, numbers))


def _sum_of_pairs(builder: ir.IRBuilder, x: Sequence[LLVMValue], kinds: Kinds) -> tuple[Any, Any]:
    terms = ([LLVMValue(builder, stage(builder, half.value, j, kinds)) for half in x] for j in range(kinds.stages))
    return reduce(dd_add, ((high, low) for high, low in terms))


def _both_halves(found: Sequence[tuple[Any, Any]]) -> list[list[Any]]:
    """The high halves, and the low halves, of pairs."""
    return [[pair[half] for pair in found] for half in (0, 1)]


def _one_by_one(formula: Callable[[Entries, Entries], Entries], kinds: Kinds) -> Callable[[Entries, Entries], Entries]:
    """A formula of one position, called once for each stage."""

    def each(position: Entries, parameters: Entries) -> Entries:
        found = [
            formula([x.lanes()[j] for x in position], [c.lanes()[j] for c in parameters]) for j in range(kinds.stages)
        ]
        return [position[0].from_lanes(one) for one in zip(*found, strict=True)]

    return each
