"""The functions of formulas as users call them: numbers, arrays, mpmath, constants, and what is refused."""

from __future__ import annotations

import math
from fractions import Fraction

import gmpy2
import mpmath
import numpy as np
import pytest

import nearharmonic.math as functions
from nearharmonic.core.number import FUNCTIONS, PI, Constant, FormulaError
from nearharmonic.systems.gradients import Multiprecision
from support.methods.function_arguments import arguments, compiled, evaluated, in_double, in_extended, same_bits
from support.oracles.random_formulas import mpmaths

NAMES = sorted(FUNCTIONS)
#: Values that doubles hold, or that are correctly rounded, where one unit in the last place would be too much.
EXACT = {
    "sin": [((0.0,), 0.0)], "cos": [((0.0,), 1.0)], "tan": [((0.0,), 0.0)],
    "exp": [((0.0,), 1.0)], "log": [((1.0,), 0.0)], "cbrt": [((-8.0,), -2.0), ((27.0,), 3.0)],
    "sinh": [((0.0,), 0.0)], "cosh": [((0.0,), 1.0)], "tanh": [((math.inf,), 1.0), ((1e300,), 1.0)],
    "erf": [((math.inf,), 1.0), ((-1e300,), -1.0)],
    "pow": [((2.0, 10.0), 1024.0), ((-2.0, 3.0), -8.0), ((-2.0, -2.0), 0.25), ((math.nan, 0.0), 1.0),
            ((1.0, math.nan), 1.0), ((-1.0, math.inf), 1.0), ((-1.0, 2.0**53 + 2), 1.0)],
    "atan2": [((0.0, -1.0), math.pi), ((-0.0, -1.0), -math.pi), ((1.0, 0.0), math.pi / 2), ((1.0, 1.0), math.pi / 4),
              ((math.inf, -math.inf), 3 * math.pi / 4), ((1.0, -math.inf), math.pi)],
    "hypot": [((3.0, -4.0), 5.0), ((3e300, 4e300), 5e300), ((5e-324, 0.0), 5e-324)],
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_values_that_doubles_hold_are_exact(name):
    """Those of infinities, NaN and signed zeros are MPFR's in test_functions.py."""
    operands = np.array([row for row, _ in EXACT[name]]).T
    expected = [value for _, value in EXACT[name]]
    assert [getattr(functions, name)(*row) for row, _ in EXACT[name]] == expected
    rows = [part for row in operands for part in (row, np.zeros_like(row))]
    assert evaluated(in_extended(name), rows, 1, 2)[0].tolist() == expected


@pytest.mark.parametrize("name", NAMES)
def test_floats_arrays_and_kernels_have_the_same_bits(name):
    rows = arguments(name, 100)
    kernel = evaluated(in_double(name), rows, 8)[0]
    function = getattr(functions, name)
    assert same_bits(function(*rows), kernel).all()
    numbers = np.array([function(*operands) for operands in zip(*(row.tolist() for row in rows), strict=True)])
    assert same_bits(numbers, kernel).all()


@pytest.mark.slow
def test_a_lane_does_not_depend_on_its_neighbours():
    """Large angles take another path, which one lane alone needs here."""
    x = np.array([[1.0, 2.0, 1e300, -0.0, 5e-324, 1e5, math.inf, -3.0]])
    for name in ("sin", "cos", "tan"):
        for rows, body in ((x, in_double(name)), (np.concatenate([x, np.zeros_like(x)]), in_extended(name))):
            function = compiled(body, len(rows), 8, len(rows))
            together = function(rows)
            alone = np.concatenate([function(rows[:, k : k + 1]) for k in range(8)], axis=1)
            assert same_bits(together, alone).all()


def test_arrays_keep_their_shape_and_broadcast():
    x, y = np.arange(3.0)[:, None] + 1, np.arange(4)
    assert functions.atan2(y, x).shape == (3, 4)
    assert functions.pow(2, np.array([[1, 2]])).tolist() == [[2.0, 4.0]]
    assert functions.exp(np.zeros((0, 2))).shape == (0, 2)
    assert type(functions.sin(np.float64(1))) is type(functions.sin(1)) is float
    assert functions.sin(np.float32(0.5)) == functions.sin(0.5)
    mixed = functions.cos(np.array([Constant(0), Constant(1)], dtype=object))
    assert [type(entry) for entry in mixed] == [Constant, Constant]


@pytest.mark.parametrize("name", NAMES)
def test_mpmath_numbers_keep_their_precision(name):
    operands = [mpmath.mpf(k + 2) / 7 for k in range(len(FUNCTIONS[name]))]
    assert getattr(functions, name)(*operands) == mpmaths(name)(*operands)
    if len(operands) == 2:
        assert getattr(functions, name)(Fraction(2, 7), operands[1]) == getattr(functions, name)(*operands)
    assert functions.cbrt(mpmath.mpf(-8)) == -2


@pytest.mark.parametrize("name", NAMES)
def test_functions_of_constants_are_good_to_300_digits(name):
    """For slopes of the order of one, a relative 2^-1024 is 1e-308 of the value."""
    operands, before = [Constant(k + 2, 7) for k in range(len(FUNCTIONS[name]))], gmpy2.get_context().precision
    found = getattr(functions, name)(*operands)
    assert type(found) is Constant
    assert gmpy2.get_context().precision == before
    with mpmath.workdps(330):
        exact = [mpmath.mpf(x.numerator) / x.denominator for x in operands]
        expected = mpmaths(name)(*exact)
        assert abs(mpmath.mpf(found.numerator) / found.denominator / expected - 1) < mpmath.mpf(10) ** -305


@pytest.mark.parametrize(
    ("name", "operands"),
    [("log", (0,)), ("log", (-2,)), ("exp", (10**9,)), ("exp", (-(10**9),)), ("pow", (-2, Fraction(1, 3))),
     ("pow", (0, -1))],
)  # fmt: skip
def test_function_of_constant_without_finite_value_is_error(name, operands):
    with pytest.raises(ArithmeticError, match=f"^{name} of the constant .* is not a finite number$"):
        getattr(functions, name)(*map(Constant, operands))


def test_pi_is_exact_enough_everywhere():
    with mpmath.workdps(320):
        assert abs(mpmath.mpf(PI.numerator) / PI.denominator - mpmath.pi) < mpmath.mpf(2) ** -1100
        assert abs(functions.pi * mpmath.mpf(2) - 2 * mpmath.pi) < mpmath.mpf(10) ** -318
    x = np.array([1.0, 2.0])
    assert functions.pi is PI
    for made in (functions.pi * x, x * functions.pi, functions.pi + x, x / functions.pi, functions.pi - x):
        assert made.dtype == np.float64
    assert (functions.pi * x).tolist() == [math.pi, 2 * math.pi]
    for half in (0.5, np.float64(0.5)):
        for product in (functions.pi * half, half * functions.pi):
            assert type(product) is Constant
            assert product == PI / 2
    assert float(functions.pi) == math.pi
    assert abs(functions.sin(functions.pi)) < Fraction(1, 2**1000)


def test_real_powers_of_constants_and_of_values():
    assert abs(float(Constant(2) ** 0.3) - 2**0.3) < 1e-15
    assert abs(float(2 ** Constant(1, 3)) - 2 ** (1 / 3)) < 1e-15
    x, y = Multiprecision.of(Constant(3)), Multiprecision.of(Constant(7, 10))
    z = Fraction(7, 10)
    for power in (x**0.7, x**z, x**y, 3**y, Constant(3) ** y, functions.pow(x, 0.7), functions.pow(3, y)):
        assert float(power.value) == pytest.approx(3**0.7, rel=1e-15)


@pytest.mark.parametrize("exponent", [1025, -1025, 100000, 1024.5])
def test_a_huge_power_is_refused_before_it_is_multiplied_out(exponent):
    for base in (Multiprecision.of(Constant(1)), Constant(1)):
        with pytest.raises(FormulaError, match=f"^raises a value to the power {exponent}, .*nearharmonic.math.pow$"):
            base**exponent


@pytest.mark.parametrize("call", [np.sin, lambda x: np.arctan2(x, 1), lambda x: np.hypot(x, 1)])
def test_numpys_functions_are_refused_but_root_and_arithmetic(call):
    for x in (Constant(1, 3), Multiprecision.of(Constant(1))):
        with pytest.raises(FormulaError, match=r"^calls .*from nearharmonic\.math"):
            call(x)
    assert np.sqrt(Constant(4)) == 2
    assert np.multiply(Constant(1, 3), np.float64(3)) == 1
    assert float(np.sqrt(Multiprecision.of(Constant(4))).value) == 2


@pytest.mark.parametrize("operand", ["a", None, 1j, [1j]])
def test_what_is_no_real_number_is_refused(operand):
    with pytest.raises(TypeError, match="sin"):
        functions.sin(operand)
