"""Quantities that a system is declared with: its parameters and observables, and numbers as decimals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from decimal import Context, Decimal, InvalidOperation
from numbers import Rational, Real
from typing import Any

#: A coordinate tuple of any number type: float, numpy array, mpf, or a number traced into a kernel.
Vector = tuple[Any, ...]
#: Decimal exponents beyond this are outside the range of doubles, and slow to make fractions of.
LARGEST_EXPONENT = 400
#: Digits of a fraction that is no decimal: three times those of double-double.
DIGITS = 100


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One constant of a system: exact decimal ``value`` with its ``unit``, "1" for none, and ``meaning``.

    A number as ``value`` means the decimal that it prints as.
    """

    value: str
    unit: str = "1"
    meaning: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", decimal(self.value))


@dataclass(frozen=True, kw_only=True)
class Observable:
    """A function ``f(q, p, *parameters)`` of states, with its unit and meaning."""

    function: Callable[..., Any]
    unit: str
    meaning: str

    def __call__(self, q: Vector, p: Vector, *parameters: Any) -> Any:
        """Its value, or its values, at states of any number type."""
        return self.function(q, p, *parameters)


def decimal(value: Any) -> Any:
    """Return a number as the shortest decimal that it prints as, and anything else as it is.

    A fraction that is no decimal is rounded to :data:`DIGITS` digits.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Rational):
        return str(Context(prec=DIGITS).divide(Decimal(int(value.numerator)), Decimal(int(value.denominator))))
    return repr(float(value))


def is_extreme(value: Any) -> bool:
    """Return True if a decimal is far outside the range of doubles, so that its fraction has very many digits."""
    try:
        number = Decimal(value) if isinstance(value, str | Decimal) else Decimal(1)
    except InvalidOperation:
        return False
    return number.is_finite() and number != 0 and abs(number.adjusted()) > LARGEST_EXPONENT


def is_list(values: Any) -> bool:
    """Return whether iterating over ``values`` gives numbers in an order: not for text, bytes, mappings and sets."""
    other = isinstance(values, str | bytes | bytearray | memoryview | Mapping | AbstractSet)
    return isinstance(values, Iterable) and not other and getattr(values, "ndim", 1) > 0


def sequence(values: Any) -> Any:
    """Return a value that is no list as a tuple of this value alone."""
    return values if is_list(values) else (values,)
