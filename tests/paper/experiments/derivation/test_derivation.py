"""Derived coefficients against closed forms, matrix products, other counts of the same solutions, and the print."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from math import comb, factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import cbrt, mp, mpf

from nearharmonic.exact.newton import Proof, prove
from nearharmonic.integrators import integrators
from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic_paper.experiments.derivation import families as isolated
from nearharmonic_paper.experiments.derivation.conditions import (
    Equations,
    agreeing_decimals,
    eliminate,
    polish,
    reduced_system,
)
from nearharmonic_paper.experiments.derivation.families import PRINTED, UNIQUE, _root, agreement, solve
from nearharmonic_paper.experiments.derivation.search import sample, search
from support.second_opinion.exact_statements import step
from support.second_opinion.methods import Method

pytestmark = pytest.mark.slow

SEED = 20150106


@st.composite
def points(draw):
    """Random conditions with random rational unknowns of three decimals."""
    stages = draw(st.integers(3, 9))
    order = draw(st.integers(3, 10))
    x = draw(st.lists(st.integers(-2000, 2000), min_size=stages - 1, max_size=stages - 1))
    return Equations(stages, order, draw(st.sampled_from(["kick", "drift"]))), [Fraction(n, 1000) for n in x]


# --- the equations ---------------------------------------------------------------------------------------------------


@given(points())
def test_errors_are_those_of_product_of_matrices_in_exact_arithmetic(case):
    equations, x = case
    zeta = [*step(Method(equations.first, *equations.palindromes(x)), 1, -1)[0], *[0] * 10]
    exact = [(1, -1, -1, 1)[n % 4] - factorial(n) * zeta[n] for n in range(1, 11)]
    assert equations.errors(x, 10) == exact
    assert equations.residuals(x) == exact[2 : equations.harmonic_order]


@given(points())
def test_first_two_errors_vanish_for_symmetric_rows_of_sum_one(case):
    equations, x = case
    outer, inner = equations.palindromes(x)
    assert (sum(outer), sum(inner)) == (1, 1)
    assert (outer, inner) == (outer[::-1], inner[::-1])
    assert (len(outer), len(inner)) == (equations.stages + 1, equations.stages)
    assert equations.errors(x, 2) == [0, 0]
    assert equations.halved(outer, inner) == x


@given(points())
def test_the_jacobian_is_the_limit_of_exact_differences(case):
    equations, x = case
    h = Fraction(1, 10**30)
    jacobian = equations.jacobian(x)
    for j in range(equations.unknowns):
        ahead, behind = (equations.residuals([c + s * h * (i == j) for i, c in enumerate(x)]) for s in (1, -1))
        for i, (a, b) in enumerate(zip(ahead, behind, strict=True)):
            # The truncation of a central difference is h^2 times a third derivative, here below 10! 2^10 20^10.
            assert abs((a - b) / (2 * h) - jacobian[i][j]) < Fraction(1, 10**38)


@pytest.mark.parametrize("name", [*UNIQUE, *PRINTED])
def test_printed_sets_solve_position_conditions_but_not_next_order(name):
    tableau = integrators[name]
    equations = Equations(tableau.stages, tableau.harmonic_order, tableau.first)
    errors = equations.errors(equations.tableau_unknowns(tableau), tableau.harmonic_order + 1)
    # 76 decimals, times factorials and coefficients: the worst of the ten leaves 3e-74.
    assert max(map(abs, errors[:-1])) < Fraction(1, 10**73)
    assert abs(errors[-1]) > Fraction(1, 10**4)


@pytest.mark.parametrize("name", ["babps6o5h", "babps8o7h", "babps9o7h", "babs7o7h"])
def test_odd_order_solution_fails_conditions_of_other_role(name):
    # The paper tells BAB from BAB' by this; both kinds solve the position of the kick-first role.
    tableau = integrators[name]
    other = Equations(tableau.stages, tableau.harmonic_order, "drift")
    errors = other.errors(other.tableau_unknowns(tableau), tableau.harmonic_order)
    assert max(map(abs, errors[:-1])) < Fraction(1, 10**73)
    assert abs(errors[-1]) > Fraction(1, 10**4)


def test_conditions_fix_four_printed_sets_but_not_six():
    assert UNIQUE == ("abas5o6h", "abas5o6h_b", "abas5o6h_c", "babs6o7h")
    assert PRINTED == ("babs6o5h", "babps6o5h", "babs7o7h", "babps7o6h", "babps8o7h", "babps9o7h")


# --- all solutions of the isolated cases -----------------------------------------------------------------------------


@pytest.mark.slow
def test_three_stages_give_ruth_and_nothing_else():
    only = solve(Equations(3, 4), RandomStarts(200, SEED, box=2.5, bound=20.0))
    assert only.complete
    assert (only.complex_solutions, only.real_solutions) == (3, 1)
    with mp.workdps(140):
        u = 1 / (2 - cbrt(2))  # Nielsen 2015, Eq. 15
        expected = [u / 2, u]
        derived = [mpf(only.roots[0].outer[0]), mpf(only.roots[0].inner[0])]
        assert max(abs(a - b) for a, b in zip(expected, derived, strict=True)) < mpf(10) ** -128


def test_five_and_six_stages_have_four_and_three_real_solutions(five, six):
    assert (five.complex_solutions, five.real_solutions, len(five.roots), five.complete) == (10, 4, 4, True)
    assert (six.complex_solutions, six.real_solutions, len(six.roots), six.complete) == (15, 3, 3, True)
    assert all(root.proved and root.eliminated and root.hits > 0 for root in (*five.roots, *six.roots))
    assert not five.unfinished


@pytest.mark.slow
def test_seven_stages_have_nine_real_of_thirty_five_solutions():
    seven = solve(Equations(7, 8), RandomStarts(4096, SEED, box=2.5, bound=20.0))
    assert (seven.complex_solutions, seven.real_solutions, len(seven.roots), seven.complete) == (35, 9, 9, True)


@pytest.mark.parametrize("name", UNIQUE)
def test_isolated_sets_of_print_come_out_to_all_its_digits(name, five, six):
    found = agreement(name, [five, six])
    assert found.root is not None
    assert found.decimals == 76


def test_a_changed_digit_of_the_print_is_found(five):
    tableau = integrators["abas5o6h"]
    text = list(tableau.drift[0])
    text[40] = str((int(text[40]) + 1) % 10)
    wrong = replace(tableau, digits=30, drift=("".join(text), *tableau.drift[1:-1], "".join(text)))
    root = next(r for r in five.roots if r.outer[0].startswith("0.1558"))
    assert agreeing_decimals(wrong, root.outer, root.inner) == 30
    assert agreeing_decimals(tableau, root.outer, root.inner) == 76


@pytest.mark.parametrize("stages", [3, 4, 5, 6, 7, 8])
def test_bezout_counts_binomials(stages):
    half = (stages - 1) // 2
    assert reduced_system(Equations(stages, stages + 1)).complex_solutions == comb(stages, half)
    if stages % 2 == 0:
        assert reduced_system(Equations(stages, stages + 1, "drift")).complex_solutions == comb(stages, half + 1)


def test_eliminant_has_real_roots_that_root_finder_sees():
    eliminated = eliminate(Equations(6, 7))
    assert eliminated.simple
    roots = np.roots([float(c) for c in reversed(eliminated.eliminant)])
    # Simple roots of a polynomial of degree 15: in double within 1e-6, and no complex pair lies that close to the axis.
    real = roots[np.abs(roots.imag) < 1e-6]
    assert len(roots) == eliminated.complex_solutions
    assert len(real) == eliminated.real_solutions


@pytest.mark.slow
@pytest.mark.parametrize("first", [pytest.param("kick", marks=pytest.mark.long), "drift"])
def test_elimination_and_search_find_the_same_solutions_for_both_roles(first):
    equations = Equations(6, 7, first)
    # The drift-first case has eight real solutions; rarely hit ones need some thousand starts.
    found = search(equations, RandomStarts(20000, SEED, box=2.5, bound=20.0))
    exact = np.array([[float(c) for c in start] for start in eliminate(equations).starts])
    distances = np.abs(found.points[:, None, :] - exact[None, :, :]).max(axis=2)
    assert distances.shape[0] <= distances.shape[1]
    assert distances.min(axis=1).max() < 1e-8
    if first == "kick":
        assert distances.shape == (3, 3)


def test_solutions_come_most_often_hit_first():
    found = search(Equations(5, 6), RandomStarts(2000, SEED, box=2.5))
    assert list(found.hits) == sorted(found.hits, reverse=True)
    assert sum(found.hits) == found.converged == len(sample(Equations(5, 6), RandomStarts(2000, SEED, box=2.5)))


def test_solution_that_is_counted_but_not_found_leaves_set_incomplete(monkeypatch):
    exact = eliminate(Equations(5, 6))
    more = replace(exact, real_solutions=exact.real_solutions + 1)
    monkeypatch.setattr("nearharmonic_paper.experiments.derivation.families.eliminate", lambda _: more)
    assert not solve(Equations(5, 6), RandomStarts(500, SEED, box=2.5, bound=20.0)).complete
    assert not solve(Equations(5, 6), RandomStarts(500, SEED, box=2.5, bound=20.0), eliminable=0).complete


# --- proofs and digits -----------------------------------------------------------------------------------------------


def test_the_proof_bounds_the_distance_to_the_solution():
    equations = Equations(5, 6)
    start = [float(c) for c in equations.tableau_unknowns(integrators["abas5o6h"])]
    near, exact = polish(equations, start, digits=40), polish(equations, start, digits=120)
    proof = prove(equations.residuals, equations.jacobian, near.unknowns, radius="1e-30")
    assert proof.proved
    with mp.workdps(120):
        apart = max(abs(a - b) for a, b in zip(near.unknowns, exact.unknowns, strict=True))
    assert apart <= proof.distance < mpf(10) ** -30


def test_no_proof_where_there_is_no_solution():
    equations = Equations(5, 6)
    shifted = [c + Fraction(1, 10**8) for c in equations.tableau_unknowns(integrators["abas5o6h"])]
    assert not prove(equations.residuals, equations.jacobian, shifted, radius="1e-9").proved
    ruth = Equations(3, 4)
    assert not prove(ruth.residuals, ruth.jacobian, [Fraction(0), Fraction(0)], radius="1e-3").proved


def test_no_digits_are_written_where_newton_finds_no_solution():
    lost = polish(Equations(4, 5), [0.3, 0.2, 0.4], digits=50)
    assert not lost.converged
    assert (lost.unknowns, lost.outer, lost.inner) == ((), (), ())
    assert lost.residual > 0


def test_candidate_that_does_not_converge_is_reported_with_residual_reached():
    outcome = _root(Equations(4, 5), [0.3, 0.2, 0.4], digits=50, hits=1, eliminated=False)
    assert isinstance(outcome, str)
    assert re.fullmatch(r"\(0\.3\d+, .*\): Newton's method reached a residual of \d.*, not 1e-50", outcome)


def test_candidate_without_proof_is_no_root(monkeypatch, five):
    start = five.equations.halved(*([mpf(c) for c in row] for row in (five.roots[0].outer, five.roots[0].inner)))
    monkeypatch.setattr(isolated, "prove", lambda *_, **__: Proof(False, mpf("1e-3"), mpf(2)))
    outcome = _root(five.equations, start, digits=30, hits=1, eliminated=False)
    assert str(outcome).endswith("no proof within 0.001: the image of Krawczyk's test reaches 2.0")
