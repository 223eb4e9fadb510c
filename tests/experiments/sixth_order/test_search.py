"""The search for order six: word sums against matrices, known methods found again, and what it registered proved."""

from __future__ import annotations

import re
from dataclasses import replace
from math import factorial

import numpy as np
import pytest
from mpmath import eye, log, matrix, mp, mpf, sqrt

from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.experiments.sixth_order import run, tables
from nearharmonic.experiments.sixth_order.cascade import candidates_of, find_solutions, winners
from nearharmonic.experiments.sixth_order.compiled_text import word_sums
from nearharmonic.experiments.sixth_order.conditions import NystromEquations, WordTable, alternating
from nearharmonic.experiments.sixth_order.criterion import TAU_PER_STAGE, criterion_of, system_of
from nearharmonic.experiments.sixth_order.kernels import kernels
from nearharmonic.experiments.sixth_order.registration import (
    NotConvergedError,
    jacobian,
    polished,
    registered,
    residuals,
    short_decimals,
    tableau_of_solution,
)
from nearharmonic.experiments.sixth_order.settings import SixthOrderSettings
from nearharmonic.integrators import integrators
from nearharmonic.integrators.nearharmonic_2026 import TABLEAUS
from nearharmonic.output.job import covered
from nearharmonic.output.provenance import task
from nearharmonic.systems import sho
from nearharmonic.theory.linear_stability import stability_limit
from nearharmonic.theory.order import error_norm, harmonic_order_of
from oracles import oscillator_step

NAMES = [tableau.name for tableau in TABLEAUS]
EVERY = pytest.mark.parametrize("name", NAMES)
FEW = SixthOrderSettings(seed=2, starts=800, walks=4, walk_steps=60)


def equations_of(tableau):
    return NystromEquations(tableau.stages, tableau.first, tableau.harmonic_order)


def unknowns_of(tableau):
    return equations_of(tableau).unknowns_of(tableau.outer, tableau.inner)


def operators_of(tableau):
    """(letter, coefficient) in the order of application, from the decimal strings."""
    letters = "AB" if tableau.first == "drift" else "BA"
    step = [None] * (2 * tableau.stages + 1)
    step[0::2] = [(letters[0], mpf(c)) for c in tableau.outer]
    step[1::2] = [(letters[1], mpf(c)) for c in tableau.inner]
    return step


def word_sum(word, operators):
    """S(word): with the letters as matrices that have ones above the diagonal where they stand in the word, the corner.

    A product of such matrices reaches the corner only along the whole word, letter by letter.
    """
    n, product = len(word), eye(len(word) + 1)
    for letter, c in operators:
        X = matrix(n + 1, n + 1)
        for i in range(n):
            X[i, i + 1] = int(word[i] == letter)
        exponential, power = eye(n + 1), eye(n + 1)
        for k in range(1, n + 1):
            power = power * X * c / k
            exponential += power
        product = product * exponential
    return product[0, n]


def energy_slope(tableau, force, potential, state, tau, steps, speed=lambda p: p, kinetic=lambda p: p * p / 2):
    """log2 of what halving ``tau`` gains in the largest error of the energy, seen at the same instants."""
    q0, p0 = ([mpf(x) for x in row] for row in state)

    def energies(tau, steps):
        q, p, values = q0, p0, []
        for _ in range(steps):
            for letter, c in operators_of(tableau):
                if letter == "A":
                    q = [x + c * tau * speed(v) for x, v in zip(q, p, strict=True)]
                else:
                    p = [v + c * tau * f for v, f in zip(p, force(*q), strict=True)]
            values.append(sum(map(kinetic, p)) + potential(*q))
        return values

    start = sum(map(kinetic, p0)) + potential(*q0)
    coarse = max(abs(H - start) for H in energies(tau, steps))
    fine = max(abs(H - start) for H in energies(tau / 2, 2 * steps)[1::2])
    return log(coarse / fine, 2)


HENON_HEILES = (
    lambda x, y: (-x - 2 * x * y, -y - x * x + y * y),
    lambda x, y: (x * x + y * y) / 2 + x * x * y - y**3 / 3,
    (["0.3", "0.1"], ["0.2", "0.4"]),
)
KEPLER = (
    lambda x, y: (-x / sqrt(x * x + y * y) ** 3, -y / sqrt(x * x + y * y) ** 3),
    lambda x, y: -1 / sqrt(x * x + y * y),
    (["1.2", "0.1"], ["0.1", "0.8"]),
)

# --- equations and kernels --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", ["kick", "drift"])
def test_word_sums_in_doubles_are_corners_of_products_of_matrices(first):
    equations, random = NystromEquations(9, first, 8), np.random.default_rng(5)
    c = np.array(equations.coefficients(list(random.uniform(-0.5, 0.5, 8))), dtype=float)
    table = equations.table
    sums = np.empty(len(table.words))
    word_sums((table.parent, table.letter), equations.letters, c, sums)
    operators = [("AB"[letter], mpf(float(value))) for letter, value in zip(equations.letters, c, strict=True)]
    for word, value in zip(table.words, sums, strict=True):
        assert value == pytest.approx(float(word_sum(word, operators)), abs=1e-12)


def test_a_table_of_words_holds_their_beginnings_and_knows_each_words_parent():
    table = WordTable.of(["AB", "BBA"])
    assert table.words == ("", "A", "B", "AB", "BB", "BBA")
    assert [table.words[parent] for parent in table.parent[1:]] == ["", "", "A", "B", "BB"]


@pytest.mark.parametrize("first", ["kick", "drift"])
@pytest.mark.parametrize("stages", [8, 9])
def test_unknowns_make_palindromes_of_sum_one_and_come_back_from_them(stages, first):
    equations = NystromEquations(stages, first, 7)
    x = [mpf(k + 1) / 16 for k in range(stages - 1)]
    step = equations.coefficients(x)
    for row in (step[0::2], step[1::2]):
        assert row == row[::-1]
        assert sum(row) == 1
    assert equations.unknowns_of(step[0::2], step[1::2]) == x


def test_a_point_that_counts_as_solved_solves_the_equations_in_multiprecision():
    equations, random = NystromEquations(8, "kick", 6), np.random.default_rng(3)
    starts = random.uniform(-1, 1, (100, 7))
    found, solved = np.empty_like(starts), np.zeros(100, np.bool_)
    kernels().solve(system_of(equations), starts, 2.0, found, solved)
    assert 0 < solved.sum() < 100
    for x, claimed in zip(found, solved, strict=True):
        size = max(map(abs, residuals(equations, [mpf(float(u)) for u in x])))
        # Rounding leaves 1e-13 in units of kappa; what is not solved stays in a valley or leaves the box.
        assert (size < 1e-10) == claimed or np.max(np.abs(x)) > 2.0


def test_free_parameters_are_counted_by_the_rank_of_the_derivatives():
    for name in NAMES:
        equations = equations_of(integrators[name])
        with mp.workdps(60):
            J = jacobian(equations, list(map(mpf, unknowns_of(integrators[name]))))
        singular = np.linalg.svd(np.array(J, dtype=float))[1]
        assert len(singular) == equations.harmonic_order == equations.unknowns - equations.free
        # The largest is near 50, and rounding to doubles leaves 1e-14.
        assert singular[-1] > 1e-5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((6, "kick", 6), "stages = 6"),
        ((8, "push", 7), "first = 'push'"),
        ((8, "kick", 8), "harmonic_order = 8"),
        ((8, "kick", 5), "harmonic_order = 5"),
    ],
)
def test_equations_without_solutions_are_refused(arguments, words):
    with pytest.raises(NearharmonicError, match=re.escape(words)):
        NystromEquations(*arguments)


# --- the search -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def seven_and_eight():
    told = []
    findings = find_solutions(FEW, stages=(7, 8), firsts=("kick",), threads=1, report=told.append)
    return findings, told


def test_yoshidas_method_is_found_among_those_of_seven_stages(seven_and_eight):
    # A method of order six for every H is one for quadratic T: Yoshida (1990) is an answer that is known. Here it is a
    # double solution: residuals of 1e-12 leave the square root of that in the unknowns.
    findings, _ = seven_and_eight
    yoshida = integrators["yoshida_s7o6a"].role("kick")
    wanted = np.array(NystromEquations(7, "kick", 6).unknowns_of(*yoshida.rows_double()))
    found = [np.array(c.unknowns) for c in findings.candidates if c.stages == 7]
    assert min(np.max(np.abs(x - wanted)) for x in found) < 1e-5


def test_a_reduced_search_finds_the_isolated_method_that_is_registered(seven_and_eight):
    findings, _ = seven_and_eight
    (best,) = winners(findings)
    tableau = integrators["babs8o6_7h"]
    assert (best.stages, best.first, best.harmonic_order) == (8, "kick", 7)
    assert registered(best, source=tableau.source, digits=tableau.digits) == tableau


def test_the_same_seed_gives_the_same_findings_on_any_number_of_threads(seven_and_eight):
    findings, told = seven_and_eight
    again = find_solutions(FEW, stages=(8, 7), firsts=("kick",), threads=2)
    assert again == findings
    assert len(told) == len(findings.counts) == 3
    other = find_solutions(replace(FEW, seed=3), stages=(7,), firsts=("kick",))
    assert other.counts[0] != findings.counts[0]


def test_winners_are_polished_and_measured_beside_the_methods_asked_for(seven_and_eight, monkeypatch):
    findings, _ = seven_and_eight
    asked = {}
    monkeypatch.setattr(
        run, "find_solutions", lambda settings, **more: asked.update(more, settings=settings) or findings
    )
    monkeypatch.setattr(tables, "MEASURED", [(sho.SYSTEM, (0.3,))])
    with covered(task("experiments.sixth_order.run:search", settings=FEW, integrators=("ruth",))):
        made = run.search(FEW, ("ruth",), 3, print)
    assert asked == {"settings": FEW, "threads": 3, "report": print}
    assert [row[2] for row in made["sixth_order_measured"].rows] == ["Ruth", "BABs8o6,7H"]
    (method,) = made["document"]["method"]
    # The registered file, written by an earlier search.
    assert (method["kick"], method["drift"]) == tuple(
        list(row) for row in (integrators["babs8o6_7h"].kick, integrators["babs8o6_7h"].drift)
    )
    assert len(made["sixth_order_counts"].rows) == len(findings.counts)
    assert len(made["sixth_order_ranking"].rows) == min(40, len(findings.candidates))


def test_counts_add_up(seven_and_eight):
    findings, _ = seven_and_eight
    for count in findings.counts:
        assert count.starts >= count.hits >= count.solutions > 0
        rows = [c for c in findings.candidates if (c.stages, c.harmonic_order) == (count.stages, count.harmonic_order)]
        if count.free == 0:
            assert len(rows) == count.solutions
            assert sum(c.hits for c in rows) == count.hits


def test_candidates_are_solutions_and_come_in_the_order_of_their_merit(seven_and_eight):
    findings, _ = seven_and_eight
    values = [c.merit.value for c in findings.candidates]
    assert values == sorted(values)
    for c in findings.candidates:
        equations = NystromEquations(c.stages, c.first, c.harmonic_order)
        assert max(map(abs, residuals(equations, list(map(mpf, c.unknowns))))) < 1e-10
        assert c.row()["composition"] == "BAB"


def test_a_walk_stays_on_its_family_and_lowers_the_criterion():
    # The isolated method of harmonic order 7 is a point on the family of order 6.
    equations = NystromEquations(8, "kick", 6)
    start = np.array([[float(x) for x in unknowns_of(integrators["babs8o6_7h"])]])
    noise = np.random.default_rng(1).normal(0, 1, (1, 200, equations.unknowns))
    end = start.copy()
    kernels().descend(system_of(equations), criterion_of(equations.stages), 2.0, noise, end)
    (before,), (after,) = candidates_of(equations, start, [0]), candidates_of(equations, end, [0])
    assert after.merit.value < before.merit.value
    assert max(map(abs, residuals(equations, list(map(mpf, after.unknowns))))) < 1e-10


@pytest.mark.parametrize("key", ["starts", "walks", "walk_steps"])
@pytest.mark.parametrize("value", [0, 1.5, True])
def test_an_effort_that_is_no_number_is_refused(key, value):
    with pytest.raises(NearharmonicError, match=f"{key} = {value}"):
        find_solutions(SixthOrderSettings(**({"seed": 1, "starts": 1} | {key: value})))


# --- the criterion ----------------------------------------------------------------------------------------------------


@EVERY
def test_the_criterion_is_made_of_what_other_modules_say_of_a_method(name):
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


@EVERY
def test_the_equations_hold_to_the_registered_digits(name):
    tableau = integrators[name]
    with mp.workdps(120):
        operators = operators_of(tableau)
        allowed = mpf(10) ** (3 - tableau.digits)  # some tens of coefficients of size 1, times derivatives of about 10
        for degree in (1, 3, 5):
            words = lyndon_words(degree)
            errors = [word_sum(word, operators) - mpf(1) / factorial(degree) for word in words]
            for row in conditions(degree, quadratic=True):
                weighted = sum(mpf(w.numerator) / w.denominator * e for w, e in zip(row.weights, errors, strict=True))
                assert abs(weighted) < allowed
        for n in range(7, tableau.harmonic_order + 1):
            assert abs(word_sum(alternating(n), operators) - mpf(1) / factorial(n)) < allowed
        beyond = alternating(tableau.harmonic_order + 1)
        assert abs(word_sum(beyond, operators) - mpf(1) / factorial(len(beyond))) > 1e-12


@EVERY
def test_newton_from_six_digits_comes_to_the_registered_digits(name):
    tableau = integrators[name]
    equations, unknowns = equations_of(tableau), unknowns_of(tableau)
    fixed = {u: text for u, text in enumerate(unknowns) if len(text.rstrip("0")) < 12}
    assert len(fixed) == equations.free
    rounded = [mpf(f"{float(text):.6f}") for text in unknowns]
    solution = polished(equations, rounded, fixed=fixed, digits=tableau.digits + 4)
    again = tableau_of_solution(
        equations, solution, name=name, label=tableau.label, source=tableau.source, digits=tableau.digits
    )
    assert (again.kick, again.drift) == (tableau.kick, tableau.drift)
    assert (again.order, again.requires, again.first) == (tableau.order, tableau.requires, tableau.first)


@EVERY
def test_energy_errors_are_of_order_six_on_henon_heiles_and_kepler(name):
    # What the next error term leaves of a slope at steps of 2^-8 is tau^2 times a ratio of order 10^2: below 0.05.
    with mp.workdps(60):
        for force, potential, state in (HENON_HEILES, KEPLER):
            slope = energy_slope(integrators[name], force, potential, state, mpf(2) ** -8, 16)
            assert slope == pytest.approx(6, abs=0.05)


@EVERY
def test_without_quadratic_kinetic_energy_the_order_is_four(name):
    force, potential, state = HENON_HEILES
    with mp.workdps(60):
        slope = energy_slope(
            integrators[name],
            force,
            potential,
            state,
            mpf(2) ** -8,
            16,
            speed=lambda p: p + p**3,
            kinetic=lambda p: p * p / 2 + p**4 / 4,
        )
    assert slope == pytest.approx(4, abs=0.05)


@EVERY
def test_the_harmonic_order_is_the_one_in_the_name(name):
    tableau = integrators[name]
    composition = "bab" if tableau.first == "kick" else "aba"
    assert name == f"{composition}s{tableau.stages}o6_{tableau.harmonic_order}h"
    assert harmonic_order_of(tableau) == tableau.harmonic_order


def test_free_parameters_become_short_decimals_from_which_the_rest_follows():
    tableau = max(TABLEAUS, key=lambda t: equations_of(t).free)
    equations, x = equations_of(tableau), [float(text) for text in unknowns_of(tableau)]
    fixed = short_decimals(equations, x, 3)
    assert len(fixed) == equations.free > 1
    solution = polished(equations, x, fixed=fixed, digits=40)
    for u, text in fixed.items():
        assert abs(solution[u] - mpf(text)) < mpf(10) ** -15
    assert max(abs(a - b) for a, b in zip(solution, x, strict=True)) < 0.05


def test_newton_that_does_not_converge_says_which_residual_it_reached():
    equations = NystromEquations(8, "kick", 7)
    with pytest.raises(NotConvergedError, match=r"residual of .*, wanted 1e-40"):
        polished(equations, [mpf(3)] * 7, digits=40)
    with pytest.raises(NotConvergedError, match="0 unknowns are fixed, and 1 are free"):
        polished(NystromEquations(9, "kick", 7), [mpf(1)] * 8)
