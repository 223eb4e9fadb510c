"""Deviations from orbits against closed forms and against differences of neighbouring orbits."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.engine.tangent import tangent_system
from nearharmonic.engine.trajectory import Problem
from nearharmonic.systems import System, systems
from nearharmonic_paper.experiments.paper.orbits import follow


def inverted(q):
    return -q[0] * q[0] / 2


def one_coordinate(name, **formulas):
    return System(name=name, q0=("0",), p0=("0",), t_end="1", **formulas)


def growth(system, *, orbit, time, runs, tau=0.1):
    problem = Problem(tangent_system(system), "babps8o7h", t_end=time, energy="none")
    return follow(problem, tau, orbit, runs)[1]


def test_deviations_of_the_oscillator_keep_their_length():
    """A rotation; the eighth-order phase error of a step of 0.1 leaves the ellipse of the map a circle to 1e-10."""
    found = growth(systems["sho"], orbit=(("1",), ("0",)), time=10, runs=30)
    assert np.abs(found.cumsum()).max() < 1e-10


def test_deviations_from_an_unstable_equilibrium_grow_as_the_hyperbola():
    """From (1, 0), u = cosh t and w = sinh t: |delta|^2 = cosh 2 t; the step's relative error is as above."""
    found = growth(one_coordinate("inverted", V=inverted), orbit=(("0",), ("0",)), time=4, runs=5)
    t = 4.0 * np.arange(1, 6)
    np.testing.assert_allclose(found.cumsum(), np.log(np.cosh(2 * t)) / 2, rtol=0, atol=1e-8)


def test_scaling_a_deviation_does_not_change_its_growth():
    orbit = (systems["henon_heiles"].q0, systems["henon_heiles"].p0)
    often, once = (growth(systems["henon_heiles"], orbit=orbit, time=20 // n, runs=n).sum() for n in (10, 1))
    assert often == pytest.approx(once, abs=1e-12)
