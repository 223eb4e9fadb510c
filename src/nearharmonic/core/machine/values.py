"""Values that emit machine code: doubles, bit patterns and truth values, as scalars or one per SIMD lane.

An operation on :class:`LLVMValue`, :class:`LLVMBits` or :class:`LLVMMask` is one instruction of the function that is
being built. A Python number beside one of them is the same in every lane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from llvmlite import ir

from nearharmonic.core.machine.operations import DOUBLE, INDEX, intrinsic

Kind = TypeVar("Kind", bound="_Emitted")
#: A method of a value and another, or a Python number.
Binary = Callable[[Kind, Any], Kind]


def _broadcast(kind: ir.Type, number: float | int) -> ir.Constant:
    return ir.Constant(kind, [number] * kind.count if isinstance(kind, ir.VectorType) else number)


def _with_lanes_of(kind: ir.Type, element: ir.Type) -> ir.Type:
    return ir.VectorType(element, kind.count) if isinstance(kind, ir.VectorType) else element


class _Emitted:
    """A value of the function that is being built."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def _operand(self, other: Any) -> ir.Value:
        return other.value if isinstance(other, type(self)) else _broadcast(self.value.type, other)

    def _made(self: Kind, name: str, *operands: ir.Value) -> Kind:
        """The result of an instruction, of the type of this value."""
        return type(self)(self.builder, getattr(self.builder, name)(*operands))


def _instruction(name: str) -> Binary[Kind]:
    def method(self: Kind, other: Any) -> Kind:
        return self._made(name, self.value, self._operand(other))

    return method


def _reversed(name: str) -> Binary[Kind]:
    """A method that makes an instruction of a Python number and a value."""

    def method(self: Kind, other: Any) -> Kind:
        return self._made(name, self._operand(other), self.value)

    return method


class LLVMMask(_Emitted):
    """A truth value, or one per lane."""

    __slots__ = ()
    __and__: Binary[LLVMMask] = _instruction("and_")
    __or__: Binary[LLVMMask] = _instruction("or_")

    def __invert__(self) -> LLVMMask:
        return self._made("not_", self.value)

    def choose(self, yes: LLVMValue | float, no: LLVMValue | float) -> LLVMValue:
        """``yes`` in the lanes where this is true, ``no`` in the others."""
        kind = _with_lanes_of(self.value.type, DOUBLE)
        choices = [x.value if isinstance(x, LLVMValue) else _broadcast(kind, x) for x in (yes, no)]
        return LLVMValue(self.builder, self.builder.select(self.value, *choices))

    def anywhere(self) -> LLVMMask:
        """Return True if this is true in any lane."""
        if not isinstance(self.value.type, ir.VectorType):
            return self
        mask = self.builder.bitcast(self.value, ir.IntType(self.value.type.count))
        return LLVMMask(self.builder, self.builder.icmp_unsigned("!=", mask, ir.Constant(mask.type, 0)))


class LLVMBits(_Emitted):
    """The 64 bits of a double as an integer, or one per lane; sums wrap around."""

    __slots__ = ()
    __add__: Binary[LLVMBits] = _instruction("add")
    __sub__: Binary[LLVMBits] = _instruction("sub")
    __rsub__: Binary[LLVMBits] = _reversed("sub")
    __mul__: Binary[LLVMBits] = _instruction("mul")
    __and__: Binary[LLVMBits] = _instruction("and_")
    __or__: Binary[LLVMBits] = _instruction("or_")
    __xor__: Binary[LLVMBits] = _instruction("xor")
    __lshift__: Binary[LLVMBits] = _instruction("shl")
    __rshift__: Binary[LLVMBits] = _instruction("lshr")  # the high bits become 0

    def at_most(self, other: int) -> LLVMBits:
        """The smaller of this signed number and ``other``."""
        smaller = self.builder.icmp_signed("<", self.value, self._operand(other))
        return LLVMBits(self.builder, self.builder.select(smaller, self.value, self._operand(other)))

    def nonzero(self) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.icmp_unsigned("!=", self.value, self._operand(0)))

    def number(self) -> LLVMValue:
        """The double that has these bits."""
        kind = _with_lanes_of(self.value.type, DOUBLE)
        return LLVMValue(self.builder, self.builder.bitcast(self.value, kind))


class LLVMValue(_Emitted):
    """One LLVM value of type ``double`` or ``<n x double>``; a carrier for :mod:`nearharmonic.core.arithmetic`."""

    __slots__ = ()
    __add__: Binary[LLVMValue] = _instruction("fadd")
    __radd__: Binary[LLVMValue] = _reversed("fadd")
    __sub__: Binary[LLVMValue] = _instruction("fsub")
    __rsub__: Binary[LLVMValue] = _reversed("fsub")
    __mul__: Binary[LLVMValue] = _instruction("fmul")
    __rmul__: Binary[LLVMValue] = _instruction("fmul")
    __truediv__: Binary[LLVMValue] = _instruction("fdiv")
    __rtruediv__: Binary[LLVMValue] = _reversed("fdiv")

    def __neg__(self) -> LLVMValue:
        return self._made("fneg", self.value)

    @property
    def width(self) -> int:
        """Number of lanes."""
        kind = self.value.type
        return int(kind.count) if isinstance(kind, ir.VectorType) else 1

    def constant(self, number: float) -> LLVMValue:
        """``number`` in every lane."""
        return LLVMValue(self.builder, _broadcast(self.value.type, number))

    def _intrinsic(self, name: str, *others: LLVMValue | float) -> LLVMValue:
        operands = [self._operand(x) for x in others]
        return LLVMValue(self.builder, intrinsic(name)(self.builder, self.value, *operands))

    def fma(self, factor: LLVMValue | float, addend: LLVMValue | float) -> LLVMValue:
        return self._intrinsic("fma", factor, addend)

    def sqrt(self) -> LLVMValue:
        return self._intrinsic("sqrt")

    def absolute(self) -> LLVMValue:
        return self._intrinsic("fabs")

    def with_sign_of(self, other: LLVMValue) -> LLVMValue:
        """|self| with the sign bit of ``other``."""
        return self._intrinsic("copysign", other)

    def bits(self) -> LLVMBits:
        """The bit pattern."""
        return LLVMBits(self.builder, self.builder.bitcast(self.value, _with_lanes_of(self.value.type, INDEX)))

    def _compare(self, relation: str, other: LLVMValue | float) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.fcmp_ordered(relation, self.value, self._operand(other)))

    def less(self, other: LLVMValue | float) -> LLVMMask:
        """self < other; every comparison except :meth:`undefined` is false for a NaN."""
        return self._compare("<", other)

    def greater(self, other: LLVMValue | float) -> LLVMMask:
        return self._compare(">", other)

    def at_least(self, other: LLVMValue | float) -> LLVMMask:
        return self._compare(">=", other)

    def equals(self, other: LLVMValue | float) -> LLVMMask:
        return self._compare("==", other)

    def undefined(self) -> LLVMMask:
        """Return True if this is a NaN."""
        return LLVMMask(self.builder, self.builder.fcmp_unordered("uno", self.value, self.value))

    def lanes(self) -> list[LLVMValue]:
        """Each lane as a scalar."""
        if self.width == 1:
            return [self]
        index = ir.IntType(32)
        return [
            LLVMValue(self.builder, self.builder.extract_element(self.value, ir.Constant(index, i)))
            for i in range(self.width)
        ]

    def from_lanes(self, scalars: Sequence[LLVMValue]) -> LLVMValue:
        """A value of the type of this one, with the given lanes."""
        if self.width == 1:
            return scalars[0]
        value = ir.Constant(self.value.type, ir.Undefined)
        for i, scalar in enumerate(scalars):
            value = self.builder.insert_element(value, scalar.value, ir.Constant(ir.IntType(32), i))
        return LLVMValue(self.builder, value)

    def times_sign(self, other: LLVMValue) -> LLVMValue:
        """Return -self where other < 0, else self."""
        return other.less(0.0).choose(-self, self)

    def larger(self, other: LLVMValue) -> LLVMValue:
        """self where self > other, else other: a NaN in self is lost, so finiteness needs a separate test."""
        return self.greater(other).choose(self, other)


def values_of(numbers: Any) -> Any:
    """Return the values of LLVM of numbers, in the same nesting."""
    return numbers.value if isinstance(numbers, LLVMValue) else [values_of(number) for number in numbers]
