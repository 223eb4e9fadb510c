"""Invariants of a system beside its energy: their values along a run, and their drift."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.description import InvariantWarning, drift_variables
from nearharmonic.engine.setup import invariant_values, observable_values
from nearharmonic.errors import SystemDefinitionError
from support.methods.own_systems import spring


def test_the_invariants_of_a_run_are_those_of_its_states():
    run = nh.integrate("kepler", "aba864", 90.0, t_end=8766, samples=50)
    (x, y), (u, v) = run.q.values.T, run.p.values.T
    GM = 1.71994752
    momentum, r = x * v - y * u, np.hypot(x, y)
    np.testing.assert_allclose(run.angular_momentum, momentum, rtol=1e-15)
    assert run.eccentricity_vector.dims == ("sample", "eccentricity_vector_component")
    # Laplace-Runge-Lenz vector, e = v x L / GM - r / |r|; cancellation leaves a few units of the last place of 1.
    vector = np.stack([v * momentum / GM - x / r, -u * momentum / GM - y / r], axis=-1)
    np.testing.assert_allclose(run.eccentricity_vector, vector, rtol=0, atol=2e-15)
    start = vector[0]
    drift = np.linalg.norm(vector - start, axis=1).max() / np.linalg.norm(start)
    assert float(run.eccentricity_vector_drift) == pytest.approx(drift, rel=1e-9)
    assert float(run.angular_momentum_drift) < 1e-13  # kept by each substep but for rounding
    assert float(run.eccentricity_vector_drift) > 1e-6  # kept by the exact orbit alone


def test_a_drift_is_relative_unless_the_invariant_begins_at_zero():
    system = spring(invariants={"zero": lambda q, p: p[0], "ten": lambda q, p: 10 * q[0]})
    q, p = np.array([[[1.0], [0.5]], [[1.0], [np.nan]]]), np.array([[[0.0], [-3.0]], [[0.0], [np.nan]]])
    found = drift_variables(system, q, p, np.array([False, False]))
    assert found["zero_drift"][1].tolist() == [3.0, 0.0]
    assert found["ten_drift"][1].tolist() == [0.5, 0.0]
    assert "of |I - I0|, I = zero" in found["zero_drift"][2]["long_name"]
    assert "|I - I0|/|I0|" in found["ten_drift"][2]["long_name"]


def test_run_that_leaves_its_energy_surface_has_infinite_drift():
    run = nh.integrate("kepler", "ruth", 2000.0)
    assert run.status == "diverged"
    assert np.isinf(run.angular_momentum_drift)


def test_a_system_without_invariants_has_no_variable_more():
    assert not [name for name in nh.integrate("sho", "ruth", 0.5, t_end=5).variables if str(name).endswith("_drift")]


def test_invariant_that_fails_far_from_start_is_nan_there():
    def picky(q, p, *_):
        if np.any(np.abs(q[0]) > 2):
            raise ValueError("too far")
        return p[0], q[0]

    system = spring(invariants={"picky": picky}, observables={"near": lambda q, p: picky(q, p)[0]})
    q, p = np.array([[[1.0], [3.0], [2.0]]]), np.array([[[4.0], [5.0], [6.0]]])
    found = drift_variables(system, q, p, np.array([False]))
    np.testing.assert_array_equal(found["picky"][1], [[[4.0, 1.0], [np.nan, np.nan], [6.0, 2.0]]])
    assert found["picky_drift"][1] == pytest.approx(np.hypot(2, 1) / np.hypot(4, 1))
    np.testing.assert_array_equal(observable_values(system, q, p, ())["near"], [[4.0, np.nan, 6.0]])
    with pytest.raises(SystemDefinitionError, match="the invariant picky cannot be evaluated: ValueError: too far"):
        invariant_values(system, q + 5, p)


def test_an_invariant_that_fails_is_named():
    system = spring(invariants={"broken": lambda q, p: q[1]})
    with pytest.raises(SystemDefinitionError, match="spring: the invariant broken cannot be evaluated: IndexError"):
        invariant_values(system, np.array([[1.0]]), np.array([[0.0]]))


def test_a_constant_is_an_invariant():
    system = spring(invariants={"one": lambda q, p: 1})
    assert invariant_values(system, np.ones((3, 1)), np.ones((3, 1)))["one"].tolist() == [[1.0]] * 3


def unequal(**invariants):
    """Two uncoupled oscillators of frequencies 1 and 2: their energies are conserved, and no angular momentum."""
    return nh.System(
        name="unequal",
        V=lambda q: q[0] ** 2 / 2 + 2 * q[1] ** 2,
        q0=[1, 0.2],
        p0=[0, 0.3],
        t_end=10,
        invariants=invariants,
    )


def test_invariant_that_changes_along_exact_orbits_is_warned_of():
    system = unequal(
        first=lambda q, p: (p[0] ** 2 + q[0] ** 2) / 2,
        momentum=lambda q, p: q[0] * p[1] - q[1] * p[0],
        both=lambda q, p: (p[1] ** 2 / 2 + 2 * q[1] ** 2, p[0]),
    )
    with pytest.warns(InvariantWarning) as caught:
        nh.integrate(system, "ruth", 0.1)
    named = [str(one.message).partition(" is not conserved")[0] for one in caught]
    assert named == ["unequal: the invariant momentum", "unequal: the invariant both"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        nh.integrate(system, "ruth", 0.2)
        nh.ensemble(system, "ruth", 0.2, q0=[[1, 2], [3, 4]])


def test_coarse_steps_are_no_fault_of_an_invariant():
    """The energy of one oscillator drifts by more than 5 % here, and so does Kepler's eccentricity vector."""
    system = unequal(second=lambda q, p: p[1] ** 2 / 2 + 2 * q[1] ** 2)
    kepler = replace(nh.systems["kepler"], name="coarse")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert nh.integrate(system, "leapfrog", 0.4).second_drift > 0.05
        assert nh.integrate(kepler, "leapfrog", 200.0).eccentricity_vector_drift > 0.05


@pytest.mark.slow
def test_differences_longer_than_a_period_of_the_potential_tell_nothing():
    """Their steps are in proportion to |q|, which is 1e8 here."""
    far = nh.System(
        name="far",
        V=lambda q: nh.math.sin(q[0] - q[1]),
        q0=[1e8, 1e8 + 1],
        p0=[1, 2],
        t_end=1,
        invariants={"total": lambda q, p: p[0] + p[1]},
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        nh.integrate(far, "ruth", 0.1)
