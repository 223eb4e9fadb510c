"""Families of methods: equations, projection, modified kicks, and digits that are proved in exact arithmetic."""

from fractions import Fraction
from itertools import combinations
from math import factorial
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf
from scipy.optimize import minimize

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.theory.order import generalised_order_of, harmonic_order, leading_errors, nystrom_order_of, order_of
from nearharmonic.training.family import Family
from nearharmonic.training.objective import DIGITS, NotConvergedError, polished, tableau_of
from support.methods.family_members import FAMILIES, members
from support.oracles import modified_steps
from support.oracles.word_series import operators_of, series

# --- Families of methods: their rows, their equations and derivatives, the projection onto them, and growth.


def shapes(least=1, most=9):
    """(stages, role, squares), all of them."""
    for stages in range(least, most + 1):
        for first in ("drift", "kick"):
            half = (stages + (first == "kick") + 1) // 2
            for count in range(half + 1):
                for squares in combinations(range(half), count):
                    yield stages, first, squares


SHAPES = [shape for shape in shapes() if shape[0] - 1 + len(shape[2]) >= 2]
families = st.sampled_from(SHAPES).map(lambda one: Family(stages=one[0], first=one[1], squares=one[2]))


@given(families, st.integers(0, 10**6))
def test_rows_are_symmetric_and_sum_to_one_and_hold_unknowns(family, seed):
    x = np.random.default_rng(seed).normal(size=family.unknowns).tolist()
    kicks, drifts, squares = family.rows(x)
    assert len(kicks) == len(squares) == family.stages + (family.first == "kick")
    assert len(drifts) == family.stages + (family.first == "drift")
    for row in (kicks, drifts, squares):
        assert row == row[::-1]
    for row in (kicks, drifts):
        assert sum(row) == pytest.approx(1, abs=1e-14 * sum(map(abs, row)))
    assert sum(1 for m in squares if m) == len({i for j in family.squares for i in (j, len(kicks) - 1 - j)})
    assert set(x) <= {*kicks, *drifts, *squares}


def test_gradients_of_a_family_are_those_of_its_tableaus():
    for stages, first, squares in SHAPES:
        family = Family(stages=stages, first=first, squares=squares)
        shape = family.shape()
        assert family.gradients == getattr(shape, "gradients", 0)
        assert (shape.stages, shape.first, shape.modified) == (stages, first, bool(squares))
        half = (len(shape.kick) + 1) // 2
        assert tuple(i for i, m in enumerate(getattr(shape, "square", ())[:half]) if m != "0") == squares


@pytest.mark.parametrize(
    "shape", [*shapes(3, 6), (12, "drift", (0, 5)), (12, "kick", (0, 6)), (13, "kick", (6,)), (13, "drift", (6,))],
    ids=str,
)  # fmt: skip
def test_a_grown_family_takes_the_same_step(shape):
    stages, first, squares = shape
    family = Family(stages=stages, first=first, squares=squares)
    random = np.random.default_rng(stages)
    with mp.workdps(60):
        x = np.array([mpf(c) for c in random.normal(1 / stages, 0.1, family.unknowns)])
        more, y = family.grown(x)
        assert (more.stages, more.first, more.squares) == (stages + 1, first, squares)
        assert len(y) == more.unknowns
        ends = []
        for one, unknowns in ((family, x), (more, y)):
            kick, drift, square = one.rows(unknowns)
            method = SimpleNamespace(first=first, kick=kick, drift=drift, square=square, processed=False)
            q, p = ("0.1", "0.2"), ("0.3", "-0.1")
            ends.append(modified_steps.states(method, modified_steps.henon_heiles, q, p, mpf("0.7"), 1)[-1])
        for one, other in zip(*ends, strict=True):
            assert max(abs(a - b) for a, b in zip(one, other, strict=True)) < mpf(10) ** -50


@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_slopes_in_sixty_digits_are_those_of_differences(family):
    random = np.random.default_rng(family.stages)
    with mp.workdps(60):
        x = [mpf(c) for c in random.normal(1 / family.stages, 0.2, family.unknowns)]
        slopes, h = family.slopes(x), mpf(10) ** -20
        for j in range(family.unknowns):
            up, down = (family.residuals([c + s * h * (i == j) for i, c in enumerate(x)]) for s in (1, -1))
            for i, (a, b) in enumerate(zip(up, down, strict=True)):
                # Central differences are off by h^2 times a third derivative of at most 8! or so.
                assert abs(slopes[i][j] - (a - b) / (2 * h)) < mpf(10) ** -33


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_residuals_and_slopes_of_arrays_are_those_of_each_point(family):
    random = np.random.default_rng(family.stages)
    x = random.normal(1 / family.stages, 0.2, (3, family.unknowns))
    values, slopes = family.residuals(x.T), family.slopes(x.T)
    for c, point in enumerate(x):
        exact = [mpf(number) for number in point]
        wanted = np.array(family.residuals(exact), dtype=float)
        assert np.array([value[c] for value in values]) == pytest.approx(wanted, rel=1e-11, abs=1e-11)
        assert slopes[c] == pytest.approx(np.array(family.slopes(exact), dtype=float), rel=1e-10, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "conditions"),
    [
        ("babs7o7h", {"harmonic_order": 7}), ("aba864", {"generalised_order": (8, 6, 4)}),
        ("aba1064", {"generalised_order": (10, 6, 4)}), ("srkn_b11", {"order": 6}), ("srkn_a14", {"order": 6}),
        ("babs8o6_7h", {"order": 6, "harmonic_order": 7}), ("abas11o6_8h", {"order": 6, "harmonic_order": 8}),
        ("teloy_8a17b", {"order": 8}), ("srkn_a18", {"order": 8}),
        ("teloy_8a17a", {"order": 8, "potential_degree": 3}), ("srkn_b17", {"order": 8, "potential_degree": 4}),
        ("omelyan_g5o6", {"order": 6, "squares": (0, 1, 2)}), ("chin_4a", {"squares": (1,)}),
    ],
)  # fmt: skip
def test_published_methods_meet_the_equations(name, conditions):
    tableau = nh.integrators[name]
    family = Family(stages=tableau.stages, first=tableau.first, **conditions)
    x = family.unknowns_of(tableau)
    kicks, drifts, squares = family.rows(x)
    assert kicks == pytest.approx([float(c) for c in tableau.kick], abs=1e-14)
    assert drifts == pytest.approx([float(c) for c in tableau.drift], abs=1e-14)
    assert squares == pytest.approx([float(m) for m in tableau.square or ["0"] * len(kicks)], abs=1e-14)
    assert np.abs(family.residuals(x)).max() < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("wanted", [(6, 4), (8, 4), (8, 6, 4)])
@pytest.mark.parametrize("first", ["drift", "kick"])
def test_members_have_the_generalised_order_of_their_family(first, wanted):
    family = Family(stages=9, first=first, generalised_order=wanted)
    for x in members(family, 2):
        assert generalised_order_of(tableau_of(family, x, digits=20, name="one", source="here")) == wanted


@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_projection_leaves_members_where_they_are(family):
    x = members(family, 5)
    again, inside = family.project(x)
    assert inside.all()
    assert again.tobytes() == x.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("family", [f for f in FAMILIES if f.unknowns > len(f.equations)], ids=str)
def test_projection_leads_to_the_nearest_member(family):
    x = members(family, 1)[0]
    near = x + 1e-3 * np.random.default_rng(5).normal(size=len(x))
    found, inside = family.project(near[None])
    assert inside[0]
    nearest = minimize(
        lambda y: 1e6 * ((y - near) ** 2).sum(), x, method="SLSQP", options={"ftol": 1e-12, "maxiter": 300},
        constraints={"type": "eq", "fun": lambda y: np.array(family.residuals(y))},
    )  # fmt: skip
    # To second order in the distance, which is 1e-3.
    assert np.linalg.norm(found[0] - near) == pytest.approx(np.linalg.norm(nearest.x - near), rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_unprojectable_point_is_no_member_and_disturbs_no_other(family):
    x = members(family, 3) + 1e-3
    alone, inside = family.project(x)
    odd = np.full((5, family.unknowns), np.nan)
    odd[1, 0], odd[1, 1:] = np.nan, 0.1
    odd[2] = np.inf
    odd[3] = 1e200
    odd[4] = -1e20
    found, which = family.project(np.concatenate([odd[:2], x, odd[2:]]))
    assert which.tolist() == [False, False, *inside, False, False, False]
    assert found[2:5].tobytes() == alone.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_projection_of_point_is_bitwise_independent_of_others(family):
    points = np.random.default_rng(7).normal(1 / family.stages, 0.2, (23, family.unknowns))
    together, inside = family.project(points)
    order = np.random.default_rng(8).permutation(23)
    shuffled, which = family.project(points[order])
    assert shuffled.tobytes() == together[order].tobytes()
    assert (which == inside[order]).all()
    for i in range(0, 23, 5):
        alone, one = family.project(points[i : i + 1])
        assert alone[0].tobytes() == together[i].tobytes()
        assert one[0] == inside[i]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"order": 5}, "order = 5 is not allowed: one of 4, 6, 8"),
        ({"potential_degree": 2}, "potential_degree = 2 is not allowed: one of None, 3, 4"),
        ({"harmonic_order": 9}, "harmonic_order = 9 is not allowed: one of 4, 5, 6, 7, 8"),
        ({"first": "push"}, "first = 'push' is not allowed: one of drift, kick"),
        ({"stages": 6, "order": 6}, "stages = 6 is not allowed: at least 6 free coefficients .* there are 5"),
        ({"generalised_order": (8, 5)}, r"generalised_order = \(8, 5\) is not allowed: even orders that do not"),
        ({"generalised_order": (6, 8)}, "even orders that do not increase, from 10 to the order 4"),
        ({"generalised_order": (12, 4)}, "even orders that do not increase, from 10"),
        ({"generalised_order": (8, 6, 4)}, "at least 6 free coefficients"),
        ({"squares": (3,)}, r"squares = \(3,\) is not allowed: different numbers of kicks, from 0 to 2"),
        ({"squares": (-1,)}, "different numbers of kicks, from 0 to 2"),
        ({"squares": (1, 1)}, "different numbers of kicks, from 0 to 2"),
    ],
)
def test_settings_that_no_family_has_are_refused(wrong, message):
    with pytest.raises(SettingError, match=message):
        Family(**{"stages": 5, "first": "kick", **wrong})


# --- Methods of order six with kicks of a modified potential: found from random starts, and their digits.

#: The family of ``abag5o6``, whose second kick is free, and the index of that.
FREE, SECOND_KICK = Family(stages=5, first="drift", order=6, squares=(0, 1, 2)), 3
OF_ORDER_SIX = {
    "abag5o6": FREE,
    "omelyan_g5o6": Family(stages=5, first="drift", order=6, squares=(0, 2)),
    "babg5o6": Family(stages=5, first="kick", order=6, squares=(0, 1)),
}
METHODS = pytest.mark.parametrize("name", list(OF_ORDER_SIX))


def solutions(family, count=3000):
    """Members (R, n) from random points, the first of each row of size 1/s."""
    random = np.random.default_rng(1)
    points = random.normal(1 / family.stages, 2 / family.stages, (count, family.unknowns))
    points[:, family.stages - 1 :] *= 1 / family.stages**2
    found, inside = family.project(points)
    return found[inside]


def sums(family, x):
    """Sum of the absolute values of all kicks and drifts of each member."""
    kicks, drifts, _ = family.rows(x.T)
    return sum(np.abs(row) for row in (*kicks, *drifts))


def member_at(kick):
    unknowns = FREE.unknowns_of(nh.modified_integrators["abag5o6"])
    return tableau_of(
        FREE, unknowns, digits=30, fixed={SECOND_KICK: kick}, nearest=0.1, name="one", source="here"
    )  # fmt: skip


def test_every_registered_method_of_order_six_has_its_family_here():
    assert set(OF_ORDER_SIX) == {name for name, one in nh.modified_integrators.items() if one.order == 6}
    assert {name: one.unknowns - len(one.equations) for name, one in OF_ORDER_SIX.items()} == {
        "abag5o6": 1, "omelyan_g5o6": 0, "babg5o6": 0,
    }  # fmt: skip


@METHODS
def test_registered_digits_follow_from_ten_of_them(name):
    known, family = nh.modified_integrators[name], OF_ORDER_SIX[name]
    fixed = {SECOND_KICK: known.kick[1]} if family is FREE else None
    near = family.unknowns_of(known) * (1 + 1e-10)
    found = tableau_of(family, near, digits=known.digits, fixed=fixed, name=name, source="here")
    for row in ("kick", "drift", "square"):
        for ours, text in zip(getattr(found, row), getattr(known, row), strict=True):
            assert abs(Fraction(ours) - Fraction(text)) < Fraction(1, 10**known.digits)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["omelyan_g5o6", "babg5o6"])
def test_random_starts_lead_to_the_registered_methods_with_nothing_free(name):
    family = OF_ORDER_SIX[name]
    found = solutions(family)
    away = np.abs(found - family.unknowns_of(nh.modified_integrators[name])).max(axis=1)
    assert away.min() < 1e-10
    # It is the one with the smallest coefficients.
    assert sums(family, found).argmin() in np.flatnonzero(away < 1e-6)


def test_random_starts_lead_to_the_family_of_the_registered_method():
    found = solutions(FREE)
    assert len(found) > 100
    ours = FREE.unknowns_of(nh.modified_integrators["abag5o6"])
    # The outermost coefficients hardly change along the family.
    assert (np.abs(found - ours)[:, [0, 2]].max(axis=1) < 2e-3).any()


def test_our_parameter_minimises_degree_seven_error_to_five_digits():
    least = leading_errors(nh.modified_integrators["abag5o6"]).nystrom.norm
    assert leading_errors(member_at("0.061")).nystrom.norm == pytest.approx(least, rel=1e-12)
    for kick in ("0.057", "0.065"):
        norm = leading_errors(member_at(kick)).nystrom.norm
        assert least < norm
        assert norm == pytest.approx(least, rel=1e-3)


# --- Polished members: their digits, proved in exact arithmetic that shares no code with the equations.


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
