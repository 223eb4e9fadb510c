"""Targets of samplers: gradients, energies, published references, and chains of another library."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.numerics.compiled import Normal
from nearharmonic_studies.samplers.run import MADE, tuned
from nearharmonic_studies.samplers.settings import TARGETS, SamplersSettings
from nearharmonic_studies.samplers.targets import COUPLING, MASS, REFERENCES, chance, loop_for, run

pytestmark = pytest.mark.slow  # numba compiles each target


@pytest.mark.parametrize("name", TARGETS)
def test_gradients_are_the_derivatives_of_the_potential(name):
    """Central differences along a random direction: rounding 1e-16 U / h and truncation h^2 of it."""
    target, random = MADE[name](25), np.random.default_rng(1)
    q, step, out = (scale * random.normal(size=target.dimension) for scale in (0.5, 1e-5, 1))
    target.gradient(q, out)
    unused = np.empty_like(out)
    slope = (target.gradient(q + step, unused) - target.gradient(q - step, unused)) / 2
    assert slope == pytest.approx(float(out @ step), rel=1e-6)


def energy(q):
    """U of a lattice by shifted arrays."""
    field = q.reshape(round(q.size**0.5), -1)
    squares = sum((np.roll(field, 1, axis) - field) ** 2 for axis in (0, 1))
    return (squares / 2 + MASS * field**2 / 2 + COUPLING * field**4 / 4).sum()


def test_energy_of_the_lattice_is_that_of_shifted_arrays():
    target, field = MADE["lattice"](36), np.random.default_rng(2).normal(size=36)
    assert target.gradient(field, np.empty(36)) == pytest.approx(energy(field), rel=1e-13)


@pytest.mark.parametrize("name", REFERENCES)
def test_posteriors_have_the_published_means_and_squares(name):
    """Errors of both add in squares; 5 of them, for at most ten numbers."""
    target, reference = MADE[name](0), REFERENCES[name]
    loop, means = loop_for(target), []
    for k in range(8):
        warm = run(target, loop, nh.integrators["leapfrog"], 0.2, 1.0, target.start(Normal([8, k])),
                   chance(Normal([9, k]), 500, target.dimension))  # fmt: skip
        drawn = chance(Normal([10, k]), 3000, target.dimension)
        means.append(run(target, loop, nh.integrators["bcss_s4"], 1.0, 2.0, warm.last, drawn).observed.mean(axis=0))
    published = [*reference.mean.values(), *reference.square.values()]
    values, errors = np.array(published).T
    own = np.std(means, axis=0, ddof=1) / 8**0.5
    assert (np.abs(np.mean(means, axis=0) - values) < 5 * np.hypot(own, errors)).all()


def test_tuning_finds_the_least_of_the_grid():
    """On a posterior of three parameters the smallest step of the grid is never the best."""
    target, settings = MADE["mesquite"](0), SamplersSettings(points=3, tuning=100, chains=8)
    starts = [target.start(Normal([3, k])) for k in range(8)]
    (place,) = tuned(target, loop_for(target), {"leapfrog": nh.integrators["leapfrog"]}, starts, settings).values()
    assert place.tau > 0.15 / target.highest
    assert place.length in target.lengths
