"""Tangent maps against closed forms, differences in extended precision, and steps with their Jacobians in mpmath."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic.math import cos, sin

EPS = 2.0**-52


def driven(q, t, k, a):
    return -k * cos(q[0]) + a * q[0] * sin(t)


def quartic(q, k):
    return k * (q[0] * q[0] * q[0] * q[0] + q[1] * q[1]) / 4 + q[0] * q[1] / 3


def relativistic(p, k):
    return nh.math.sqrt(1 + p[0] * p[0] + p[1] * p[1]) + k * p[0] * p[1] / 8


DRIVEN = nh.System(
    name="driven", V=driven, q0=["1"], p0=["0.2"], t_end="6", parameters={"k": "1.5", "a": "0.3"}, time_dependent=True
)
GENERAL = nh.System(
    name="general", V=quartic, T=relativistic, q0=["1", "0.2"], p0=["0.1", "0.4"], t_end="6", parameters={"k": "1.25"}
)
SYSTEMS = {"henon_heiles": (0.5, 20), "kepler": (30, 3000), DRIVEN: (0.2, 6), GENERAL: (0.2, 6)}


def tangent_map(run):
    """The matrix whose columns are the images of the unit vectors, from which the run began."""
    directions = np.concatenate([run.deviation_q, run.deviation_p], axis=1)
    return (directions * np.exp(run.growth.values[-1])[:, None]).T


def symplectic_form(d):
    return np.block([[np.zeros((d, d)), np.eye(d)], [-np.eye(d), np.zeros((d, d))]])


def whole_map(system, method, tau, t_end, **settings):
    dimension = (system if isinstance(system, nh.System) else nh.systems[system]).dimension
    run = nh.tangent(system, method, tau, t_end=t_end, deviations=np.eye(2 * dimension), **settings)
    return tangent_map(run), run


def differences(system, method, tau, t_end, **settings):
    """Central differences of the map, with steps of 1e-10: truncation errors of 1e-20, and roundings of 1e-31/1e-10."""
    system = system if isinstance(system, nh.System) else nh.systems[system]
    h, d, columns = Fraction(1, 10**10), system.dimension, []

    def end(state):
        run = nh.integrate(
            system, method, tau, t_end=t_end, q0=state[:d], p0=state[d:], precision="extended", energy="none",
            samples=2, **settings,
        )  # fmt: skip
        parts = [run[name].values[-1] for name in ("q", "p", "q_low", "p_low")]
        return np.concatenate(parts[:2]), np.concatenate(parts[2:])

    start = [Fraction(x) for x in (*system.q0, *system.p0)]
    for i in range(2 * d):
        up, down = (end([x + sign * h * (i == j) for j, x in enumerate(start)]) for sign in (1, -1))
        columns.append(((up[0] - down[0]) + (up[1] - down[1])) / (2 * float(h)))
    return np.array(columns).T


@pytest.mark.parametrize("method", ["ruth", "babps8o7h", "mclachlan_atela_3", "chin_4a"])
def test_oscillators_tangent_map_is_a_power_of_its_step(method):
    """The step is a product of shears; a kick of the modified potential of q^2/2 has k tau - 2 m tau^3."""
    method = {**integrators, **nh.modified_integrators}[method]
    tau, steps = 0.25, 40
    step = np.eye(2)
    kicks, drifts = iter(zip(method.kick, method.square or ["0"] * len(method.kick), strict=True)), iter(method.drift)
    for i in range(len(method.kick) + len(method.drift)):
        if (i % 2 == 0) == (method.first == "kick"):
            k, m = map(float, next(kicks))
            step = np.array([[1, 0], [-(k * tau - 2 * m * tau**3), 1]]) @ step
        else:
            step = np.array([[1, float(next(drifts)) * tau], [0, 1]]) @ step
    found, run = whole_map("sho", method, tau, tau * steps)
    assert run.steps.item() == steps
    # Some ten roundings a step, of numbers near 1.
    np.testing.assert_allclose(found, np.linalg.matrix_power(step, steps), rtol=0, atol=10 * steps * EPS)


@pytest.mark.slow
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda one: getattr(one, "name", one))
def test_tangent_map_is_symplectic_to_rounding(system):
    """Each entry of M^T J M is a sum of 2 d products of columns; M errs by a few roundings a step."""
    tau, t_end = SYSTEMS[system]
    M, run = whole_map(system, "babps8o7h", tau, t_end)
    d = len(M) // 2
    form = symplectic_form(d)
    size = np.abs(M).T @ np.abs(form) @ np.abs(M)
    assert (np.abs(M.T @ form @ M - form) <= run.steps.item() * EPS * size).all()
    bound = run.steps.item() * EPS * np.abs(M).max() ** 2 * len(M)
    assert abs(np.linalg.det(M) - 1) < bound < 1e-4


@pytest.mark.parametrize("method", ["ruth", "babps8o7h"])
@pytest.mark.parametrize("system", SYSTEMS, ids=lambda one: getattr(one, "name", one))
def test_tangent_map_is_the_derivative_of_the_discrete_map(system, method):
    tau, t_end = SYSTEMS[system]
    found, run = whole_map(system, method, tau / 2, t_end)
    expected = differences(system, method, tau / 2, t_end)
    # Roundings of the steps, relative to each column.
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=run.steps.item() * EPS * scale)


def test_tangent_map_of_an_implicit_method_is_symplectic():
    """A step of Gauss collocation errs by the rounding of its sums over 16 forces; iterations err by less."""
    M, run = whole_map("henon_heiles", "gauss16", 0.5, 20)
    fine, _ = whole_map("henon_heiles", "babps8o7h", 0.05, 20)
    form, size = symplectic_form(2), np.abs(M).T @ np.abs(symplectic_form(2)) @ np.abs(M)
    assert (np.abs(M.T @ form @ M - form) <= 16 * run.steps.item() * EPS * size).all()
    # The error of the splitting method, of order 8 and at most 1e-7 at ten times the step.
    np.testing.assert_allclose(M, fine, rtol=0, atol=1e-9)
    assert run.evaluations.item() > 4 * 16 * run.steps.item()
    assert run.attrs["integrator"] == "gauss16"


def test_rescaling_does_not_change_the_tangent_map():
    often, once = (whole_map("henon_heiles", "babps8o7h", 0.5, 45, samples=n)[0] for n in (91, 2))
    np.testing.assert_allclose(often, once, rtol=0, atol=100 * EPS * np.abs(once).max())


def test_extended_precision_keeps_the_orbit():
    settings = {"t_end": 300, "samples": 7}
    found = nh.tangent("henon_heiles", "babps8o7h", 0.5, precision="extended", **settings)
    alone = nh.integrate("henon_heiles", "babps8o7h", 0.5, precision="extended", **settings)
    # 600 steps with roundings of 1e-32, which grow by 1e7 or so: no double differs.
    np.testing.assert_array_equal(found.q, alone.q)
    np.testing.assert_array_equal(found.p, alone.p)


def test_processed_methods_have_the_derivative_of_processed_states():
    """Differences of doubles: steps of 1e-5 err by 1e-10 of a third derivative, and by 1e-16 over 1e-5."""
    method = next(name for name, one in nh.modified_integrators.items() if one.processed)
    found, _ = whole_map("henon_heiles", method, 0.2, 4)
    h, columns = 1e-5, []
    for i in range(4):
        ends = []
        for sign in (1, -1):
            state = np.array([0.3, 0.0, 0.0, 0.4])
            state[i] += sign * h
            run = nh.integrate("henon_heiles", method, 0.2, t_end=4, q0=state[:2], p0=state[2:], samples=2)
            ends.append(np.concatenate([run.q.values[-1], run.p.values[-1]]))
        columns.append((ends[0] - ends[1]) / (2 * h))
    np.testing.assert_allclose(found, np.array(columns).T, rtol=0, atol=1e-8)


def test_members_have_the_bits_of_single_runs():
    q0, p0 = [[0, 0.1], [0, -0.15], [0.3, 0]], [[0.4, 0.1], [0.49, 0], [0, 0.4]]
    settings = {"t_end": 300, "samples": 5, "deviations": 3}
    many = nh.tangent("henon_heiles", "aba104", 0.5, q0=q0, p0=p0, **settings)
    assert many.sizes["member"] == 3
    assert many.identical(nh.tangent("henon_heiles", "aba104", 0.5, q0=q0, p0=p0, threads=2, **settings))
    for i in range(3):
        one = nh.tangent("henon_heiles", "aba104", 0.5, q0=q0[i], p0=p0[i], **settings)
        assert "member" not in one.dims
        for name in one.data_vars:
            expected = many[name].isel(member=i) if "member" in many[name].dims else many[name]
            np.testing.assert_array_equal(one[name], expected)


def test_members_may_differ_in_their_parameters():
    k = [1.0, 1.5, 2.0]
    many = nh.tangent(DRIVEN, "leapfrog", 0.2, t_end=6, parameters={"k": k}, deviations=np.eye(2))
    assert many.parameter_k.values.tolist() == k
    for i, value in enumerate(k):
        one = nh.tangent(DRIVEN, "leapfrog", 0.2, t_end=6, parameters={"k": value}, deviations=np.eye(2))
        np.testing.assert_array_equal(many.growth[i], one.growth)


def test_runs_backwards_have_the_inverse_tangent_map():
    forth, run = whole_map("henon_heiles", "babps8o7h", 0.5, 20)
    back = nh.tangent(
        "henon_heiles", "babps8o7h", 0.5, t_end=-20, q0=run.q.values[-1], p0=run.p.values[-1], deviations=np.eye(4)
    )
    # Roundings of 40 steps, times the size of both maps.
    np.testing.assert_allclose(tangent_map(back) @ forth, np.eye(4), rtol=0, atol=40 * EPS * np.abs(forth).max() ** 2)


@pytest.mark.parametrize("system", ["regularised", "numba"])
def test_systems_without_second_derivatives_are_refused(system):
    if system == "numba":
        numba = pytest.importorskip("numba")
        V, grad_V = (numba.njit(f) for f in (lambda q: q[0] * q[0] / 2, lambda q: (q[0],)))
        subject = nh.System(name="numba_spring", V=V, grad_V=grad_V, q0=["1"], p0=["0"], t_end="5")
    else:
        subject = "kepler_regularised"
    for call in (nh.tangent, nh.gradient):
        arguments = [subject, "leapfrog", 0.1] + ["energy"] * (call is nh.gradient)
        with pytest.raises(nh.NearharmonicError, match=r"^system = "):
            call(*arguments)
