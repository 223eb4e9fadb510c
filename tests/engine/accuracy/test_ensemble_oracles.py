"""Ensembles, continued and backward runs of systems with functions, parameters and time, against closed forms."""

from __future__ import annotations

import pickle
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine.runs import ensemble as ensembles
from nearharmonic.math import cos


def driven_potential(q, t, F, w):
    return q[0] ** 2 / 2 - F * q[0] * cos(w * t)


#: Functions of the module, so that the system pickles.
DRIVEN = nh.System(
    name="driven oscillator",
    V=driven_potential,
    time_dependent=True,
    q0=("1",),
    p0=("0.5",),
    t_end="10",
    parameters={"F": "0.5", "w": "0.7"},
)


def driven_state(t, q0, p0, F, w):
    """q'' = -q + F cos(w t): q = (q0 - A) cos t + p0 sin t + A cos(w t), A = F / (1 - w^2)."""
    q0, p0, F, w, t = map(mpf, (q0, p0, F, w, t))
    A = F / (1 - w * w)
    q = (q0 - A) * mpmath.cos(t) + p0 * mpmath.sin(t) + A * mpmath.cos(w * t)
    return float(q), float((A - q0) * mpmath.sin(t) + p0 * mpmath.cos(t) - A * w * mpmath.sin(w * t))


def members(count):
    rng = np.random.default_rng(5)
    q0, p0 = rng.uniform(-2, 2, (2, count, 1))
    return {"q0": q0, "p0": p0, "parameters": {"F": rng.uniform(0, 2, count), "w": rng.uniform(0.1, 0.8, count)}}


@pytest.mark.parametrize("t", [None, [0.3, 2.5, 9.99]], ids=["samples", "output times"])
def test_driven_oscillators_follow_closed_forms_for_all_frequencies_and_amplitudes(t):
    """Members have frequencies, amplitudes and starts of their own; the method's error at this step is 1e-12."""
    given = members(37)
    many = nh.ensemble(DRIVEN, "srkn_a14", 0.04, t=t, samples=3, energy_scale=1, **given)
    F, w = given["parameters"].values()
    for i in range(37):
        for k, time in enumerate(many.t[i].values):
            q, p = driven_state(time, given["q0"][i, 0], given["p0"][i, 0], F[i], w[i])
            assert abs(many.q.values[i, k, 0] - q) < 1e-11
            assert abs(many.p.values[i, k, 0] - p) < 1e-11
    assert np.array_equal(many.parameter_F, F)
    assert np.array_equal(many.parameter_w, w)


def test_problems_with_parameters_and_time_pickle_with_results():
    problem = nh.problem(DRIVEN, "blanes_moan_s6o4", t_end=10, samples=4, energy_scale=1)
    given = {"q0": [0.25], "parameters": {"w": Fraction(1, 3)}}
    result, again = problem(0.1, **given), pickle.loads(pickle.dumps(problem))(0.1, **given)
    copied = pickle.loads(pickle.dumps(result))
    single = nh.integrate(DRIVEN, "blanes_moan_s6o4", 0.1, t_end=10, samples=4, energy_scale=1, **given)
    for other in (again.to_dataset(), copied.to_dataset(), single):
        assert result.to_dataset().identical(other)


def test_a_result_knows_the_parameters_that_it_was_computed_with():
    """Invariants, what continues from it, and its description are those of its own parameters."""
    spring = nh.System(
        name="spring of a constant",
        V=lambda q, k: k * q[0] ** 2 / 2,
        q0=("1",),
        p0=("0",),
        t_end="2",
        parameters={"k": "1"},
        invariants={"twice_the_energy": lambda q, p, k: k * q[0] ** 2 + p[0] ** 2},
    )
    problem = nh.problem(spring, "leapfrog", samples=5)
    for value in ("4", np.float32(0.1), np.array(2.5), [0.3]):
        given = {"q0": [1.5], "parameters": {"k": value}}
        result, single = problem(0.1, **given).to_dataset(), nh.integrate(spring, "leapfrog", 0.1, samples=5, **given)
        assert result.identical(single)
        assert result.twice_the_energy.values[0] == pytest.approx(2 * result.initial_energy.item(), rel=1e-15)
        whole = nh.integrate(spring, "leapfrog", 0.1, t_end=4, **given)
        rest = nh.integrate(spring, "leapfrog", 0.1, start=result)
        assert np.array_equal(rest.q.values[-1], whole.q.values[-1])
        assert np.array_equal(rest.q_low.values[-1], whole.q_low.values[-1])
        whole_drift = nh.integrate(spring, "leapfrog", 0.1, **given).twice_the_energy_drift
        assert nh.integrate(spring, "leapfrog", 0.1, samples=1, **given).twice_the_energy_drift.item() > 0
        assert nh.integrate(spring, "leapfrog", 0.1, t=[0.5, 2], **given).twice_the_energy_drift <= whole_drift
    # Members of energy 0 are measured absolutely, and the Dataset says so of them alone.
    some = nh.ensemble(spring, "leapfrog", 0.1, q0=np.array([[0.0], [2.0]])).max_energy_error
    none = nh.ensemble(spring, "leapfrog", 0.1, q0=np.array([[0.0], [0.0]])).max_energy_error
    assert "|H - H0|/|H0| (absolute, in 1, where H0 = 0)" in some.long_name
    assert "|H - H0| over" in none.long_name
    assert some.values[1] == nh.integrate(spring, "leapfrog", 0.1, q0=[2.0]).max_energy_error


def test_parameters_that_are_compiled_in_serve_ensembles_too():
    """A power that the formula branches on; two blocks of members, and a value that is refused."""
    system = nh.System(
        name="power", V=lambda q, n: q[0] ** 4 / 4 if n > 2 else q[0] ** 2 / 2, q0=["1"], p0=["0"], t_end="1",
        parameters={"n": "4"},
    )  # fmt: skip
    q0 = np.linspace(0.5, 1, ensembles.BLOCK + 3)[:, None]
    members = nh.ensemble(system, "leapfrog", 0.1, q0=q0, threads=1)
    for i in (0, ensembles.BLOCK, ensembles.BLOCK + 2):
        assert np.array_equal(members.q[i], nh.integrate(system, "leapfrog", 0.1, q0=q0[i]).q[[0, -1]])
    with pytest.raises(nh.errors.SettingError, match="they are compiled in"):
        nh.ensemble(system, "leapfrog", 0.1, q0=q0, parameters={"n": "2"})
