"""Methods inside REBOUND: trajectories, changed particles, names, and refusals."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rebound", minversion="5", reason="rebound >= 5 is not installed")

import rebound

import nearharmonic as nh
from nearharmonic.adapters.rebound import register

EPS = 2.0**-52


def planets(method, dt=0.1):
    simulation = rebound.Simulation()
    simulation.add(m=1.0)
    simulation.add(m=1e-3, a=1.0, e=0.2)
    simulation.add(m=1e-3, a=2.5, e=0.1, inc=0.3)
    simulation.integrator, simulation.dt = method, dt
    return simulation


def particle(method, force, dt=0.25):
    """One particle in a field: ``force`` maps time and position to an acceleration in the plane."""
    simulation = rebound.Simulation()
    simulation.add(m=1.0, x=0.3, y=0.0, vx=0.0, vy=0.4)
    calls = []

    def additional(pointer):
        moved = pointer.contents.particles[0]
        calls.append(pointer.contents.t)
        ax, ay = force(pointer.contents.t, moved.x, moved.y)
        moved.ax += ax
        moved.ay += ay

    simulation.additional_forces = additional
    simulation.integrator, simulation.dt = method, dt
    return simulation, calls


def henon_heiles(_, x, y):
    return -(x + 2 * x * y), -(y + x * x - y * y)


def state(simulation):
    return np.array([[*p.xyz, *p.vxyz] for p in simulation.particles])


@pytest.mark.parametrize("active", [None, 2])
def test_verlet_takes_the_steps_of_leapfrog_of_rebound(active):
    found = []
    for method in (register(nh.integrators["verlet"].role("drift")), "leapfrog"):
        simulation = planets(method)
        simulation.add(a=4.0, e=0.3)
        simulation.N_active, simulation.testparticle_hidewarnings = active or simulation.N, 1
        simulation.integrate(20.05)
        found.append(state(simulation))
        assert simulation.t == pytest.approx(20.05, abs=201 * 20 * EPS)  # a rounding of t each step
    # 201 steps of three moves, two roundings each and numbers up to 6; planets part linearly, below a factor of 200.
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=201 * 3 * 2 * 6 * 200 * EPS)


def test_integrator_used_before_leaves_no_trace():
    switched, fresh = planets("whfast"), planets(register("aba864"))
    switched.steps(1)
    for own, other in zip(fresh.particles, switched.particles, strict=True):
        own.xyz, own.vxyz = other.xyz, other.vxyz
    switched.integrator = register("aba864")
    if switched.gravity == "jacobi":
        with pytest.raises(RuntimeError, match="basic"):
            switched.steps(1)
        switched.gravity = "basic"  # this version of REBOUND leaves Jacobi coordinates to the next integrator
    switched.steps(10)
    fresh.steps(10)
    assert np.array_equal(state(switched), state(fresh))


def test_copy_goes_on_with_the_same_integrator():
    simulation = planets(register("trained_light"))
    simulation.steps(3)
    copied = simulation.copy()
    simulation.steps(3)
    copied.steps(3)
    assert str(copied.integrator) == "nearharmonic_trained_light"
    assert np.array_equal(state(simulation), state(copied))


def test_same_method_has_one_name():
    own = replace(nh.integrators["leapfrog"], name="aba864", aliases=())
    assert register("aba864") == register(nh.integrators["aba864"]) == "nearharmonic_aba864"
    assert register(own) == register(own) == "nearharmonic_aba864_2"
    found = []
    for method in (own, "verlet"):
        simulation = planets(register(method))
        simulation.steps(3)
        found.append(state(simulation))
    assert np.array_equal(*found)


def test_particles_that_splitting_cannot_move_are_refused():
    variational = planets(register("aba864"))
    variational.add_variation()
    drag, _ = particle(register("aba864"), henon_heiles)
    drag.force_is_velocity_dependent = 1
    jacobi = planets(register("aba864"))
    jacobi.gravity = "jacobi"
    for message, simulation in {"variational": variational, "velocities": drag, "basic": jacobi}.items():
        start = state(simulation)
        with pytest.raises(RuntimeError, match=message):
            simulation.steps(1)
        assert np.array_equal(state(simulation), start)


@pytest.mark.parametrize("method", ["leapfrog", "aba864"])
@pytest.mark.parametrize(
    "drag", [lambda t, one, other: -0.1 * one.vx * (t > 5), lambda t, one, other: -0.1 * one.vx * (t > 21.7)]
)
def test_friction_without_the_flag_of_rebound_is_refused(drag, method):
    simulation = rebound.Simulation()
    simulation.add(m=1.0, vx=1.0)
    simulation.add(m=1.0, x=50.0)

    def additional(pointer):
        one, other = pointer.contents.particles
        one.ax += drag(pointer.contents.t, one, other) - one.x

    simulation.additional_forces = additional
    simulation.integrator, simulation.dt = register(method), 0.25
    with pytest.raises(RuntimeError, match="depend on velocities"):
        simulation.integrate(22.0)


def test_short_pieces_are_not_compared_each_time():
    simulation, calls = particle(register("leapfrog"), henon_heiles)
    for piece in range(1, 101):
        simulation.integrate(0.25 * piece)
    # Two forces a step, and two for each comparison: at 1 to 5 and then a quarter later at least, 18 to 100.
    assert 4 + 2 * 6 <= len(calls) - 200 <= 4 + 2 * 19
