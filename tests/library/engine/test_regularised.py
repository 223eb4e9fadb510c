"""Kepler's problem in a fictitious time, against the closed form, and against the same method in multiprecision."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from mpmath import cos, matrix, mp, mpf, pi, sin, sqrt

import nearharmonic as nh
from nearharmonic.engine.batch import landing_of, unperturbed
from nearharmonic.errors import SettingError, SystemDefinitionError
from nearharmonic.systems.formulas import Regularisation, RegularisedFormulas
from support.oracles.multiprecision import digits_of

SYSTEM = nh.systems["kepler_regularised"]
with mp.workdps(60):
    GM = mpf("1.71994752")


def orbit(e, a="57.9"):
    """q0 and p0 at the aphelion of an ellipse, as strings of 40 digits."""
    a, e = mpf(a), mpf(e)
    speed = sqrt(GM / a * (1 - e) / (1 + e))
    return (mp.nstr(a * (1 + e), 40), "0"), ("0", mp.nstr(speed, 40))


def levi_civita(q, p, A):
    """u, v and -H by complex square roots."""
    z, momentum = mp.mpc(*q), mp.mpc(*p)
    u = sqrt(z)
    r = abs(z)
    return u, momentum * mp.conj(u) / 2, GM / r + A / r**3 - abs(momentum) ** 2 / 2


def by_hand(tableau, q, p, t_end, tau, A):
    """Physical states after each step, the last at t_end: substeps in complex numbers, its length by bisection."""
    u, v, w = levi_civita(q, p, A)
    h = tau * 2 * w / GM
    outer, inner = ([mpf(c) for c in row] for row in (tableau.outer, tableau.inner))

    def step(u, v, t, h):
        def kick(u, v, t, c):
            r = abs(u) ** 2
            # V = r w/4 - A/(4 r^2), and t' = r.
            return u, v - c * h * (w / 2 * u + A * u / r**3), t + c * h * r

        def drift(u, v, t, c):
            return u + c * h * v, v, t

        first, second = (kick, drift) if tableau.first == "kick" else (drift, kick)
        state = first(u, v, t, outer[0])
        for i, c in enumerate(inner):
            state = first(*second(*state, c), outer[i + 1])
        return state

    state, states = (u, v, mpf(0)), []
    while (following := step(*state, h))[2] < t_end:
        state = following
        states.append(state)
        assert len(states) < 1000  # negative coefficients may turn the time of large steps back
    low, high = mpf(0), h
    while high - low > mpf(10) ** -40 * h:
        middle = (low + high) / 2
        low, high = (middle, high) if step(*state, middle)[2] < t_end else (low, middle)
    return [(u * u, 2 * v / mp.conj(u)) for u, v, _ in [*states, step(*state, high)]]


def found(run, name, sample=-1):
    """Position or momentum of a run as a complex number."""
    return mp.mpc(*digits_of(run, name, sample))


@pytest.mark.slow
@pytest.mark.parametrize("A", [pytest.param("0", marks=pytest.mark.long), "2e-3"])
@pytest.mark.parametrize("method", ["aba864", "babs7o7h", "srkn_b6"])
def test_a_run_is_that_of_the_same_method_by_hand(method, A):
    """To the rounding of double-doubles, 2^-104 times the growth over 60 steps."""
    tableau = nh.integrators[method]
    q0, p0 = ("40", "13"), ("-0.05", "0.17")
    tau, t_end = Fraction(3000, 60), 3000
    run = nh.integrate(
        SYSTEM, tableau, tau, q0=q0, p0=p0, parameters={"A": A}, t_end=t_end, precision="extended", samples=2
    )
    state = tuple(map(mpf, q0)), tuple(map(mpf, p0))
    states = by_hand(tableau, *state, mpf(t_end), mpf(tau.numerator) / tau.denominator, mpf(A))
    assert int(run.steps) == len(states)
    for name, z in zip("qp", states[-1], strict=True):
        assert abs(found(run, name) - z) < abs(z) * mpf(10) ** -27


@pytest.mark.slow
def test_dense_samples_of_a_near_collision_are_those_by_hand():
    """At the aphelion two samples fall into one step of 1.97 tau, at the perihelion a step is 0.03 tau."""
    tableau, tau, (q0, p0) = nh.integrators["ruth"], 4, orbit("0.97")
    run = nh.integrate(SYSTEM, tableau, tau, q0=q0, p0=p0, t_end=88 * tau, precision="extended", samples=89)
    for sample in (1, 2, 43, 44, 45, 88):
        states = by_hand(tableau, tuple(map(mpf, q0)), tuple(map(mpf, p0)), mpf(sample * tau), mpf(tau), mpf(0))
        assert run.t[sample] == sample * tau
        for name, z in zip("qp", states[-1], strict=True):
            assert abs(found(run, name, sample) - z) < abs(z) * mpf(10) ** -22, sample
    assert int(run.steps) == len(states)


@pytest.mark.slow
def test_the_error_of_a_landing_counts_in_the_mean():
    run = nh.integrate(SYSTEM, "ruth", 200, t_end=200, samples=2)
    assert run.steps.item() == 1
    assert run.mean_energy_error.item() == abs(run.energy_error[-1].item()) > 0, "mean energy error of one step"


@pytest.mark.slow
@pytest.mark.parametrize("A", [pytest.param("0", marks=pytest.mark.long), "2"])
def test_errors_over_three_steps_match_hand_calculation(A):
    """Two whole steps, and one that lands."""
    tableau, tau, (q0, p0) = nh.integrators["ruth"], 200, orbit("0.4")
    run = nh.integrate(SYSTEM, tableau, tau, q0=q0, p0=p0, parameters={"A": A}, t_end=3 * tau)
    start = tuple(map(mpf, q0)), tuple(map(mpf, p0))
    states = by_hand(tableau, *start, mpf(3 * tau), mpf(tau), mpf(A))
    assert len(states) == 3

    def H(q, p):
        return abs(p) ** 2 / 2 - GM / abs(q) - mpf(A) / abs(q) ** 3

    begin = H(*(mp.mpc(*pair) for pair in start))
    errors = [float(abs((H(*state) - begin) / begin)) for state in states]
    assert min(errors) > 1e-6
    assert float(run.mean_energy_error) == pytest.approx(sum(errors) / 3, rel=1e-9)
    assert float(run.max_energy_error) == pytest.approx(max(errors), rel=1e-9)


@pytest.mark.slow
def test_an_ensemble_of_mixed_strengths_is_made_of_single_runs():
    strengths = ["0", "2", "0", "5"]
    q0, settings = [57.9, 12.0], {"t_end": 20000}
    system = "kepler_regularised"
    together = nh.ensemble(system, "babs7o7h", 200, q0=np.array([q0] * 4), parameters={"A": strengths}, **settings)
    for i, A in enumerate(strengths):
        alone = nh.integrate(system, "babs7o7h", 200, q0=q0, parameters={"A": A}, samples=2, **settings)
        assert np.abs(together.q[i].values - alone.q.values).max() < (1e-9 if A == "0" else 1e-300)
        assert float(together.max_energy_error[i]) == pytest.approx(float(alone.max_energy_error), rel=1e-6)
    assert np.abs(np.diff(together.q.values[:, -1, 0])).min() > 1e-3


def test_maps_are_inverse_and_conserve_energy_in_plane_and_space():
    for dimension, starts in ((2, [(3, 4), (-3, 4), (-5, 0), (0, -2)]), (3, [(1, 2, 2), (-1, 2, -2), (-3, 0, 0)])):
        maps = RegularisedFormulas(Regularisation("GM", lambda q, r, GM, A: A * q[0] / r), 0, dimension)
        p = tuple(mpf(k) / 7 for k in (1, -2, 3))[:dimension]
        for start in starts:
            q = tuple(map(mpf, start))
            x, y = maps.from_physical(q, p, GM, mpf(2))
            r = sqrt(sum(c * c for c in q))
            H = sum(c * c for c in p) / 2 - GM / r + 2 * q[0] / r
            back = maps.to_physical(x, y)
            assert max(abs(a - b) for ours, given in zip(back, (q, p), strict=True)
                       for a, b in zip(ours, given, strict=True)) < mpf(10) ** -45  # fmt: skip
            assert abs(sum(maps.energies(x, y, GM, mpf(2))) - H) < mpf(10) ** -45
            # r (H + w)/4 = 0 is T + V - GM/4 of the oscillator.
            assert abs(maps.T(y) + maps.V(x, GM, mpf(2)) - GM / 4) < mpf(10) ** -45
            assert abs(x[-1] + H) < mpf(10) ** -45


@pytest.mark.slow
@pytest.mark.parametrize("t", ["100", "1000", "-777.5"])
def test_samples_land_on_their_times_and_positions_converge_to_ellipse(t):
    exact = nh.systems["kepler"].exact_position(nh.systems["kepler"], mpf(t))
    errors = []
    for tau in (20, 10):
        run = nh.integrate("kepler_regularised", "yoshida_s7o6a", tau, t_end=t, precision="extended")
        assert run.t[-1] == float(t)
        errors.append(abs(found(run, "q") - mp.mpc(*exact)))
    # Order six; the landing of the last step changes the ratio by a few percent.
    assert 50 < errors[0] / errors[1] < 80 or errors[1] < mpf(10) ** -24


@pytest.mark.parametrize("e", ["0", "0.3", "0.95"])
def test_an_orbit_takes_as_many_steps_as_in_physical_time(e):
    q0, p0 = orbit(e)
    period = float(2 * pi * sqrt(mpf("57.9") ** 3 / GM))
    run = nh.integrate("kepler_regularised", "aba864", period / 200, q0=q0, p0=p0, t_end=repr(3 * period))
    assert abs(int(run.steps) - 600) <= 1  # the last one may be as short as the rounding of the period


@pytest.mark.slow
def test_a_perturbation_turns_the_perihelion_as_in_first_order():
    """6 pi A/(GM p^2) an orbit, with p = a (1 - e^2); the next order is smaller by A/(GM p^2) = 1e-6."""
    e, a = mpf("0.2"), mpf("57.9")
    q0, p0 = orbit(e)
    p = a * (1 - e * e)
    A = GM * p * p * mpf("1e-6")
    period = float(2 * pi * sqrt(a**3 / GM))
    run = nh.integrate(
        "kepler_regularised", "srkn_a14", period / 30, q0=q0, p0=p0, parameters={"A": mp.nstr(A, 30)},
        t_end=repr(100 * period), samples=101,
    )  # fmt: skip
    angle = np.unwrap(run.perihelion_angle.values)
    slope = np.polyfit(np.arange(101), angle, 1)[0]
    assert slope == pytest.approx(6 * np.pi * 1e-6, rel=1e-3)
    assert float(run.angular_momentum_drift) < 1e-13


@pytest.mark.slow
def test_without_its_strength_a_perturbation_costs_nothing():
    bare = nh.integrate(unperturbed(SYSTEM), "aba864", 300, samples=2)
    assert np.array_equal(nh.integrate(SYSTEM, "aba864", 300, samples=2).q, bare.q)
    near = nh.integrate(SYSTEM, "aba864", 300, samples=2, parameters={"A": "1e-12"})
    assert not np.array_equal(near.q, bare.q)
    assert np.abs(near.q - bare.q).max() < 1e-9


def spatial(q0, p0, **changes):
    return nh.System(
        name="spatial", V=lambda q, GM: -GM / (q[0] ** 2 + q[1] ** 2 + q[2] ** 2) ** 0.5, q0=q0, p0=p0, t_end=20000,
        parameters={"GM": "1.71994752"}, **{"regularisation": Regularisation("GM"), **changes},
    )  # fmt: skip


@pytest.mark.slow
def test_an_orbit_in_space_is_that_in_the_plane_turned():
    """The steps are the same numbers but for rounding, whatever the regularisation's fourth coordinate does."""
    (x, _), (_, v) = orbit("0.6")
    plane = nh.integrate("kepler_regularised", "babs7o7h", 100, q0=(x, "0"), p0=("0", v), t_end=20000, samples=9)
    angle = mpf(1) / 3
    turned = spatial((x, "0", "0"), ("0", mp.nstr(mpf(v) * cos(angle), 40), mp.nstr(mpf(v) * sin(angle), 40)))
    space = nh.integrate(turned, "babs7o7h", 100, samples=9)
    rotation = np.array(matrix([[1, 0], [0, cos(angle)], [0, sin(angle)]]).tolist(), dtype=float)
    assert np.abs(space.q.values - plane.q.values @ rotation.T).max() < 1e-12 * float(x)
    assert float(space.max_energy_error) == pytest.approx(float(plane.max_energy_error), rel=1e-4)


def test_a_run_back_returns():
    # The last steps are shortened, which the way back does not mirror: an error of the method's size is left.
    fine = nh.integrate("kepler_regularised", "srkn_a14", 30, samples=2)
    again = nh.integrate("kepler_regularised", "srkn_a14", 30, start=fine, t_end=-87660, samples=2)
    assert np.abs(again.q[-1] - fine.q[0]).max() < 1e-9
    assert "running" not in fine


@pytest.mark.parametrize("energy", ["every", "none"])
def test_run_with_reversed_time_has_diverged_and_ends(energy):
    """Steps of 0.4 periods of a method with negative coefficients, which stay near a bounded curve."""
    run = nh.integrate("kepler_regularised", "ruth", Fraction(87660, 110), energy=energy, samples=2)
    assert run.status.item() == "diverged"
    assert 8 <= run.diverged_at.item() <= 2 * 110


@pytest.mark.parametrize("p0", [("0", "0.3"), ("0", "0.2219666")])
def test_an_orbit_that_is_not_bound_is_refused(p0):
    with pytest.raises(SettingError, match=r"\(q0, p0\) = .* energy below 0, on a bound orbit; its energy is"):
        nh.integrate("kepler_regularised", "aba864", 100, p0=p0)
    with pytest.raises(SettingError, match="bound orbit"):
        nh.ensemble("kepler_regularised", "aba864", 100, p0=np.array([[0, 0.1], [0, 0.3]]))


@pytest.mark.parametrize(
    "changes",
    [{"masses": ("1", "1", "2")}, {"regularisation": Regularisation("mass")},
     {"regularisation": Regularisation("GM", strength="A")}],
)  # fmt: skip
def test_a_regularisation_that_does_not_fit_is_refused(changes):
    with pytest.raises(SystemDefinitionError, match=r"regularisation = .* is not allowed"):
        nh.integrate(spatial(("1", "0", "0"), ("0", "1", "0"), **changes), "aba864", 0.1)


class HalfSteps(RegularisedFormulas):
    """Maps whose fictitious time runs as if each orbit were half as large."""

    def inverse_axis(self, x, *parameters):
        return 2 * super().inverse_axis(x, *parameters)


@pytest.mark.slow
def test_systems_of_different_time_maps_get_their_own_code():
    """A step of fictitious time is a physical step over the semi-major axis: half the axis, half as many steps."""
    own = nh.systems["kepler_regularised"]
    system, other = (replace(own, regularisation=Regularisation(gravity="GM")) for _ in range(2))
    maps = other.formulas().regularised
    halved = HalfSteps(maps.regularisation, maps.gravity, maps.dimension)
    vars(other)["_formulas"] = replace(other.formulas(), regularised=halved)
    steps = {}
    for key, one in (("own", system), ("halved", other), ("own again", system)):
        landing_of.cache_clear()
        steps[key] = nh.integrate(one, "ruth", 100, t_end=20000, samples=2).steps.item()
    assert steps["own"] == steps["own again"]
    assert steps["halved"] == pytest.approx(steps["own"] / 2, abs=1)
