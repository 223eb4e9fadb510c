"""Functions with the same bits everywhere, against exact fractions, multiprecision and LAPACK."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nearharmonic.numerics.portable import (
    decades,
    dot,
    eigen,
    geometric,
    log10,
    nearest_power_of_two,
    norms,
    product,
    total,
)

#: A double of 1 is off by half of this at most.
EPS = 2.0**-52
numbers = st.floats(-1e100, 1e100)


@given(st.lists(numbers))
def test_a_total_is_the_exact_sum_rounded_once(terms):
    assert total(terms) == float(sum(map(Fraction, terms)))


@given(st.lists(st.tuples(numbers, numbers)))
def test_a_dot_product_is_the_exact_sum_of_rounded_products(pairs):
    one, other = np.array(pairs).reshape(-1, 2).T
    assert dot(one, other) == float(sum(Fraction(float(a) * float(b)) for a, b in pairs))


@pytest.mark.parametrize(("terms", "expected"), [([1.0, np.inf], np.inf), ([-np.inf, 1.0], -np.inf)])
def test_a_total_with_an_infinity_is_infinite(terms, expected):
    assert total(terms) == expected


def test_a_total_of_what_is_undefined_is_nan():
    assert np.isnan([total([1.0, np.nan]), total([np.inf, -np.inf])]).all()


@given(st.floats(1e-300, 1e300))
def test_log10_is_off_by_two_ulp_at_most(x):
    """Errors of the logarithm, of ln 10 and of the quotient are half an ulp each, or one ulp for our logarithm."""
    exact = mpmath.log10(mpmath.mpf(x))
    assert abs(mpmath.mpf(log10(x)) - exact) <= 2 * EPS * abs(exact)
    assert log10(np.array([x]))[0] == log10(x)


@given(st.integers(-1000, 1000), st.floats(1.0, 2.0, exclude_max=True))
def test_a_power_of_two_is_the_nearest_in_the_logarithm(exponent, factor):
    x = mpmath.mpf(factor) * mpmath.mpf(2) ** exponent
    assert nearest_power_of_two(float(x)) == mpmath.mpf(2) ** mpmath.nint(mpmath.log(x, 2))


@pytest.mark.parametrize("x", [np.inf, np.nan])
def test_what_is_not_finite_has_no_power_of_two(x):
    assert not np.isfinite(nearest_power_of_two(x))


@given(st.floats(1e-200, 1e200), st.floats(1e-200, 1e200), st.integers(2, 9))
def test_a_geometric_grid_is_correctly_rounded(lowest, highest, count):
    """Ends stand for the decimals that name them, as the config writes them."""
    first, last = mpmath.mpf(repr(lowest)), mpmath.mpf(repr(highest))
    inner = [first * (last / first) ** (mpmath.mpf(i) / (count - 1)) for i in range(1, count - 1)]
    assert geometric(lowest, highest, count) == [lowest, *map(float, inner), highest]


def test_a_geometric_grid_holds_the_decimals_that_it_passes():
    assert geometric(1e-4, 1, 5) == [1e-4, 1e-3, 1e-2, 1e-1, 1.0]
    assert geometric(3.0, 5.0, 1) == [3.0]
    assert [float(x) for x in decades(0.2, 2, 0, 5)][::2] == [0.2, 2.0, 20.0]


def symmetric(seed, count, n):
    A = np.random.default_rng(seed).normal(size=(count, n, n))
    return A + A.swapaxes(-1, -2)


@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_eigenvalues_are_those_of_lapack_and_vectors_are_orthonormal(n):
    """To rounding of some sweeps of n^2 / 2 rotations, times the size of the matrix."""
    A = symmetric(n, 20, n)
    values, vectors = eigen(A)
    bound = 100 * n * EPS * np.abs(A).max()
    assert np.abs(values - np.linalg.eigvalsh(A)).max() < bound
    assert np.abs(A @ vectors - vectors * values[:, None, :]).max() < bound
    assert np.abs(vectors.swapaxes(-1, -2) @ vectors - np.eye(n)).max() < 100 * n * EPS


def test_degenerate_eigenvalues_have_an_orthonormal_basis():
    """The differences of a ring of six: frequencies 0, 1, 1, 3, 3, 4 squared, known in closed form."""
    ring = 2 * np.eye(6) - np.roll(np.eye(6), 1, axis=0) - np.roll(np.eye(6), -1, axis=0)
    values, vectors = eigen(ring)
    assert values == pytest.approx([0, 1, 1, 3, 3, 4], abs=1e-14)
    assert np.abs(vectors.T @ vectors - np.eye(6)).max() < 1e-14


def test_a_diagonal_matrix_keeps_the_axes():
    values, vectors = eigen(np.diag([3.0, 1.0, 1.0]))
    assert values.tolist() == [1, 1, 3]
    assert vectors.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


def test_norms_are_largest_singular_values():
    A = np.random.default_rng(1).normal(size=(30, 5, 3))
    assert norms(A) == pytest.approx(np.linalg.norm(A, ord=2, axis=(1, 2)), rel=100 * EPS)


def test_a_product_is_that_of_matrices():
    rows, matrix = np.random.default_rng(2).integers(-9, 9, (4, 3, 5)) * 1.0, np.arange(10.0).reshape(5, 2)
    assert (product(rows, matrix) == rows @ matrix).all()
