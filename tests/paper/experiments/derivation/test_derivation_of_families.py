"""Families of solutions, the paper's route, the growth with stages, and the derivation as a whole."""

from __future__ import annotations

import tomllib
from fractions import Fraction
from math import isnan

import pytest
import tomli_w
from mpmath import mpf

from nearharmonic.engine.trajectory import sweep
from nearharmonic.exact.newton import rank_and_pivots
from nearharmonic.integrators import integrators
from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic.theory.oscillator import harmonic_energy_error
from nearharmonic_paper.experiments.derivation.conditions import Equations, polish
from nearharmonic_paper.experiments.derivation.families import PRINTED, UNIQUE, printed_point, rank_printed, reach
from nearharmonic_paper.experiments.derivation.run import derive
from nearharmonic_paper.experiments.derivation.search import sample, search
from nearharmonic_paper.experiments.derivation.settings import DerivationSettings
from nearharmonic_paper.experiments.derivation.simplex import Simplex, _Objective, minimise, promising_starts
from nearharmonic_paper.experiments.derivation.tables import solution_errors
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import task

pytestmark = pytest.mark.slow

SEED = 20150106


# --- families --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "free"),
    [("babs6o5h", 2), ("babps6o5h", 2), ("babs7o7h", 1), ("babps7o6h", 2), ("babps8o7h", 2), ("babps9o7h", 3)],
)
def test_other_sets_lie_in_families_to_printed_digits(name, free):
    point = printed_point(name)
    # Half of 2s + 1 coefficients less two sums, less lambda - 2 conditions, if these are independent.
    tableau = integrators[name]
    assert point.free_parameters == free == tableau.stages - 1 - (tableau.harmonic_order - 2)
    assert point.proof.proved
    assert point.continued.converged
    assert point.continued.residual < mpf(10) ** -128
    # One coefficient of BAB's8o7H is printed ten units of its last decimal off.
    assert point.decimals == (75 if name == "babps8o7h" else 76)


def test_the_rank_drops_where_two_unknowns_act_alike():
    # With every coefficient but the centres 0 the step is Strang's, and outer unknowns cannot be told from inner ones.
    rank, pivots = rank_and_pivots(Equations(7, 8).jacobian, [Fraction(0)] * 6)
    assert rank == len(pivots) < 6


def test_rank_of_printed_set_is_that_among_members_of_its_family():
    (ranking,) = rank_printed(["babs7o7h"], RandomStarts(1000, SEED, bound=5.0))
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
    reached = reach(range(3, 8), RandomStarts(2000, SEED, bound=20.0), known={})
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


@pytest.mark.slow
def test_same_seed_gives_same_table(twice):
    first, second = twice
    assert first["document"] == second["document"]
    assert {a["name"]: a["decimals"] for a in first["document"]["agreements"]} == dict.fromkeys(UNIQUE, 60)
    other = search(Equations(5, 6), RandomStarts(300, 4, box=2.5))
    assert other.hits != search(Equations(5, 6), RandomStarts(300, 3, box=2.5)).hits


def test_what_is_derived_is_tabulated_and_documented(twice):
    made, _ = twice
    printed = made["table4_derived"].rows
    assert len({row[0] for row in printed}) == len(UNIQUE) + len(PRINTED)
    fixed = {integrators[name].label for name in UNIQUE}
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
