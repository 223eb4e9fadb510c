"""Bounds of residuals due to digits: never below the residuals of rounded correct coefficients."""

from __future__ import annotations

import random
from dataclasses import replace
from decimal import Context
from fractions import Fraction

import pytest
from mpmath import diff, expm, log, matrix, mp, mpf, taylor

from nearharmonic.exchange import proof as residuals
from nearharmonic.exchange.files import CoefficientFile
from nearharmonic.exchange.method import Printed, digits_of, step_of
from nearharmonic.exchange.verdict import OscillatorStep, Verdict
from nearharmonic.integrators import plain_integrators as integrators
from support.oracles.reference_solutions import oscillator_step

SOME = ("ruth", "abas5o6h", "babps8o7h", "srkn_b11", "yoshida_s7o6a", "s15odr8")


def file_of(tableau, digits=None, claimed=True):
    context = Context(prec=digits) if digits else None
    rows = {
        key: tuple(str(context.create_decimal(text)) if context else text for text in getattr(tableau, key))
        for key in ("kick", "drift")
    }
    return CoefficientFile(
        path="",
        name=tableau.name,
        label=tableau.label,
        source=tableau.source,
        first=tableau.first,
        order=tableau.order,
        harmonic_order=tableau.harmonic_order,
        requires=tableau.requires,
        digits=(digits or tableau.digits) if claimed else None,
        **rows,
    )


def test_majorant_is_series_of_minus_logarithm_of_two_minus_exp():
    for n, coefficient in enumerate(taylor(lambda x: -log(2 - mp.exp(x)), 0, 8)[1:], start=1):
        one = residuals.majorant(n)
        assert abs(mpf(one.numerator) / one.denominator - coefficient) < mpf(10) ** -12


@pytest.mark.slow
@pytest.mark.parametrize("digits", [6, 10, 16, 30])
@pytest.mark.parametrize("name", SOME)
def test_no_rounding_of_a_registered_method_refutes_what_it_declares(name, digits):
    tableau = integrators[name]
    for claimed in (True, False):
        assert Verdict(file_of(tableau, digits, claimed=claimed)).holds


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in SOME else pytest.mark.long) for name in integrators]
)
def test_every_registered_method_proves_declarations_from_digits(name):
    for digits in (None, 8, 15, 17, 40):
        if digits is None or digits <= integrators[name].digits:
            found = Verdict(file_of(integrators[name], digits))
            assert found.holds
            assert found.nearest.tableau.name == name
            assert found.nearest.is_same
            assert not found.suspects


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_an_order_higher_by_two_is_refuted_with_sixteen_digits(name):
    tableau = integrators[name]
    higher = replace(file_of(tableau, 16), order=tableau.order + 2, harmonic_order=None)
    assert not Verdict(higher).holds


@pytest.mark.slow
@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("name", SOME[:4])
def test_residuals_of_rounded_coefficients_stay_within_what_the_digits_allow(name, quadratic):
    """Each coefficient is off by up to three units of its tenth decimal, one of each row by what closes the sum too."""
    tableau, generator = integrators[name], random.Random(1)
    exact = step_of(tableau.kick, tableau.drift, tableau.first, 10)
    for _ in range(5):
        moved = [generator.uniform(-1, 1) * c.uncertainty for _, c in exact]
        for letter in "AB":
            places = [i for i, (x, _) in enumerate(exact) if x == letter]
            moved[generator.choice(places)] -= sum(moved[i] for i in places)
        step = tuple(
            (letter, Printed(c + Fraction(d), c.uncertainty, c.place))
            for (letter, c), d in zip(exact, moved, strict=True)
        )
        found = [one for n in range(1, tableau.order + 1) for one in residuals.residuals(step, n, quadratic=True)]
        assert all(one.vanishes for one in found)
        # The bound is no idle one: somewhere a residual comes within a factor of a thousand of it.
        assert max(abs(one.value) / one.allowed for one in found if one.degree > 1) > 1e-3
        limit = OscillatorStep(step)
        assert limit.harmonic_order >= (tableau.harmonic_order or tableau.order)


def test_a_residual_is_that_of_matrices():
    """On 3 by 3 matrices that vanish in triple products, log(exp(aA) exp(bB)...) has two degrees alone."""
    A, B = matrix([[0, 1, 0], [0, 0, 2], [0, 0, 0]]), matrix([[0, 3, 0], [0, 0, 1], [0, 0, 0]])
    step = step_of(("0.3", "0.7"), ("0.4", "0.6"), "kick", 0)
    product = matrix([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    for letter, c in step:
        product = product * expm({"A": A, "B": B}[letter] * (mpf(c.numerator) / c.denominator))
    X = product - matrix([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    corner = (X - X * X / 2 - A - B)[0, 2]
    (one,) = residuals.residuals(step, 2, quadratic=False)
    bracket = (A * B - B * A)[0, 2]
    assert abs(mpf(one.value.numerator) / one.value.denominator - corner / bracket) < mpf(10) ** -25


@pytest.mark.parametrize(
    ("kick", "drift", "first", "limit"),
    [(("1",), ("1",), "kick", 2), (("2", "-1"), ("-1", "2"), "kick", 0.5), (("0.5", "0.5"), ("1",), "kick", 2)],
)
def test_the_stability_limit_is_where_the_trace_leaves_two(kick, drift, first, limit):
    """tr K of the second is 2 - tau^2 + 4 tau^4, less than 2 up to tau = 1/2."""
    assert float(OscillatorStep(step_of(kick, drift, first, 0)).stability_limit(0)) == pytest.approx(limit, abs=1e-15)


def test_asymmetric_stability_limit_matches_multiprecision_trace():
    file = file_of(integrators["mclachlan_atela_4"])
    step = step_of(file.kick, file.drift, file.first, digits_of(file).number)

    def trace(tau):
        K = oscillator_step(file, tau)
        return K[0, 0] + K[1, 1]

    limit = mpf(OscillatorStep(step).stability_limit(0))
    assert abs(abs(trace(limit)) - 2) < mpf(10) ** -25
    assert abs(diff(trace, limit)) > 0.01
    assert all(abs(trace(limit * k / 200)) < 2 for k in range(1, 200))


@pytest.mark.parametrize(
    ("texts", "number"),
    [
        (("0.5", "0.5"), 0),
        (("0.1932", "0.3068"), 0),
        (("0.25000000", "0.50000000"), 0),
        (("0.04649290043965892", "0.154901012702888", "0.31970548287359174"), 16),
        (("0.675604", "0.1756"), 6),
        (("0.351166139915740498", "0.15585935917621682", "-0.007025499091957318"), 16),
        (("0.26500275499062083398646002963079872",), 35),
        (("0.04649290043965891900", "0.15490101270288800000"), 15),
        ((f"{0.04649290043965892:.22f}", f"{0.154901012702888:.25f}", "0.5"), 16),
    ],
)
def test_unclaimed_digits_of_file_are_its_shown_digits(texts, number):
    file = CoefficientFile(path="", name="", label="", source="", first="kick", kick=texts, drift=("1",))
    assert digits_of(file).number == number
    assert digits_of(replace(file, digits=12)).number == 12
