"""Paths of panel D of Figure 6 from starts outside its plane, compared with steps in multiprecision and single runs."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic_paper.experiments.paper import orbits as displaced
from nearharmonic_paper.experiments.paper.orbits import paper_panels
from support.oracles.multiprecision import energy_errors, trajectory

ITERATIONS = 100_000


@pytest.fixture(scope="module")
def contents():
    return displaced.displaced("babs7o7h", ITERATIONS)["cube"]


@pytest.fixture(scope="module")
def cube(contents):
    return {name: values for name, (_, values, _) in contents.variables.items()}


def walked(q_x, iterations):
    """q_x and |dH/H0| after each step of 2 from (q_x, 0.4), (0, 0.4)."""
    steps = integrators["babs7o7h"], nh.systems["henon_heiles"], mpf(2), iterations
    start = [mpf(q_x), mpf("0.4")], [mpf(0), mpf("0.4")]
    _, *states = trajectory(*steps, start)
    return np.array([[q[0] for q, _ in states], energy_errors(*steps, start)], dtype=float)


@pytest.mark.parametrize("run", [0, 3, 4])
def test_the_paths_are_those_of_steps_in_multiprecision(cube, run):
    """Rounding of 1e-16 grows by a factor e in about seven iterations, to 1e-12 after 60."""
    position, error = walked(float(displaced.DISPLACEMENTS[run]), 60)
    marks = cube["iteration"][cube["iteration"] <= 60]
    largest = [error[begin:end].max() for begin, end in zip([0, *marks[:-1]], marks, strict=True)]
    for summation in (0, 1):
        np.testing.assert_allclose(cube["q_x"][run, summation, : marks.size], position[marks - 1], rtol=0, atol=1e-11)
        found = cube["block_max_energy_error"][run, summation, : marks.size]
        np.testing.assert_allclose(found, largest, rtol=0, atol=1e-11)


@pytest.mark.parametrize("summation", displaced.SUMS)
def test_a_path_leaves_where_a_single_run_of_it_does(cube, summation):
    for run, q_x in enumerate(displaced.DISPLACEMENTS):
        alone = nh.integrate(
            "henon_heiles", "babs7o7h", 2.0, t_end=2 * ITERATIONS, summation=summation, q0=(q_x, "0.4"),
            p0=("0", "0.4"), samples=2,
        )  # fmt: skip
        place = run, displaced.SUMS.index(summation)
        assert cube["left_at"][place] == alone.diverged_at
        assert cube["max_energy_error"][place] == alone.max_energy_error


def test_only_the_path_inside_the_plane_stays_on_its_surface(cube):
    """A thousand iterations of panel D, in one coordinate, come near to the largest error of the curve they follow."""
    assert (cube["left_at"][0] == 0).all()
    assert (cube["q_x"][0] == 0).all()
    of_panel = float(paper_panels()["D"].max_energy_error)
    assert cube["max_energy_error"][0] == pytest.approx(of_panel, rel=1e-3)
    assert (cube["left_at"][1:] > 1000).all()
    assert (cube["left_at"][1:] < ITERATIONS).all()
    assert np.isinf(cube["max_energy_error"][1:]).all()


def test_samples_end_where_a_path_has_left_its_surface(cube):
    left_at = np.where(cube["left_at"] > 0, cube["left_at"], ITERATIONS + 1)
    kept = cube["iteration"] < left_at[..., None]
    for name in ("block_max_energy_error", "q_x"):
        assert (np.isfinite(cube[name]) == kept).all()
    assert cube["iteration"][[0, -1]].tolist() == [1, ITERATIONS]
    assert (np.diff(cube["iteration"]) > 0).all()


def test_evaluations_are_those_of_the_steps_made(contents, cube):
    """Seven a step, and one to begin each run with, for the kick comes first."""
    steps = np.where(cube["left_at"] > 0, cube["left_at"], ITERATIONS)
    assert contents.evaluations == 7 * steps.sum() + steps.size
