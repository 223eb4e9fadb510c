"""Numbers that write machine code when the Python formulas of a system are called, once for each kernel.

:class:`LLVMValue` is one LLVM value (a double, or a vector of doubles in SIMD lanes); each operation on it is one
instruction. Formulas are called with numbers of :class:`Double` or :class:`DoubleDouble`. Because the formulas are
*called*, not parsed, they may use loops over components, ``sum`` and their own functions. Operations on constants alone
are exact. A formula cannot branch on a value.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core import arithmetic
from nearharmonic.core.formulas.number import Constant, Number
from nearharmonic.core.machine.values import LLVMValue

__all__ = ["Double", "DoubleDouble", "LLVMValue"]


def _power_of_two(number: Constant) -> bool:
    top, bottom = abs(number.numerator), number.denominator
    return top > 0 and top & (top - 1) == 0 and bottom & (bottom - 1) == 0


class Double(Number):
    """A double, or one per lane. A product that is added to a number is always fused: both are rounded once.

    This class makes the contraction, not the compiler, so that scalars, lanes and all processors agree bitwise.
    """

    __slots__ = ("_carrier", "_factors")

    def __init__(self, carrier: Any, factors: tuple[Any, Any] | None = None) -> None:
        self._carrier, self._factors = carrier, factors

    @classmethod
    def of(cls, number: Constant, like: Any) -> Double:
        """Return ``number``, rounded once, in the carrier of ``like``."""
        return cls(like.constant(float(number)))

    @property
    def carrier(self) -> Any:
        """The value; a pending product is multiplied out once."""
        if self._carrier is None:
            assert self._factors is not None
            self._carrier = self._factors[0] * self._factors[1]
        return self._carrier

    def _add(self, other: Double | Constant) -> Double:
        if isinstance(other, Constant):
            if other == 0:
                return self
            other = self.lifted(other)
        for product, addend in ((self, other), (other, self)):
            if product._factors is not None:
                return Double(arithmetic.fma(*product._factors, addend.carrier))
        return Double(self.carrier + other.carrier)

    def _multiply(self, other: Double | Constant) -> Double:
        if isinstance(other, Constant):
            if other == 1:
                return self
            other = self.lifted(other)
        return Double(None, (self.carrier, other.carrier))

    def __neg__(self) -> Double:
        if self._factors is not None:
            return Double(None, (-self._factors[0], self._factors[1]))
        return Double(-self.carrier)

    def _divide(self, other: Double | Constant) -> Double:
        if isinstance(other, Constant):
            if _power_of_two(other):
                return self._multiply(1 / other)
            other = self.lifted(other)
        return Double(self.carrier / other.carrier)

    def __abs__(self) -> Double:
        return Double(arithmetic.absolute(self.carrier))

    def sign(self) -> Double:
        return Double(arithmetic.times_sign(self.carrier.constant(1.0), self.carrier))

    def sqrt(self) -> Double:
        return Double(arithmetic.sqrt(self.carrier))

    def lifted(self, number: Constant) -> Double:
        return Double.of(number, self._factors[0] if self._carrier is None and self._factors else self._carrier)

    def apply(self, function: str, *others: Double | Constant) -> Double:
        from nearharmonic.core.functions import double  # slow to load, and most formulas need no functions

        operands = [self, *map(self._lift, others)]
        return Double(double.FUNCTIONS[function](*(x.carrier for x in operands)))


class DoubleDouble(Number):
    """An unevaluated sum high + low of about 32 digits; :mod:`nearharmonic.core.arithmetic` has the error bounds."""

    __slots__ = ("high", "low")

    def __init__(self, high: Any, low: Any) -> None:
        self.high, self.low = high, low

    @classmethod
    def of(cls, number: Constant, like: Any) -> DoubleDouble:
        """Return ``number``, rounded once, in the carrier of ``like``."""
        high, low = arithmetic.rounded_pair(number.numerator, number.denominator)
        return cls(like.constant(high), like.constant(low))

    @property
    def pair(self) -> tuple[Any, Any]:
        return self.high, self.low

    def _add(self, other: DoubleDouble | Constant) -> DoubleDouble:
        if isinstance(other, Constant):
            if other == 0:
                return self
            pair = self.lifted(other).pair
            if Constant(float(other)) == other:
                return DoubleDouble(*arithmetic.dd_add_double(self.pair, pair[0]))
            return DoubleDouble(*arithmetic.dd_add(self.pair, pair))
        return DoubleDouble(*arithmetic.dd_add(self.pair, other.pair))

    def _multiply(self, other: DoubleDouble | Constant) -> DoubleDouble:
        if isinstance(other, Constant):
            if other == 1:
                return self
            scale = self.lifted(other)
            if _power_of_two(other):
                return DoubleDouble(self.high * scale.high, self.low * scale.high)
            other = scale
        return DoubleDouble(*arithmetic.dd_mul(self.pair, other.pair))

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def _divide(self, other: DoubleDouble | Constant) -> DoubleDouble:
        if isinstance(other, Constant):
            return self._multiply(1 / other)
        return DoubleDouble(*arithmetic.dd_div(self.pair, other.pair))

    def __abs__(self) -> DoubleDouble:
        return DoubleDouble(*arithmetic.dd_abs(self.pair))

    def sign(self) -> DoubleDouble:
        one = self.high.constant(1.0)
        return DoubleDouble(arithmetic.times_sign(one, self.high), one - one)

    def sqrt(self) -> DoubleDouble:
        return DoubleDouble(*arithmetic.dd_sqrt(self.pair))

    def lifted(self, number: Constant) -> DoubleDouble:
        return DoubleDouble.of(number, self.high)

    def apply(self, function: str, *others: DoubleDouble | Constant) -> DoubleDouble:
        from nearharmonic.core.functions import extended

        operands = [self, *map(self._lift, others)]
        return DoubleDouble(*extended.FUNCTIONS[function](*(x.pair for x in operands)))
