"""Random formulas for hypothesis: as a user writes them, and in mpmath with a bound that follows each rounding.

A formula is a variable (its number), ("constant", exact decimal, literal), or (operation, operands...).
"""

from fractions import Fraction
from math import floor

import mpmath
import numpy as np
from hypothesis import HealthCheck, assume, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

import nearharmonic.math
from nearharmonic.core import arithmetic
from nearharmonic.core.number import FUNCTIONS, Constant

LITERALS = [("0.1", 0.1), ("-2.5", -2.5), ("0.3333333333333333", 1 / 3), ("3", 3), ("0", 0), ("1", 1), ("4", 4)]
LITERALS += [("-2", -2), ("0.7", np.float64(0.7)), ("2", np.int64(2))]
#: Literals that Python's floats would round.
EXACT = [("1/3", Fraction(1, 3)), ("2/7", Constant(2, 7)), ("0.1", np.float32(0.1))]
EXPONENTS = [2, 3, 4, 5, 7, -1, -2, -4, 1, 0.5, 1.5, -0.5, -1.5, Fraction(5, 2), np.float64(2.0), np.int64(3)]
REAL_EXPONENTS = [0.3, Fraction(-1, 3), 2.7]
#: Distance that arguments keep from where a function is not analytic, and the largest modulus of a value.
AWAY, LARGE = mpf("0.05"), mpf(2000)
#: Relative errors of operations that are not rounded.
NONE = dict.fromkeys(("constant", "+", "*", "/", "root", "function"), mpf(0))

TENTH, THREE, FOUR, ZERO = (("constant", str(x), x) for x in (0.1, 3, 4, 0))
#: Every operation with each order of its operands, and every function; the random formulas nest them.
OPERATIONS = (
    "+",
    ("+", ("*", TENTH, ("**", ("abs", 0), -1.5)), ("/", ("sqrt", ("**", 1, 6)), ("pos", 0))),
    (
        "-",
        ("-", THREE, ("/", 0, THREE)),
        ("+", ("/", TENTH, ("neg", 1)), ("-", ("+", ("/", ("neg", ("*", 0, 1)), FOUR), ZERO), TENTH)),
    ),
)
EVERY = OPERATIONS
for _name, _slopes in FUNCTIONS.items():
    EVERY = ("+", EVERY, ("*", ("sin", 1), (_name, *(("+", ("**", i, 2), THREE) for i in range(len(_slopes))))))

randomly = settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)


def trees(literals=LITERALS, variables=2, functions=True):
    """Formulas of up to seven leaves, constants apart, so that each operand but those is a value."""
    constants = st.sampled_from(literals).map(lambda pair: ("constant", *pair))
    two = [name for name, slopes in FUNCTIONS.items() if len(slopes) == 2]

    def extended(inner):
        either = st.one_of(st.tuples(inner, inner), st.tuples(inner, constants), st.tuples(constants, inner))
        called = [
            st.tuples(st.sampled_from([name for name in FUNCTIONS if name not in two]), inner),
            st.tuples(st.sampled_from(two), inner, inner | constants),
        ]
        return st.one_of(
            *(called if functions else ()),
            st.tuples(st.sampled_from("+-*/"), either).map(lambda pair: (pair[0], *pair[1])),
            st.tuples(st.sampled_from(["neg", "pos", "abs", "sqrt"]), inner),
            st.tuples(st.just("**"), inner, st.sampled_from(EXPONENTS + (REAL_EXPONENTS if functions else []))),
        )

    return st.recursive(st.integers(0, variables - 1), extended, max_leaves=7)


def written(tree, q):
    """The formula as a user writes it."""
    if isinstance(tree, int):
        return q[tree]
    name, *operands = tree
    if name == "constant":
        return operands[1]
    if name == "**":
        return written(operands[0], q) ** operands[1]
    a, *rest = (written(operand, q) for operand in operands)
    if name in FUNCTIONS:
        return getattr(nearharmonic.math, name)(a, *rest)
    unary = {"neg": lambda: -a, "pos": lambda: +a, "abs": lambda: abs(a), "sqrt": lambda: arithmetic.sqrt(a)}
    binary = {"+": lambda: a + rest[0], "-": lambda: a - rest[0], "*": lambda: a * rest[0], "/": lambda: a / rest[0]}
    return (unary | binary)[name]()


def mpmaths(name):
    """mpmath's real function of the name that formulas know it by."""
    if name == "cbrt":  # the root of a negative number is complex in mpmath
        return lambda x: mp.sign(x) * mp.cbrt(abs(x))
    return getattr(mpmath, "power" if name == "pow" else name)


def truth(tree, q, bounds=NONE):
    """Value in mpmath, and a bound on the error of a computation whose operations have the relative errors ``bounds``.

    Formulas that come near where they are not analytic, and formulas of large values, are left out.
    """
    if isinstance(tree, int):
        return q[tree], mpf(0)
    name, *operands = tree
    if name == "constant":
        value = mpf(Fraction(operands[0]).numerator) / Fraction(operands[0]).denominator
        return value, bounds["constant"] * abs(value)
    if name == "**":
        return _power(truth(operands[0], q, bounds), Fraction(str(operands[1])), bounds)
    a, *rest = (truth(operand, q, bounds) for operand in operands)
    if name in FUNCTIONS:
        return _function(name, [a, *rest], bounds)
    if not rest:
        assume(name != "abs" or abs(a[0]) > AWAY)
        return _root(a, bounds) if name == "sqrt" else ({"neg": -a[0], "pos": a[0], "abs": abs(a[0])}[name], a[1])
    return {"+": _sum, "-": _difference, "*": _product, "/": _quotient}[name](a, *rest, bounds)


def _rounded(value, inherited, bound):
    assume(value == 0 or mpf("1e-30") < abs(value) < LARGE)
    return value, inherited + bound * (abs(value) + inherited)


def _sum(a, b, bounds):
    return _rounded(a[0] + b[0], a[1] + b[1], bounds["+"])


def _difference(a, b, bounds):
    return _rounded(a[0] - b[0], a[1] + b[1], bounds["+"])


def _product(a, b, bounds):
    return _rounded(a[0] * b[0], abs(a[0]) * b[1] + abs(b[0]) * a[1] + a[1] * b[1], bounds["*"])


def _quotient(a, b, bounds):
    assume(abs(b[0]) > max(AWAY, 1000 * b[1]))
    return _rounded(a[0] / b[0], (a[1] + abs(a[0] / b[0]) * b[1]) / (abs(b[0]) - b[1]), bounds["/"])


def _root(a, bounds):
    assume(a[0] > max(AWAY, 1000 * a[1]))
    return _rounded(mp.sqrt(a[0]), a[1] / mp.sqrt(a[0] - a[1]), bounds["root"])


def _function(name, operands, bounds):
    """Each operand moves by its error: by the mean value theorem, the value by no more than twice what slopes give.

    That holds if no operand's error, relative to how far the function's slopes change over, reaches a thousandth.
    """
    function, values = mpmaths(name), [x for x, _ in operands]
    assume(all(mpf("1e-3") < abs(x) < 30 and 1000 * error < mpf("1e-6") for x, error in operands))
    assume(name not in ("log", "pow") or values[0] > AWAY)
    assume(name != "tan" or abs(mp.cos(values[0])) > AWAY)
    assume(name != "atan2" or values[1] > 0 or abs(values[0]) > AWAY)
    value, inherited = function(*values), mpf(0)
    for i, (x, error) in enumerate(operands):
        if error:
            step = abs(x) * mpf("1e-10")
            ahead, behind = (function(*values[:i], x + sign * step, *values[i + 1 :]) for sign in (1, -1))
            inherited += 2 * error * (abs(ahead - behind) / (2 * step) + abs(value) * mpf("1e-6"))
    return _rounded(value, inherited, bounds["function"])


def _power(a, exponent, bounds):
    if exponent.denominator > 2:
        constant = mpf(exponent.numerator) / exponent.denominator
        return _function("pow", [a, (constant, bounds["constant"] * abs(constant))], bounds)
    if exponent < 0:
        return _quotient((mpf(1), mpf(0)), _power(a, -exponent, bounds), bounds)
    result = None
    for factor in [a] * floor(exponent) + ([_root(a, bounds)] if exponent % 1 else []):
        result = factor if result is None else _product(result, factor, bounds)
    return result
