"""Constants of a formula: what literals mean, exact arithmetic, roots, and powers."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.core import arithmetic
from nearharmonic.core.number import Constant, Number, constant
from nearharmonic.systems.gradients import Multiprecision


@pytest.mark.parametrize(
    ("literal", "meaning"),
    [
        (0.1, "1/10"), (-2.5e-7, "-1/4000000"), (np.float64(0.1), "1/10"), (np.float32(0.1), "1/10"), (3, "3"),
        (np.int8(3), "3"), (True, "1"), (Fraction(1, 3), "1/3"), (Decimal("0.7"), "7/10"), (1e300, f"{10**300}"),
    ],
)  # fmt: skip
def test_a_literal_means_the_shortest_decimal_that_it_prints_as(literal, meaning):
    assert type(constant(literal)) is Constant
    assert constant(literal) == Fraction(meaning)


@pytest.mark.parametrize("other", ["1", None, 1j, (1,), np.ones(2), object()])
def test_what_is_no_real_number_is_no_constant(other):
    assert constant(other) is None


rationals = st.fractions(min_value=-1000, max_value=1000, max_denominator=1000)
decimals = st.decimals(min_value=-1000, max_value=1000, places=3)


@pytest.mark.slow
@given(rationals, decimals)
def test_constants_stay_exact_beside_floats(a, b):
    """0.1 + 0.2 is 3/10; a Fraction would have become a float."""
    exact, x, f = Fraction(b), Constant(a), float(b)
    assert x + f == f + x == a + exact
    assert (x - f, f - x) == (a - exact, exact - a)
    assert x * f == f * x == np.float64(f) * x == a * exact
    assert abs(-x) == abs(a)
    assert [x**2, x**4, x**7] == [a**2, a**4, a**7]
    if a and b:
        assert (x / f, f / x, x**-1) == (a / exact, exact / a, 1 / a)
    assert all(type(y) is Constant for y in (x + f, f - x, f * x, -x, +x, abs(x), x**3, x**0))


def test_root_of_constant_is_exact_or_good_to_300_digits():
    assert Constant(4, 9).sqrt() == Fraction(2, 3)
    assert Constant(0).sqrt() == 0
    assert arithmetic.sqrt(Constant(9, 4)) == Fraction(3, 2)
    assert arithmetic.sqrt(Fraction(1, 4)) == 0.5  # no parameter: that of a float
    assert Constant(1, 9) ** 1.5 == Fraction(1, 27)
    for value in (Constant(2), Constant(1, 10**40), Constant(10**41 + 1)):
        assert abs(value.sqrt() ** 2 / value - 1) < Fraction(1, 10**300)
    with pytest.raises(ArithmeticError, match="negative number -2"):
        Constant(-2).sqrt()


class Recorded(Number):
    """Counts multiplications."""

    multiplications = 0

    def _multiply(self, other):
        Recorded.multiplications += 1
        return self


@pytest.mark.parametrize(
    ("exponent", "most"), [(1, 0), (2, 1), (3, 2), (4, 3), (5, 4), (6, 3), (8, 4), (12, 4), (64, 7), (100, 8)]
)
def test_a_power_takes_few_multiplications(exponent, most):
    Recorded.multiplications = 0
    Recorded() ** exponent
    assert Recorded.multiplications == most


def test_numpys_arrays_work_in_formulas():
    """sum, sqrt and abs of an array of values, and numpy's floats on either side."""
    q = (Multiprecision(Decimal(-3)), Multiprecision(Decimal(4)))
    assert np.sqrt(np.sum(np.array(q) ** 2)).value == 5
    assert np.abs(np.array(q))[0].value == 3
    for half in (np.float64(0.1) * q[0], q[0] * np.float64(0.1), np.float32(0.1) * q[0], q[0] / np.float64(10)):
        assert half.value == Decimal("-0.3")
    assert [x.value for x in np.array([0.1, 1]) * np.array(q)] == [Decimal("-0.3"), 4]
    assert [x.value for x in np.array([0.1, 1]) * q[1]] == [Decimal("0.4"), 4]
