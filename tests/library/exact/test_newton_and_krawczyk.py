"""Zeros of functions with closed forms: found, counted by rank, and proved."""

from __future__ import annotations

from fractions import Fraction

import pytest
from mpmath import mp, mpf, sqrt

from nearharmonic.exact.polynomials import newton, prove, rank_and_pivots


def circle_and_line(x):
    """x^2 + y^2 = 4 and x = y: zeros at +-(sqrt 2, sqrt 2)."""
    return [x[0] ** 2 + x[1] ** 2 - 4, x[0] - x[1]]


def slopes(x):
    return [[2 * x[0], 2 * x[1]], [1 + 0 * x[0], -1 + 0 * x[0]]]


def sphere(x):
    return [sum(c * c for c in x) - 9]


def sphere_slopes(x):
    return [[2 * c for c in x]]


@pytest.mark.parametrize("digits", [20, 300])
def test_newton_comes_to_the_zero_to_the_digits_asked_for(digits):
    limit = newton(circle_and_line, slopes, [1.5, Fraction(4, 3)], digits=digits)
    assert limit.converged
    with mp.workdps(digits + 10):
        assert max(abs(c - sqrt(mpf(2))) for c in limit.point) < mpf(10) ** -digits
    assert limit.residual < mpf(10) ** -digits
    # Each iteration doubles the digits: from one, 300 take nine, and the last one only confirms.
    assert limit.iterations <= 11


def test_newton_finds_nearest_surface_point_at_first_order():
    # Steps along the gradient of |x|^2 lead straight to the centre: the direction of the start is kept.
    limit = newton(sphere, sphere_slopes, [2, 4, 4], digits=40)
    assert max(abs(a - b) for a, b in zip(limit.point, (1, 2, 2), strict=True)) < mpf(10) ** -40


def test_unknowns_that_are_fixed_stay_where_they_are():
    limit = newton(sphere, sphere_slopes, [1, 2, mpf("1.9")], digits=40, fixed=(0, 1))
    assert limit.point[:2] == (1, 2)
    assert abs(limit.point[2] - 2) < mpf(10) ** -40
    off = newton(sphere, sphere_slopes, [5, 0, 1], digits=40, fixed=(0,))
    assert not off.converged  # x = 5 meets no sphere of radius 3


def test_where_no_zero_is_newton_says_how_large_residual_is():
    limit = newton(lambda x: [x[0] ** 2 + 1], lambda x: [[2 * x[0]]], [mpf("0.5")], digits=30)
    assert not limit.converged
    assert abs(limit.residual - (limit.point[0] ** 2 + 1)) < mpf(10) ** -10 * limit.residual
    assert limit.residual >= 1


def test_double_zero_is_not_distinguished_from_no_zero():
    # Each step halves the distance: 2^-16 after 15 of them.
    limit = newton(lambda x: [x[0] ** 2], lambda x: [[2 * x[0]]], [mpf("0.5")], digits=10)
    assert (limit.converged, limit.iterations) == (False, 15)
    assert (limit.correction, limit.point[0]) == (mpf(2) ** -16, mpf(2) ** -16)


def test_a_singular_start_ends_at_once():
    limit = newton(circle_and_line, lambda x: [[0 * x[0]] * 2] * 2, [1, 1], digits=30)
    assert (limit.converged, limit.iterations, limit.correction) == (False, 0, mp.inf)
    assert limit.residual == 2


def test_rank_counts_independent_values_and_pivots_have_largest_slopes():
    rows = [[1, 2, 100, 0], [2, 4, 200, 0], [0, 0, 1, 3]]
    rank, pivots = rank_and_pivots(lambda _: [list(map(mpf, row)) for row in rows], [0] * 4)
    assert (rank, pivots) == (2, (2, 3))
    for digits, expected in ((24, 2), (16, 1)):  # a pivot of 1e-10 counts while it is above half of the digits
        nearly = [[mpf(1), mpf(1)], [mpf(1), 1 + mpf("1e-10")]]
        assert rank_and_pivots(lambda _, rows=nearly: rows, [0, 0], digits=digits)[0] == expected
    assert rank_and_pivots(slopes, [1, 1])[0] == 2
    assert rank_and_pivots(slopes, [Fraction(1, 2), Fraction(-1, 2)])[0] == 1  # there circle and line are parallel


def test_zero_that_is_near_is_proved_and_its_distance_bounded():
    exact = sqrt(mpf(2))
    near = [exact + mpf("2e-21"), exact - mpf("1e-21")]
    proof = prove(circle_and_line, slopes, near, radius="1e-20")
    assert proof.proved
    assert mpf("2e-21") <= proof.distance < mpf("2.001e-21")


@pytest.mark.parametrize(
    ("point", "radius"),
    [
        ([Fraction(14142, 10000)] * 2, "1e-5"),  # the zero is 1.4e-5 away
        ([Fraction(0)] * 2, "10"),  # two zeros in the box
        ([Fraction(1), Fraction(-1)], "1e-3"),  # the Jacobian is singular
    ],
)
def test_nothing_is_proved_without_exactly_one_zero_in_box(point, radius):
    assert not prove(circle_and_line, slopes, point, radius=radius).proved


def test_a_proof_with_fixed_unknowns_is_about_the_others():
    point = [Fraction(1), Fraction(2), Fraction(2) + Fraction(1, 10**12)]
    proof = prove(sphere, sphere_slopes, point, radius="1e-11", fixed=(0, 1))
    assert proof.proved
    assert mpf("0.999e-12") < proof.distance < mpf("1.001e-12")
    assert not prove(sphere, sphere_slopes, point, radius="1e-13", fixed=(0, 1)).proved
