"""docs/how_to/stepper.md: its programs run as printed, and their results are correct."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs/how_to/stepper.md").read_text(encoding="utf-8")


def run(word):
    """The names that the one program with this word in it leaves behind."""
    (program,) = [block for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL) if word in block]
    names = {}
    exec(compile(program, "docs/how_to/stepper.md", "exec"), names)
    return names


def test_the_loop_follows_the_orbit_of_a_run():
    found = run("def orbit")
    settings = {"q0": [69.82, 0.0], "p0": [0.0, 0.14], "parameters": {"GM": "1.72"}}
    path = nh.integrate("kepler", "babps9o7h", 36, t_end=36_000, summation="plain", energy="none", **settings)
    # Each of the 1000 steps makes 18 sums. Their roundings, of 2^-53, change the energy as a random walk does, and the
    # phase by the sum of that over the steps.
    bound = 18 * 2.0**-53 * 1000**1.5
    assert np.abs(found["q"] / path.q.values[-1] - 1).max() < bound


@pytest.mark.slow
def test_the_sampler_has_the_variances_of_its_gaussian():
    found = run("def sample")
    squares = (found["chain"] - found["chain"].mean(axis=0)) ** 2
    # Batches of 200 states are independent for a chain whose correlation decays within a few.
    means = squares.reshape(100, 200, 2).mean(axis=1)
    error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    assert (np.abs(means.mean(axis=0) - [1, 4]) < 5 * error).all()
    assert (error < [0.05, 0.2]).all()
    assert 0.9 < found["accepted"] < 0.99


@pytest.fixture(scope="module")
def crossings():
    return run("def section")


def test_points_of_section_lie_on_it_with_energy_of_orbit(crossings):
    (x, y), (px, py) = crossings["positions"].T, crossings["momenta"].T
    assert len(x) == 200
    assert np.abs(x).max() < 2.0**-52  # Newton's method squares the error: less than 0.3 becomes less than rounding
    assert px.min() > 0
    H = (px**2 + py**2) / 2 + y * y / 2 - y**3 / 3
    run = nh.integrate("henon_heiles", "babps9o7h", 0.5, t_end=2000, q0=[0.0, 0.1], p0=[0.49, 0.0])
    # The orbits part by rounding, and have errors of one size: a factor 3 for that.
    assert np.abs(H / run.initial_energy.item() - 1).max() < 3 * run.max_energy_error.item()


@pytest.mark.slow
def test_the_section_is_that_of_straight_lines_between_samples(crossings):
    system, tau = nh.systems[str(ROOT / "examples/poincare_section.py")], 0.02
    speed = np.sqrt(-0.674 - np.log(0.14**2 + 0.3**2))
    run = nh.integrate(system, "ruth", tau, t_end=30, samples=1501, q0=[0.3, 0.0], p0=[0.0, speed])
    q, p = run.q.values, run.p.values
    (before,) = np.nonzero((q[:-1, 1] < 0) & (q[1:, 1] >= 0))
    share = q[before, 1] / (q[before, 1] - q[before + 1, 1])
    lines = np.array([(a[before] + share[:, None] * (a[before + 1] - a[before]))[:, 0] for a in (q, p)])
    step = nh.stepper(system, "ruth")
    positions, momenta = crossings["section"](step, np.array([0.3, 0.0]), np.array([0.0, speed]), tau, len(before), 1)
    # A straight line is off by at most tau^2/8 of the second derivative of each coordinate, and its crossing of y = 0
    # by that over the speed, which moves x and its momentum by their own rates.
    rates = [np.abs(np.gradient(a, tau, axis=0)).max() for a in (q, p)]
    curvatures = [np.abs(np.gradient(np.gradient(a, tau, axis=0), tau, axis=0)).max() for a in (q, p)]
    late = curvatures[0] * tau**2 / 8 / momenta[:, 1].min()
    assert len(before) > 5
    for line, exact, rate, curvature in zip(lines, (positions, momenta), rates, curvatures, strict=True):
        assert np.abs(line - exact[:, 0]).max() < curvature * tau**2 / 8 + rate * late
