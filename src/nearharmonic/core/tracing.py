"""Numbers that write machine code: a system's plain Python formulas, called once while a kernel is built.

:class:`Emitted` is one LLVM value (a double, or a vector of doubles in SIMD lanes); each operation on it is one
instruction. :class:`Double` and :class:`DoubleDouble` are what the physics sees. Because the formulas are *called*,
not parsed, they may use loops over components, ``sum`` and their own functions; constants (ints, Fractions) fold
exactly. What they may not do is branch on a value.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from llvmlite import ir

from nearharmonic.core import arithmetic

Exact = int | Fraction


class Emitted:
    """One LLVM value of type ``double`` or ``<n x double>``; a carrier for :mod:`nearharmonic.core.arithmetic`."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def constant(self, number: float) -> Emitted:
        """``number`` in every lane."""
        kind = self.value.type
        literal = [number] * kind.count if isinstance(kind, ir.VectorType) else number
        return Emitted(self.builder, ir.Constant(kind, literal))

    def _intrinsic(self, name: str, *operands: Emitted) -> Emitted:
        kind = self.value.type
        suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
        signature = ir.FunctionType(kind, [kind] * len(operands))
        module, symbol = self.builder.module, f"llvm.{name}.{suffix}"
        function = module.globals.get(symbol) or ir.Function(module, signature, symbol)
        return Emitted(self.builder, self.builder.call(function, [x.value for x in operands]))

    def __add__(self, other: Emitted) -> Emitted:
        return Emitted(self.builder, self.builder.fadd(self.value, other.value))

    def __sub__(self, other: Emitted) -> Emitted:
        return Emitted(self.builder, self.builder.fsub(self.value, other.value))

    def __mul__(self, other: Emitted) -> Emitted:
        return Emitted(self.builder, self.builder.fmul(self.value, other.value))

    def __truediv__(self, other: Emitted) -> Emitted:
        return Emitted(self.builder, self.builder.fdiv(self.value, other.value))

    def __neg__(self) -> Emitted:
        return Emitted(self.builder, self.builder.fneg(self.value))

    def fma(self, factor: Emitted, addend: Emitted) -> Emitted:
        return self._intrinsic("fma", self, factor, addend)

    def sqrt(self) -> Emitted:
        return self._intrinsic("sqrt", self)

    def absolute(self) -> Emitted:
        return self._intrinsic("fabs", self)

    def larger(self, other: Emitted) -> Emitted:
        """self where self > other, else other: a NaN in self is dropped, so finiteness needs a test of its own."""
        where = self.builder.fcmp_ordered(">", self.value, other.value)
        return Emitted(self.builder, self.builder.select(where, self.value, other.value))

    def any_not_within(self, bound: Emitted) -> ir.Value:
        """One bit: whether in any lane self <= bound fails, as it does for a NaN."""
        outside = self.builder.fcmp_unordered(">", self.value, bound.value)
        if not isinstance(self.value.type, ir.VectorType):
            return outside
        mask = self.builder.bitcast(outside, ir.IntType(self.value.type.count))
        return self.builder.icmp_unsigned("!=", mask, ir.Constant(mask.type, 0))


def _power_of_two(number: Exact) -> bool:
    top, bottom = abs(Fraction(number).numerator), Fraction(number).denominator
    return top > 0 and top & (top - 1) == 0 and bottom & (bottom - 1) == 0


class _Number:
    """The operators both number types share: subtraction, powers, and constants on the left."""

    def __add__(self, other: Any) -> Any:
        raise NotImplementedError

    def __mul__(self, other: Any) -> Any:
        raise NotImplementedError

    def __neg__(self) -> Any:
        raise NotImplementedError

    def __bool__(self) -> bool:
        raise TypeError("a formula must not branch on a value: it is called once, for all values")

    def __sub__(self, other: Any) -> Any:
        return self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return (-self) + other

    def __radd__(self, other: Any) -> Any:
        return self + other

    def __rmul__(self, other: Any) -> Any:
        return self * other

    def __pow__(self, exponent: int) -> Any:
        if not isinstance(exponent, int) or exponent < 1:
            raise TypeError(f"a traced number takes whole powers of at least 1, not {exponent!r}")
        result: Any = self
        for _ in range(exponent - 1):
            result = result * self
        return result


class Double(_Number):
    """A double, or one per lane. A product that is added to something is fused (one rounding), always and everywhere.

    The contraction is made here, by rule, not by the compiler, so scalars, lanes and every processor agree to the bit.
    """

    __slots__ = ("_carrier", "_factors")

    def __init__(self, carrier: Any, factors: tuple[Any, Any] | None = None) -> None:
        self._carrier, self._factors = carrier, factors

    @property
    def carrier(self) -> Any:
        """The value itself; a pending product is multiplied out, once."""
        if self._carrier is None:
            assert self._factors is not None
            self._carrier = self._factors[0] * self._factors[1]
        return self._carrier

    def _constant(self, number: Exact) -> Any:
        carrier = self._factors[0] if self._carrier is None and self._factors else self._carrier
        return carrier.constant(float(number))

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Exact):
            if other == 0:
                return self
            other = Double(self._constant(other))
        if not isinstance(other, Double):
            return NotImplemented
        for product, addend in ((self, other), (other, self)):
            if product._factors is not None:
                return Double(arithmetic.fma(*product._factors, addend.carrier))
        return Double(self.carrier + other.carrier)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Exact):
            if other == 1:
                return self
            return Double(None, (self.carrier, self._constant(other)))
        if not isinstance(other, Double):
            return NotImplemented
        return Double(None, (self.carrier, other.carrier))

    def __neg__(self) -> Double:
        if self._factors is not None:
            return Double(None, (-self._factors[0], self._factors[1]))
        return Double(-self.carrier)

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Exact):
            if _power_of_two(other):
                return self * (1 / Fraction(other))
            other = Double(self._constant(other))
        if not isinstance(other, Double):
            return NotImplemented
        return Double(self.carrier / other.carrier)

    def __rtruediv__(self, other: Exact) -> Double:
        return Double(self._constant(other) / self.carrier)

    def sqrt(self) -> Double:
        return Double(arithmetic.sqrt(self.carrier))


class DoubleDouble(_Number):
    """An unevaluated sum high + low, about 32 digits; see :mod:`nearharmonic.core.arithmetic` for the error bounds."""

    __slots__ = ("high", "low")

    def __init__(self, high: Any, low: Any) -> None:
        self.high, self.low = high, low

    @property
    def pair(self) -> tuple[Any, Any]:
        return self.high, self.low

    def _constant(self, number: Exact) -> tuple[Any, Any]:
        high, low = arithmetic.rounded_pair(*number.as_integer_ratio())
        return self.high.constant(high), self.high.constant(low)

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Exact):
            if other == 0:
                return self
            high, low = self._constant(other)
            if Fraction(float(other)) == other:
                return DoubleDouble(*arithmetic.dd_add_double(self.pair, high))
            return DoubleDouble(*arithmetic.dd_add(self.pair, (high, low)))
        if not isinstance(other, DoubleDouble):
            return NotImplemented
        return DoubleDouble(*arithmetic.dd_add(self.pair, other.pair))

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Exact):
            if other == 1:
                return self
            if _power_of_two(other):
                scale = self._constant(other)[0]
                return DoubleDouble(self.high * scale, self.low * scale)
            return DoubleDouble(*arithmetic.dd_mul(self.pair, self._constant(other)))
        if not isinstance(other, DoubleDouble):
            return NotImplemented
        return DoubleDouble(*arithmetic.dd_mul(self.pair, other.pair))

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Exact):
            return self * (1 / Fraction(other))
        if not isinstance(other, DoubleDouble):
            return NotImplemented
        return DoubleDouble(*arithmetic.dd_div(self.pair, other.pair))

    def __rtruediv__(self, other: Exact) -> DoubleDouble:
        return DoubleDouble(*arithmetic.dd_div(self._constant(other), self.pair))

    def sqrt(self) -> DoubleDouble:
        return DoubleDouble(*arithmetic.dd_sqrt(self.pair))
