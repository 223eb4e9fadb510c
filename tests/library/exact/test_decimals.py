"""Printed and rounded numbers against decimals written out by hand and exact fractions."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal, localcontext
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import inf, mp, mpf, sqrt

from nearharmonic.exact.polynomials import as_fraction, as_mpf, decimals_in_common, fixed_point, significant


@pytest.mark.parametrize(
    ("number", "places", "text"),
    [
        ("1.23456", 3, "1.235"),
        ("-0.0004", 3, "0.000"),
        ("-0.0006", 3, "-0.001"),
        ("0.00049", 4, "0.0005"),
        ("12", 2, "12.00"),
        ("9.9996", 3, "10.000"),
        ("1e-3", 5, "0.00100"),
        (Fraction(-2, 3), 4, "-0.6667"),
        (Fraction(1, 8), 2, "0.12"),  # a tie goes to the even digit
        (Fraction(3, 8), 2, "0.38"),
        (0.5, 1, "0.5"),
        (inf, 3, "inf"),
    ],
)
def test_number_is_rounded_to_given_decimals_with_trailing_zeros(number, places, text):
    assert fixed_point(number, places) == text


@given(st.integers(-(10**30), 10**30), st.integers(1, 40))
@settings(deadline=None)
def test_fixed_point_agrees_with_decimal_arithmetic(numerator, places):
    with localcontext(prec=120):
        number = Decimal(numerator).scaleb(-25)
        expected = number.quantize(Decimal(1).scaleb(-places), ROUND_HALF_EVEN)
    found = fixed_point(Fraction(numerator, 10**25), places)
    assert Decimal(found) == expected
    assert len(found.partition(".")[2]) == places


def test_every_bit_of_number_is_written_whatever_current_precision():
    with mp.workdps(60):
        root = sqrt(mpf(2))
    with mp.workdps(5):
        assert fixed_point(root, 50) == "1.41421356237309504880168872420969807856967187537695"
        assert fixed_point(-root, 3) == "-1.414"


@pytest.mark.parametrize("value", ["0.1", "-123456789.0625", "3e-40"])
def test_a_number_becomes_the_fraction_that_its_bits_stand_for(value):
    with mp.workdps(25):
        number = mpf(value)
        assert abs(as_fraction(number) / Fraction(value) - 1) < Fraction(1, 2**mp.prec)
        assert as_mpf(as_fraction(number)) == number
    assert as_fraction(value) == Fraction(value)
    assert as_fraction(0.1) == Fraction(*(0.1).as_integer_ratio())


def test_a_fraction_is_rounded_to_the_precision_at_hand():
    with mp.workdps(40):
        third = as_mpf(Fraction(1, 3))
        assert abs(3 * third - 1) < mpf(10) ** -40
        assert as_mpf(7) == 7
        assert as_mpf("0.5") == as_mpf(0.5) == mpf(1) / 2


@pytest.mark.parametrize(
    ("number", "text"),
    [(mpf("3.25"), "3.2500"), (mpf("0.5"), "0.50000"), (mpf("12.34567"), "12.346"), (inf, "inf"), (0, "0")],
)
def test_significant_digits_are_counted_from_first_that_is_not_zero(number, text):
    assert significant(number, 5) == text


@pytest.mark.parametrize(
    ("printed", "derived", "digits"),
    [
        ("0.123456", "0.12345649", 6),
        ("0.123456", "0.1234551", 6),
        ("0.123456", "0.1234499", 5),
        ("0.123456", "0.1334560", 1),
        ("0.123456", "0.123457", 5),  # one unit of the last decimal is too much
        ("-0.5", "0.5", 0),
    ],
)
def test_decimals_agree_where_the_difference_is_less_than_one_unit(printed, derived, digits):
    assert decimals_in_common(printed, derived) == digits


def test_no_more_decimals_agree_than_are_looked_at():
    assert decimals_in_common("0.123456", "0.123456", 4) == 4
    assert decimals_in_common("0.5", "0.50000001", 10) == 7
