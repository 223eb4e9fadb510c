"""Potentials that depend on time: a driven oscillator in closed form, orders, derivatives, what is refused."""

from math import log2
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic import math
from nearharmonic.core import expression as size
from nearharmonic.core.number import Constant
from nearharmonic.engine.reference import reference
from nearharmonic.engine.settings import check_fit
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.gradients import check_gradients, velocity
from support.methods.own_systems import DRIVE, driven, spring
from support.oracles.multiprecision import digits_of, energy_errors


def exact_state(t, q0=1, p0=0, F=DRIVE["F"], w=DRIVE["w"]):
    """q'' = -q + F cos(w t): q = (q0 - a) cos t + p0 sin t + a cos(w t), a = F / (1 - w^2)."""
    q0, p0, F, w, t = map(mpf, (q0, p0, F, w, t))
    a = F / (1 - w * w)
    q = (q0 - a) * mpmath.cos(t) + p0 * mpmath.sin(t) + a * mpmath.cos(w * t)
    return q, (a - q0) * mpmath.sin(t) + p0 * mpmath.cos(t) - a * w * mpmath.sin(w * t)


def exact_position(t):
    return exact_state(t)[0]


def exact_momentum_of_time(t):
    """p_t = -integral of dV/dt = -(T + V - H0), with H0 = 0."""
    q, p = exact_state(t)
    return -(p**2 / 2 + q**2 / 2 - mpf("0.5") * q * mpmath.cos(mpf("0.7") * t))


def anharmonic(q, t):
    return q[0] ** 4 / 4 * (1 + math.cos(t) / 2) + q[0] ** 2 / 2 + q[0] * t * t


@pytest.mark.parametrize("precision", ["double", pytest.param("extended", marks=pytest.mark.slow)])
def test_a_driven_oscillator_follows_its_closed_form(precision):
    """The method's error at this step size is 2e-14; double-double adds the digits below."""
    tau, close = (0.02, 2e-13) if precision == "double" else (0.01, mpf("1e-15"))
    run = nh.integrate(driven(), "srkn_a14", tau, t_end=20, precision=precision, samples=21, energy_scale=1)
    for i, t in enumerate(run.t.values):
        assert abs(digits_of(run, "q", i)[0] - exact_position(t)) < close
    assert run.max_energy_error.item() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("t", [None, [0.3, 2.5, 9.99]], ids=["samples", "output times"])
def test_driven_oscillators_follow_closed_forms_for_all_frequencies_and_amplitudes(t):
    """Members have frequencies, amplitudes and starts of their own; the method's error at this step is 1e-12."""
    rng = np.random.default_rng(5)
    q0, p0 = rng.uniform(-2, 2, (2, 37, 1))
    F, w = rng.uniform(0, 2, 37), rng.uniform(0.1, 0.8, 37)
    given = {"q0": q0, "p0": p0, "parameters": {"F": F, "w": w}, "t_end": 10}
    many = nh.ensemble(driven(), "srkn_a14", 0.04, t=t, samples=3, energy_scale=1, **given)
    for i in range(37):
        for k, time in enumerate(many.t[i].values):
            q, p = exact_state(time, q0[i, 0], p0[i, 0], F[i], w[i])
            assert abs(many.q.values[i, k, 0] - q) < 1e-11
            assert abs(many.p.values[i, k, 0] - p) < 1e-11
    assert np.array_equal(many.parameter_F, F)
    assert np.array_equal(many.parameter_w, w)


def relativistic(p):
    return math.sqrt(1 + p[0] ** 2)


@pytest.mark.parametrize(
    ("method", "more"),
    [
        ("leapfrog", {}),
        *(
            pytest.param(method, more, marks=pytest.mark.slow)
            for method, more in (
                ("leapfrog", {"T": relativistic}), ("chin_4a", {}), ("gauss16", {}), ("gauss16", {"T": relativistic}),
                ("leapfrog in memory", {}), ("gauss16 in memory", {}),
            )
        ),
    ],
)  # fmt: skip
def test_the_clock_of_plain_sums_is_compensated(method, more, monkeypatch):
    if method.endswith(" in memory"):
        method = method.removesuffix(" in memory")
        monkeypatch.setattr(size, "MOST_UNROLLED", 0)
    t_end = 20_000 if method == "leapfrog" else 2000
    run = nh.integrate(driven(**more), method, 0.01, t_end=t_end, samples=2, summation="plain", energy="none")
    # The step size and its products with coefficients are rounded once; a sum of plain additions is off by 3e-7.
    assert abs(run.clock[-1].item() - t_end + run.clock_low[-1].item()) < t_end * 2.0**-52, "clock"
    half = nh.integrate(driven(**more), method, 0.01, t_end=t_end // 2, samples=2, summation="plain", energy="none")
    for start in (half, half.drop_vars("running")):
        rest = {"start": start, "t_end": t_end - t_end // 2, "samples": 2, "summation": "plain", "energy": "none"}
        assert nh.integrate(driven(**more), method, 0.01, **rest).clock_low[-1] == run.clock_low[-1]


def test_extended_energy_is_conserved_and_p_t_is_work():
    """In mpmath: H = T + V + p_t, by the formulas that kernels integrate."""
    formulas = driven().formulas()
    q0, p0 = driven().extended_start(mpf)
    assert (q0, p0, formulas.dimension) == ((1, 0), (0, 0), 2)
    constants = tuple(map(mpf, DRIVE.values()))
    t = mpf(2)
    q, p = exact_position(t), mpmath.diff(exact_position, t)
    x, y = (q, t), (p, exact_momentum_of_time(t))
    H0 = formulas.T(p0, *constants) + formulas.V(q0, *constants)
    assert abs(formulas.T(y, *constants) + formulas.V(x, *constants) - H0) < mpf(10) ** -25
    assert formulas.grad_T(y, *constants) == (p, 1)
    force = formulas.grad_V(x, *constants)
    assert abs(force[0] + mpmath.diff(exact_position, t, 2)) < mpf(10) ** -20
    assert abs(force[1] + mpmath.diff(exact_momentum_of_time, t)) < mpf(10) ** -20


@pytest.mark.slow
@pytest.mark.parametrize(("name", "order"), [("aba864", 4), ("srkn_b11", 6)])
def test_the_energy_error_falls_with_the_order_of_the_method(name, order):
    """In 60 digits, on a nonlinear system; Nystrom methods keep their order, since T + p_t is quadratic."""
    made = spring(V=anharmonic, grad_V=None, time_dependent=True)
    check_fit(made, nh.integrators[name])
    formulas, (q0, p0) = made.formulas(), made.extended_start(mpf)
    extended = SimpleNamespace(
        V=formulas.V, T=formulas.T, grad_V=formulas.grad_V, grad_T=formulas.grad_T, q0=q0, p0=p0, parameters={}
    )
    coarse, fine = (energy_errors(nh.integrators[name], extended, mpf(1) / n, n)[-1] for n in (64, 128))
    assert log2(coarse / fine) == pytest.approx(order, abs=0.15)


@pytest.mark.slow
def test_a_gradient_that_is_given_is_used_and_compared():
    sound = driven(grad_V=lambda q, t, F, w: (q[0] - F * math.cos(w * t),))
    check_gradients(sound)
    a, b = (nh.integrate(s, "aba864", 0.1, t_end=5, energy_scale=1) for s in (sound, driven()))
    assert a.q.values == pytest.approx(b.q.values, abs=1e-14)
    wrong = driven(grad_V=lambda q, t, F, w: (q[0] - F * math.sin(w * t),))
    with pytest.raises(SystemDefinitionError, match=r"^driven: grad_V\[0\] contradicts V: at q = \("):
        nh.integrate(wrong, "aba864", 0.1)
    extended = driven(grad_V=lambda q, t, F, w: (q[0] - F * math.cos(w * t), 0))
    with pytest.raises(SystemDefinitionError, match=r"^driven: grad_V returns 2 components, expected a tuple of 1"):
        nh.integrate(extended, "aba864", 0.1)


def test_extended_system_is_available_as_separate_system():
    made = driven(observables={}, exact_position=lambda system, t: (exact_position(t),))
    own = made.autonomous()
    assert (own.dimension, own.time_dependent, own.q0, own.p0) == (2, False, ("1", "0"), ("0", "0"))
    assert own.quadratic_kinetic_energy
    assert not own.unit_masses
    assert nh.systems["sho"].autonomous() is nh.systems["sho"]
    check_gradients(own)
    a, b = (nh.integrate(s, "aba864", 0.1, t_end=5, energy_scale=1) for s in (made, own))
    assert a.q.values[:, 0].tobytes() == b.q.values[:, 0].tobytes()
    assert b.q.values[:, 1] == pytest.approx(b.t.values, abs=1e-14)
    *rates, _ = velocity(made.autonomous())(1.0, 0.0, 0.5, 0.0)
    assert rates == pytest.approx([0.5, 1.0, -0.5])


@pytest.mark.slow
def test_positions_are_compared_without_the_time():
    """With the closed form, which the check of forces passes, and with a fine run."""
    for closed in (lambda system, t: (exact_position(t),), None):
        known = reference(driven(exact_position=closed), "3")
        assert known.q.shape == (1, 2)
        assert abs(mpf(known.q[0, 0]) + mpf(known.q[0, 1]) - exact_position(mpf(3))) < 1e-16
        assert known.error([[known.q[0, 0] + 0.5, 3.0]]) == pytest.approx(0.5 / known.scale)
    with pytest.raises(SystemDefinitionError, match="exact_position contradicts"):
        reference(driven(exact_position=lambda system, t: (mpmath.cos(t),)), "3")


def test_gradient_and_energy_take_the_time():
    made = driven()
    assert made.grad_V((2.0,), 0.0, 0.5, 0.7) == (1.5,)
    assert made.energy((2.0,), (1.0,), (0.5, 0.7), 0.0) == 1.5
    with pytest.raises(SystemDefinitionError, match=r"^driven: V depends on time, and its energy needs t$"):
        made.energy((2.0,), (1.0,), (0.5, 0.7))
    assert made.quadratic_kinetic_energy
    assert made.parameters_at_run_time
    assert made.constants(Constant) == (Constant(1, 2), Constant(7, 10))


@pytest.mark.slow
def test_a_relativistic_particle_may_be_driven_too():
    made = driven(T=lambda p: math.sqrt(1 + p[0] ** 2))
    assert not made.quadratic_kinetic_energy
    run = nh.integrate(made, "aba864", 0.05, t_end=5)
    assert run.max_energy_error.item() < 1e-9


def test_a_potential_of_the_wrong_arguments_is_refused():
    for V in (lambda q: q[0], lambda q, t, F, w, more: q[0]):
        with pytest.raises(SystemDefinitionError, match=r"^driven: V takes \(q.* and is called as V\(q, t, F, w\): "):
            nh.integrate(driven(V=V), "aba864", 0.1)


def test_the_time_is_no_component_of_the_coordinates():
    for formulas in ({"V": lambda q, t, F, w: q[1]}, {"grad_V": lambda q, t, F, w: (q[1],)}):
        with pytest.raises(SystemDefinitionError, match=r"V raises IndexError: .*range: q has 1 component$"):
            check_gradients(driven(**formulas))


@pytest.mark.parametrize(("more", "scale"), [({"energy_scale": 2}, 2), ({"q0": [2]}, 0.99), ({"q0": [1]}, 0.99)])
def test_energy_errors_that_include_p_t_have_a_stated_scale(more, scale):
    """H0 of q0 = 1 is 0 by accident. 0.5 - 0.5 cos(0.7 t) is largest at t = 13.75 of the 17 times: 0.990."""
    says, label = f"/({scale} 1), H = T + V + p_t", f"relative to energy_scale {scale}"
    absolute = nh.integrate(driven(), "ruth", 0.1, t_end=1, **(more | {"energy_scale": 1}))
    run = nh.integrate(driven(), "ruth", 0.1, t_end=1, **more)
    assert run.energy_error.values * scale == pytest.approx(absolute.energy_error.values, rel=1e-15)
    assert run.energy_error.attrs["long_name"] == f"(H - H0){says}"
    assert run.max_energy_error.attrs["long_name"] == f"maximum of |H - H0|{says}, over every step, inf if diverged"
    assert label in nh.plot(run, kind="energy").axes[0].get_ylabel()
    assert "p_t" not in nh.integrate("sho", "ruth", 0.1, t_end=1).energy_error.attrs["long_name"]
