"""The search for order six: equations and criterion against other modules, known methods found again, tables."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest
import xarray as xr
from mpmath import matrix, mp, mpf, sqrt

from nearharmonic.integrators import integrators
from nearharmonic.integrators.nearharmonic_2026 import TABLEAUS
from nearharmonic.systems import kepler, sho
from nearharmonic.theory.order import error_norm
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic.training.objective import polished, tableau_of
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import task
from nearharmonic_studies.sixth_order import search
from nearharmonic_studies.sixth_order import search as run
from nearharmonic_studies.sixth_order.settings import SixthOrderSettings
from support.oracles.nystrom_steps import equations_of, unknowns_of
from support.oracles.reference_solutions import oscillator_step

# --- The search for order six: word sums against matrices, known methods found again, and the same from the same seed.

NAMES = [tableau.name for tableau in TABLEAUS]
FEW = SixthOrderSettings(seed=2, starts=800, walks=4, walk_steps=60)


# --- equations and kernels --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_point_that_counts_as_solved_solves_equations_in_multiprecision():
    equations, random = search.NystromEquations(8, "kick", 6), np.random.default_rng(3)
    found, solved = search.solve(search.system_of(equations), random.uniform(-1, 1, (100, 7)), 2.0)
    assert 0 < solved.sum() < 100
    for x, claimed in zip(found, solved, strict=True):
        size = max(map(abs, equations.residuals([mpf(float(u)) for u in x])))
        # Rounding leaves 1e-13 in units of kappa; what is not solved stays in a valley or leaves the box.
        assert (size < 1e-10) == claimed or np.max(np.abs(x)) > 2.0


@pytest.mark.slow
def test_start_beyond_bound_is_given_up_where_it_stands():
    equations, start = search.NystromEquations(8, "kick", 6), np.full((1, 7), 0.5)
    found, solved = search.solve(search.system_of(equations), start, 0.4)
    assert found.tolist() == start.tolist()
    assert not solved[0]


@pytest.mark.slow
@pytest.mark.parametrize("first", ["kick", "drift"])
def test_derivatives_agree_with_multiprecision_differences(first):
    equations = search.NystromEquations(9, first, 8)
    x = np.random.default_rng(4).uniform(-0.5, 0.5, 8)
    system = search.system_of(equations)
    found = search.jacobian(system, x, search.coefficients(system, x))
    # Terms of up to 5000 in units of kappa_7, with some roundings each.
    assert found == pytest.approx(np.array(equations.slopes(list(map(mpf, x))), dtype=float), rel=1e-10, abs=1e-10)


@pytest.mark.slow
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
    return search.find_solutions(FEW, stages=(7, 8), firsts=("kick",), threads=1)


@pytest.mark.slow
def test_yoshidas_method_is_found_among_those_of_seven_stages(findings):
    # A method of order six for every H is one for quadratic T: Yoshida (1990) is an answer that is known. Here it is a
    # double solution: residuals of 1e-12 leave the square root of that in the unknowns.
    yoshida = integrators["yoshida_s7o6a"].role("kick")
    wanted = np.array(search.NystromEquations(7, "kick", 6).halved(*yoshida.rows_double()))
    found = [np.array(c.unknowns) for c in findings.candidates if c.stages == 7]
    assert min(np.max(np.abs(x - wanted)) for x in found) < 1e-5


@pytest.mark.slow
def test_a_reduced_search_finds_the_isolated_method_that_is_registered(findings):
    (best,) = search.winners(findings)
    tableau = integrators["babs8o6_7h"]
    assert (best.stages, best.first, best.harmonic_order) == (8, "kick", 7)
    assert search.registered(best, source=tableau.source, digits=tableau.digits) == tableau


@pytest.mark.slow
def test_same_seed_gives_same_findings_on_any_number_of_threads(findings):
    again = search.find_solutions(FEW, stages=(8, 7), firsts=("kick",), threads=2)
    assert again == findings
    assert len(findings.counts) == 3
    other = search.find_solutions(replace(FEW, seed=3), stages=(7,), firsts=("kick",))
    assert other.counts[0] != findings.counts[0]


@pytest.mark.slow
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


@pytest.mark.slow
def test_candidates_are_solutions_and_come_in_order_of_their_merit(findings):
    values = [c.merit.value for c in findings.candidates]
    assert values == sorted(values)
    for c in findings.candidates:
        equations = search.NystromEquations(c.stages, c.first, c.harmonic_order)
        assert max(map(abs, equations.residuals(list(map(mpf, c.unknowns))))) < 1e-10
        assert c.row()["composition"] == "BAB"


@pytest.mark.slow
def test_a_walk_stays_on_its_family_and_lowers_the_criterion():
    # The isolated method of harmonic order 7 is a point on the family of order 6.
    equations = search.NystromEquations(8, "kick", 6)
    start = np.array([[float(x) for x in unknowns_of(integrators["babs8o6_7h"])]])
    noise = np.random.default_rng(1).normal(0, 1, (1, 200, equations.unknowns))
    end = search.descend(
        search.system_of(equations), search.criterion_of(equations.stages), 2.0, search.Walk(), noise, start
    )
    (before,), (after,) = search.candidates_of(equations, start, [0]), search.candidates_of(equations, end, [0])
    assert after.merit.value < before.merit.value
    assert max(map(abs, equations.residuals(list(map(mpf, after.unknowns))))) < 1e-10


# --- Methods of the search for order six: its criterion agrees with other modules, its digits solve the equations.

NAMES = [tableau.name for tableau in TABLEAUS]
EVERY = pytest.mark.parametrize("name", NAMES)


# --- the criterion ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@EVERY
def test_criterion_is_made_of_what_other_modules_say_of_method(name):
    tableau = integrators[name]
    unknowns = np.array([[float(x) for x in unknowns_of(tableau)]])
    (candidate,) = search.candidates_of(equations_of(tableau), unknowns, [0])
    merit, tau = candidate.merit, mpf(tableau.stages) * search.TAU_PER_STAGE
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
    point = np.array([[float(x) for x in unknowns_of(tableau)]])
    (candidate,) = search.candidates_of(equations_of(tableau), point, [0])
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
    fixed = search.short_decimals(equations, x, 3)
    assert len(fixed) == equations.free > 1
    solution = polished(equations, x, 40, fixed=fixed, nearest=0.05)
    for u, text in fixed.items():
        assert abs(solution[u] - mpf(text)) < mpf(10) ** -15


# --- Tables of the search: errors and ranks of the measured methods, and lines of counts and candidates.

METHODS = [integrators[name] for name in ("ruth", "leapfrog", "babs7o7h")]
#: Errors of the methods by the stages that tell them apart: ruth the worst, then the best; the last diverges.
ERRORS = {3: [1e-2, 1e-9], 1: [1e-3, 1e-5], 7: [2e-3, np.inf]}


@pytest.fixture
def asked(monkeypatch):
    """Arguments of :func:`sweep`, which returns the errors above."""
    calls = []

    def sweep(system, tableau, taus, *, precision):
        calls.append((system.name, tableau.name, tuple(taus), precision))
        errors = np.array(ERRORS[tableau.stages])
        return xr.Dataset({"max_energy_error": ("tau", errors), "mean_energy_error": ("tau", errors / 4)})

    monkeypatch.setattr(run, "sweep", sweep)
    monkeypatch.setattr(run, "MEASURED", [(kepler.SYSTEM, (30.0, 5.0))])
    return calls


def test_smallest_error_has_rank_one_and_diverged_method_the_last(asked):
    table = run.measured(METHODS)
    assert table.header[-3:] == ("max energy error", "mean energy error", "rank by maximum")
    assert table.rows == [
        ("Sun-Mercury system", 30.0, "Ruth", 4, 1e-2, 0.25e-2, 3),
        ("Sun-Mercury system", 30.0, "Leapfrog", 2, 1e-3, 0.25e-3, 1),
        ("Sun-Mercury system", 30.0, "BABs7o7H", 4, 2e-3, 0.5e-3, 2),
        ("Sun-Mercury system", 5.0, "Ruth", 4, 1e-9, 0.25e-9, 1),
        ("Sun-Mercury system", 5.0, "Leapfrog", 2, 1e-5, 0.25e-5, 2),
        ("Sun-Mercury system", 5.0, "BABs7o7H", 4, np.inf, np.inf, 3),
    ]


def test_measured_error_is_that_of_steps_taken_one_by_one(monkeypatch):
    """The leapfrog with tau = 0.3 from (1, 0) over [0, 500]: 1667 steps, in doubles, which round by 1e-13 of H0."""
    monkeypatch.setattr(run, "MEASURED", [(sho.SYSTEM, (0.3,))])
    ((_, _, _, _, largest, mean, _),) = run.measured([integrators["leapfrog"]]).rows
    q, p, tau, errors = 1.0, 0.0, 500 / 1667, []
    for _ in range(1667):
        p -= tau / 2 * q
        q += tau * p
        p -= tau / 2 * q
        errors.append(abs(q * q + p * p - 1))
    assert largest == pytest.approx(max(errors), rel=1e-9)
    assert mean == pytest.approx(sum(errors) / 1667, rel=1e-9)
