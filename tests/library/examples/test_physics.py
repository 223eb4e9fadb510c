"""Results of the examples, compared with closed forms, the literature and other integrators."""

from fractions import Fraction
from itertools import pairwise
from math import pi, sin
from pathlib import Path

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.special import mathieu_a, mathieu_b

import nearharmonic as nh
from nearharmonic.registry import load_file

EXAMPLES = Path(__file__).parents[3] / "examples"


def module(name):
    return load_file(EXAMPLES / f"{name}.py", "an example", ValueError)


def returns(system, period, q0):
    """Distance in phase space of an orbit from its start after a period, by a run of 400 steps of order six."""
    end = nh.integrate(system, "srkn_a14", period / 400, t_end=period, samples=2, precision="extended")
    return float(np.hypot(end.q[-1, 0] - q0, end.p[-1, 0]))


#: Error of the sixth order at 400 steps a period, which 800 make 64 times smaller; the period itself is exact.
RETURN = 1e-12


def test_morse_oscillator_in_closed_form_solves_its_equation_of_motion():
    system, exact = module("morse").SYSTEM, module("morse").exact_position
    for t in (0.3, 4, 77):
        (q,) = exact(system, mpmath.mpf(t))
        acceleration = mpmath.diff(lambda s: exact(system, s)[0], t, 2)
        assert abs(acceleration + 2 * mpmath.exp(-q) * (1 - mpmath.exp(-q))) < 1e-25  # D = a = 1
        velocity = mpmath.diff(lambda s: exact(system, s)[0], t)
        assert abs(velocity**2 / 2 + (1 - mpmath.exp(-q)) ** 2 - (1 - mpmath.exp(mpmath.mpf("-0.5"))) ** 2) < 1e-25


def test_runs_of_morse_oscillator_end_where_closed_form_says():
    system, exact = module("morse").SYSTEM, module("morse").exact_position
    end = nh.integrate(system, "s15odr8", 0.025, samples=2, precision="extended")
    # Of order eight: 1e-14, and 4e-12 at twice the step.
    assert float(end.q[-1, 0]) == pytest.approx(float(exact(system, mpmath.mpf(100))[0]), abs=1e-13)


@pytest.mark.slow
def test_pendulum_is_back_after_period_that_arithmetic_geometric_mean_gives():
    system = module("pendulum").SYSTEM
    period = 2 * mpmath.pi * mpmath.sqrt(1 / mpmath.mpf("9.80665")) / mpmath.agm(1, mpmath.cos(mpmath.mpf("0.25")))
    assert returns(system, float(period), 0.5) < RETURN


def test_double_well_particle_returns_after_elliptic_period():
    system = module("double_well").SYSTEM
    a = mpmath.mpf("1.42")
    period = 4 * mpmath.ellipk(a**2 / (2 * (a**2 - 1))) / mpmath.sqrt(a**2 - 1)
    assert returns(system, float(period), 1.42) < 1e3 * RETURN  # beside the barrier, errors grow e^t


@pytest.mark.slow
def test_the_driven_oscillator_moves_as_another_integrator_says():
    system = module("driven_oscillator").SYSTEM

    def rate(t, y):
        return y[1], -y[0] - 0.2 * y[0] ** 3 + 0.2 * np.cos(1.5 * t)

    other = solve_ivp(rate, (0, 20), (1, 0), method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    end = nh.integrate(system, "babps9o7h", 0.05, t_end=20, samples=2)
    np.testing.assert_allclose([end.q[-1, 0], end.p[-1, 0]], other, atol=1e-9)  # the tolerance, over 20 units of time


@pytest.mark.slow
def test_stable_ions_are_those_between_the_characteristic_values_of_mathieu():
    half_trace = module("paul_trap").half_trace
    s = np.linspace(0.5, 3, 15)
    for order in range(3):  # stable for a_n(s) < a < b_(n+1)(s), not from there to a_(n+1)(s)
        low, high, above = mathieu_a(order, s), mathieu_b(order + 1, s), mathieu_a(order + 1, s)
        gap = 1e-3 * (high - low)
        assert (abs(half_trace(np.concatenate([low + gap, high - gap]), np.tile(s, 2), steps=40)) < 1).all()
        for share in (0.1, 0.5, 0.9):
            assert (abs(half_trace(high + share * (above - high), s, steps=40)) > 1).all()


def test_the_quadrupole_boson_has_threefold_symmetry():
    system = module("quadrupole_boson").SYSTEM
    values = system.constants(float)
    for angle in np.linspace(0, 2, 7):
        thirds = [(2.5 * np.cos(angle + k * 2 * pi / 3), 2.5 * np.sin(angle + k * 2 * pi / 3)) for k in range(3)]
        energies = [system.V(q, *values) for q in thirds]
        assert np.ptp(energies) < 1e-13 * max(map(abs, energies))


def test_eigenvalues_of_lax_matrix_are_those_of_its_known_traces():
    toda = module("toda_chain")
    q, p = np.random.default_rng(1).normal(size=(2, 8))
    values = np.array(toda.lax(q[:, None], p[:, None]))[:, 0]
    e = np.exp(q - np.roll(q, -1))
    H = toda.SYSTEM.energy(tuple(q), tuple(p))
    assert values.sum() == pytest.approx(p.sum() / 2, abs=1e-12)
    assert (values**2).sum() == pytest.approx((H + 8) / 2, rel=1e-13)  # the d add up to 0 on a ring
    henon = (p**3).sum() / 8 + 3 / 8 * ((p + np.roll(p, -1)) * e).sum()  # Henon (1974), Phys. Rev. B 9, 1921
    assert (values**3).sum() == pytest.approx(henon, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "order"), [("leapfrog", 2), ("aba864", 4), ("babps9o7h", 4), ("srkn_b11", 6)])
def test_toda_lax_invariants_are_conserved_to_method_order(name, order):
    system, per_stage = module("toda_chain").SYSTEM, {2: 0.002, 4: 0.01, 6: 0.025}[order]
    taus = [nh.integrators[name].stages * per_stage / k for k in (1, 2)]
    coarse, fine = (float(nh.integrate(system, name, tau, t_end=20).lax_drift) for tau in taus)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.3)


def recurrence(system, name, tau):
    """Time, in periods of the first mode, at which its energy is largest again, and its share of the first energy."""
    run = nh.integrate(system, name, tau, samples=4000)
    energy = module("fput_recurrence").mode_energies(run.q.values, run.p.values)[:, 0]
    last = 2000 + energy[2000:].argmax()
    return float(run.t[last]) / (pi / sin(pi / 64)), energy[last] / energy[0]


@pytest.mark.slow
def test_fput_chain_recurs_after_157_or_146_periods_as_stated():
    system = module("fput_recurrence").SYSTEM
    # "After 157 periods of the mode": Dauxois (2008), Physics Today 61(1), 55; the report's step is sqrt(1/8).
    periods, share = recurrence(system, "leapfrog", 8**-0.5)
    assert round(periods) == 157
    assert 0.97 < share < 1
    exact = [recurrence(system, "babps9o7h", tau)[0] for tau in (2, 1)]
    assert [round(x) for x in exact] == [146, 146]


def test_mode_energies_add_up_to_energy_without_cubic_terms():
    fput = module("fput_recurrence")
    q, p = np.random.default_rng(1).normal(size=(2, 31))
    energy = (p @ p + (np.diff(q, prepend=0, append=0) ** 2).sum()) / 2
    assert fput.mode_energies(q, p).sum() == pytest.approx(energy, rel=1e-13)


@pytest.mark.slow
def test_half_of_plummer_stars_are_within_half_mass_radius():
    star = module("plummer_sphere").star
    stars = np.array([star() for _ in range(8000)])
    r, v = np.linalg.norm(stars, axis=-1).T
    unit = 3 * pi / 16
    # Of 8000 the median is known to 1 %; half of the mass is within (2^(2/3) - 1)^(-1/2) units of length.
    assert np.median(r) == pytest.approx(unit * (2 ** (2 / 3) - 1) ** -0.5, rel=0.03)
    # Plummer's velocity dispersion at each place: <v^2> = 1/(2 (r^2 + unit^2)^(1/2)).
    assert (v**2 * 2 * np.hypot(r, unit)).mean() == pytest.approx(1, rel=0.03)


def heyoka_positions(kind, tolerance):
    """Positions (6, 3) of the outer solar system after 200 000 days by heyoka's Taylor series."""
    hy = pytest.importorskip("heyoka")
    planets = module("outer_solar_system")
    masses = [kind(m.numerator) / kind(m.denominator) for m in planets.MASSES]
    state = []
    for body in planets.BODIES.values():
        state += [kind(x) for row in body[1:] for x in row.split()]
    equations = hy.model.nbody(6, masses=masses, Gconst=kind("2.95912208286e-4"))
    integrator = hy.taylor_adaptive(equations, np.array(state, dtype=kind), tol=kind(tolerance), fp_type=kind)
    integrator.propagate_until(kind(200000))
    return np.array(integrator.state).reshape(6, 6)[:, :3]


@pytest.mark.slow
def test_outer_solar_system_after_200_000_days_matches_heyoka():
    end = nh.integrate(
        module("outer_solar_system").SYSTEM, "srkn_a14", 5, samples=2, precision="extended", energy="none"
    )
    ours = (end.q.values[-1].astype(np.longdouble) + end.q_low.values[-1]).reshape(6, 3)
    # Order six: steps of 5 days leave 1e-15 au of Jupiter, 20 days 4000 times that. heyoka has 64 bits here.
    assert abs(heyoka_positions(np.longdouble, "1e-19") - ours).max() < 2e-14
    # At 1e-16 in doubles, whose rounding of initial values and steps has grown to 1e-11 au along Jupiter's orbit.
    assert abs(heyoka_positions(float, "1e-16") - ours).max() < 3e-11


@pytest.mark.slow
def test_outer_solar_system_conserves_momentum_and_moves_centre_evenly():
    planets = module("outer_solar_system")
    run = nh.integrate(planets.SYSTEM, "aba104", 200, t_end=20000, samples=50)
    q, p = (x.values.reshape(-1, 6, 3) for x in (run.q, run.p))
    momentum = p.sum(axis=1)
    # Kicks are equal and opposite to rounding: 1e-16 of Jupiter's momentum, 500 kicks added up.
    assert np.ptp(momentum, axis=0).max() < 1e-14 * abs(p).max()
    masses = np.array([float(mass) for mass in planets.MASSES])
    centre = (q * masses[:, None]).sum(axis=1) / masses.sum()
    moved = centre[0] + run.t.values[:, None] * momentum[0] / masses.sum()
    np.testing.assert_allclose(centre, moved, atol=1e-13)


def test_the_planets_start_where_another_print_of_the_table_says():
    """Comparison with the table by columns in the documentation of DiffEqPhysics.jl."""
    x = (0.0, -3.5023653, 9.0755314, 8.3101420, 11.4707666, -15.5387357)
    y = (0.0, -3.8169847, -3.0458353, -16.2901086, -25.7294829, -25.2225594)
    z = (0.0, -1.5507963, -1.6483708, -7.2521278, -10.8169456, -3.1902382)
    vx = (0.0, 0.00565429, 0.00168318, 0.00354178, 0.00288930, 0.00276725)
    vy = (0.0, -0.00412490, 0.00483525, 0.00137102, 0.00114527, -0.00170702)
    vz = (0.0, -0.00190589, 0.00192462, 0.00055029, 0.00039677, -0.00136504)
    masses = (1.00000597682, 0.000954786104043, 0.000285583733151, 0.0000437273164546, 0.0000517759138449, 1 / 1.3e8)
    planets = module("outer_solar_system")
    q, p = (np.reshape(row, (6, 3)) for row in planets.SYSTEM.start(float))
    assert q.T.tolist() == [[*x], [*y], [*z]]
    np.testing.assert_allclose(p / np.reshape(masses, (6, 1)), np.transpose([vx, vy, vz]), rtol=1e-15)
    assert planets.SYSTEM.constants(str) == ("2.95912208286e-4",)


def test_the_planets_have_the_momenta_of_the_table():
    planets = module("outer_solar_system")
    velocities = [v for _, _, row in planets.BODIES.values() for v in row.split()]
    masses = [mass for mass in planets.MASSES for _ in range(3)]
    for p, v, mass in zip(planets.SYSTEM.p0, velocities, masses, strict=True):
        assert abs(Fraction(p) / mass - Fraction(v)) <= abs(Fraction(v)) / 10**27


def test_galaxy_orbits_of_one_energy_start_on_long_axis():
    galaxy = module("poincare_section").SYSTEM
    for x in (0.1, 0.4, 0.69):
        speed = np.sqrt(-0.674 - np.log(0.14**2 + x**2))  # as in the file
        assert galaxy.energy((x, 0.0), (0.0, speed), galaxy.constants(float)) == pytest.approx(-0.337, abs=1e-15)


def test_angular_momentum_in_the_round_quartic_well_is_kept():
    drifts = [
        float(nh.integrate(module("quartic_well").SYSTEM, "ruth", tau).angular_momentum_drift) for tau in (0.3, 0.1)
    ]
    assert max(drifts) < 1e-13
    assert all(a != b for a, b in pairwise(drifts)) or max(drifts) == 0


@pytest.mark.slow
def test_the_tabulated_well_is_the_natural_spline_of_another_library():
    table, spacing = module("tabulated_well").TABLE, module("tabulated_well").H
    spline = CubicSpline(-2 + spacing * np.arange(17), table, bc_type="natural")
    q = np.linspace(-2, 2, 401)
    system = module("tabulated_well").SYSTEM
    # V up to 2 and slopes up to 6, of some ten roundings.
    np.testing.assert_allclose(system.V((q,)), spline(q), atol=20 * 2.0**-53, rtol=0)
    np.testing.assert_allclose(system.grad_V((q,))[0], spline(q, 1), atol=60 * 2.0**-53 / spacing, rtol=0)


@pytest.mark.slow
def test_mass_with_clearance_is_back_after_its_flights_and_oscillations():
    system = module("clearance").SYSTEM
    period, stiffness, speed = 4 + 2 * pi / 2, 4, 1
    assert system.period((0,), (1.0,), stiffness) == period
    for steps in (500, 2000):
        tau = period / steps
        end = nh.integrate(system, "ruth", tau, t_end=period, samples=2)
        # The step over a jump of V'' applies a force that is off by up to k v tau; there are four a period.
        kicked = 4 * stiffness * speed * tau**2
        assert abs(end.p[-1, 0]) < kicked
        assert abs(end.q[-1, 0] - 1.5) < kicked * period


@pytest.mark.slow
def test_the_neural_force_is_nearly_that_of_henon_and_heiles():
    system, formula = module("neural_force").SYSTEM, nh.systems["henon_heiles"].V
    x = np.linspace(-0.75, 0.75, 61)
    x, y = (grid.ravel() for grid in np.meshgrid(x, x))
    inside = np.hypot(x, y) < 0.75
    off = system.V((x[inside], y[inside])) - formula((x[inside], y[inside]))
    assert off.std() < 1.5e-4  # 1e-4 to a digit
    known, ours = (nh.sweep(system, name, [tau]) for name, tau in (("aba864", 0.35), ("babps9o7h", 0.45)))
    gain = float(known.max_energy_error[0] / ours.max_energy_error[0])
    assert 50 < gain < 100  # nearly two decades, as the page says
