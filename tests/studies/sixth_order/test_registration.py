"""Methods of the search for order six: its criterion is that of other modules, its digits solve the equations."""

from __future__ import annotations

from math import factorial

import numpy as np
import pytest
from mpmath import matrix, mp, mpf, sqrt

from nearharmonic.integrators import integrators
from nearharmonic.integrators.nearharmonic_2026 import TABLEAUS
from nearharmonic.theory.order import error_norm
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic.training.objective import NotConvergedError, polished, tableau_of
from nearharmonic_studies.sixth_order.cascade import candidates_of, short_decimals
from nearharmonic_studies.sixth_order.criterion import TAU_PER_STAGE, NystromEquations
from support.oracles.nystrom_steps import equations_of, unknowns_of
from support.oracles.reference_solutions import oscillator_step

NAMES = [tableau.name for tableau in TABLEAUS]
EVERY = pytest.mark.parametrize("name", NAMES)


# --- the criterion ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@EVERY
def test_criterion_is_made_of_what_other_modules_say_of_method(name):
    tableau = integrators[name]
    unknowns = np.array([[float(x) for x in unknowns_of(tableau)]])
    (candidate,) = candidates_of(equations_of(tableau), unknowns, [0])
    merit, tau = candidate.merit, mpf(tableau.stages) * TAU_PER_STAGE
    # Cancellation from sums of about 1 to errors of about 1e-6 leaves 1e-9 of these.
    assert merit.nystrom_error == pytest.approx(float(error_norm(tableau, 7, quadratic=True) * tau**6), rel=1e-6)
    size = sum(abs(float(c)) for c in tableau.kick + tableau.drift)
    assert merit.sum_of_absolute_values == pytest.approx(size, rel=1e-12)
    # Linear interpolation over steps of 0.02: they enter squared, times the curvature, which is small near pi.
    assert merit.stability_limit == pytest.approx(float(stability_limit(tableau)), abs=1e-4)
    error = merit.harmonic_error + 0.1 * merit.nystrom_error
    expected = np.log10(error * size / 2 * 2 * tableau.stages / merit.stability_limit)
    assert merit.value == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
@EVERY
def test_harmonic_errors_are_those_of_the_step_matrix(name):
    # Terms in tau^7, tau^9 and tau^11 of the matrix by finite differences: its entries are polynomials in tau, sampled
    # where what lies beyond is 1e-40 of them.
    tableau = integrators[name]
    (candidate,) = candidates_of(equations_of(tableau), np.array([[float(x) for x in unknowns_of(tableau)]]), [0])
    with mp.workdps(200):
        odd = range(1, 2 * tableau.stages + 2, 2)
        taus = [mpf(k + 1) / 8 for k in range(len(odd))]
        powers = matrix([[tau**n for n in odd] for tau in taus])
        steps = [oscillator_step(tableau, tau) for tau in taus]
        K12, K21 = (mp.lu_solve(powers, matrix([step[i, j] for step in steps])) for i, j in ((0, 1), (1, 0)))
        total, h = mpf(0), mpf(tableau.stages) / 10
        for n in (7, 9, 11):
            place, sign = (n - 1) // 2, (-1) ** ((n - 1) // 2)
            exact = mpf(sign) / factorial(n)
            total += sqrt((K12[place] - exact) ** 2 + (K21[place] + exact) ** 2) * h ** (n - 1)
    assert candidate.merit.harmonic_error == pytest.approx(float(total), rel=1e-5)


# --- the digits -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@EVERY
def test_newton_from_six_digits_comes_to_the_registered_digits(name):
    tableau = integrators[name]
    equations, unknowns = equations_of(tableau), unknowns_of(tableau)
    fixed = {u: text for u, text in enumerate(unknowns) if len(text.rstrip("0")) < 12}
    assert len(fixed) == equations.free
    rounded = [float(f"{float(text):.6f}") for text in unknowns]
    again = tableau_of(
        equations, rounded, digits=tableau.digits, fixed=fixed, nearest=1e-4, name=name, label=tableau.label,
        source=tableau.source,
    )  # fmt: skip
    assert (again.kick, again.drift) == (tableau.kick, tableau.drift)
    assert (again.order, again.requires, again.first) == (tableau.order, tableau.requires, tableau.first)


def test_free_parameters_become_short_decimals_from_which_the_rest_follows():
    tableau = max(TABLEAUS, key=lambda t: equations_of(t).free)
    equations, x = equations_of(tableau), [float(text) for text in unknowns_of(tableau)]
    fixed = short_decimals(equations, x, 3)
    assert len(fixed) == equations.free > 1
    solution = polished(equations, x, 40, fixed=fixed, nearest=0.05)
    for u, text in fixed.items():
        assert abs(solution[u] - mpf(text)) < mpf(10) ** -15


def test_newton_that_does_not_converge_says_which_residual_it_reached():
    equations = NystromEquations(8, "kick", 7)
    with pytest.raises(NotConvergedError, match=r"residual of .* away; wanted 1e-40"):
        polished(equations, [3.0] * 7, 40)
