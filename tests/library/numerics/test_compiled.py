"""Compiled numerics: searches against linear algebra and closed forms, functions against mpmath."""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest

from nearharmonic.core.numba_code import jit
from nearharmonic.numerics import compiled as numerics

# --- The damped iteration: its steps against numpy's linear algebra, its ends against solutions in closed form


STEPS = pytest.mark.parametrize("step_of", [numerics.levenberg_step, numerics.marquardt_step])
#: Newton's method with a damping that adapts, to residuals that doubles resolve.
DAMPED = numerics.Damping(
    iterations=100, enough=1e-14, solved=1e-12, first=1e-2, fall=(1.0, 10.0), rise=10.0, most=1e10
)


@pytest.mark.slow
@STEPS
@pytest.mark.parametrize("damping", [0.0, 0.3, 50.0])
def test_a_step_solves_the_damped_normal_equations(step_of, damping):
    random = np.random.default_rng(2)
    F, J = random.normal(size=4), random.normal(size=(4, 6))
    normal = J @ J.T
    added = np.eye(4) if step_of is numerics.levenberg_step else np.diag(np.diag(normal))
    step = np.empty(6)
    assert step_of(F, J, damping, np.empty((5, 5)), step)
    # The condition of J J^T, below 1e3 for this seed, times a few roundings.
    assert step == pytest.approx(J.T @ np.linalg.solve(normal + damping * added, F), rel=1e-11, abs=1e-12)


@pytest.mark.slow
def test_equations_that_contradict_each_other_have_no_step():
    F, J, step = np.ones(2), np.array([[1.0, 2.0], [2.0, 4.0]]), np.zeros(2)
    assert not numerics.marquardt_step(F, J, 0.0, np.empty((3, 3)), step)
    numerics.levenberg_step(F, J, 0.0, np.empty((3, 3)), step)
    assert np.isnan(step).all()


@jit
def residuals(radius, x):
    """x^2 + y^2 + z^2 = radius^2 and x = y."""
    F = np.array([x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - radius * radius, x[0] - x[1]])
    return F, np.sqrt(F[0] * F[0] + F[1] * F[1]), 2.0 * x


@jit
def slopes(radius, x, twice):
    return np.array([[twice[0], twice[1], twice[2]], [1.0, -1.0, 0.0]])


@cache
def compiled(step_of):
    return numerics.iteration(residuals, slopes, step_of)


def ended(damping, start, bound=np.inf, step_of=numerics.levenberg_step, radius=3.0):
    """End of the iteration: True at a solution, and its place."""
    x = np.array(start, dtype=float)
    return compiled(step_of)(radius, x, bound, damping), x


@pytest.mark.slow
@pytest.mark.parametrize(
    "step_of", [pytest.param(numerics.levenberg_step, marks=pytest.mark.long), numerics.marquardt_step]
)
def test_the_iteration_comes_to_a_solution_from_near_and_far(step_of):
    for start in np.random.default_rng(1).uniform(-20, 20, (20, 3)):
        solved, x = ended(DAMPED, start, step_of=step_of)
        assert solved
        assert x @ x == pytest.approx(9, abs=1e-12)
        assert x[0] == pytest.approx(x[1], abs=1e-12)


@pytest.mark.slow
def test_without_damping_the_first_step_is_that_of_newtons_method():
    _, x = ended(numerics.Damping(iterations=1, monotone=False), [1.0, 2.0, 2.5])
    F, J = np.array([1 + 4 + 6.25 - 9, -1]), np.array([[2.0, 4.0, 5.0], [1.0, -1.0, 0.0]])
    assert x == pytest.approx(np.array([1.0, 2.0, 2.5]) - np.linalg.pinv(J) @ F, rel=1e-14)


@pytest.mark.slow
def test_steps_that_raise_residuals_are_taken_by_projection_only():
    # From near the centre Newton's step is long: 9 / (2 |x|).
    start = [0.1, 0.1, 0.1]
    assert ended(numerics.Damping(iterations=1), start)[1].tolist() == start
    assert np.abs(ended(numerics.Damping(iterations=1, monotone=False), start)[1]).max() > 10
    assert ended(numerics.Damping(iterations=9, solved=1e-12, lost=8.0, monotone=False), start)[1].tolist() == start


@pytest.mark.slow
def test_iteration_that_is_bounded_is_given_up_where_it_leaves():
    # The solution is at (-2, -2, 1), and the step to it is a full one.
    start = [-1.99, -2.0, 1.0]
    assert ended(DAMPED, start)[0]
    for bounded in (False, True):
        solved, x = ended(DAMPED._replace(bounded=bounded), start, bound=1.5)
        assert not solved
        assert (x.tolist() == start) == bounded


@pytest.mark.slow
def test_step_of_no_length_and_little_damping_ends_at_rest():
    by_rest = DAMPED._replace(enough=-1.0, solved=0.0, rest=1e-10, undamped=1e-4, most=1e12)
    solved, x = ended(by_rest, [1.0, 2.0, 2.5], radius=3.3)
    assert solved
    assert x @ x == pytest.approx(3.3**2, abs=1e-9)
    assert not ended(by_rest._replace(undamped=0.0), [1.0, 2.0, 2.5], radius=3.3)[0]
    assert not ended(by_rest, [1.0, 2.0, 2.5], radius=np.nan)[0]


# --- Distinct points: the first of near ones stands for all, in the order given


def test_points_near_an_earlier_one_are_counted_and_not_kept():
    points = np.array([[1.0, 2.0], [5.0, 0.0], [1.05, 1.95], [1.0, 2.2], [5.0, 0.1]])
    kept, hits = numerics.distinct(points, 0.11)
    assert kept.tolist() == [[1.0, 2.0], [5.0, 0.0], [1.0, 2.2]]
    assert hits == [2, 2, 1]


def test_every_unknown_has_to_be_near():
    assert numerics.distinct(np.array([[0.0, 0.0], [0.0, 1.0]]), 0.5)[1] == [1, 1]
    assert numerics.distinct(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.5)[1] == [1, 1]
    assert numerics.distinct(np.array([[0.0, 0.0], [-0.5, 0.5]]), 0.5)[1] == [2]


@pytest.mark.parametrize("relative", [False, True])
def test_distance_is_that_of_plain_rule_for_many_points(relative):
    points = np.random.default_rng(3).uniform(-3, 3, (400, 2))
    kept: list[np.ndarray] = []
    for x in points:
        reach = 0.3 * (max(1.0, np.abs(x).max()) if relative else 1.0)
        if all(np.abs(x - y).max() > reach for y in kept):
            kept.append(x)
    found, hits = numerics.distinct(points, 0.3, relative=relative)
    assert found.tolist() == np.array(kept).tolist()
    assert sum(hits) == 400


def test_at_most_wanted_number_is_kept_and_none_of_none():
    points = np.arange(10.0)[:, None]
    assert numerics.distinct(points, 0.1, most=3)[0].tolist() == [[0.0], [1.0], [2.0]]
    kept, hits = numerics.distinct(np.empty((0, 4)), 0.1)
    assert (kept.shape, hits) == ((0, 4), [])


# --- Functions of compiled loops, against mpmath


@pytest.mark.slow
def test_exponential_is_correct_to_one_ulp():
    for x in (*np.linspace(-699.5, 699.5, 401), 1e-300, 0.34657, -0.34658):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(mpmath.mpf(numerics.exponential(float(x))) / exact - 1) < 1.5 * 2.0**-52
    assert (numerics.exponential(-1e4), numerics.exponential(1e4)) == (0, np.inf)


@pytest.mark.slow
def test_logarithm_is_correct_to_one_ulp():
    for x in (*np.geomspace(1e-300, 1e300, 101), 0.99, 1.0, 1.01):
        exact = mpmath.log(mpmath.mpf(float(x)))
        assert abs(mpmath.mpf(numerics.logarithm(float(x))) - exact) <= 1.5 * 2.0**-52 * abs(exact)
    assert (numerics.logarithm(-1.0), numerics.logarithm(0.0)) == (np.inf, np.inf)
