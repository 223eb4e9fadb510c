"""The arithmetic of formulas: operations of a number, exact constants, and the functions with their derivatives."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real
from sys import float_info
from typing import Any, NoReturn, Protocol, Self

from nearharmonic.core.arithmetic import whole_pi
from nearharmonic.errors import SystemDefinitionError

# --- Exact constants of formulas: meaning of literals, powers, roots, functions, and operations with numpy numbers.

#: Operations of a formula, as errors list them.
OPERATIONS = "formulas use + - * / **, abs and the functions of nearharmonic.math"
#: Largest integer power that is computed as a product; larger powers need nearharmonic.math.pow.
LARGEST_POWER = 1024
#: Bits of the largest constants.
LARGEST_CONSTANT = 1 << 20
#: Bits of the root of a constant that is not a square: more than any precision in which formulas are evaluated.
ROOT_BITS = 1024


class FormulaError(TypeError):
    """An operation that formulas do not have; the message continues "V ..."."""


def constant(value: Any) -> Constant | None:
    """Return the exact number that a constant in a formula means, or None if ``value`` is not a real number.

    Integers and fractions are exact. A float of Python or numpy means the shortest decimal that it prints as; infinity
    and NaN raise a FormulaError.
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
    """Return ``base`` (a :class:`Number` or :class:`Constant`) to a power.

    Integer and half-integer powers, up to :data:`LARGEST_POWER`, are products and roots; other powers are the function
    pow.
    """
    if isinstance(exponent, Number):
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
    """Return a function of :data:`FUNCTIONS` of operands that are constants, or numbers of one type."""
    numbers: list[Any] = [x for x in operands if isinstance(x, Number)]
    values: list[Any] = [x if isinstance(x, Number) else constant(x) for x in operands]
    if any(x is None for x in values) or len({type(x) for x in numbers}) > 1:
        shown = ", ".join(type(x).__name__ for x in operands)
        raise FormulaError(f"calls {function} with operands of the types {shown}: {OPERATIONS}")
    first, *others = values
    return (numbers[0].lifted(first) if numbers and isinstance(first, Constant) else first).apply(function, *others)


def in_mpfr(function: str, *operands: Any) -> Any:
    """Return a function of :data:`FUNCTIONS` or a root of numbers of MPFR, in the present precision of gmpy2."""
    import gmpy2

    found = {"pow": operator.pow, "root": gmpy2.sqrt}.get(function) or getattr(gmpy2, function)
    return found(*operands)


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

    A ``Fraction`` would become a float in an operation with a float, and lose the digits beyond double precision.
    """

    __slots__ = ()

    def __array_ufunc__(self, function: Any, method: str, *operands: Any, **more: Any) -> Any:
        """Apply a numpy function: exactly with a scalar or a value of a formula, in floats with an array."""
        name = function.__name__
        if all(not getattr(x, "shape", ()) for x in operands):
            if name in _OPERATORS and method == "__call__":
                return _OPERATORS[name](*(x if isinstance(x, Number) else constant(x) for x in operands))
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

        It raises an ArithmeticError where there is none, or none with a modulus from 2^-1048576 to 2^1048576.
        """
        import gmpy2

        with gmpy2.context(precision=ROOT_BITS, emax=LARGEST_CONSTANT, emin=-LARGEST_CONSTANT):
            value = in_mpfr(function, *(gmpy2.mpfr(x.numerator) / x.denominator for x in (self, *others)))
        if not gmpy2.is_finite(value) or (function in ("exp", "pow", "cosh") and not value and self):
            shown = ", ".join(f"{float(x):g}" for x in (self, *others))
            raise ArithmeticError(f"{function} of the constant {shown} is not a finite number")
        return Constant(*map(int, value.as_integer_ratio()))

    def whole_power(self, exponent: int) -> Constant:
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

#: The functions of :mod:`nearharmonic.math` that a number has besides its operators, each with its partial derivatives
#: by its arguments, as formulas of its value and of the arguments.
FUNCTIONS: dict[str, tuple[Callable[..., Any], ...]] = {
    "sin": (lambda f, x: x.apply("cos"),),
    "cos": (lambda f, x: -x.apply("sin"),),
    "tan": (lambda f, x: 1 + f**2,),
    "exp": (lambda f, x: f,),
    "log": (lambda f, x: 1 / x,),
    "cbrt": (lambda f, x: f**-2 / 3,),
    # The first is finite at 0 where y >= 1.
    "pow": (lambda f, x, y: y * x.apply("pow", y - 1), lambda f, x, y: f * x.apply("log")),
    "atan2": (lambda f, y, x: x / (x * x + y * y), lambda f, y, x: -(y / (x * x + y * y))),
    "tanh": (lambda f, x: 1 - f**2,),
    "sinh": (lambda f, x: x.apply("cosh"),),
    "cosh": (lambda f, x: x.apply("sinh"),),
    "erf": (lambda f, x: Constant(2) / PI.sqrt() * (-(x * x)).apply("exp"),),
    "hypot": (lambda f, x, y: x / f, lambda f, x, y: y / f),
}


# --- The arithmetic of formulas: operations of a number in a formula, and the meaning of constants.
#
# Every number that replaces a value while a formula is called (traced into a kernel, written as source text,
# evaluated in multiprecision) is a :class:`Number`. All of them accept the same formulas, and refuse others with the
# same messages. A constant in a formula is exact: a float literal means the shortest decimal that it prints as.

#: The largest double.
LARGEST = int(float_info.max)
#: Message of Python for a tuple with too few components.
NO_SUCH_COMPONENT = "tuple index out of range"
#: Message for a formula that branches.
BRANCHES = (
    "a formula is called once, for all values, and must not branch; functions decorated with numba.njit may "
    "(docs/how_to/own_systems.md)"
)
_ARGUMENTS = re.compile(r"\(\) (takes|missing|got) |is not callable$")


class Number:
    """A number that a formula is called with; its operators use a few operations that a subclass defines.

    A subclass defines ``_add``, ``_multiply`` and ``_divide`` of itself and another operand (of its own type or a
    :class:`Constant`), ``__neg__``, ``__abs__``, ``sqrt``, ``lifted`` and ``apply``.
    """

    __slots__ = ()
    #: Between the priorities of numpy's scalars and arrays, so that ``np.float64(0.1) * x`` calls this class.
    __array_priority__ = -1.0

    _add: Callable[..., Any]
    _multiply: Callable[..., Any]
    _divide: Callable[..., Any]
    __neg__: Any
    __abs__: Any
    sqrt: Callable[[], Any]
    lifted: Callable[[Constant], Any]
    #: ``apply(function, *others)``: a function of :data:`FUNCTIONS`; further operands have this type or are constants.
    apply: Callable[..., Any]

    def sign(self) -> Any:
        """Return -1 for a negative value, else 1."""
        return self / abs(self)

    def _refused(self, *others: Any) -> NoReturn:
        raise FormulaError("calls a function of numpy, such as numpy.exp: from nearharmonic.math import exp")

    def __array_function__(self, function: Any, *_: Any) -> NoReturn:
        raise FormulaError(
            f"calls numpy.{function.__name__}, which needs numbers: write a polynomial fit, or decorate V and grad_V "
            "with numba.njit (docs/how_to/tabulated_potentials.md)"
        )

    # numpy calls the method of the object with the name of the function, and hides all other errors
    sin = cos = tan = exp = log = cbrt = arctan2 = tanh = sinh = cosh = hypot = _refused
    arcsin = arccos = arctan = arcsinh = arccosh = arctanh = exp2 = expm1 = log2 = log10 = log1p = _refused

    def _lift(self, operand: Self | Constant) -> Self:
        number: Self = self.lifted(operand) if isinstance(operand, Constant) else operand
        return number

    def _operand(self, other: Any) -> Any:
        return other if isinstance(other, type(self)) else constant(other)

    def __add__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._add(operand)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._add(-operand)

    def __rsub__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else (-self)._add(operand)

    def __mul__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._multiply(operand)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        operand = self._operand(other)
        if isinstance(operand, Constant) and not operand:
            raise ZeroDivisionError("division of a value by zero")
        return NotImplemented if operand is None else self._divide(operand)

    def __rtruediv__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._lift(operand)._divide(self)

    def __pos__(self) -> Any:
        return self

    def __pow__(self, exponent: Any) -> Any:
        return power(self, exponent)

    def __rpow__(self, base: Any) -> Any:
        return NotImplemented if constant(base) is None else applied("pow", base, self)

    def whole_power(self, exponent: int) -> Any:
        """Return the ``exponent``-th power, ``exponent`` >= 1, by few multiplications."""
        if exponent <= 4:  # sequential products: the fourth power takes one multiplication and one rounding more
            result = self
            for _ in range(exponent - 1):
                result = result * self
            return result
        if exponent % 2:
            return self.whole_power(exponent - 1) * self
        half = self.whole_power(exponent // 2)
        return half * half

    def _compare(self, other: Any) -> NoReturn:
        raise FormulaError(f"compares a value: {BRANCHES}")

    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = _compare

    def __bool__(self) -> NoReturn:
        raise FormulaError(f"uses a value as a condition: {BRANCHES}")

    def __hash__(self) -> NoReturn:
        raise FormulaError(
            "hashes a value (a set, a key of a dict, a cached function), which no value in a formula has"
        )

    def __float__(self) -> NoReturn:
        raise FormulaError(f"converts a value to float, as the functions of the module math do: {OPERATIONS}")


class Formulas(Protocol):
    """A system with its name, for errors, and the number of components that its formulas return."""

    @property
    def name(self) -> str: ...

    @property
    def dimension(self) -> int: ...


def call(system: Formulas, formula: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Call ``function``, part of the formula named ``formula`` ("V", "grad_V", "T" or "grad_T") of ``system``.

    An exception becomes the cause of a SystemDefinitionError.
    """
    try:
        return function(*arguments)
    except SystemDefinitionError:  # from the energy that a derived gradient is traced from
        raise
    except FormulaError as error:
        raise SystemDefinitionError(f"{system.name}: {formula} {error}") from error
    except Exception as error:
        hint = _hint(system, formula, error)
        raise SystemDefinitionError(f"{system.name}: {formula} raises {type(error).__name__}: {error}{hint}") from error


def _hint(system: Formulas, formula: str, error: Exception) -> str:
    """Return a hint to append to the message of an exception."""
    if isinstance(error, IndexError) and str(error) == NO_SUCH_COMPONENT:
        return f": {components('q' if formula.endswith('V') else 'p', system.dimension)}"
    if isinstance(error, TypeError) and "tuple" in str(error):
        return ": q and p are tuples, which nearharmonic.math.array makes arrays of"
    unsupported = (isinstance(error, TypeError) and not _ARGUMENTS.search(str(error))) or (
        isinstance(error, AttributeError) and isinstance(error.obj, Number)
    )
    return f" ({OPERATIONS})" if unsupported else ""


def components(name: str, count: int) -> str:
    return f"{name} has {count} component{'' if count == 1 else 's'}"


def _shown_type(result: Any) -> str:
    return "None" if result is None else f"an object of type {type(result).__name__}"


def _forgotten(result: Any) -> str:
    return ": is a return missing?" if result is None else ""


def scalar(system: Formulas, formula: str, *arguments: Any) -> Any:
    """Return the value of V or T, one :class:`Number` or :class:`Constant`."""
    result = call(system, formula, getattr(system, formula), *arguments)
    value = result if isinstance(result, Number) else call(system, formula, _constant, result)
    if value is None:
        raise SystemDefinitionError(
            f"{system.name}: {formula} returns {_shown_type(result)}, expected one number{_forgotten(result)}"
        )
    return value


def _constant(result: Any) -> Constant | None:
    """Return a constant result, if a double can hold it."""
    value = constant(result)
    if value is not None and abs(value) > LARGEST:
        raise FormulaError("is a constant larger than any double")
    return value


def vector(system: Formulas, formula: str, *arguments: Any) -> tuple[Any, ...]:
    """Return the components of grad_V or grad_T, one :class:`Number` or :class:`Constant` per coordinate."""
    result = call(system, formula, getattr(system, formula), *arguments)
    expected = f"expected a tuple of {system.dimension}, one number per coordinate"
    if not hasattr(result, "__iter__"):
        what = "one number" if isinstance(result, Number) else _shown_type(result)
        raise SystemDefinitionError(f"{system.name}: {formula} returns {what}, {expected}{_forgotten(result)}")
    entries = call(system, formula, tuple, result)
    if len(entries) != system.dimension:
        raise SystemDefinitionError(f"{system.name}: {formula} returns {len(entries)} components, {expected}")
    components = []
    for i, entry in enumerate(entries):
        component = entry if isinstance(entry, Number) else call(system, f"{formula}[{i}]", _constant, entry)
        if component is None:
            raise SystemDefinitionError(
                f"{system.name}: {formula}[{i}] is an object of type {type(entry).__name__}, expected a number"
            )
        components.append(component)
    return tuple(components)
