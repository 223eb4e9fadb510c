"""Numbers written as text: the limits within which they are read, and their exact values."""

from __future__ import annotations

import time
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.numerics.written import any_decimal_of, decimal_of, exact_number, fraction_of, integer_of, is_integer

SLOW = ["1e999999999", "-1E-999999999", "1e" + "9" * 500, "9" * 10**6, "0." + "3" * 10**6, "1e401", "1e-401"]
#: Text that ``Fraction``, ``Decimal``, ``int`` or ``float`` would accept, and other text that is no number.
OTHER = [
    "",
    " ",
    "nan",
    "inf",
    "-Infinity",
    "1_000",
    "٣",
    "１",
    "0x10",
    "1e",
    "e1",
    ".",
    "+",
    "1 2",
    "1,5",
    "1e1.5",
    "ten",
]


@given(st.integers(-(10**30), 10**30), st.integers(-300, 300))
def test_a_decimal_has_its_exact_value(digits, power):
    exact = digits * Fraction(10) ** power
    assert fraction_of(f"{digits}e{power}") == Fraction(decimal_of(f" {digits}E{power}\n")) == exact


@given(st.integers(-(10**30), 10**30), st.integers(1, 10**30))
def test_a_quotient_has_its_exact_value(above, below):
    assert fraction_of(f"{above}/{below}") == exact_number(Fraction(above, below)) == Fraction(above, below)


@pytest.mark.parametrize("text", [*SLOW, *OTHER], ids=lambda text: text[:12] or "empty")
def test_other_text_is_refused_at_once(text):
    begin = time.process_time()
    for read in (decimal_of, fraction_of, integer_of, exact_number):
        for one in (text, f"{text}/3", f"1/{text}"):
            with pytest.raises(ValueError):  # noqa: PT011
                read(one)
    assert time.process_time() - begin < 1


def test_a_zero_of_any_exponent_is_zero_and_no_divisor():
    assert fraction_of("0e999999999") == decimal_of("-0e-999999999") == any_decimal_of("0e999999999") == 0
    with pytest.raises(ValueError):  # noqa: PT011
        fraction_of("1/0e5")


def test_an_extreme_decimal_can_be_compared():
    assert any_decimal_of("1e999999999") > any_decimal_of("1e999999998")


@pytest.mark.parametrize("value", [10, 10.0, "10", "10.0", "1e1", Decimal(10), Fraction(10), "20/2"])
def test_an_integer_may_be_written_in_each_form(value):
    assert integer_of(value) == 10
    assert type(integer_of(value)) is int


@pytest.mark.parametrize("value", [True, None, [1], {1: 2}, b"1", 1j])
def test_what_is_no_number_is_a_type_error(value):
    with pytest.raises(TypeError):
        integer_of(value)
    with pytest.raises(TypeError):
        exact_number(value)


@pytest.mark.parametrize("value", [0.5, "0.5", float("inf"), float("nan"), Decimal("inf"), Decimal("nan"), "1/3"])
def test_what_is_no_integer_is_a_value_error(value):
    with pytest.raises(ValueError):  # noqa: PT011
        integer_of(value)


def test_an_integer_has_ascii_digits_alone():
    assert [is_integer(text) for text in ("0", "-12", "+3", "1.0", "", "٣", "1_0", " 1", "1" * 401)] == [True] * 3 + [
        False
    ] * 6
