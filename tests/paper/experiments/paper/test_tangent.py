"""Deviations from orbits against closed forms and against differences of neighbouring orbits."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.solution import Problem
from nearharmonic.engine.variation import tangent_system
from nearharmonic.systems import System, systems
from nearharmonic_paper.experiments.paper.orbits.tangent import follow


def inverted(q):
    return -q[0] * q[0] / 2


def slow(p):
    return p[0] * p[0] * p[0] * p[0] / 4


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


@pytest.mark.parametrize("tau", [0.5, 0.1])
def test_the_tangent_map_is_the_derivative_of_the_steps(tau):
    """Central differences at 1e-5 err by 1e-10 of the third derivative and by rounding, 1e-16 over 1e-5."""
    h, base = 1e-5, systems["henon_heiles"]
    runs = [nh.integrate(base, "babps8o7h", tau, t_end=5, q0=(0.3 + s * h, 0.0), samples=2) for s in (1, -1)]
    u, w = ((runs[0][name] - runs[1][name]).values[-1] / (2 * h) for name in "qp")
    found = nh.problem(tangent_system(base), "babps8o7h", t_end=5, energy="none")(tau, (0.3, 0.0, 1.0, 0.0))
    np.testing.assert_allclose(found.q[-1, 2:], u, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.p[-1, :2], w, rtol=0, atol=1e-8)


def test_a_tangent_system_follows_the_orbit_of_its_system():
    base, runs = systems["henon_heiles"], 4
    problem = Problem(tangent_system(base), "babps8o7h", t_end=5, energy="none")
    states, _ = follow(problem, 0.5, (base.q0, base.p0), runs)
    alone = nh.integrate(base, "babps8o7h", 0.5, t_end=5 * runs, samples=runs + 1)
    # Some 300 roundings of 1e-16, which grow by a factor of two or so in this time.
    np.testing.assert_allclose(states[:, 0], alone.q.values[1:], rtol=0, atol=1e-13)
    np.testing.assert_allclose(states[:, 1], alone.p.values[1:], rtol=0, atol=1e-13)


def test_scaling_a_deviation_does_not_change_its_growth():
    orbit = (systems["henon_heiles"].q0, systems["henon_heiles"].p0)
    often, once = (growth(systems["henon_heiles"], orbit=orbit, time=20 // n, runs=n).sum() for n in (10, 1))
    assert often == pytest.approx(once, abs=1e-12)


def test_any_kinetic_energy_enters_the_tangent_map():
    """T = p^4/4 at V = 0: u grows by 3 p^2 w t, so w = 1 and p = 1/2 give u = 3 t/4."""
    problem = Problem(tangent_system(one_coordinate("slow", T=slow, V=zero)), "babps8o7h", t_end=8, energy="none")
    end = problem(0.5, (0.0, 0.0), (1.0, 0.5))
    assert end.q[-1].tolist() == pytest.approx([1.0, 6.0], rel=1e-14)


def zero(q):
    return 0 * q[0]
