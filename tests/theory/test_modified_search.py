"""The equations of methods with kicks of a modified potential, and what the search for their solutions finds."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.exact.words import word_sums, words
from nearharmonic.integrators.order_conditions import step_of
from nearharmonic.theory.modified_search import ModifiedEquations, digits_of, solutions
from support.oracles.word_series import series

SIX = [name for name, one in nh.modified_integrators.items() if one.order == 6]


def point_of(equations, tableau):
    kicks, drifts, squares = equations.counts
    return [*tableau.kick[:kicks], *tableau.drift[:drifts], *tableau.square[:squares]]


@pytest.mark.parametrize("name", list(nh.modified_integrators))
def test_sums_over_words_are_those_of_exact_series(name):
    tableau = nh.modified_integrators[name]
    exact = series(step_of(tableau), 5)
    with mp.workdps(60):
        factors = [(letter, mpf(c.numerator) / c.denominator) for letter, c in step_of(tableau)]
        found = word_sums(factors, words(5))
        for word in words(5):
            assert abs(found[word] - mpf(exact[word].numerator) / exact[word].denominator) < mpf(10) ** -50


@pytest.mark.parametrize("name", SIX)
def test_registered_digits_are_those_of_newtons_method_from_ten_of_them(name):
    tableau = nh.modified_integrators[name]
    equations = ModifiedEquations(5, tableau.first, 6)
    point = point_of(equations, tableau)
    # What fixes the parameter of the family: a kick of few digits, or one without a square.
    fixed = [i for i, text in enumerate(point) if len(text) < 10]
    assert len(fixed) == 1
    start = [text if i in fixed else float(text) * (1 + 1e-10) for i, text in enumerate(point)]
    limit = digits_of(equations, start, fixed, 82)
    assert limit.converged
    with mp.workdps(90):
        assert max(abs(mpf(text) - x) for text, x in zip(point, limit.point, strict=True)) < mpf(10) ** -80


def test_the_published_method_has_the_digits_of_its_paper():
    tableau = nh.modified_integrators["omelyan_g5o6"]
    printed = [
        (tableau.drift[0], "0.1097059723948682"),
        (tableau.drift[1], "0.4140632267310831"),
        (tableau.kick[0], "0.2693315848935301"),
        (tableau.kick[1], "1.131980348651556"),
        (tableau.square[2], "-0.01324638643416052"),
        (tableau.square[0], "0.0008642161339706166"),
    ]
    for text, digits in printed:
        assert float(text) == pytest.approx(float(digits), rel=2e-15)


def test_the_parameter_of_our_method_makes_the_error_of_degree_seven_least_to_five_digits():
    from nearharmonic.theory.order import leading_errors

    tableau = nh.modified_integrators["abag5o6"]
    equations = ModifiedEquations(5, "drift", 6)
    least = leading_errors(tableau).nystrom.norm
    for change in (-0.004, 0.004):
        point = point_of(equations, tableau)
        point[1] = str(float(point[1]) + change)
        limit = digits_of(equations, point, [1], 30)
        kick, drift, square = ([mp.nstr(x, 30) for x in row] for row in equations.rows(limit.point))
        other = nh.ModifiedTableau(
            name="other", order=6, first="drift", kick=tuple(kick), drift=tuple(drift), square=tuple(square),
            source="here", digits=25,
        )  # fmt: skip
        norm = leading_errors(other).nystrom.norm
        assert least < norm
        assert norm == pytest.approx(least, rel=1e-3)


@pytest.mark.slow
def test_random_starts_lead_to_the_family_of_the_registered_method():
    equations = ModifiedEquations(5, "drift", 6)
    found = solutions(equations, 400, 1)
    assert len(found) > 20
    for point in found:
        assert np.abs(np.array(equations.residuals(point[:, None]))).max() < 1e-12
    ours = np.array([float(x) for x in point_of(equations, nh.modified_integrators["abag5o6"])])
    # The outermost coefficients hardly change along the family.
    assert (np.abs(found[:, [0, 3]] - ours[[0, 3]]).max(axis=1) < 2e-3).any()


@pytest.mark.slow
def test_four_stages_have_no_small_coefficients_of_order_six():
    """Their eight unknowns meet eight equations."""
    found = solutions(ModifiedEquations(4, "kick", 6), 400, 1)
    assert all(np.abs(point).sum() > 2 for point in found)
