"""Polished members: their digits, proved in exact arithmetic that shares no code with the equations."""

from __future__ import annotations

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.theory.order import harmonic_order, nystrom_order_of, order_of
from nearharmonic.training.family import Family
from nearharmonic.training.objective import DIGITS, NotConvergedError, polished, tableau_of
from support.methods.family_members import FAMILIES, members
from support.oracles.word_series import operators_of, series


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_polished_members_have_the_orders_of_their_family_by_proof(family):
    for x in members(family, 2):
        tableau = tableau_of(family, x, name="member", source="here")
        assert (tableau.stages, tableau.first, tableau.digits) == (family.stages, family.first, DIGITS)
        assert nystrom_order_of(tableau) >= family.order
        if not family.squares:
            assert order_of(tableau) >= 4
        assert harmonic_order(tableau) >= family.harmonic_order
        assert tableau.order == family.order


def test_order_six_conditions_are_necessary_and_not_fulfilled_by_chance():
    family = Family(stages=9, first="drift")
    tableau = tableau_of(family, members(family, 1)[0], name="member", source="here")
    assert nystrom_order_of(tableau) == 4
    assert harmonic_order(tableau) == 4
    assert tableau.requires is None
    family = Family(stages=9, first="drift", order=6)
    tableau = tableau_of(family, members(family, 1)[0], name="member", source="here")
    assert (order_of(tableau), nystrom_order_of(tableau), harmonic_order(tableau)) == (4, 6, 6)
    assert tableau.requires


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_sixty_decimals_meet_the_equations_in_exact_arithmetic(family):
    tableau = tableau_of(family, members(family, 1)[0], name="member", source="here")
    step = series(operators_of(tableau), max(5, family.harmonic_order))
    allowed = Fraction(1, 10 ** (DIGITS - 6))  # a sum of some hundred products of coefficients below 4, times 7!
    for letter in "AB":
        assert abs(step[letter] - 1) < allowed
    for degree in range(3, family.order, 2):
        for row in conditions(degree, quadratic=True):
            pairs = zip(row.weights, lyndon_words(degree), strict=True)
            assert abs(sum(w * (factorial(degree) * step[word] - 1) for w, word in pairs)) < allowed
    for power in range(family.order + 1, family.harmonic_order + 1):
        assert abs(factorial(power) * step[("AB" * power)[:power]] - 1) < allowed


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_polishing_moves_little_and_returns_initial_doubles(family):
    x = members(family, 1)[0]
    with mp.workdps(80):
        found = polished(family, x)
        assert max(abs(a - mpf(b)) for a, b in zip(found, x, strict=True)) < 1e-8
        assert max(map(abs, family.residuals(found))) < mpf(10) ** -58
    again = polished(family, [float(c) for c in found])
    assert np.array(again, dtype=float) == pytest.approx(np.array(found, dtype=float), abs=1e-12)


def test_polishing_of_an_isolated_method_finds_its_printed_digits():
    tableau = nh.integrators["abas5o6h"]
    family = Family(stages=5, first="drift", harmonic_order=6)
    assert family.unknowns == len(family.equations)
    found = tableau_of(family, family.unknowns_of(tableau), name="again", source="here")
    for row in ("kick", "drift"):
        for ours, printed in zip(getattr(found, row), getattr(tableau, row), strict=True):
            # The printed ones are off by half a unit of their last digit, the derivatives are of size 1.
            assert abs(Fraction(ours) - Fraction(printed)) < Fraction(1, 10 ** (min(tableau.digits, DIGITS) - 1))


@pytest.mark.parametrize("away", [1e-7, 1e-3, 5.0])
def test_a_point_that_is_no_member_is_refused(away):
    family = Family(stages=6, first="drift")
    # Along the derivatives of an equation, which leads away from the family.
    x = members(family, 1)[0]
    slope = family.slopes(x[:, None])[0][0]
    with pytest.raises(NotConvergedError, match="wanted 1e-60 within 1e-08"):
        polished(family, x + away * slope / np.linalg.norm(slope))
