"""Exact constants of formulas: meaning of literals, powers, roots, functions, and operations with numpy numbers.

The module is separate from :mod:`nearharmonic.core.formulas.number` because constants have values; numbers of a formula
have none.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real
from typing import Any

from nearharmonic.core.arithmetic import whole_pi

#: Operations of a formula, as errors list them.
OPERATIONS = "formulas use + - * / **, abs and the functions of nearharmonic.math"
#: The functions of :mod:`nearharmonic.math` that a number has besides its operators, with their numbers of arguments.
FUNCTIONS = {
    "sin": 1, "cos": 1, "tan": 1, "exp": 1, "log": 1, "cbrt": 1, "pow": 2, "atan2": 2, "tanh": 1, "sinh": 1, "cosh": 1,
    "erf": 1, "hypot": 2,
}  # fmt: skip
#: Largest integer power that is computed as a product; larger powers need nearharmonic.math.pow.
LARGEST_POWER = 1024
#: Bits of the largest constants.
LARGEST_CONSTANT = 1 << 20
#: Bits of the root of a constant that is not a square: more than any precision in which formulas are evaluated.
ROOT_BITS = 1024


class FormulaError(TypeError):
    """An operation that formulas do not have; the message continues "V ..."."""


class Value:
    """Base class of ``Number``, which replaces a value while a formula is called."""

    __slots__ = ()


def constant(value: Any) -> Constant | None:
    """Return the exact number that a constant in a formula means, or None if ``value`` is not a real number.

    Integers and fractions are exact. A float of Python or numpy means the shortest decimal that it prints as.

    Raises
    ------
    FormulaError
        ``value`` is infinite or NaN.
    """
    if isinstance(value, Constant):
        return value
    if isinstance(value, Integral):
        return Constant(int(value))
    if isinstance(value, Rational):
        return Constant(int(value.numerator), int(value.denominator))
    if isinstance(value, float | Decimal) or (isinstance(value, Real) and type(value).__module__ == "numpy"):
        if not math.isfinite(value):
            raise FormulaError(f"contains the number {value!s}, which is not finite")
        return Constant(str(value))
    return None


def power(base: Any, exponent: Any) -> Any:
    """Return ``base`` (a :class:`Value` or :class:`Constant`) to a power.

    Integer and half-integer powers are products and roots; other powers are the function pow.

    Raises
    ------
    FormulaError
        The exponent is not a number of formulas, or an integer or half-integer beyond :data:`LARGEST_POWER`.
    """
    if isinstance(exponent, Value):
        return applied("pow", base, exponent)
    value = constant(exponent)
    if value is None:
        raise FormulaError(f"raises a value to the power {exponent!r}: {OPERATIONS}")
    if value.denominator > 2:
        return base.apply("pow", value)
    if abs(value) > LARGEST_POWER:
        raise FormulaError(
            f"raises a value to the power {exponent!r}, more than {LARGEST_POWER} factors: use nearharmonic.math.pow"
        )
    if value < 0:
        return 1 / power(base, -value)
    whole = int(value)
    if value.denominator == 2:
        root = base.sqrt()
        return base.whole_power(whole) * root if whole else root
    return base.whole_power(whole) if whole else Constant(1)


def applied(function: str, *operands: Any) -> Any:
    """Return a function of :data:`FUNCTIONS` of operands that are numbers or constants of formulas.

    Raises
    ------
    FormulaError
        An operand is neither a number nor a constant, or numbers have different types.
    """
    numbers: list[Any] = [x for x in operands if isinstance(x, Value)]
    values: list[Any] = [x if isinstance(x, Value) else constant(x) for x in operands]
    if any(x is None for x in values) or len({type(x) for x in numbers}) > 1:
        shown = ", ".join(type(x).__name__ for x in operands)
        raise FormulaError(f"calls {function} with operands of the types {shown}: {OPERATIONS}")
    first, *others = values
    return (numbers[0].lifted(first) if numbers and isinstance(first, Constant) else first).apply(function, *others)


_OPERATORS: dict[str, Callable[..., Any]] = {
    "add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv,
    "power": power, "negative": operator.neg, "positive": operator.pos, "absolute": abs, "sqrt": lambda x: x.sqrt(),
    "square": lambda x: x * x,
}  # fmt: skip


def refusal(function: str) -> FormulaError:
    """The error for a formula that calls a function of another library."""
    return FormulaError(f"calls {function} of numpy or math: functions of formulas come from nearharmonic.math")


def _exact(operation: Callable[[Fraction, Fraction], Fraction]) -> Any:
    def method(self: Fraction, other: Any) -> Any:
        value = constant(other)
        return NotImplemented if value is None else Constant(operation(self, value))

    return method


class Constant(Fraction):
    """An exact constant of a formula, such as a parameter of a system.

    A ``Fraction`` would become a float in an operation with a float, and lose the digits below those of a double.
    """

    __slots__ = ()

    def __array_ufunc__(self, function: Any, method: str, *operands: Any, **more: Any) -> Any:
        """Apply a numpy function: exactly with a scalar or a value of a formula, in floats with an array."""
        name = function.__name__
        if all(not getattr(x, "shape", ()) for x in operands):
            if name in _OPERATORS and method == "__call__":
                return _OPERATORS[name](*(x if isinstance(x, Value) else constant(x) for x in operands))
            raise refusal(name)
        import numpy as np

        exact = any(str(getattr(x, "dtype", "")) == "object" for x in operands)
        plain = [(np.array(x, object) if exact else float(x)) if isinstance(x, Constant) else x for x in operands]
        return getattr(function, method)(*plain, **more)

    __add__ = __radd__ = _exact(Fraction.__add__)
    __mul__ = __rmul__ = _exact(Fraction.__mul__)
    __sub__ = _exact(Fraction.__sub__)
    __rsub__ = _exact(lambda a, b: Fraction.__sub__(b, a))
    __truediv__ = _exact(Fraction.__truediv__)
    __rtruediv__ = _exact(lambda a, b: Fraction.__truediv__(b, a))

    def __neg__(self) -> Constant:
        return Constant(-self.numerator, self.denominator)

    def __pos__(self) -> Constant:
        return self

    def __abs__(self) -> Constant:
        return Constant(abs(self.numerator), self.denominator)

    def __pow__(self, exponent: Any) -> Any:
        return power(self, exponent)

    def __rpow__(self, base: Any) -> Any:
        return NotImplemented if constant(base) is None else power(constant(base), self)

    def apply(self, function: str, *others: Constant) -> Constant:
        """Return the value of a function of :data:`FUNCTIONS`, rounded to :data:`ROOT_BITS` bits.

        Raises
        ------
        ArithmeticError
            The function has no value there, or its modulus is above 2^1048576 or below the inverse of that.
        """
        import gmpy2

        with gmpy2.context(precision=ROOT_BITS, emax=LARGEST_CONSTANT, emin=-LARGEST_CONSTANT):
            operands = [gmpy2.mpfr(x.numerator) / x.denominator for x in (self, *others)]
            value = operands[0] ** operands[1] if function == "pow" else getattr(gmpy2, function)(*operands)
        if not gmpy2.is_finite(value) or (function in ("exp", "pow", "cosh") and not value and self):
            shown = ", ".join(f"{float(x):g}" for x in (self, *others))
            raise ArithmeticError(f"{function} of the constant {shown} is not a finite number")
        return Constant(*map(int, value.as_integer_ratio()))

    def whole_power(self, exponent: int) -> Constant:
        """Return the ``exponent``-th power, ``exponent`` >= 1."""
        return Constant(self.numerator**exponent, self.denominator**exponent)

    def sqrt(self) -> Constant:
        """Return the square root: exact for the square of a fraction, otherwise rounded to :data:`ROOT_BITS` bits."""
        top, bottom = self.numerator, self.denominator
        if top < 0:
            raise ArithmeticError(f"square root of the negative number {self}")
        exact = Constant(math.isqrt(top), math.isqrt(bottom))
        if exact * exact == self:
            return exact
        shift = max(0, ROOT_BITS + (bottom.bit_length() - top.bit_length()) // 2)
        return Constant(math.isqrt((top << 2 * shift) // bottom), 1 << shift)


#: pi to more bits than any precision in which formulas are evaluated.
PI = Constant(whole_pi(1100), 1 << 1100)
