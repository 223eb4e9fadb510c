"""Numbers with a bound of their rounding error in double precision, by which kernels choose a precision.

``size`` x u bounds, to first order in u = 2^-53, the change of ``value`` when every operand and result of the formula
changes by a relative u (running error analysis: Higham, Accuracy and Stability of Numerical Algorithms, 3.3).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nearharmonic.core.formulas.number import Constant, Number
from nearharmonic.core.formulas.tracing import Double

#: Change of a function of one argument x: from its value f, from x, and from the size s of x.
_INHERITED: Mapping[str, Callable[[Any, Any, Any], Any]] = {
    "sin": lambda f, x, s: s,
    "cos": lambda f, x, s: s,
    "tan": lambda f, x, s: (1 + f * f) * s,
    "exp": lambda f, x, s: f * s,
    "log": lambda f, x, s: s / abs(x),
    "cbrt": lambda f, x, s: abs(f / x) * s / 3,
    "tanh": lambda f, x, s: s,
    "sinh": lambda f, x, s: (1 + abs(f)) * s,
    "cosh": lambda f, x, s: f * s,
    "erf": lambda f, x, s: s * 2,
}


class Conditioned(Number):
    """A traced double with the condition of the formula that computes it."""

    __slots__ = ("size", "value")

    def __init__(self, value: Double, inherited: Any = 0) -> None:
        self.value, self.size = value, abs(value) + inherited

    def _add(self, other: Conditioned | Constant) -> Conditioned:
        other = self._lift(other)
        return Conditioned(self.value + other.value, self.size + other.size)

    def _multiply(self, other: Conditioned | Constant) -> Conditioned:
        other = self._lift(other)
        inherited = self.size * abs(other.value) + other.size * abs(self.value)
        return Conditioned(self.value * other.value, inherited)

    def _divide(self, other: Conditioned | Constant) -> Conditioned:
        other = self._lift(other)
        value = self.value / other.value
        return Conditioned(value, (self.size + abs(value) * other.size) / abs(other.value))

    def _with(self, value: Double) -> Conditioned:
        result = Conditioned(value)
        result.size = self.size
        return result

    def __neg__(self) -> Conditioned:
        return self._with(-self.value)

    def __abs__(self) -> Conditioned:
        return self._with(abs(self.value))

    def sign(self) -> Conditioned:
        return Conditioned(self.value.sign())

    def sqrt(self) -> Conditioned:
        value = self.value.sqrt()
        return Conditioned(value, self.size / (value + value))

    def lifted(self, number: Constant) -> Conditioned:
        return Conditioned(self.value.lifted(number))

    def apply(self, function: str, *others: Conditioned | Constant) -> Conditioned:
        operands = [self._lift(x) for x in others]
        value = self.value.apply(function, *(x.value for x in operands))
        if not operands:
            return Conditioned(value, _INHERITED[function](value, self.value, self.size))
        (second,) = operands
        if function == "pow":
            relative = self.size / abs(self.value) * abs(second.value) + abs(abs(self.value).apply("log")) * second.size
            return Conditioned(value, abs(value) * relative)
        crossed = self.size * abs(second.value) + second.size * abs(self.value)
        squares = self.value * self.value + second.value * second.value
        return Conditioned(value, crossed / squares if function == "atan2" else self.size + second.size)
