"""Functions of formulas: their accuracy, their data, and how users call them."""

import math
import re
from fractions import Fraction
from pathlib import Path

import gmpy2
import mpmath
import numpy as np
import pytest
from gmpy2 import mpfr
from mpmath import mp, mpf

import nearharmonic.math as functions
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions import extended
from nearharmonic.core.number import FUNCTIONS, PI, Constant, FormulaError
from nearharmonic.systems.gradients import Multiprecision
from support.methods.function_arguments import arguments, compiled, evaluated, in_double, in_extended, pairs, same_bits
from support.oracles.random_formulas import mpmaths

# --- Accuracy of the functions of formulas in machine code, against MPFR, which shares no code with them


NAMES = sorted(FUNCTIONS)
#: More digits than the results; MPFR rounds each function correctly. The range of exponents is MPFR's, not a double's.
WIDE = gmpy2.context(precision=400, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min())
#: Sum of two doubles of any exponents, without rounding.
EXACT = gmpy2.context(precision=2200, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min())


PAGE = (Path(__file__).parents[3] / "docs/how_to/formulas.md").read_text(encoding="utf-8")
#: Function -> bounds that the page states: units in the last place of doubles, bits of double-doubles.
STATED = {
    name: (float(units), int(bits))
    for name, units, bits in re.findall(r"^\| `(\w+)` \| ([\d.]+) \| 2<sup>-(\d+)</sup> \|", PAGE, re.MULTILINE)
}


def exactly(name, *operands):
    return operands[0] ** operands[1] if name == "pow" else getattr(gmpy2, name)(*operands)


def outside_of_the_numbers(found, true):
    """None where both are finite numbers other than 0, else whether they agree: infinities, NaN, signs of zeros."""
    if gmpy2.is_nan(true) or np.isnan(found):
        return gmpy2.is_nan(true) and np.isnan(found)
    rounded = float(true)
    if np.isinf(rounded) or np.isinf(found):
        return rounded == found
    if not true and not found:
        return gmpy2.is_signed(true) == np.signbit(found)
    return None


def test_page_states_one_unit_at_most_and_100_bits_minimum():
    assert set(STATED) == {"sqrt", *FUNCTIONS}
    assert all(units <= 1 and bits >= 100 for units, bits in STATED.values())


#: Arguments of a campaign.
MANY = pytest.param(100_000, marks=pytest.mark.long)


@pytest.mark.parametrize("count", [2000, MANY])
@pytest.mark.parametrize("name", NAMES)
def test_doubles_are_within_the_bound_of_the_page(name, count):
    rows = arguments(name, count)
    single, lanes = (evaluated(in_double(name), rows, width)[0] for width in (1, 8))
    assert same_bits(single, lanes).all()
    with WIDE:
        for found, *operands in zip(single.tolist(), *(row.tolist() for row in rows), strict=True):
            true = exactly(name, *map(mpfr, operands))
            agree = outside_of_the_numbers(found, true)
            if agree is None:
                unit = gmpy2.exp2(max(gmpy2.get_exp(true) - 53, -1074)) if true else gmpy2.exp2(-1074)
                agree = abs(mpfr(found) - true) <= STATED[name][0] * unit
            assert agree, (name, operands, found, float(true))


@pytest.mark.parametrize("count", [pytest.param(2000, marks=pytest.mark.slow), MANY])
@pytest.mark.parametrize("name", NAMES)
def test_double_doubles_are_within_the_bound_of_the_page(name, count):
    rows = pairs(name, count)
    single, lanes = (evaluated(in_extended(name), rows, width, 2) for width in (1, 8))
    assert same_bits(single, lanes).all()
    halves = zip(*(row.tolist() for row in rows), strict=True)
    for given, found, low in zip(halves, *single.tolist(), strict=True):
        with EXACT:
            operands = [mpfr(h) + mpfr(e) if e else mpfr(h) for h, e in zip(given[::2], given[1::2], strict=True)]
        with WIDE:
            true = exactly(name, *operands)
            agree = outside_of_the_numbers(found, true)
            if agree is None:
                # relative down to 2^-960, where the low half ends, and as much as is left below
                allowed = abs(true) * gmpy2.exp2(-STATED[name][1]) + gmpy2.exp2(-1074)
                agree = abs(mpfr(found) + mpfr(low) - true) <= allowed
            assert agree, (name, given, found, low, float(true))
            assert np.isfinite(low)


# --- The data of the functions of formulas against what it stands for, in mpmath


def in_square(function, power, *leading):
    """(function(x) - the sum of leading factors times powers of x) / x^power as a function of x^2."""

    def quotient(z):
        x = mpmath.sqrt(z)
        return (function(x) - sum(c * x**k for k, c in leading)) / x**power

    return quotient


def complement(t):
    """Function of x from 1 to 6 or 9, by t = (x - 5/2) / (x + 5/2)."""
    x = mpf("2.5") * (1 + t) / (1 - t)
    return mpmath.exp(x * x) * mpmath.erfc(x)


def exponential(r):
    return (mpmath.exp(r) - 1 - r) / r**2


X, QUARTER, HALF_LN2, ROOTS = (1, 1), (mp.pi / 4) ** 2, mp.ln2 / 2, (3 - 2 * mp.sqrt(2)) ** 2
erf = in_square(mpmath.erf, 1, X)
#: Function, interval, and largest deviation; each deviation times the weight of its term is far below 2^-53, or 2^-106.
POLYNOMIALS = {
    "SIN": (table.SIN, in_square(mpmath.sin, 3, X), 0, QUARTER, -54.8),
    "COS": (table.COS, in_square(mpmath.cos, 4, (0, 1), (2, -mpf(1) / 2)), 0, QUARTER, -58.5),
    "EXP": (table.EXP, exponential, -HALF_LN2, HALF_LN2, -55),
    "LOG": (table.LOG, in_square(mpmath.atanh, 3, X), 0, ROOTS, -52),
    "LOG_TAIL": (table.LOG_TAIL, lambda z: (in_square(mpmath.atanh, 3, X)(z) - mpf(1) / 3) / z, 0, ROOTS, -54),
    "SINH": (table.SINH, in_square(mpmath.sinh, 3, X), 0, 1, -56),
    "TANH": (table.TANH, in_square(mpmath.tanh, 3, X), 0, mpf("0.55") ** 2, -54),
    "ATAN": (table.ATAN, in_square(mpmath.atan, 3, X), 0, mp.tan(mp.pi / 8) ** 2, -53),
    "ERF": (table.ERF, erf, 0, 1, -53),
    "ERFCX": (table.ERFCX, complement, -mpf(3) / 7, mpf(7) / 17, -54),
    "CBRT": (table.CBRT, lambda m: 1 / mpmath.cbrt(m), 1, 2, -14.5),
    "ERF_EXTENDED": (table.ERF_EXTENDED, erf, 0, 1, -107),
    "ERFCX_EXTENDED": (table.ERFCX_EXTENDED, complement, -mpf(3) / 7, mpf(13) / 23, -105),
    "series of sin": (extended.SIN, in_square(mpmath.sin, 3, X), 0, QUARTER, -104),
    "series of cos": (extended.COS, in_square(mpmath.cos, 2, (0, 1)), 0, QUARTER, -104),
    "series of sinh": (extended.SINH, in_square(mpmath.sinh, 3, X), 0, mpf("0.25"), -104),
    "series of artanh": (extended.ARTANH, in_square(mpmath.atanh, 3, X), 0, mpf("0.0434") ** 2, -104),
    "series of exp": (extended.EXP, exponential, 0, HALF_LN2, -104),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", POLYNOMIALS)
def test_a_polynomial_is_near_its_function(name):
    """At 300 points, which 30 oscillations of a near-minimax error cannot hide between, and at the end for series."""
    parts, function, least, most, bound = POLYNOMIALS[name]
    with mpmath.workdps(150):
        exact = [mpf(c[0]) + mpf(c[1]) if isinstance(c, tuple) else mpf(c) for c in parts]
        points = [least + (mpf(most) - least) * (k + mpf("0.5")) / 300 for k in range(300)]
        worst = max(abs(mp.polyval(exact, x, asc=True) - function(x)) for x in (*points, mpf(most)))
    assert worst < mpf(2) ** bound


@pytest.mark.parametrize(
    ("parts", "value", "bits"),
    [
        (table.HALF_PI, lambda: mp.pi / 2, 320), (table.HALF_PI_SHORT, lambda: mp.pi / 2, 139),
        (table.LN2, lambda: mp.ln2, 265), (table.QUARTER_PI, lambda: mp.pi / 4, 106),
        (table.LN2_SHORT, lambda: mp.ln2, 95), (table.TWO_PI, lambda: 2 * mp.pi, 104),
        (table.THIRD, lambda: mpf(1) / 3, 107), ((table.LOG2_E,), lambda: 1 / mp.ln2, 52),
        ((table.TWO_OVER_PI,), lambda: 2 / mp.pi, 53),
        (table.ERF[:1] + table.ERF_LOW[:1], lambda: 2 / mp.sqrt(mp.pi) - 1, 56),
        *((row[2:], lambda row=row: -mp.log(row[1]), 155) for row in table.LOG_FACTORS),
        *(((root,), lambda t=t: mp.mpf(2) ** (-mpf(t) / 3), 53) for t, root in enumerate(table.CUBE_ROOTS)),
    ],
)  # fmt: skip
def test_the_parts_of_a_constant_sum_to_it(parts, value, bits):
    with mpmath.workdps(150):
        assert abs(mpmath.fsum(parts) - value()) <= mpf(2) ** -bits


# --- The functions of formulas as users call them: numbers, arrays, mpmath, constants, and what is refused


NAMES_OF_MATH = sorted(FUNCTIONS)
#: Values that doubles hold, or that are correctly rounded, where one unit in the last place would be too much.
EXACT_OF_MATH = {
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
@pytest.mark.parametrize("name", NAMES_OF_MATH)
def test_values_that_doubles_hold_are_exact(name):
    """Those of infinities, NaN and signed zeros are MPFR's in test_functions.py."""
    operands = np.array([row for row, _ in EXACT_OF_MATH[name]]).T
    expected = [value for _, value in EXACT_OF_MATH[name]]
    assert [getattr(functions, name)(*row) for row, _ in EXACT_OF_MATH[name]] == expected
    rows = [part for row in operands for part in (row, np.zeros_like(row))]
    assert evaluated(in_extended(name), rows, 1, 2)[0].tolist() == expected


@pytest.mark.parametrize("name", NAMES_OF_MATH)
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


@pytest.mark.parametrize("name", NAMES_OF_MATH)
def test_mpmath_numbers_keep_their_precision(name):
    operands = [mpmath.mpf(k + 2) / 7 for k in range(len(FUNCTIONS[name]))]
    assert getattr(functions, name)(*operands) == mpmaths(name)(*operands)
    if len(operands) == 2:
        assert getattr(functions, name)(Fraction(2, 7), operands[1]) == getattr(functions, name)(*operands)
    assert functions.cbrt(mpmath.mpf(-8)) == -2


@pytest.mark.parametrize("name", NAMES_OF_MATH)
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
