"""The damped iteration against closed forms: one equation in three unknowns, and its steps against numpy's algebra."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.core.compile import machine_code, strict
from nearharmonic.core.layout import Group, floats, least_squares_signature, least_squares_workspace
from nearharmonic.core.levenberg_marquardt import DampingRule, levenberg_marquardt, levenberg_step, marquardt_step
from nearharmonic.core.native import NativeFunction, _address

STEPS = {"levenberg": levenberg_step, "marquardt": marquardt_step}
SIGNATURE = least_squares_signature(Group("problem", (floats("square"),)), Group("scratch", (floats("calls", 1),)))


@strict
def sphere(problem, x, residuals, jacobian, scratch):
    """|x|^2 = square."""
    residuals[0] = -problem[0]
    for k in range(x.size):
        residuals[0] += x[k] * x[k]
        jacobian[0, k] = 2.0 * x[k]
    scratch[0][0] += 1.0
    return abs(residuals[0])


@pytest.fixture(scope="module")
def iterate():
    rule = DampingRule(
        step=levenberg_step,
        less=lambda damping: damping / 10.0,
        more=lambda damping: damping * 8.0,
        most=1e6,
        iterations=60,
        rest=1e-12,
        undamped=1.0,
    )
    function = NativeFunction(_address(*machine_code(levenberg_marquardt(sphere, rule), SIGNATURE)), SIGNATURE)

    def call(points, bound, square=1.0):
        sizes, rested, calls = np.zeros(len(points)), np.zeros(len(points), np.bool_), np.zeros(1)
        function((square,), points, bound, sizes, rested, least_squares_workspace(1, points.shape[1]), (calls,))
        return sizes, rested, int(calls[0])

    return call


def test_steps_of_least_length_go_straight_to_a_sphere(iterate):
    """The gradient of |x|^2 is along x: each start ends where its own ray meets the sphere."""
    starts = np.random.default_rng(1).uniform(-3, 3, (50, 3))
    points = starts.copy()
    sizes, rested, _ = iterate(points, np.inf)
    assert rested.all()
    # Some roundings of numbers near 1.
    assert np.abs(points - starts / np.linalg.norm(starts, axis=1)[:, None]).max() < 1e-14
    assert sizes.max() < 1e-14


def test_a_point_beyond_the_bound_is_given_up_where_it_stands(iterate):
    points = np.array([[3.0, 0.0, 0.0], [1.5, 0.0, 0.0]])
    _, rested, _ = iterate(points, 2.0)
    assert rested.tolist() == [False, True]
    assert points[0].tolist() == [3.0, 0.0, 0.0]


def test_where_no_step_helps_the_iteration_ends_and_says_so(iterate):
    """|x|^2 = -1 has no solution: x can only shrink, from residuals of 2.25 to no less than 1."""
    sizes, rested, calls = iterate(np.array([[1.0, 0.5]]), np.inf, square=-1.0)
    assert not rested.any()
    assert 1.0 <= sizes[0] < 2.25
    assert calls <= 1 + 60


@pytest.mark.parametrize("name", sorted(STEPS))
@pytest.mark.parametrize("damping", [0.0, 0.3, 50.0])
def test_a_step_solves_the_damped_normal_equations(name, damping):
    random = np.random.default_rng(2)
    F, J = random.normal(size=4), random.normal(size=(4, 6))
    normal = J @ J.T
    added = np.eye(4) if name == "levenberg" else np.diag(np.diag(normal))
    step = np.empty(6)
    assert STEPS[name].py_func(F, J, damping, np.empty((4, 5)), step)
    # The condition of J J^T, below 1e3 for this seed, times a few roundings.
    assert step == pytest.approx(J.T @ np.linalg.solve(normal + damping * added, F), rel=1e-11, abs=1e-12)


def test_equations_that_contradict_each_other_have_no_step():
    F, J, step = np.ones(2), np.array([[1.0, 2.0], [2.0, 4.0]]), np.zeros(2)
    assert not marquardt_step.py_func(F, J, 0.0, np.empty((2, 3)), step)
    levenberg_step.py_func(F, J, 0.0, np.empty((2, 3)), step)
    assert np.isnan(step).all()
