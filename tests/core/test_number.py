"""What the constants of a formula mean, and what formulas are refused for, in which words."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.core import arithmetic
from nearharmonic.core.number import Constant, Number, constant
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems import System
from nearharmonic.systems.gradients import Multiprecision
from nearharmonic.systems.source import velocity_text

UNITS = dict.fromkeys(("q", "p", "t", "energy"), "1")


def system(grad_V, V=lambda q: q[0], **more):
    return System(
        **{"name": "mine", "label": "mine", "q0": ("1",), "p0": ("1",), "t_end": "1", "units": UNITS, "source": "test"}
        | more,
        V=V,
        grad_V=grad_V,
    )


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


@given(rationals, decimals)
def test_constants_stay_exact_beside_floats(a, b):
    """0.1 + 0.2 is 3/10; a Fraction would have become a float."""
    exact, x, f = Fraction(b), Constant(a), float(b)
    assert x + f == f + x == a + exact
    assert (x - f, f - x) == (a - exact, exact - a)
    assert x * f == f * x == np.float64(f) * x == a * exact
    assert abs(-x) == abs(a)
    assert x**2 == a**2
    if a and b:
        assert (x / f, f / x, x**-1) == (a / exact, exact / a, 1 / a)
    assert all(type(y) is Constant for y in (x + f, f - x, f * x, -x, +x, abs(x), x**3, x**0))


def test_the_root_of_a_constant_is_exact_or_good_to_300_digits():
    assert Constant(4, 9).sqrt() == Fraction(2, 3)
    assert Constant(0).sqrt() == 0
    assert arithmetic.sqrt(Constant(9, 4)) == Fraction(3, 2)
    assert Constant(1, 9) ** 1.5 == Fraction(1, 27)
    for value in (Constant(2), Constant(1, 10**40), Constant(10**41 + 1)):
        assert abs(value.sqrt() ** 2 / value - 1) < Fraction(1, 10**300)
    with pytest.raises(ArithmeticError, match="negative number -2"):
        Constant(-2).sqrt()


def test_the_root_of_a_fraction_that_is_no_parameter_is_that_of_a_float():
    assert arithmetic.sqrt(Fraction(1, 4)) == 0.5


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


def sine(q):
    return (math.sin(q[0]),)


def numpy_sine(q):
    return (np.sin(q[0]),)


REFUSED = {
    "equal": (lambda q: (1 if q[0] == 0 else 2,), "grad_V compares a value"),
    "reflected": (lambda q: (1 if 0 == q[0] else 2,), "grad_V compares a value"),  # noqa: SIM300
    "numpy's": (lambda q: (1 if np.float64(0) < q[0] else 2,), "grad_V compares a value"),
    "unequal": (lambda q: (1 if q[0] != 0 else 2,), "grad_V compares a value"),
    "less": (lambda q: (1 if q[0] < 0 else 2,), "grad_V compares a value"),
    "least": (lambda q: (min(q[0], 1),), "grad_V compares a value"),
    "at most": (lambda q: (1 if q[0] <= 0 else 2,), "grad_V compares a value"),
    "not": (lambda q: (1 if not q[0] else 2,), "grad_V uses a value as a condition"),
    "set": (lambda q: (len({q[0]}),), "grad_V hashes a value"),
    "math": (sine, "grad_V converts a value to float, as the functions of the module math do: .*nearharmonic.math$"),
    "array": (lambda q: (np.array(q, dtype=float)[0],), "grad_V converts a value to float"),
    "numpy": (numpy_sine, "grad_V calls a function of numpy: .* come from nearharmonic.math$"),
    "huge power": (lambda q: (q[0] ** 100000,), "grad_V raises a value to the power 100000, .*nearharmonic.math.pow$"),
    "text as exponent": (lambda q: (q[0] ** "2",), "grad_V raises a value to the power '2': formulas use"),
    "remainder": (lambda q: (q[0] % 2,), "grad_V raises TypeError: .*%.*formulas use"),
    "zero": (lambda q: (q[0] / (0.3 - 0.3),), "grad_V raises ZeroDivisionError"),
    "index": (lambda q: (q[1],), "grad_V raises IndexError: tuple index out of range: q has 1 component$"),
    "arguments": (lambda q: (sine(),), r"grad_V raises TypeError: .* missing 1 required .* argument: 'q'$"),
    "attribute": (lambda q: (q[0].real,), "grad_V raises AttributeError: .*'real'.*formulas use"),
    "attribute of a module": (lambda q: (math.arcsin(q[0]),), "grad_V raises AttributeError: .*'arcsin'$"),
    "name": (lambda q: (nothing,), "grad_V raises NameError"),  # noqa: F821
    "infinite": (lambda q: (math.inf * q[0],), "grad_V contains the number inf, which is not finite"),
    "NaN": (lambda q: (math.nan,), r"grad_V\[0\] contains the number nan"),
    "too many": (lambda q: (q[0], 0), "grad_V returns 2 components, expected a tuple of 1, one number a coordinate"),
    "none": (lambda q: (), "grad_V returns 0 components, expected a tuple of 1"),
    "no tuple": (lambda q: q[0], "grad_V returns one number, expected a tuple of 1"),
    "nothing": (lambda q: None, "grad_V returns None, expected a tuple of 1, .*: is a return missing.$"),
    "text": (lambda q: ("a",), r"grad_V\[0\] is an object of type str, expected a number"),
}


@pytest.mark.parametrize("case", REFUSED)
@pytest.mark.parametrize("tracer", ["kernel", "text"])
def test_a_formula_that_cannot_be_traced_is_refused_by_its_name(case, tracer):
    grad_V, words = REFUSED[case]
    trace = {"kernel": traced, "text": velocity_text}[tracer]
    with pytest.raises(SystemDefinitionError, match=f"^mine: {words}") as caught:
        trace(system(grad_V))
    missing_cause = case in {"too many", "none", "no tuple", "nothing", "text"}  # nothing was raised by the formula
    assert (caught.value.__cause__ is None) == missing_cause


def traced(made):
    from nearharmonic.core.formulas import fingerprint
    from nearharmonic.core.physics import Physics
    from nearharmonic.core.rules import Rules

    formulas = {name: getattr(made, name) for name in ("V", "grad_V", "T", "grad_T", "name", "dimension")}
    formulas |= {"grad_V_and_V": None, "balanced_T": None}  # of systems of more coordinates
    physics = Physics(**formulas, parameters=0, constants=made.constants(Constant))
    return fingerprint(Rules(physics, extended=True, compensated=True))


@pytest.mark.parametrize("formula", ["V", "grad_V", "T", "grad_T"])
def test_the_error_names_the_formula_that_failed(formula):
    def broken(*_):
        raise KeyError("lost")

    made = system(**({"grad_V": lambda q: (1,)} | {formula: broken}))
    with pytest.raises(SystemDefinitionError, match=f"^mine: {formula} raises KeyError: 'lost'$") as caught:
        traced(made)
    assert isinstance(caught.value.__cause__, KeyError)


def test_an_energy_that_is_no_number_is_refused():
    with pytest.raises(SystemDefinitionError, match=r"^mine: V returns an object of type tuple, expected one number$"):
        traced(system(lambda q: (1,), V=lambda q: q))


def test_an_energy_that_returns_nothing_asks_for_its_return():
    words = r"^mine: V returns None, expected one number: is a return missing\?$"
    with pytest.raises(SystemDefinitionError, match=words):
        traced(system(lambda q: (1,), V=lambda q: None))


def test_numpys_arrays_work_in_formulas():
    """sum, sqrt and abs of an array of values, and numpy's floats on either side."""
    q = (Multiprecision(Decimal(-3)), Multiprecision(Decimal(4)))
    assert np.sqrt(np.sum(np.array(q) ** 2)).value == 5
    assert np.abs(np.array(q))[0].value == 3
    for half in (np.float64(0.1) * q[0], q[0] * np.float64(0.1), np.float32(0.1) * q[0], q[0] / np.float64(10)):
        assert half.value == Decimal("-0.3")
    assert [x.value for x in np.array([0.1, 1]) * np.array(q)] == [Decimal("-0.3"), 4]
    assert [x.value for x in np.array([0.1, 1]) * q[1]] == [Decimal("0.4"), 4]
