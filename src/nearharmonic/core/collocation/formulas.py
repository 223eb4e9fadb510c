"""Functions of the stages of a collocation method as functions of LLVM: products with its matrices, and formulas.

A coordinate of the stages is one vector of all lanes of all stages (:mod:`nearharmonic.core.machine.values`). A
product with a matrix is two chains of operations, for the first and for the second half of the stages, so that its bits
do not depend on the number of lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from typing import Any

from llvmlite import ir

from nearharmonic.core.arithmetic import dd_add, dd_mul
from nearharmonic.core.formulas.tracing import Entries, Rules
from nearharmonic.core.layout import Vector, collocation_columns
from nearharmonic.core.machine.values import (
    INDEX,
    Kinds,
    LLVMValue,
    folded,
    in_every_lane,
    loaded,
    shuffled,
    stage,
    write_function,
)

#: Function of the builder and of the entries of each argument.
Body = Callable[..., Any]
Matrix = tuple[Vector, ...]


def write(module: ir.Module, rules: Rules, kinds: Kinds, needed: Container[str]) -> None:
    """Write the functions of stages that are ``needed`` into a module."""
    table = rules.physics.stages
    assert table is not None
    stages, point = kinds.of("S"), kinds.of("R" if kinds.block else "P")
    both = ir.ArrayType(stages, 2)
    extended, d = rules.extended, len(stages.elements)

    def define(name: str, letters: str, result: ir.Type, body: Body) -> None:
        if name in needed:
            write_function(module, name, [kinds.of(letter) for letter in letters], result, body)

    def of_stages(formula: Callable[[Entries, Entries], Entries]) -> Body:
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
        define("weights_pairs", "RR", both, lambda builder, h, low: _pairs([dd_mul(
            _constant_pair(builder, table.weights, kinds),
            (_of_every_stage(builder, h[0], kinds), _of_every_stage(builder, low[0], kinds)),
        )] * d))  # fmt: skip
        define("by_momentum_pairs", "SS", both, lambda builder, x, low: _pairs(
            [_product_of_pairs(table.momentum, pair, kinds) for pair in zip(x, low, strict=True)]
        ))  # fmt: skip
        define("summed_pairs", "SS", ir.ArrayType(point, 2), lambda builder, x, low: _pairs(
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
        return _pairs([
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


def _column(matrix: Matrix, j: int) -> Vector:
    return tuple(row[j] for row in matrix)


def _of_every_stage(builder: ir.IRBuilder, x: LLVMValue, kinds: Kinds) -> LLVMValue:
    """A number of each lane in every stage."""
    return LLVMValue(builder, in_every_lane(builder, x.value, kinds.of("S").elements[0]))


def _from_stage(x: LLVMValue, j: int, kinds: Kinds) -> LLVMValue:
    places = [j * kinds.lanes + i % kinds.lanes for i in range(kinds.stages * kinds.lanes)]
    return LLVMValue(x.builder, shuffled(x.builder, x.value, places))


def _product(matrix: Matrix, x: LLVMValue, kinds: Kinds) -> LLVMValue:
    return _combined([_constant(x.builder, _column(matrix, j), kinds) for j in range(kinds.stages)], x, kinds)


def _combined(columns: Sequence[LLVMValue], x: LLVMValue, kinds: Kinds) -> LLVMValue:
    """The sum of columns, each times the number of its stage, in two chains."""
    chains = []
    for places in _halves(kinds.stages):
        first, *others = places
        chain = columns[first] * _from_stage(x, first, kinds)
        for j in others:
            chain = columns[j].fma(_from_stage(x, j, kinds), chain)
        chains.append(chain)
    return chains[0] if len(chains) == 1 else chains[0] + chains[1]


def _halves(count: int) -> list[range]:
    middle = -(-count // 2)
    return [places for places in (range(middle), range(middle, count)) if places]


def _product_of_pairs(matrix: Matrix, x: tuple[LLVMValue, LLVMValue], kinds: Kinds) -> tuple[Any, Any]:
    """A matrix times numbers of the stages, each a pair."""
    total = None
    for j in range(kinds.stages):
        column = _constant_pair(x[0].builder, _column(matrix, j), kinds)
        term = dd_mul(column, tuple(_from_stage(half, j, kinds) for half in x))  # type: ignore[arg-type]
        total = term if total is None else dd_add(total, term)
    assert total is not None
    return total


def _sum_of_pairs(builder: ir.IRBuilder, x: tuple[LLVMValue, LLVMValue], kinds: Kinds) -> tuple[Any, Any]:
    found = [tuple(LLVMValue(builder, stage(builder, half.value, j, kinds)) for half in x) for j in range(kinds.stages)]
    total: Any = found[0]
    for pair in found[1:]:
        total = dd_add(total, pair)  # type: ignore[arg-type]
    return total[0], total[1]


def _pairs(found: Sequence[tuple[Any, Any]]) -> list[list[Any]]:
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
