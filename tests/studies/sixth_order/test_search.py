"""The search for order six: word sums against matrices, known methods found again, and the same from the same seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp, mpf

from nearharmonic.integrators import integrators
from nearharmonic.integrators.nearharmonic_2026 import TABLEAUS
from nearharmonic.systems import sho
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import task
from nearharmonic_studies.sixth_order import search as run
from nearharmonic_studies.sixth_order.search import (
    NystromEquations,
    Walk,
    candidates_of,
    coefficients,
    criterion_of,
    descend,
    find_solutions,
    registered,
    solve,
    system_of,
    winners,
)
from nearharmonic_studies.sixth_order.search import jacobian as derivatives
from nearharmonic_studies.sixth_order.settings import SixthOrderSettings
from support.oracles.nystrom_steps import equations_of, unknowns_of

pytestmark = pytest.mark.slow

NAMES = [tableau.name for tableau in TABLEAUS]
FEW = SixthOrderSettings(seed=2, starts=800, walks=4, walk_steps=60)


# --- equations and kernels --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", ["kick", "drift"])
@pytest.mark.parametrize("stages", [8, 9])
def test_unknowns_give_palindromes_of_sum_one_and_back(stages, first):
    equations = NystromEquations(stages, first, 7)
    x = [mpf(k + 1) / 16 for k in range(stages - 1)]
    step = [number for _, number in equations.step(x)]
    for row in (step[0::2], step[1::2]):
        assert row == row[::-1]
        assert sum(row) == 1
    assert equations.halved(step[0::2], step[1::2]) == x


@pytest.mark.slow
def test_point_that_counts_as_solved_solves_equations_in_multiprecision():
    equations, random = NystromEquations(8, "kick", 6), np.random.default_rng(3)
    found, solved = solve(system_of(equations), random.uniform(-1, 1, (100, 7)), 2.0)
    assert 0 < solved.sum() < 100
    for x, claimed in zip(found, solved, strict=True):
        size = max(map(abs, equations.residuals([mpf(float(u)) for u in x])))
        # Rounding leaves 1e-13 in units of kappa; what is not solved stays in a valley or leaves the box.
        assert (size < 1e-10) == claimed or np.max(np.abs(x)) > 2.0


def test_start_beyond_bound_is_given_up_where_it_stands():
    equations, start = NystromEquations(8, "kick", 6), np.full((1, 7), 0.5)
    found, solved = solve(system_of(equations), start, 0.4)
    assert found.tolist() == start.tolist()
    assert not solved[0]


@pytest.mark.parametrize("first", ["kick", "drift"])
def test_derivatives_agree_with_multiprecision_differences(first):
    equations = NystromEquations(9, first, 8)
    x = np.random.default_rng(4).uniform(-0.5, 0.5, 8)
    system = system_of(equations)
    found = derivatives(system, x, coefficients(system, x))
    # Terms of up to 5000 in units of kappa_7, with some roundings each.
    assert found == pytest.approx(np.array(equations.slopes(list(map(mpf, x))), dtype=float), rel=1e-10, abs=1e-10)


def test_free_parameters_are_counted_by_the_rank_of_the_derivatives():
    for name in NAMES:
        equations = equations_of(integrators[name])
        with mp.workdps(60):
            J = equations.slopes(list(map(mpf, unknowns_of(integrators[name]))))
        singular = np.linalg.svd(np.array(J, dtype=float))[1]
        assert len(singular) == equations.harmonic_order == equations.unknowns - equations.free
        # The largest is near 50, and rounding to doubles leaves 1e-14.
        assert singular[-1] > 1e-5


# --- the search -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def findings():
    return find_solutions(FEW, stages=(7, 8), firsts=("kick",), threads=1)


@pytest.mark.slow
def test_yoshidas_method_is_found_among_those_of_seven_stages(findings):
    # A method of order six for every H is one for quadratic T: Yoshida (1990) is an answer that is known. Here it is a
    # double solution: residuals of 1e-12 leave the square root of that in the unknowns.
    yoshida = integrators["yoshida_s7o6a"].role("kick")
    wanted = np.array(NystromEquations(7, "kick", 6).halved(*yoshida.rows_double()))
    found = [np.array(c.unknowns) for c in findings.candidates if c.stages == 7]
    assert min(np.max(np.abs(x - wanted)) for x in found) < 1e-5


def test_a_reduced_search_finds_the_isolated_method_that_is_registered(findings):
    (best,) = winners(findings)
    tableau = integrators["babs8o6_7h"]
    assert (best.stages, best.first, best.harmonic_order) == (8, "kick", 7)
    assert registered(best, source=tableau.source, digits=tableau.digits) == tableau


def test_same_seed_gives_same_findings_on_any_number_of_threads(findings):
    again = find_solutions(FEW, stages=(8, 7), firsts=("kick",), threads=2)
    assert again == findings
    assert len(findings.counts) == 3
    other = find_solutions(replace(FEW, seed=3), stages=(7,), firsts=("kick",))
    assert other.counts[0] != findings.counts[0]


def test_winners_are_polished_and_measured_beside_the_methods_asked_for(findings, monkeypatch):
    asked = {}
    monkeypatch.setattr(
        run, "find_solutions", lambda settings, **more: asked.update(more, settings=settings) or findings
    )
    monkeypatch.setattr(run, "MEASURED", [(sho.SYSTEM, (0.3,))])
    with covered(task("nearharmonic_studies.sixth_order.search:search", settings=FEW, integrators=("ruth",))):
        made = run.search(FEW, ("ruth",), 3)
    assert asked == {"settings": FEW, "threads": 3}
    assert [row[2] for row in made["sixth_order_measured"].rows] == ["Ruth", "6A8", "BABs8o6,7H"]
    (method,) = made["document"]["method"]
    # The registered file, written by an earlier search.
    assert (method["kick"], method["drift"]) == tuple(
        list(row) for row in (integrators["babs8o6_7h"].kick, integrators["babs8o6_7h"].drift)
    )
    assert len(made["sixth_order_counts"].rows) == len(findings.counts)
    assert len(made["sixth_order_ranking"].rows) == min(40, len(findings.candidates))


def test_candidates_are_solutions_and_come_in_order_of_their_merit(findings):
    values = [c.merit.value for c in findings.candidates]
    assert values == sorted(values)
    for c in findings.candidates:
        equations = NystromEquations(c.stages, c.first, c.harmonic_order)
        assert max(map(abs, equations.residuals(list(map(mpf, c.unknowns))))) < 1e-10
        assert c.row()["composition"] == "BAB"


def test_a_walk_stays_on_its_family_and_lowers_the_criterion():
    # The isolated method of harmonic order 7 is a point on the family of order 6.
    equations = NystromEquations(8, "kick", 6)
    start = np.array([[float(x) for x in unknowns_of(integrators["babs8o6_7h"])]])
    noise = np.random.default_rng(1).normal(0, 1, (1, 200, equations.unknowns))
    end = descend(system_of(equations), criterion_of(equations.stages), 2.0, Walk(), noise, start)
    (before,), (after,) = candidates_of(equations, start, [0]), candidates_of(equations, end, [0])
    assert after.merit.value < before.merit.value
    assert max(map(abs, equations.residuals(list(map(mpf, after.unknowns))))) < 1e-10
