"""Methods inside solve_ivp: trajectories, calls of the force, events, times within a step, and refusals."""

import numpy as np
import pytest

pytest.importorskip("scipy", reason="scipy is not installed")

from scipy.integrate import solve_ivp

import nearharmonic as nh
from nearharmonic.adapters.scipy import solver
from nearharmonic.errors import SettingError
from nearharmonic.exchange.method import VelocityCheck

EPS = 2.0**-52


class Field:
    """The right-hand side of accelerations that depend on time and positions, which counts its calls."""

    def __init__(self, acceleration):
        self.acceleration, self.calls = acceleration, 0

    def __call__(self, t, y):
        self.calls += 1
        q, v = np.split(np.asarray(y), 2)
        return np.concatenate([v, self.acceleration(t, q)])


def oscillator():
    return Field(lambda t, q: -q)


def henon_heiles():
    return Field(lambda t, q: -np.array([q[0] + 2 * q[0] * q[1], q[1] + q[0] ** 2 - q[1] ** 2]))


def solved(field, method, step, end=20.0, y0=(0.3, 0.0, 0.0, 0.4), **options):
    return solve_ivp(field, (0, end), y0, method=solver(method, len(y0) // 2), max_step=step, **options)


@pytest.mark.parametrize(("span", "step", "steps"), [(0.3, 0.1, 3), (0.1 * 3, 0.1, 3), (1.0, 0.3, 4), (0.1, 5.0, 1)])
def test_equal_steps_fill_the_interval_exactly(span, step, steps):
    for end in (span, -span):
        times = solved(oscillator(), "leapfrog", step, end=end).t
        assert times[-1] == end
        np.testing.assert_allclose(times, np.arange(steps + 1) * (end / steps), rtol=4 * EPS)


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "aba864"])
def test_run_backwards_returns_to_the_start(method):
    there = solved(henon_heiles(), method, 0.25, end=10.0)
    back = solve_ivp(henon_heiles(), (10.0, 0), there.y[:, -1], method=solver(method, 2), max_step=0.25)
    # 80 steps of 2 s + 1 moves with two roundings each, and neighbours part by a factor below ten.
    tolerance = 80 * (2 * nh.integrators[method].stages + 1) * 2 * 10 * EPS
    np.testing.assert_allclose(back.y[:, -1], [0.3, 0, 0, 0.4], rtol=0, atol=tolerance)


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "aba864", "ruth_s3o3"])
def test_state_within_a_step_has_the_order_of_method(method):
    times = np.linspace(0, 8, 41) + 0.0123
    times = times[times < 8]
    exact = solve_ivp(henon_heiles(), (0, 8), (0.3, 0.0, 0.0, 0.4), "DOP853", t_eval=times, rtol=1e-13, atol=1e-14).y

    def error(step):
        dense = solved(henon_heiles(), method, step, end=8.0, dense_output=True).sol
        return np.abs(dense(times) - exact).max()

    step = 0.1 if nh.integrators[method].order < 4 else 0.4
    assert error(step) / error(step / 2) > 2 ** (nh.integrators[method].order - 0.5)


def test_dense_output_meets_the_steps_exactly():
    field = henon_heiles()
    found = solved(field, "babs7o7h", 0.25, dense_output=True)
    assert np.array_equal(found.sol(found.t), found.y)
    assert field.calls == found.nfev  # the ends of a step are known
    near = found.sol(found.t[1:] - 1e-9)
    np.testing.assert_allclose(near, found.y[:, 1:], rtol=0, atol=2e-9)  # speeds below 1


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "aba864"])
def test_requested_times_are_those_of_dense_output(method):
    times = np.array([0.0, 0.1, 0.25, 0.3, 7.77, 19.99, 20.0])
    found = solved(henon_heiles(), method, 0.25, t_eval=times)
    dense = solved(henon_heiles(), method, 0.25, dense_output=True).sol
    assert np.array_equal(found.t, times)
    assert np.array_equal(found.y, dense(times))


def zero(t, y):
    return y[0]


@pytest.mark.parametrize("method", ["leapfrog", "babs7o7h", "aba864"])
def test_zero_crossings_are_those_of_the_cosine(method):
    def error(step):
        (found,) = solved(oscillator(), method, step, y0=(1.0, 0.0), events=zero).t_events
        assert found.size == 6
        return np.abs(found - np.pi * (np.arange(6) + 0.5)).max()

    assert error(0.2) / error(0.1) > 2 ** (nh.integrators[method].order - 0.5)


def test_events_do_not_change_the_trajectory():
    with_events = solved(henon_heiles(), "babs7o7h", 0.25, events=zero)
    assert with_events.t_events[0].size > 3
    assert np.array_equal(with_events.y, solved(henon_heiles(), "babs7o7h", 0.25).y)


def test_terminal_event_ends_the_run():
    def landed(t, y):
        return y[0]

    landed.terminal, landed.direction = True, -1
    found = solved(Field(lambda t, q: np.array([-0.5])), "aba864", 1.5, y0=(0.0, 10.0), end=100, events=landed)
    assert found.status == 1
    assert found.t[-1] == pytest.approx(40, abs=40 * 30 * EPS)  # a parabola, exact but for thirty roundings a step


def test_ignored_options_cause_one_warning():
    with pytest.warns(UserWarning, match=r"atol, rtol has no effect") as caught:
        solved(oscillator(), "leapfrog", 0.25, rtol=1e-8, atol=1e-8)
    assert len(caught) == 1


def test_state_that_is_no_number_fails_the_run():
    found = solved(Field(lambda t, q: np.where(t < 5, -q, np.nan)), "leapfrog", 0.25, y0=(1.0, 0.0))
    assert (found.success, found.status) == (False, -1)
    assert "not finite" in found.message


@pytest.mark.parametrize("y0", [(1.0, 0.0, 0.0), (1j, 0.0), (1.0,)])
def test_bad_state_raises_clear_error(y0):
    with pytest.raises(SettingError, match="y0 = "):
        solve_ivp(oscillator(), (0, 1), y0, method=solver("leapfrog", 1), max_step=0.1)


def test_momenta_friction_and_wrong_shapes_are_refused():
    refused = {
        "not momenta": lambda t, y: np.array([y[1] / 2, -y[0]]),
        "positions and then velocities": lambda t, y: np.array([-y[0], y[1]]),
        "depend on the velocities": lambda t, y: np.array([y[1], -y[0] - 1e-6 * y[1]]),
        "array of shape": lambda t, y: np.array([y[1], -y[0], 0.0]),
    }
    for message, fun in refused.items():
        with pytest.raises(SettingError, match=message):
            solved(fun, "leapfrog", 0.1, y0=(1.0, 0.0))


def test_friction_is_found_beside_a_force_of_another_velocity():
    """The known force of a state belongs to the velocity before the last kick; repetitions are equal."""
    v = np.array([0.02, -0.01])
    assert VelocityCheck().finds(lambda velocity: 1 - 0.3 * velocity, v, 0, known=1 - 0.3 * (v + 1.0))
    assert not VelocityCheck().finds(lambda velocity: 1 + 0 * velocity, v, 0, known=np.ones(2))


#: Accelerations that depend on velocities in few states.
FRICTION = {
    "where x < -0.9": lambda t, q, v: -0.1 * v * (q[0] < -0.9),
    "after t = 5": lambda t, q, v: -0.1 * v * (t > 5),
    "in the last step": lambda t, q, v: -0.1 * v * (t > 19.96),
    "below a speed": lambda t, q, v: -0.1 * v * (abs(v) < 0.01),
}


@pytest.mark.parametrize("step", [0.05, 0.25])
@pytest.mark.parametrize("method", ["leapfrog", "aba864"])
@pytest.mark.parametrize("place", FRICTION)
def test_friction_is_found_wherever_it_acts(place, method, step):
    def fun(t, y, drag=FRICTION[place]):
        q, v = np.split(y, 2)
        return np.concatenate([v, -q + drag(t, q, v)])

    with pytest.raises(SettingError, match="depend on the velocities, at t ="):
        solved(fun, method, step, y0=(0.0, 0.0, 1.0, 0.0))


def test_forces_of_a_matrix_and_of_threads_pass():
    """A sum with products of velocities and 0, and one that is rounded differently each time."""
    matrix, noise = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-2, 1, 0, 0], [1, -2.0, 0, 0]]), np.random.default_rng(1)
    assert solved(lambda t, y: matrix @ y, "babs7o7h", 0.25).success
    rounded = Field(lambda t, q: -q * (1 + 1e-7 * noise.standard_normal(2)))
    assert solved(rounded, "babs7o7h", 0.25).success


def test_function_may_return_the_same_array_each_time():
    out = np.empty(4)

    def fun(t, y):
        out[:2], out[2:] = y[2:], -y[:2] - 0.1 * y[:2] ** 3
        return out

    found = solved(fun, "babs7o7h", 0.25, dense_output=True, events=zero)
    assert np.array_equal(found.y, solved(lambda t, y: fun(t, y).copy(), "babs7o7h", 0.25).y)


@pytest.mark.parametrize("end", [np.inf, -np.inf, np.nan])
def test_endless_run_raises_clear_error(end):
    with pytest.raises(SettingError, match="t_span = "):
        solved(oscillator(), "leapfrog", 0.1, end=end)
    with pytest.raises(SettingError, match="max_step = inf"):
        solved(oscillator(), "leapfrog", np.inf, end=end)


@pytest.mark.parametrize("dimension", [0, -1, 1.5, True, "2"])
def test_bad_dimension_raises_clear_error(dimension):
    with pytest.raises(SettingError, match="dimension = "):
        solver("leapfrog", dimension)
