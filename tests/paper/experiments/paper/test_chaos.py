"""Lyapunov exponents: definition, interval, and values for the two orbits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t as student

from nearharmonic.engine.tangent import tangent_system
from nearharmonic.engine.trajectory import Problem
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.paper import orbits as chaos
from nearharmonic_paper.experiments.paper.orbits import follow


@pytest.fixture(scope="module")
def cube():
    return {name: values for name, (_, values, _) in chaos.chaos("babps8o7h", 200_000)["cube"].variables.items()}


@pytest.fixture(scope="module")
def short():
    """Variables of twenty scalings a unit of time apart, and the growth of the paper's deviation between them."""
    system = systems["henon_heiles"]
    problem = Problem(tangent_system(system), "babps8o7h", t_end=1, energy="none")
    found = chaos.lyapunov_exponents(system, problem, 20)
    return {name: values for name, (_, values, _) in found.items()}, follow(
        problem, chaos.TAU, chaos.ORBITS["paper"], 20
    )[1]


def test_an_exponent_is_the_mean_growth_up_to_its_time(short):
    found, growth = short
    assert found["time"].tolist() == [*range(1, 21)]
    expected = [math.fsum(growth[:n]) / n for n in range(1, 21)]
    np.testing.assert_allclose(found["lyapunov_exponent"][0], expected, rtol=1e-13)


def test_the_interval_is_that_of_ten_equal_blocks(short):
    """Ten blocks of two scalings; the quantile is exact to 2e-3 (3/9)^5."""
    found, growth = short
    blocks = growth.reshape(10, 2).mean(axis=1)
    width = student.ppf(0.975, 9) * blocks.std(ddof=1) / math.sqrt(10)
    assert found["lyapunov_exponent_interval"][0] == pytest.approx(width, rel=1e-5)


def test_the_orbits_keep_their_energy(cube):
    """As :data:`chaos.TAU` says of the paper's orbit; the error falls with the amplitude."""
    paper, regular = np.abs(cube["energy_error"]).max(axis=1)
    assert 1e-10 < paper < 1e-7
    assert 0 < regular < paper


def test_the_large_orbit_is_chaotic_the_small_one_regular(cube):
    """Deviations of a regular orbit grow at most linearly: ln(t)/t = 6.1e-5 at t = 2e5."""
    assert cube["time"][-1] == 2e5
    paper, regular = cube["lyapunov_exponent"][:, -1]
    of_paper, of_regular = cube["lyapunov_exponent_interval"]
    assert 0 < regular < math.log(2e5) / 2e5
    assert paper - of_paper > 100 * (regular + of_regular)


def test_early_exponents_are_those_of_finer_steps(cube):
    """Errors of 1e-7 of the orbit grow by e^11, to 6e-3, up to t = 500."""
    system = systems["henon_heiles"]
    problem = Problem(tangent_system(system), "babps9o7h", t_end=500, energy="none")
    for i, orbit in enumerate(chaos.ORBITS.values()):
        growth = follow(problem, 0.05, orbit, 1)[1].item()
        assert cube["lyapunov_exponent"][i, 0] == pytest.approx(growth / 500, rel=6e-3)
