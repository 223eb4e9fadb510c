"""Exact positions: closed forms where the system has one of its own, else an orbit followed in extended precision."""

import dataclasses
import re
import warnings
from dataclasses import replace
from fractions import Fraction
from math import inf, nan

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.core.number import FUNCTIONS, Constant
from nearharmonic.engine import reference as reference_module
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.description import InvariantWarning, drift_variables
from nearharmonic.engine.reference import Reference, reference
from nearharmonic.engine.settings import Numerics
from nearharmonic.engine.setup import invariant_values, observable_values
from nearharmonic.errors import SettingError, SystemDefinitionError
from nearharmonic.math import atan2, cbrt, cos, cosh, erf, exp, hypot, log, pi, pow, sin, sinh, sqrt, tan, tanh
from nearharmonic.systems import System, systems
from nearharmonic.systems.gradients import velocity, velocity_text
from support.methods.own_systems import spring
from support.oracles.multiprecision import energy_errors, trajectory
from support.oracles.reference_solutions import kepler_state


def test_positions_of_oscillator_and_planet_are_those_of_closed_forms():
    sho, kepler = reference(systems["sho"], "500"), reference(systems["kepler"], "87660")
    planet = systems["kepler"]
    exact = kepler_state(planet.q0[0], planet.p0[1], planet.parameters["GM"].value, 87660)
    for found, expected in ((sho.q, [mpmath.cos(mpf(500))]), (kepler.q, exact[:2])):
        for (high, low), value in zip(found, expected, strict=True):
            assert abs(mpf(high) + mpf(low) - value) < mpf(10) ** -29  # two doubles hold 32 digits of at most 70
    assert (sho.scale, kepler.scale) == (1.0, 69.82)


def test_reference_of_copy_uses_its_own_start_and_parameters():
    """Copies keep the closed form: sin t from (0, 1); Mercury around a star of twice the mass."""
    struck = dataclasses.replace(systems["sho"], q0=("0",), p0=("1",))
    assert reference(struck, "20").error([float(mpmath.sin(20))]) < 1e-15
    near = dataclasses.replace(systems["kepler"], p0=("0", "0.2"), parameters={"GM": "3.43989504"})
    exact = reference(near, "5000")
    expected = kepler_state("69.82", "0.2", "3.43989504", 5000)
    assert exact.source == "closed form in 40 digits"
    assert exact.error([float(x) for x in expected[:2]]) < 1e-15


def test_another_potential_has_no_closed_form_whatever_its_name():
    """A copy of the oscillator, and a system of its name, are followed numerically: cos 2t."""
    stiffer = {"V": lambda q: 2 * q[0] * q[0], "grad_V": lambda q: (4 * q[0],)}
    for system in (dataclasses.replace(systems["sho"], **stiffer), spring("sho", **stiffer)):
        assert reference(system, "3").error([float(mpmath.cos(mpf(6)))]) < 1e-15


@pytest.mark.parametrize(
    "position", [lambda t: mpmath.cos(t) + 1, lambda t: mpmath.cos(2 * t), lambda t: mpmath.cos(t) + mpmath.sin(t)]
)
def test_a_closed_form_that_is_none_is_refused(position):
    """From another point, with another period, with another velocity at the start."""
    with pytest.raises(SystemDefinitionError, match="spring: exact_position contradicts"):
        reference(spring(exact_position=lambda _, t: (position(t),)), "20")


def test_orbit_without_closed_form_of_its_own_is_followed_numerically():
    """A hyperbola from its perihelion: x = a (e - cosh F), y = b sinh F, and e sinh F - F proportional to time."""
    fast = dataclasses.replace(systems["kepler"], p0=("0", "0.333"))
    exact = reference(fast, "500")
    assert "double-double" in exact.source
    r, GM = mpf("69.82"), mpf("1.71994752")
    e = r * mpf("0.333") ** 2 / GM - 1
    a = r / (e - 1)
    F = mpmath.findroot(lambda F: e * mpmath.sinh(F) - F - mpmath.sqrt(GM / a**3) * 500, 1)
    expected = a * (e - mpmath.cosh(F)), a * mpmath.sqrt(e * e - 1) * mpmath.sinh(F)
    assert e > 3
    assert exact.error([float(x) for x in expected]) < 1e-15


def test_system_without_closed_form_is_followed_in_extended_precision():
    found = reference(spring(), "20")
    error = abs(mpf(found.q[0, 0]) + mpf(found.q[0, 1]) - mpmath.cos(mpf(20)))
    # The error that the reference states, which rests on order 6, to a factor of 3; and far below a double's error.
    assert error < 3 * max(found.uncertainty, 1e-30)
    assert found.uncertainty < 1e-17


def test_an_orbit_that_cannot_be_followed_is_refused(monkeypatch):
    monkeypatch.setattr(reference_module, "FIRST_STEPS", 4)
    monkeypatch.setattr(reference_module, "MOST_STEPS", 8)
    with pytest.raises(SettingError, match=r"t_end = '20' is not allowed: the orbit of spring cannot be followed"):
        reference(spring(), "20")


def test_position_errors_are_relative_and_infinite_without_number():
    exact = reference(systems["kepler"], "87660")
    assert exact.error(exact.q[:, 0] + [69.82, 0.0], exact.q[:, 1]) == pytest.approx(1.0, rel=1e-15)
    assert exact.error([nan, 0.0]) == inf


def test_digits_below_a_double_count_on_both_sides():
    exact = Reference(q=np.array([[1.0, 3e-17]]), scale=1.0, uncertainty=0.0, source="")
    assert exact.error(np.array([1.0]), np.array([3e-17])) == 0
    assert exact.error(np.array([1.0]), np.array([1e-17])) == pytest.approx(2e-17)
    assert exact.error(np.array([1.0])) == pytest.approx(3e-17)


# --- Systems whose formulas have functions: kernels against steps in mpmath, and what other libraries make of them


#: A fraction, because mpmath's numbers take a float for its binary value.
A = Fraction(7, 10)


def one_dimensional(name, V, derivative, q0="0.75", p0="0.5"):
    return System(name=name, V=V, grad_V=lambda q: (derivative(q),), q0=(q0,), p0=(p0,), t_end="10")


def gaussian(q):
    return 2 * exp(-q[0] * q[0]) / sqrt(pi)


#: Potentials with their derivatives: each function in one or the other, pi among them.
SYSTEMS = [
    one_dimensional("pendulum", lambda q: -cos(q[0]), lambda q: sin(q[0])),
    one_dimensional("morse", lambda q: (1 - exp(-q[0])) ** 2, lambda q: 2 * exp(-q[0]) * (1 - exp(-q[0]))),
    one_dimensional("soft wall", lambda q: log(cosh(q[0])), lambda q: tanh(q[0])),
    one_dimensional("catenary", lambda q: cosh(q[0]), lambda q: sinh(q[0])),
    one_dimensional("real power", lambda q: (1 + q[0] ** 2) ** A, lambda q: 2 * A * q[0] * pow(1 + q[0] ** 2, A - 1)),
    one_dimensional("exponential", lambda q: 2 ** q[0], lambda q: log(Constant(2)) * 2 ** q[0], q0="-0.25"),
    one_dimensional("bell", lambda q: erf(q[0]), gaussian),
    one_dimensional("pole", lambda q: -log(cos(q[0])), lambda q: tan(q[0])),
    one_dimensional("cubic", lambda q: 0.75 * cbrt(2 + q[0]) ** 4, lambda q: cbrt(2 + q[0])),
    one_dimensional("angle", lambda q: atan2(q[0], 2) / pi, lambda q: 2 / (4 + q[0] ** 2) / pi),
    one_dimensional("length", lambda q: hypot(q[0], 1), lambda q: q[0] / hypot(q[0], 1)),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "system",
    [SYSTEMS[0], *(pytest.param(system, marks=pytest.mark.long) for system in SYSTEMS[1:])],
    ids=lambda system: system.name,
)
def test_kernels_of_both_precisions_make_the_steps_of_mpmath(system):
    """20 steps: 160 stages of some u each for positions; in double-double some 2^-100 for energies."""
    tableau = nh.integrators["aba864"]
    tau, steps = mpf("0.125"), 20
    (q, p), worst = trajectory(tableau, system, tau, steps)[-1], max(energy_errors(tableau, system, tau, steps))
    for precision in ("double", "extended"):
        run = nh.integrate(system, tableau, tau="0.125", t_end="2.5", precision=precision)
        assert float(run.q[-1, 0]) == pytest.approx(float(q[0]), rel=1e-13, abs=1e-13)
        assert float(run.p[-1, 0]) == pytest.approx(float(p[0]), rel=1e-13, abs=1e-13)
    assert float(run.max_energy_error) == pytest.approx(float(worst), abs=1e-26, rel=1e-12)


@pytest.mark.slow
def test_numba_and_heyoka_understand_every_function():
    """One system whose force is the sum of all of them."""
    whole = one_dimensional("sum", lambda q: 0, lambda q: sum(system.grad_V(q)[0] + system.V(q) for system in SYSTEMS))
    assert set(FUNCTIONS) <= set(re.findall(r"\w+", velocity_text(whole)))
    rates = velocity(whole)(0.75, 0.5)
    numba = pytest.importorskip("numba")
    assert numba.njit(velocity(whole))(0.75, 0.5) == pytest.approx(rates, rel=1e-13)
    heyoka = pytest.importorskip("heyoka")
    from nearharmonic_paper.experiments.work_precision.peers import functions_of

    q, p = heyoka.make_vars("q", "p")
    compiled = heyoka.cfunc(list(velocity(whole, functions_of(heyoka))(q, p)), [q, p])
    assert compiled([0.75, 0.5]) == pytest.approx(rates, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "extended"])
def test_rotating_pendulum_lanes_equal_single_runs_bitwise(precision):
    """A momentum of 1e6 brings angles beyond those that are reduced in floating point, in some lanes only."""
    made = one_dimensional("rotor", lambda q: -cos(q[0]), lambda q: sin(q[0]), p0="1000000")
    steps = [20, 25, 31, 40, 50, 63, 80, 100, 126]
    lanes, single = (
        integrate_batch(
            made, nh.integrators["aba864"], t_end=Fraction(2), steps=steps, samples=5,
            numerics=Numerics(width=width, precision=precision),
        )
        for width in (8, 1)
    )  # fmt: skip
    assert np.abs(lanes.q).max() > 2.0**20
    assert np.array_equal(lanes.q, single.q)
    assert np.array_equal(lanes.max_energy_error, single.max_energy_error)


# --- Invariants of a system beside its energy: their values along a run, and their drift


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
