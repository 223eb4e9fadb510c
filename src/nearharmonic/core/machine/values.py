"""Values that emit machine code: doubles, bit patterns and truth values, as scalars or one per SIMD lane.

An operation on :class:`LLVMValue`, :class:`LLVMBits` or :class:`LLVMMask` is one instruction of the function that is
being built. A Python number beside one of them is the same in every lane.
"""

from __future__ import annotations

from collections.abc import Sequence

from llvmlite import ir

_WORD = ir.IntType(64)


def _broadcast(kind: ir.Type, number: float | int) -> ir.Constant:
    return ir.Constant(kind, [number] * kind.count if isinstance(kind, ir.VectorType) else number)


def _with_lanes_of(kind: ir.Type, element: ir.Type) -> ir.Type:
    return ir.VectorType(element, kind.count) if isinstance(kind, ir.VectorType) else element


class LLVMMask:
    """A truth value, or one per lane."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def __and__(self, other: LLVMMask) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.and_(self.value, other.value))

    def __or__(self, other: LLVMMask) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.or_(self.value, other.value))

    def __invert__(self) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.not_(self.value))

    def choose(self, yes: LLVMValue | float, no: LLVMValue | float) -> LLVMValue:
        """``yes`` in the lanes where this is true, ``no`` in the others."""
        kind = _with_lanes_of(self.value.type, ir.DoubleType())
        choices = [x.value if isinstance(x, LLVMValue) else _broadcast(kind, x) for x in (yes, no)]
        return LLVMValue(self.builder, self.builder.select(self.value, *choices))

    def anywhere(self) -> LLVMMask:
        """Return True if this is true in any lane."""
        if not isinstance(self.value.type, ir.VectorType):
            return self
        mask = self.builder.bitcast(self.value, ir.IntType(self.value.type.count))
        return LLVMMask(self.builder, self.builder.icmp_unsigned("!=", mask, ir.Constant(mask.type, 0)))


class LLVMBits:
    """The 64 bits of a double as an integer, or one per lane; sums wrap around."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def _operand(self, other: LLVMBits | int) -> ir.Value:
        return other.value if isinstance(other, LLVMBits) else _broadcast(self.value.type, other)

    def __add__(self, other: LLVMBits | int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.add(self.value, self._operand(other)))

    def __sub__(self, other: LLVMBits | int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.sub(self.value, self._operand(other)))

    def __and__(self, other: LLVMBits | int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.and_(self.value, self._operand(other)))

    def __or__(self, other: LLVMBits | int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.or_(self.value, self._operand(other)))

    def __xor__(self, other: LLVMBits | int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.xor(self.value, self._operand(other)))

    def __rsub__(self, other: int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.sub(self._operand(other), self.value))

    def __mul__(self, other: int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.mul(self.value, self._operand(other)))

    def at_most(self, other: int) -> LLVMBits:
        """The smaller of this signed number and ``other``."""
        smaller = self.builder.icmp_signed("<", self.value, self._operand(other))
        return LLVMBits(self.builder, self.builder.select(smaller, self.value, self._operand(other)))

    def __lshift__(self, count: int) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.shl(self.value, self._operand(count)))

    def __rshift__(self, count: int) -> LLVMBits:
        """Shift right; the high bits become 0."""
        return LLVMBits(self.builder, self.builder.lshr(self.value, self._operand(count)))

    def nonzero(self) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.icmp_unsigned("!=", self.value, self._operand(0)))

    def number(self) -> LLVMValue:
        """The double that has these bits."""
        kind = _with_lanes_of(self.value.type, ir.DoubleType())
        return LLVMValue(self.builder, self.builder.bitcast(self.value, kind))


class LLVMValue:
    """One LLVM value of type ``double`` or ``<n x double>``; a carrier for :mod:`nearharmonic.core.arithmetic`."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    @property
    def width(self) -> int:
        """Number of lanes."""
        kind = self.value.type
        return int(kind.count) if isinstance(kind, ir.VectorType) else 1

    def constant(self, number: float) -> LLVMValue:
        """``number`` in every lane."""
        return LLVMValue(self.builder, _broadcast(self.value.type, number))

    def _operand(self, other: LLVMValue | float) -> ir.Value:
        return other.value if isinstance(other, LLVMValue) else _broadcast(self.value.type, other)

    def _intrinsic(self, name: str, *operands: LLVMValue | float) -> LLVMValue:
        kind = self.value.type
        suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
        signature = ir.FunctionType(kind, [kind] * len(operands))
        module, symbol = self.builder.module, f"llvm.{name}.{suffix}"
        function = module.globals.get(symbol) or ir.Function(module, signature, symbol)
        return LLVMValue(self.builder, self.builder.call(function, [self._operand(x) for x in operands]))

    def __add__(self, other: LLVMValue | float) -> LLVMValue:
        return LLVMValue(self.builder, self.builder.fadd(self.value, self._operand(other)))

    def __radd__(self, other: float) -> LLVMValue:
        return self.constant(other) + self

    def __sub__(self, other: LLVMValue | float) -> LLVMValue:
        return LLVMValue(self.builder, self.builder.fsub(self.value, self._operand(other)))

    def __rsub__(self, other: float) -> LLVMValue:
        return self.constant(other) - self

    def __mul__(self, other: LLVMValue | float) -> LLVMValue:
        return LLVMValue(self.builder, self.builder.fmul(self.value, self._operand(other)))

    __rmul__ = __mul__

    def __truediv__(self, other: LLVMValue | float) -> LLVMValue:
        return LLVMValue(self.builder, self.builder.fdiv(self.value, self._operand(other)))

    def __rtruediv__(self, other: float) -> LLVMValue:
        return self.constant(other) / self

    def __neg__(self) -> LLVMValue:
        return LLVMValue(self.builder, self.builder.fneg(self.value))

    def fma(self, factor: LLVMValue | float, addend: LLVMValue | float) -> LLVMValue:
        return self._intrinsic("fma", self, factor, addend)

    def sqrt(self) -> LLVMValue:
        return self._intrinsic("sqrt", self)

    def absolute(self) -> LLVMValue:
        return self._intrinsic("fabs", self)

    def with_sign_of(self, other: LLVMValue) -> LLVMValue:
        """|self| with the sign bit of ``other``."""
        return self._intrinsic("copysign", self, other)

    def bits(self) -> LLVMBits:
        """The bit pattern."""
        return LLVMBits(self.builder, self.builder.bitcast(self.value, _with_lanes_of(self.value.type, _WORD)))

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
        negative = self.builder.fcmp_ordered("<", other.value, other.constant(0.0).value)
        return LLVMValue(self.builder, self.builder.select(negative, self.builder.fneg(self.value), self.value))

    def larger(self, other: LLVMValue) -> LLVMValue:
        """self where self > other, else other: a NaN in self is lost, so finiteness needs a separate test."""
        where = self.builder.fcmp_ordered(">", self.value, other.value)
        return LLVMValue(self.builder, self.builder.select(where, self.value, other.value))
