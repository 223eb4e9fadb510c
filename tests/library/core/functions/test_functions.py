"""Accuracy of the functions of formulas in machine code, against MPFR, which shares no code with them."""

from __future__ import annotations

import re
from pathlib import Path

import gmpy2
import mpmath
import numpy as np
import pytest
from gmpy2 import mpfr

from nearharmonic.core.number import FUNCTIONS
from support.methods.function_arguments import arguments, evaluated, in_double, in_extended, pairs, same_bits

NAMES = sorted(FUNCTIONS)
#: More digits than the results; MPFR rounds each function correctly. The range of exponents is MPFR's, not a double's.
WIDE = gmpy2.context(precision=400, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min())
#: Sum of two doubles of any exponents, without rounding.
EXACT = gmpy2.context(precision=2200, emax=gmpy2.get_emax_max(), emin=gmpy2.get_emin_min())


PAGE = (Path(__file__).parents[4] / "docs/how_to/formulas.md").read_text(encoding="utf-8")
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


@pytest.mark.parametrize("name", NAMES)
def test_the_oracle_is_that_of_mpmath(name):
    """20 moderate arguments in 50 digits by both libraries."""
    random = np.random.default_rng(3)
    with gmpy2.context(precision=200), mpmath.workdps(50):
        for operands in random.uniform(0.1, 5, (20, len(FUNCTIONS[name]))).tolist():
            theirs = getattr(mpmath, "power" if name == "pow" else name)(*map(mpmath.mpf, operands))
            assert abs(mpmath.mpf(str(exactly(name, *map(mpfr, operands)))) / theirs - 1) < mpmath.mpf(10) ** -48
