"""The steps of the damped iteration against numpy's linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.numerics.levenberg_marquardt import levenberg_step, marquardt_step


@pytest.mark.parametrize("step_of", [levenberg_step, marquardt_step])
@pytest.mark.parametrize("damping", [0.0, 0.3, 50.0])
def test_a_step_solves_the_damped_normal_equations(step_of, damping):
    random = np.random.default_rng(2)
    F, J = random.normal(size=4), random.normal(size=(4, 6))
    normal = J @ J.T
    added = np.eye(4) if step_of is levenberg_step else np.diag(np.diag(normal))
    step = np.empty(6)
    step_of(F, J, damping, np.empty((4, 5)), step)
    # The condition of J J^T, below 1e3 for this seed, times a few roundings.
    assert step == pytest.approx(J.T @ np.linalg.solve(normal + damping * added, F), rel=1e-11, abs=1e-12)


def test_equations_that_contradict_each_other_have_no_step():
    F, J, step = np.ones(2), np.array([[1.0, 2.0], [2.0, 4.0]]), np.zeros(2)
    assert not marquardt_step(F, J, 0.0, np.empty((2, 3)), step)
    levenberg_step(F, J, 0.0, np.empty((2, 3)), step)
    assert np.isnan(step).all()
