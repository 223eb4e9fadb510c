"""The derivation: conditions, elimination, search, simplex, families, and what is tabulated of them."""

import re
import tomllib
from dataclasses import replace
from fractions import Fraction
from math import comb, factorial, isnan

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st
from mpmath import cbrt, mp, mpf

from nearharmonic.engine.trajectory import sweep
from nearharmonic.exact.polynomials import Proof
from nearharmonic.integrators import integrators
from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic.theory.oscillator import harmonic_energy_error
from nearharmonic_paper.experiments.derivation import families
from nearharmonic_paper.experiments.derivation import families as isolated
from nearharmonic_paper.experiments.derivation.experiment import DerivationSettings
from nearharmonic_paper.experiments.derivation.run import derive, solution_errors
from nearharmonic_paper.experiments.derivation.search import (
    Equations,
    Simplex,
    _Objective,
    agreeing_decimals,
    eliminate,
    minimise,
    polish,
    promising_starts,
    reduced_system,
    sample,
    search,
)
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import task
from support.second_opinion.exact_statements import step
from support.second_opinion.methods import Method

# --- Derived coefficients against closed forms, matrix products, other counts of the same solutions, and the print.


pytestmark = pytest.mark.slow

SEED = 20150106


@pytest.fixture(scope="module")
def five():
    return families.solve(Equations(5, 6), RandomStarts(4000, SEED, box=2.5, bound=20.0))


@pytest.fixture(scope="module")
def six():
    return families.solve(Equations(6, 7), RandomStarts(8000, SEED, box=2.5, bound=20.0))


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


@pytest.mark.parametrize("name", [*families.UNIQUE, *families.PRINTED])
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
    assert families.UNIQUE == ("abas5o6h", "abas5o6h_b", "abas5o6h_c", "babs6o7h")
    assert families.PRINTED == ("babs6o5h", "babps6o5h", "babs7o7h", "babps7o6h", "babps8o7h", "babps9o7h")


# --- all solutions of the isolated cases -----------------------------------------------------------------------------


def test_three_stages_give_ruth_and_nothing_else():
    only = families.solve(Equations(3, 4), RandomStarts(200, SEED, box=2.5, bound=20.0))
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


def test_seven_stages_have_nine_real_of_thirty_five_solutions():
    seven = families.solve(Equations(7, 8), RandomStarts(4096, SEED, box=2.5, bound=20.0))
    assert (seven.complex_solutions, seven.real_solutions, len(seven.roots), seven.complete) == (35, 9, 9, True)


@pytest.mark.parametrize("name", families.UNIQUE)
def test_isolated_sets_of_print_come_out_to_all_its_digits(name, five, six):
    found = families.agreement(name, [five, six])
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
    monkeypatch.setattr("nearharmonic_paper.experiments.derivation.search.eliminate", lambda _: more)
    assert not families.solve(Equations(5, 6), RandomStarts(500, SEED, box=2.5, bound=20.0)).complete
    assert not families.solve(Equations(5, 6), RandomStarts(500, SEED, box=2.5, bound=20.0), eliminable=0).complete


# --- proofs and digits -----------------------------------------------------------------------------------------------


def test_candidate_that_does_not_converge_is_reported_with_residual_reached():
    outcome = families._root(Equations(4, 5), [0.3, 0.2, 0.4], digits=50, hits=1, eliminated=False)
    assert isinstance(outcome, str)
    assert re.fullmatch(r"\(0\.3\d+, .*\): Newton's method reached a residual of \d.*, not 1e-50", outcome)


def test_candidate_without_proof_is_no_root(monkeypatch, five):
    start = five.equations.halved(*([mpf(c) for c in row] for row in (five.roots[0].outer, five.roots[0].inner)))
    monkeypatch.setattr(isolated, "prove", lambda *_, **__: Proof(False, mpf("1e-3"), mpf(2)))
    outcome = families._root(five.equations, start, digits=30, hits=1, eliminated=False)
    assert str(outcome).endswith("no proof within 0.001: the image of Krawczyk's test reaches 2.0")


# --- Families of solutions, the paper's route, the growth with stages, and the derivation as a whole.


# --- families --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "free"),
    [("babs6o5h", 2), ("babps6o5h", 2), ("babs7o7h", 1), ("babps7o6h", 2), ("babps8o7h", 2), ("babps9o7h", 3)],
)
def test_other_sets_lie_in_families_to_printed_digits(name, free):
    point = families.printed_point(name)
    # Half of 2s + 1 coefficients less two sums, less lambda - 2 conditions, if these are independent.
    tableau = integrators[name]
    assert point.free_parameters == free == tableau.stages - 1 - (tableau.harmonic_order - 2)
    assert point.proof.proved
    assert point.continued.converged
    assert point.continued.residual < mpf(10) ** -128
    # One coefficient of BAB's8o7H is printed ten units of its last decimal off.
    assert point.decimals == (75 if name == "babps8o7h" else 76)


def test_rank_of_printed_set_is_that_among_members_of_its_family():
    (ranking,) = families.rank_printed(["babs7o7h"], RandomStarts(1000, SEED, bound=5.0))
    assert ranking.members > 50
    # Numbers of the printed set itself, from its strings.
    tableau = integrators["babs7o7h"]
    assert ranking.sum_of_absolute_values == pytest.approx(sum(abs(float(c)) for c in tableau.kick + tableau.drift))
    assert ranking.smaller_sum < 0.05
    assert ranking.better_in_all <= round(min(ranking.smaller_sum, *ranking.smaller_higher) * ranking.members)
    assert min(ranking.sum_slope, ranking.higher_slope) > 1e-3
    assert ranking.nearest < 0.1


def test_members_of_a_family_solve_its_conditions():
    equations = Equations(8, 7)
    members = sample(equations, RandomStarts(300, SEED))
    assert len(members) > 30
    # Double precision: rounding of 1e-16 times 7! and coefficients up to 10.
    assert max(max(map(abs, equations.residuals(x))) for x in members.tolist()) < 1e-7


# --- the simplex, growth and the whole -------------------------------------------------------------------------------


def test_the_simplex_reaches_the_root_that_newton_reaches():
    equations = Equations(5, 6)
    start = [float(c) + 0.03 for c in equations.tableau_unknowns(integrators["abas5o6h_c"])]
    outcome = minimise(equations, start, seed=1, settings=Simplex(bits=256, digits=40, evaluations=20_000))
    assert outcome.converged
    assert outcome.kappa_max < mpf(10) ** -40
    exact = polish(equations, start, digits=60)
    assert max(abs(a - b) for a, b in zip(outcome.unknowns, exact.unknowns, strict=True)) < mpf(10) ** -36


@pytest.mark.parametrize("first", ["kick", "drift"])
@pytest.mark.parametrize(("stages", "order"), [(5, 6), (6, 7), (7, 8)])
def test_the_simplex_descends_on_the_largest_of_the_errors(stages, order, first):
    equations = Equations(stages, order, first)
    x = [Fraction(2 * i + 3, 32) * (-1) ** (i // 2) for i in range(equations.unknowns)]
    found = Fraction(int(_Objective(equations, 200)([int(c * 2**200) for c in x])), 2**200)
    # Some sixty products are cut off at 2^-200 each, and the last power of tau is multiplied by 8!, below 2^16.
    assert abs(found - max(map(abs, equations.errors(x, order)))) < Fraction(1, 2**176)


@pytest.mark.long
def test_promising_random_start_leads_simplex_to_root(five):
    """One in a few hundred random points; nothing of a root is known to the simplex."""
    (start, *_) = promising_starts(five.equations, starts=200, seed=1)
    outcome = minimise(five.equations, start, seed=1, settings=Simplex(bits=192, digits=30, evaluations=40_000))
    assert outcome.converged
    roots = [five.equations.halved(root.outer, root.inner) for root in five.roots]
    apart = [max(abs(a - mpf(b)) for a, b in zip(outcome.unknowns, root, strict=True)) for root in roots]
    assert min(apart) < mpf("1e-25")


def test_each_stage_from_five_adds_harmonic_order_and_two_powers():
    reached = families.reach(range(3, 8), RandomStarts(2000, SEED, bound=20.0), known={})
    assert [r.harmonic_order for r in reached] == [4, 4, 6, 7, 8]
    assert [r.lambda_max for r in reached] == [6, 8, 10, 12, 14]
    assert all(r.proved_largest for r in reached)


FEW = DerivationSettings(
    seed=3, starts=300, family_starts=50, growth_starts=100, growth_stages=(3, 4), simplex_stages=()
)


@pytest.fixture(scope="module")
def twice():
    """Two derivations with the same settings."""
    with covered(task("nearharmonic_paper.experiments.derivation.run:derive", settings=FEW)):
        return [derive(FEW, digits=60) for _ in range(2)]


def test_same_seed_gives_same_table(twice):
    first, second = twice
    assert first["document"] == second["document"]
    assert {a["name"]: a["decimals"] for a in first["document"]["agreements"]} == dict.fromkeys(families.UNIQUE, 60)
    other = search(Equations(5, 6), RandomStarts(300, 4, box=2.5))
    assert other.hits != search(Equations(5, 6), RandomStarts(300, 3, box=2.5)).hits


def test_what_is_derived_is_tabulated_and_documented(twice):
    made, _ = twice
    printed = made["table4_derived"].rows
    assert len({row[0] for row in printed}) == len(families.UNIQUE) + len(families.PRINTED)
    fixed = {integrators[name].label for name in families.UNIQUE}
    # Derived to 60 decimals; where the next ones of the print are zeros it agrees further.
    assert all(60 <= row[-1] < 65 for row in printed if row[0] in fixed)
    rows = {stem: len(made[stem].rows) for stem in made if stem not in {"document", "table4_derived"}}
    # 4 + 3 + 9 real solutions of three cases, six sets in families; 4 solutions in 2 roles at 3 step sizes.
    assert rows == {
        "derived_solutions": 16, "derived_counts": 3, "derived_families": 6, "derived_orders": 2, "derived_routes": 3,
        "derived_errors": 24,
    }  # fmt: skip
    text = tomli_w.dumps(made["document"])
    assert tomllib.loads(text) == made["document"]
    assert "seconds" not in text
    assert (made["document"]["seed"], made["document"]["digits"], len(made["document"]["isolated"])) == (3, 60, 3)


def test_the_fourth_solution_has_the_largest_errors_of_the_four(five):
    table = solution_errors(five, [0.05])
    assert [row[:3] for row in table.rows] == [(n, first, 0.05) for n in (1, 2, 3, 4) for first in ("drift", "kick")]
    errors = {row[:2]: row[3:] for row in table.rows}
    for first in ("drift", "kick"):
        of_role = [errors[n, first] for n in (1, 2, 3, 4)]
        assert of_role[-1] == tuple(map(max, zip(*of_role, strict=True)))
    assert not any(isnan(henon_heiles) for _, henon_heiles in errors.values())
    # Solution 2 is the registered set A: five stages of 0.05 are a step of 0.25.
    registered = sweep("henon_heiles", "abas5o6h", [0.25]).max_energy_error.values[0]
    oscillator, henon_heiles = errors[2, "drift"]
    assert henon_heiles == pytest.approx(registered, rel=1e-9)
    assert oscillator == pytest.approx(float(harmonic_energy_error("abas5o6h", 0.25)))
