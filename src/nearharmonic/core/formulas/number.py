"""The arithmetic of formulas: operations of a number in a formula, and the meaning of constants.

Every number that replaces a value while a formula is called (traced into a kernel, written as source text, evaluated in
multiprecision) is a :class:`Number`. All of them accept the same formulas, and refuse others with the same messages. A
constant in a formula is exact: a float literal means the shortest decimal that it prints as.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from sys import float_info
from typing import Any, NoReturn, Protocol, Self

from nearharmonic.core.formulas.constant import (
    FUNCTIONS,
    OPERATIONS,
    PI,
    ROOT_BITS,
    Constant,
    FormulaError,
    Value,
    applied,
    constant,
    power,
)
from nearharmonic.errors import SystemDefinitionError

__all__ = [
    "FUNCTIONS", "OPERATIONS", "PI", "ROOT_BITS", "Constant", "FormulaError", "Formulas", "Number", "applied", "call",
    "constant", "power", "scalar", "vector",
]  # fmt: skip

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


class Number(Value):
    """A number that a formula is called with; its operators use a few operations that a subclass defines.

    A subclass defines ``_add``, ``_multiply`` and ``_divide`` of itself and another operand (of its own type or a
    :class:`Constant`), ``__neg__``, ``__abs__``, ``sqrt``, ``lifted`` and ``apply``.
    """

    __slots__ = ()
    #: Above the priority of numpy's scalars, so that ``np.float64(0.1) * x`` calls this class, and below that of its
    #: arrays.
    __array_priority__ = -1.0

    def _add(self, other: Any) -> Any:
        raise NotImplementedError

    def _multiply(self, other: Any) -> Any:
        raise NotImplementedError

    def _divide(self, other: Any) -> Any:
        raise NotImplementedError

    def __neg__(self) -> Any:
        raise NotImplementedError

    def __abs__(self) -> Any:
        raise NotImplementedError

    def sqrt(self) -> Any:
        """Return the square root."""
        raise NotImplementedError

    def sign(self) -> Any:
        """Return -1 for a negative value, else 1."""
        return self / abs(self)

    def apply(self, function: str, *others: Any) -> Any:
        """Return the value of a function of :data:`FUNCTIONS`; further operands have this type or are constants."""
        raise NotImplementedError

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

    def lifted(self, number: Constant) -> Any:
        """Return ``number`` as a number of this type."""
        raise NotImplementedError

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

    Raises
    ------
    SystemDefinitionError
        The function raises an exception, which is the cause of this one.
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
        isinstance(error, AttributeError) and isinstance(error.obj, Value)
    )
    return f" ({OPERATIONS})" if unsupported else ""


def components(name: str, count: int) -> str:
    """Return the number of components of a tuple, for error messages."""
    return f"{name} has {count} component{'' if count == 1 else 's'}"


def _shown_type(result: Any) -> str:
    return "None" if result is None else f"an object of type {type(result).__name__}"


def _forgotten(result: Any) -> str:
    return ": is a return missing?" if result is None else ""


def scalar(system: Formulas, formula: str, *arguments: Any) -> Any:
    """Return the value of V or T as a :class:`Number` or a :class:`Constant`.

    Raises
    ------
    SystemDefinitionError
        The formula raises an exception, or does not return one number.
    """
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
    """Return the components of grad_V or grad_T, each a :class:`Number` or a :class:`Constant`.

    Raises
    ------
    SystemDefinitionError
        The formula raises an exception, or does not return one number per coordinate.
    """
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
