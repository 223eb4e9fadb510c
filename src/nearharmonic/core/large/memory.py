"""Numbers in memory for compiled loops: arrays of doubles or double-doubles, tables, and writers of loops."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from nearharmonic.core.formulas.number import Constant
from nearharmonic.core.formulas.tracing import Conditioned, Double, DoubleDouble, LLVMValue
from nearharmonic.core.large.terms import BLOCK
from nearharmonic.core.machine.values import DOUBLE, INDEX, LLVMBits, LLVMMask

PLACE = ir.IntType(32)


class ConditionedDouble(Conditioned):
    """A double with its condition, which are two planes in memory."""

    __slots__ = ()
    parts = 2

    @classmethod
    def read(cls, value: LLVMValue, size: LLVMValue) -> ConditionedDouble:
        """The number of these carriers."""
        number = cls(Double(value))
        number.size = Double(size)
        return number

    @classmethod
    def of(cls, number: Constant, like: LLVMValue) -> ConditionedDouble:
        return cls(Double.of(number, like))

    @classmethod
    def of_state(cls, high: LLVMValue, low: LLVMValue) -> ConditionedDouble:
        return cls(Double(high))

    @property
    def carriers(self) -> list[LLVMValue]:
        return [self.value.carrier, self.size.carrier]


#: Types of the numbers of loops.
Kind = type[Double] | type[DoubleDouble] | type[ConditionedDouble]


@dataclass(frozen=True)
class Planes:
    """Numbers in memory: the address of the first double, and the distance from one plane to the next in doubles."""

    address: ir.Value
    stride: int


#: A 64-bit integer.
Index = LLVMBits


class Variable:
    """A variable of a function that is written."""

    def __init__(self, builder: ir.IRBuilder, initial: LLVMValue) -> None:
        self._builder = builder
        with builder.goto_entry_block():
            self._room = builder.alloca(initial.value.type)
        self.value = initial

    @property
    def value(self) -> LLVMValue:
        return LLVMValue(self._builder, self._builder.load(self._room))

    @value.setter
    def value(self, new: LLVMValue) -> None:
        self._builder.store(new.value, self._room)


class LoopWriter:
    """Writes loops over blocks, tables and accesses to memory at the end of a function."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self.builder = builder

    def index(self, number: int) -> Index:
        return Index(self.builder, INDEX(number))

    @contextmanager
    def repeated(self, count: int | Index, begin: int | Index = 0, step: int = 1) -> Iterator[Index]:
        """Write the body of a loop over ``begin``, ``begin`` + ``step``, ... below ``count``."""
        builder = self.builder
        end, start = (self.index(x).value if isinstance(x, int) else x.value for x in (count, begin))
        before, head = builder.block, builder.append_basic_block("repeated")
        body, behind = builder.append_basic_block("body"), builder.append_basic_block("behind")
        builder.branch(head)
        builder.position_at_end(head)
        i = builder.phi(INDEX)
        i.add_incoming(start, before)
        builder.cbranch(builder.icmp_signed("<", i, end), body, behind)
        builder.position_at_end(body)
        yield Index(builder, i)
        i.add_incoming(builder.add(i, INDEX(step)), builder.block)
        builder.branch(head)
        builder.position_at_end(behind)

    def zero(self, width: int) -> LLVMValue:
        kind = DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)
        return LLVMValue(self.builder, ir.Constant(kind, 0.0 if width == 1 else [0.0] * width))

    def place(self, address: ir.Value, offset: Index | int) -> ir.Value:
        """The address ``offset`` doubles behind another."""
        return self.builder.gep(address, [self.index(offset).value if isinstance(offset, int) else offset.value])

    def load(self, address: ir.Value, width: int) -> LLVMValue:
        """``width`` neighbouring doubles."""
        kind = DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)
        value = self.builder.load(self.builder.bitcast(address, kind.as_pointer()))
        value.align = 8
        return LLVMValue(self.builder, value)

    def store(self, value: LLVMValue, address: ir.Value) -> None:
        """Neighbouring doubles."""
        place = self.builder.bitcast(address, value.value.type.as_pointer())
        self.builder.store(value.value, place).align = 8

    def broadcast(self, value: LLVMValue, width: int) -> LLVMValue:
        """A double in every lane."""
        if width == value.width:
            return value
        return self.zero(width).from_lanes([value] * width)

    def gather(self, address: ir.Value, places: Sequence[Index]) -> LLVMValue:
        """The doubles at ``places``, one per lane."""
        scalars = [self.load(self.place(address, place), 1) for place in places]
        return self.zero(len(scalars)).from_lanes(scalars)

    def blocks(self, count: int) -> Iterator[tuple[Index, int, int]]:
        """Blocks of ``count`` results; the caller writes their code in a loop over this generator.

        Yields the index of the first result of a block, its length, and the number of its results that the previous
        block has too: the last block ends with the last result.
        """
        if count < BLOCK:
            with self.repeated(count) as i:
                yield i, 1, 0
            return
        with self.repeated(count // BLOCK) as i:
            yield i * BLOCK, BLOCK, 0
        if count % BLOCK:
            yield self.index(count - BLOCK), BLOCK, BLOCK - count % BLOCK

    def last_lanes(self, skipped: int) -> LLVMMask:
        """The mask of the lanes of a block after the first ``skipped``."""
        lanes = [int(i >= skipped) for i in range(BLOCK)]
        return LLVMMask(self.builder, ir.Constant(ir.VectorType(ir.IntType(1), BLOCK), lanes))

    def table(self, numbers: NDArray[Any]) -> ir.Value:
        """The address of constant numbers: 32-bit integers or doubles."""
        element = DOUBLE if numbers.dtype.kind == "f" else PLACE
        contents = bytearray(numbers.astype("<f8" if element is DOUBLE else "<i4").tobytes())
        module = self.builder.module
        kind = ir.ArrayType(ir.IntType(8), len(contents))
        table = ir.GlobalVariable(module, kind, f"table.{len(module.globals)}")
        table.linkage, table.global_constant, table.align = "internal", True, 64
        table.initializer = ir.Constant(kind, contents)
        return self.builder.bitcast(table, element.as_pointer())

    def looked_up(self, table: ir.Value, first: Index, width: int) -> list[Index]:
        """``width`` neighbouring entries of a table of places."""
        address = self.builder.gep(table, [first.value])
        if width == 1:
            return [Index(self.builder, self.builder.sext(self.builder.load(address), INDEX))]
        kind = ir.VectorType(PLACE, width)
        entries = self.builder.load(self.builder.bitcast(address, kind.as_pointer()))
        entries.align = 4
        lanes = (self.builder.extract_element(entries, ir.Constant(PLACE, i)) for i in range(width))
        return [Index(self.builder, self.builder.sext(lane, INDEX)) for lane in lanes]


def is_consecutive(places: NDArray[np.int64]) -> bool:
    """Return True if ``places`` ascend by 1."""
    return len(places) > 1 and bool((np.diff(places) == 1).all())


def is_constant(places: NDArray[np.int64]) -> bool:
    """Return True if all ``places`` are equal."""
    return bool((places == places[0]).all())
