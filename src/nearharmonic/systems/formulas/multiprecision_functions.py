"""Values and slopes of the functions of formulas as decimals, computed by MPFR."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Context, Decimal
from functools import cache
from typing import Any


@cache
def slopes() -> dict[str, Callable[..., tuple[Any, ...]]]:
    """Return, by function, the first derivatives for each argument, as functions of the arguments and the value."""
    import gmpy2  # as slow to load as numpy, and the registry imports every module of this folder

    return {
        "sin": lambda x, v: (gmpy2.cos(x),),
        "cos": lambda x, v: (gmpy2.sin(x),),
        "tan": lambda x, v: (1 + v * v,),
        "exp": lambda x, v: (v,),
        "log": lambda x, v: (1 / x,),
        "cbrt": lambda x, v: (1 / (3 * v * v),),
        "pow": lambda x, y, v: (y * v / x, gmpy2.log(abs(x)) * v),
        "atan2": lambda y, x, v: (x / (x * x + y * y), y / (x * x + y * y)),
        "tanh": lambda x, v: (1 - v * v,),
        "sinh": lambda x, v: (gmpy2.cosh(x),),
        "cosh": lambda x, v: (gmpy2.sinh(x),),
        "erf": lambda x, v: (2 * gmpy2.exp(-x * x) / gmpy2.sqrt(gmpy2.const_pi()),),
        "hypot": lambda x, y, v: (x / v, y / v),
    }


def evaluated(function: str, arguments: Sequence[Decimal], digits: int) -> tuple[Decimal, list[Decimal]]:
    """Return the value of a function to ``digits`` digits, and the sizes of its slopes.

    Raises
    ------
    ArithmeticError
        The value or a slope is not a finite number.
    """
    import gmpy2

    with gmpy2.context(precision=int(3.33 * digits) + 40):
        numbers = [gmpy2.mpfr(str(x)) for x in arguments]
        value = numbers[0] ** numbers[1] if function == "pow" else getattr(gmpy2, function)(*numbers)
        derivatives = slopes()[function](*numbers, value)
        if not all(map(gmpy2.is_finite, (value, *derivatives))):
            raise ArithmeticError(
                f"{function} has no finite value and slope at {', '.join(map('{:.6e}'.format, arguments))}"
            )
        short = Context(prec=digits)
        return short.create_decimal(f"{value:.{digits + 5}e}"), [Decimal(f"{slope:.9e}") for slope in derivatives]
