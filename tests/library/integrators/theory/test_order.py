"""Orders and error norms of methods against closed forms and other people's methods."""

import random
from decimal import Decimal, localcontext
from fractions import Fraction
from math import sqrt

import numpy as np
import pytest
from mpmath import mp, mpf, nstr

from nearharmonic.errors import SettingError
from nearharmonic.exact import lie
from nearharmonic.exact.words import SQUARE, logarithm, words
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory import order as theory
from nearharmonic.theory.order_conditions import step_of, tolerance
from nearharmonic.theory.oscillator import ShiftedKick, shifted_kicks
from support.methods.ten_methods import EVERY_METHOD
from support.oracles.reference_solutions import oscillator_step


def method(name, first, outer, inner, digits, order=2):
    kick, drift = (outer, inner) if first == "kick" else (inner, outer)
    return Tableau(name=name, order=order, first=first, kick=kick, drift=drift, digits=digits, source="these tests")


LEAPFROGS = {first: method("leapfrog", first, ("0.5", "0.5"), ("1",), 50) for first in ("kick", "drift")}


def composed(base, order, digits=60):
    """Yoshida's triple jump: the composition of three steps of ``base`` that has the order ``order`` + 2."""
    with mp.workdps(digits + 20):
        root = mpf(2) ** (mpf(1) / (order + 1))
        weights = [1 / (2 - root), -root / (2 - root), 1 / (2 - root)]
        outer, inner = ([mpf(c) for c in row] for row in (base.outer, base.inner))
        steps = [[w * c for c in outer] for w in weights]
        joined = steps[0]
        for step in steps[1:]:
            joined = [*joined[:-1], joined[-1] + step[0], *step[1:]]
        inners = [w * c for w in weights for c in inner]
        rows = [
            tuple(nstr((a + b) / 2, digits + 10) for a, b in zip(r, r[::-1], strict=True)) for r in (joined, inners)
        ]
    return method(f"triple jump of {base.name}", base.first, *rows, digits)


# --- orders that are known -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", ["kick", "drift"])
def test_leapfrog_has_order_two_and_its_textbook_error(first):
    # log = A + B - [A, [A, B]]/24 - [B, [A, B]]/12 or with the roles exchanged: sqrt(1/24^2 + 1/12^2) = sqrt(5)/24.
    leapfrog = LEAPFROGS[first]
    assert theory.order_of(leapfrog) == theory.nystrom_order_of(leapfrog) == 2
    assert theory.leading_errors(leapfrog).general == theory.ErrorTerm(3, pytest.approx(sqrt(5) / 24, rel=1e-14))
    assert theory.generalised_order_of(leapfrog) == (2,)
    assert theory.harmonic_orders_of(leapfrog) == (2, 2, 2, 2)


def test_each_triple_jump_adds_two_orders_up_to_eight():
    tableau = LEAPFROGS["drift"]
    for order in (2, 4, 6):
        tableau = composed(tableau, order)
        assert theory.order_of(tableau) == theory.nystrom_order_of(tableau) == order + 2
        assert theory.harmonic_orders_of(tableau).energy == order + 2
    assert theory.order_of(tableau, highest=6) == 6
    assert theory.error_norm(tableau, 9) > 1e-3
    with pytest.raises(SettingError, match="highest = 7 is not allowed: the order of triple jump"):
        theory.leading_errors(tableau, highest=7)


def test_nystrom_method_has_its_order_only_for_quadratic_kinetic_energy():
    assert (theory.order_of("srkn_b11"), theory.nystrom_order_of("srkn_b11")) == (4, 6)
    assert theory.nystrom_order_of("srkn_b11", first="drift") == 4


@EVERY_METHOD
def test_the_first_generalised_order_is_that_of_a_quadrature(name):
    # To first order in epsilon the kicks are the weights, the drifts before them the nodes, of a quadrature on [0, 1].
    tableau = integrators[name]
    letters, nodes, weights = step_of(tableau), [], []
    position = Fraction(0)
    for letter, c in letters:
        if letter == "A":
            position += c
        else:
            nodes.append(position)
            weights.append(c)
    exact, allowed = 0, Fraction(1, 10 ** min(25, tableau.digits - 3))
    while abs(sum(w * x**exact for w, x in zip(weights, nodes, strict=True)) - Fraction(1, exact + 1)) < allowed:
        exact += 1
    assert theory.generalised_order_of(tableau)[0] == exact


def test_what_blanes_and_others_call_small_part_is_kick():
    assert theory.generalised_order_of("aba864") == (8, 6, 4)
    assert theory.generalised_order_of("aba864", first="kick") == (4,)


@EVERY_METHOD
def test_order_for_quadratic_potentials_is_that_of_the_step_matrix(name):
    # Coupled oscillators are single ones in their normal modes.
    wrong = theory.leading_errors(name).harmonic.degree
    assert theory.order_of(name, potential_degree=2, highest=8) == min(wrong - 1, 8)


@EVERY_METHOD
def test_a_potential_of_lower_degree_never_lowers_the_order(name):
    orders = [theory.order_of(name, potential_degree=degree) for degree in (4, 3, 2)]
    assert orders == sorted(orders)
    assert theory.nystrom_order_of(name) <= orders[0]


@pytest.mark.parametrize("degree", [1, 0, -3, 2.5, "three", True])
def test_degree_of_a_potential_below_two_is_refused(degree):
    with pytest.raises(SettingError, match="potential_degree"):
        theory.order_of("ruth", potential_degree=degree)


# --- norms -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ruth", "yoshida_s7o6a", "abas5o6h", "babps9o7h"])
@pytest.mark.parametrize("degree", [5, 7])
def test_the_nystrom_norm_is_the_distance_to_what_vanishes(name, degree):
    # Double precision suffices: least squares of well-scaled columns.
    found = logarithm(step_of(integrators[name]), lie.lyndon_words(degree))
    matrix = np.zeros((len(lie.lyndon_words(degree)),) * 2)
    for i, row in enumerate(lie._to_basis(degree)):
        matrix[i, list(row)] = list(row.values())
    error = matrix @ [float(found[word]) for word in lie.lyndon_words(degree)]
    ideal = matrix @ np.array(
        [[x.get(word, 0) for x in lie._ideal(degree)] for word in lie.lyndon_words(degree)], dtype=float
    )
    solution = np.linalg.lstsq(ideal, error, rcond=None)[0]
    # What double precision leaves where the error vanishes, as below the order.
    assert theory.error_norm(name, degree) == pytest.approx(np.linalg.norm(error), rel=1e-9, abs=1e-12)
    expected = np.linalg.norm(error - ideal @ solution)
    assert theory.error_norm(name, degree, quadratic=True) == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("name", ["ruth", "abas5o6h", "babs7o7h"])
def test_harmonic_error_is_limit_of_step_minus_rotation(name):
    degree, norm = theory.leading_errors(name).harmonic
    tau = mpf(10) ** -5
    rotation = mp.matrix([[mp.cos(tau), mp.sin(tau)], [-mp.sin(tau), mp.cos(tau)]])
    # The next term is smaller by the order of tau.
    error = mp.mnorm(oscillator_step(integrators[name], tau) - rotation, "f")
    assert error / tau**degree == pytest.approx(norm, rel=1e-3)


# --- digits ----------------------------------------------------------------------------------------------------------


def rounded(tableau, digits):
    """The tableau with all but its innermost coefficients rounded, these closing the sums, as a table prints it."""
    rows = []
    with localcontext(prec=200):
        for row in (tableau.kick, tableau.drift):
            middle = (len(row) - 1) // 2
            half = [Decimal(c).quantize(Decimal(1).scaleb(-digits)) for c in row[:middle]]
            inner = (1 - 2 * sum(half)) / (2 - len(row) % 2)
            rows.append(tuple(map(str, [*half, *[inner] * (2 - len(row) % 2), *reversed(half)])))
    kick, drift = rows
    return method(tableau.name, tableau.first, *((kick, drift) if tableau.first == "kick" else (drift, kick)), digits)


@pytest.mark.parametrize("digits", [16, 30, 70])
@pytest.mark.parametrize(("name", "order"), [("yoshida_s7o6a", 6), ("babps9o7h", 4), ("ruth", 4)])
def test_order_is_recognised_from_guaranteed_digits_and_no_fewer(name, order, digits):
    tableau = rounded(integrators[name], digits)
    assert theory.order_of(tableau) == order
    # Digits claimed beyond those that are right: found out once the bound no longer covers the difference.
    forged = method(name, tableau.first, tableau.outer, tableau.inner, digits + 12)
    assert theory.order_of(forged) == 2


@pytest.mark.parametrize("name", ["yoshida_s7o6a", "babps9o7h", "aba864"])
@pytest.mark.parametrize("degree", [3, 5, 7])
def test_the_tolerance_bounds_what_wrong_last_digits_do(name, degree):
    chance, tableau = random.Random(7), integrators[name]
    wrong = []
    for letter, c in step_of(tableau):
        wrong.append((letter, c + Fraction(chance.choice((-1, 1)), 10**tableau.digits)))
    every = [word for word in words(degree) if len(word) == degree]
    right, off = (logarithm(step, every) for step in (step_of(tableau), wrong))
    change = sum(abs(right[word] - off[word]) for word in every)
    assert 0 < change <= tolerance(tableau, degree)


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [0, -2, 2.0, True, "4"])
def test_degree_and_highest_order_must_be_positive_integers(number):
    with pytest.raises(SettingError, match=r"highest = .* is not allowed: an integer >= 1"):
        theory.order_of("ruth", highest=number)
    with pytest.raises(SettingError, match=r"degree = .* is not allowed: an integer >= 1"):
        theory.error_norm("ruth", number)


# --- two kicks around a short drift, as one of a modified potential ---------------------------------------------------


def test_coefficient_of_square_is_that_of_exact_logarithm():
    a, d, b = Fraction(-2, 5), Fraction(-1, 90), Fraction(7, 10)
    found = logarithm([("B", a), ("A", d), ("B", b)], lie.lyndon_words(3))
    # On the word ABB, C = [B, [A, B]] has -1, and no other bracket of one A and two B is independent of it.
    square = found["ABB"] / SQUARE["ABB"]
    kick = ShiftedKick(0, float(a), float(d), float(b))
    assert kick.square == pytest.approx(float(square), rel=1e-14)
    assert kick.net == pytest.approx(0.3)


def test_pairs_are_found_where_signs_differ_and_drift_is_short():
    found = shifted_kicks(integrators["babps8o7h"])
    assert [one.place for one in found] == [2, 5]
    assert all(one.before * one.behind < 0 for one in found)
    assert shifted_kicks(integrators["ruth"]) == []
    assert shifted_kicks(method("one sign", "drift", ("0.49", "0.02", "0.49"), ("0.5", "0.5"), 30)) == []
    # ABA104 drifts first: the drift behind kick i is drift i + 1.
    assert [round(one.drift, 5) for one in shifted_kicks(integrators["aba104"])] == [-0.01453, -0.01453]
