"""Functions for the formulas of a system, for floats, arrays, mpmath numbers and numbers of kernels.

Arguments are numbers or arrays that broadcast; the value of a function has their type and shape.
Errors are at most 1 ulp in double precision, and a relative 2^-100 in double-double, over the whole range of arguments.
Results for floats, numpy arrays and compiled kernels are bitwise identical. For floats and arrays outside the domain of
a function the result is NaN, as in IEEE 754.

Some functions are not analytic at a point: ``abs``, ``sqrt``, ``cbrt`` and ``pow`` at 0, ``hypot`` and ``atan2`` where
both arguments are 0. No integrator has its order on a trajectory through such a point. Such a potential needs
softening: ``sqrt(x*x + y*y + eps*eps)`` for ``hypot(x, y)``, ``sqrt(x*x + eps*eps)`` for ``abs(x)``.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from numbers import Rational
from typing import Any

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.number import PI, Constant, Number, applied

__all__ = [
    "array", "atan2", "cbrt", "cos", "cosh", "erf", "exp", "hypot", "log", "pi", "pow", "sin", "sinh", "sqrt", "sum",
    "tan", "tanh",
]  # fmt: skip

_NUMBERS = {float, int}  # exact types only: a check of subclasses, such as numpy's, takes longer
#: pi to 1100 bits, enough for every precision. Operations with constants and floats give constants, with arrays arrays.
pi = PI


def array(components: Iterable[Any], *shape: int) -> Any:
    """Return numbers as a numpy array, so that formulas can use slices, indices and ``reshape``.

    Parameters
    ----------
    components : iterable of n numbers
        Numbers of one type: the coordinates or momenta of a formula. If they are arrays, each array is one element.
    *shape : int
        Lengths of the axes, (n,) by default; one of them may be -1.

    Returns
    -------
    numpy.ndarray
        Array of objects. Operators, ``**``, ``abs``, the functions of this module and :func:`sum` work element by
        element.

    Examples
    --------
    >>> from nearharmonic import math
    >>> math.array((1, 2, 3, 4), 2, 2).tolist()
    [[1, 2], [3, 4]]
    """
    import numpy as np

    elements = tuple(components)
    made = np.empty(len(elements), object)
    for i, element in enumerate(elements):
        made[i] = element
    return made.reshape(shape or (-1,))


def sum(terms: Any) -> Any:
    """Return the pairwise sum of numbers of one type, or of all elements of an array; 0 if there are none.

    Kernels of many coordinates compute terms of the same form in a loop.

    Examples
    --------
    >>> from nearharmonic import math
    >>> math.sum([1.0, 2.0, 3.0])
    6.0
    """
    left = list(terms.ravel() if hasattr(terms, "ravel") else terms)
    while len(left) > 1:
        pairs = [a + b for a, b in zip(left[::2], left[1::2], strict=False)]
        left = pairs + left[len(pairs) * 2 :]
    return left[0] if left else 0


def sin(x: Any) -> Any:
    """Sine of an angle in radians.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.sin(1):.6f}")
    0.841471
    """
    return _value("sin", x)


def cos(x: Any) -> Any:
    """Cosine of an angle in radians.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.cos(1):.6f}")
    0.540302
    """
    return _value("cos", x)


def tan(x: Any) -> Any:
    """Tangent of an angle in radians.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.tan(1):.6f}")
    1.557408
    """
    return _value("tan", x)


def exp(x: Any) -> Any:
    """Exponential function.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.exp(1):.6f}")
    2.718282
    """
    return _value("exp", x)


def log(x: Any) -> Any:
    """Natural logarithm of a positive number.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.log(2):.6f}")
    0.693147
    """
    return _value("log", x)


def cbrt(x: Any) -> Any:
    """Cube root of a real number, which may be negative; not analytic at 0.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.cbrt(-8):.6f}")
    -2.000000
    """
    return _value("cbrt", x)


def pow(x: Any, y: Any) -> Any:
    """Power x^y for x > 0, or for x < 0 and integer y; not analytic at x = 0.

    Parameters
    ----------
    x, y : number or array
        Base and exponent.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.pow(2, 0.5):.6f}")
    1.414214
    """
    return _value("pow", x, y)


def atan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y) in radians, from -pi to pi; it jumps where y = 0 and x < 0.

    Parameters
    ----------
    y, x : number or array
        Coordinates of the point, the second one first.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.atan2(1, -1):.6f}")
    2.356194
    """
    return _value("atan2", y, x)


def sinh(x: Any) -> Any:
    """Hyperbolic sine.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.sinh(1):.6f}")
    1.175201
    """
    return _value("sinh", x)


def cosh(x: Any) -> Any:
    """Hyperbolic cosine.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.cosh(1):.6f}")
    1.543081
    """
    return _value("cosh", x)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.tanh(1):.6f}")
    0.761594
    """
    return _value("tanh", x)


def erf(x: Any) -> Any:
    """Error function.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.erf(1):.6f}")
    0.842701
    """
    return _value("erf", x)


def hypot(x: Any, y: Any) -> Any:
    """Root of x^2 + y^2 without intermediate overflow; not analytic at the origin.

    Parameters
    ----------
    x, y : number or array
        Coordinates of a point.

    Examples
    --------
    >>> from nearharmonic import math
    >>> print(f"{math.hypot(3, 4):.6f}")
    5.000000
    """
    return _value("hypot", x, y)


def _value(name: str, *operands: Any) -> Any:
    kinds = {type(x) for x in operands}
    if kinds <= _NUMBERS or all(issubclass(kind, float | int) for kind in kinds):
        return _of_numbers(name)(*operands)
    if any(issubclass(kind, Number) for kind in kinds):
        return applied(name, *operands)
    for x in operands:
        if hasattr(x, "context"):  # an mpmath number belongs to a context
            return _in_multiprecision(name, x.context, operands)
    if Constant in kinds and not any(hasattr(x, "shape") and x.shape for x in operands):
        return applied(name, *operands)
    return _of_arrays(name, operands)


@cache
def _of_numbers(name: str) -> Any:
    from nearharmonic.core.functions import of_numbers

    return of_numbers(name)


def _in_multiprecision(name: str, context: Any, operands: tuple[Any, ...]) -> Any:
    values = [context.mpf(x.numerator) / x.denominator if isinstance(x, Rational) else x for x in operands]
    if name == "cbrt" and values[0] < 0:  # mpmath returns the root in the first quadrant
        return -context.cbrt(-values[0])
    return getattr(context, "power" if name == "pow" else name)(*values)


def _of_arrays(name: str, operands: tuple[Any, ...]) -> Any:
    import numpy as np

    if any(str(getattr(x, "dtype", "")) == "object" for x in operands):
        return np.frompyfunc(globals()[name], len(operands), 1)(*operands)
    from nearharmonic.core.functions import of_arrays

    arrays = [np.asarray(float(x) if isinstance(x, Rational) else x) for x in operands]
    if not all(array.dtype.kind in "biuf" for array in arrays):
        raise TypeError(f"{name} of {', '.join(type(x).__name__ for x in operands)}: expected real numbers")
    result = of_arrays(name, *arrays)
    return result if result.ndim else float(result)
