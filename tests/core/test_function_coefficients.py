"""The data of the functions of formulas against what it stands for, in mpmath."""

from __future__ import annotations

import mpmath
import pytest
from mpmath import mp, mpf

from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions import extended


def in_square(function, leading, power):
    """(function(x) - leading(x)) / x^power as a function of x^2."""

    def quotient(z):
        x = mpmath.sqrt(z)
        return (function(x) - leading(x)) / x**power

    return quotient


def artanh_tail(z):
    s = mpmath.sqrt(z)
    return (mpmath.atanh(s) - s - s**3 / 3) / s**5


def complement(t):
    x = mpf("2.5") * (1 + t) / (1 - t)
    return mpmath.exp(x * x) * mpmath.erfc(x)


def of_t(x):
    return (x - mpf("2.5")) / (x + mpf("2.5"))


def same(x):
    return x


#: Function, interval, and largest deviation; each deviation times the weight of its term is far below 2^-53, or 2^-106.
POLYNOMIALS = {
    "SIN": (in_square(mpmath.sin, same, 3), 0, (mp.pi / 4) ** 2, 2.0**-54.8),
    "COS": (in_square(mpmath.cos, lambda x: 1 - x * x / 2, 4), 0, (mp.pi / 4) ** 2, 2.0**-58.5),
    "EXP": (lambda r: (mpmath.exp(r) - 1 - r) / r**2, -mp.ln2 / 2, mp.ln2 / 2, 2.0**-55),
    "LOG": (in_square(mpmath.atanh, same, 3), 0, (3 - 2 * mp.sqrt(2)) ** 2, 2.0**-52),
    "LOG_TAIL": (artanh_tail, 0, (3 - 2 * mp.sqrt(2)) ** 2, 2.0**-54),
    "SINH": (in_square(mpmath.sinh, same, 3), 0, 1, 2.0**-56),
    "TANH": (in_square(mpmath.tanh, same, 3), 0, mpf("0.55") ** 2, 2.0**-54),
    "ATAN": (in_square(mpmath.atan, same, 3), 0, mp.tan(mp.pi / 8) ** 2, 2.0**-53),
    "ERF": (lambda z: mpmath.erf(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1, 0, 1, 2.0**-53),
    "ERFCX": (complement, of_t(1), of_t(6), 2.0**-54),
    "CBRT": (lambda m: 1 / mpmath.cbrt(m), 1, 2, 2.0**-14.5),
    "ERF_EXTENDED": (lambda z: mpmath.erf(mpmath.sqrt(z)) / mpmath.sqrt(z) - 1, 0, 1, 2.0**-107),
    "ERFCX_EXTENDED": (complement, of_t(1), of_t(9), 2.0**-105),
}


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_a_polynomial_is_near_its_function(name):
    """At 300 points, which 30 oscillations of a near-minimax error cannot hide between."""
    function, least, most, bound = POLYNOMIALS[name]
    parts = getattr(table, name)
    with mpmath.workdps(150):
        exact = [mpf(c[0]) + mpf(c[1]) if isinstance(c, tuple) else mpf(c) for c in parts]
        points = [least + (mpf(most) - least) * (k + mpf("0.5")) / 300 for k in range(300)]
        worst = max(abs(sum(c * x**k for k, c in enumerate(exact)) - function(x)) for x in points)
    assert worst < bound


@pytest.mark.parametrize(
    ("parts", "value", "bits"),
    [
        (table.HALF_PI, lambda: mp.pi / 2, 320), (table.HALF_PI_SHORT, lambda: mp.pi / 2, 139),
        (table.LN2, lambda: mp.ln2, 265),
        (table.QUARTER_PI, lambda: mp.pi / 4, 106), (table.LN2_SHORT, lambda: mp.ln2, 95),
        (table.TWO_PI, lambda: 2 * mp.pi, 104),
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


def test_multiples_of_short_parts_are_exact():
    assert (table.HALF_PI_SHORT[1] * 2.0**86).is_integer()
    assert abs(table.HALF_PI_SHORT[1] * 2.0**86) < 2.0**33
    assert (table.LN2_SHORT[0] * 2.0**42).is_integer()
    assert (table.QUARTER_PI[0] * 2.0**50).is_integer()


@pytest.mark.parametrize(
    ("name", "function", "argument", "power"),
    [
        ("SIN", mpmath.sin, mp.pi / 4, 3), ("SINH", mpmath.sinh, mpf("0.5"), 3),
        ("ARTANH", mpmath.atanh, mpf("0.0434"), 3),
        ("COS", lambda x: mpmath.cos(x) - 1 + x, mp.pi / 4, 2), ("EXP", lambda x: mpmath.exp(x) - 1, mp.ln2 / 2, 2),
    ],
)  # fmt: skip
def test_series_of_double_doubles_have_enough_terms(name, function, argument, power):
    """At the end of the interval, where the first omitted term is largest."""
    terms = getattr(extended, name)
    with mpmath.workdps(60):
        variable = argument if name == "EXP" else argument**2
        value = sum((mpf(h) + mpf(e)) * variable**k for k, (h, e) in enumerate(terms))
        assert abs(value - (function(argument) - argument) / argument**power) < mpf(2) ** -104
