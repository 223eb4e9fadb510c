"""``nh.section``: crossings to rounding, by closed forms and by runs that end at them."""

import warnings
from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError
from support.methods.own_systems import spring

#: Starts of the Henon-Heiles system on x = 0, of energies from 0.05 to 0.15.
STARTS = [[0, 0.1, 0.4, 0], [0, -0.2, 0.35, 0.1], [0, 0.3, 0.3, -0.2]]


@pytest.mark.slow
def test_an_oscillator_crosses_zero_at_odd_quarters_of_its_period():
    """To the phase error of the method, which falls with the sixth power of the step."""
    for tau, error in ((0.5, 4e-9), (0.25, 4e-9 / 2**6)):
        found = nh.section("sho", "babps8o7h", tau, surface=0, direction="both", t_end=200)
        n = np.arange(found.sizes["crossing"])
        late = found.t[0] - (n + 0.5) * np.pi
        assert (abs(late) <= error * (n + 1)).all()
        assert found.crossings.item() == int(200 / np.pi + 0.5)
        assert abs(found.surface).max() < 2.3e-16  # the rounding of sums of numbers up to 1
        np.testing.assert_allclose(found.p[0, :, 0], np.where(n % 2, 1.0, -1.0), rtol=1e-7)


@pytest.mark.parametrize("member", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in (1, 2))])
def test_crossings_are_ends_of_runs_with_one_shorter_step(member):
    tau = 0.5
    found = nh.section("henon_heiles", "babps9o7h", tau, surface=0, starts=STARTS, t_end=100)
    for j in (0, 1, int(found.crossings[member]) - 1):
        t = float(found.t[member, j])
        whole, rest = int(t // tau), t % tau
        start = {"q0": STARTS[member][:2], "p0": STARTS[member][2:]}
        run = nh.integrate("henon_heiles", "babps9o7h", tau, t_end=Fraction(whole, 2), **start) if whole else None
        state = (start["q0"], start["p0"]) if run is None else (run.q.values[-1], run.p.values[-1])
        last = nh.integrate("henon_heiles", "babps9o7h", rest, t_end=rest, q0=state[0], p0=state[1])
        # The time is known to a unit of its last place, the states of 200 steps to their rounding.
        np.testing.assert_allclose(found.q[member, j], last.q.values[-1], rtol=0, atol=1e-13)
        np.testing.assert_allclose(found.p[member, j], last.p.values[-1], rtol=0, atol=1e-13)
    assert float(abs(found.q[..., 0]).max()) < 2.3e-16  # the rounding of sums of numbers up to 1
    assert (found.p[..., 0].values[np.isfinite(found.t.values)] > 0).all()


@pytest.mark.slow
def test_members_have_the_bits_of_single_calls_and_of_threads():
    more = {"surface": 0, "t_end": 100}
    found = nh.section("henon_heiles", "babps9o7h", 0.5, starts=STARTS, threads=2, **more)
    for i, start in enumerate(STARTS):
        one = nh.section("henon_heiles", "babps9o7h", 0.5, starts=[start], **more)
        count = int(found.crossings[i])
        assert one.crossings.item() == count
        for name in ("t", "q", "p", "energy_error"):
            assert np.array_equal(one[name][0], found[name][i, :count])


@pytest.mark.slow
def test_directions_split_crossings_and_a_function_is_a_surface():
    counts, times = {}, {}
    for direction in ("up", "down", "both"):
        found = nh.section("henon_heiles", "ruth", 0.1, surface=0, direction=direction, starts=STARTS, t_end=60)
        counts[direction], times[direction] = found.crossings.values, found.t.values
    assert (counts["up"] + counts["down"] == counts["both"]).all()
    how = {"surface": lambda q, p: -q[0], "direction": "down", "starts": STARTS, "t_end": 60}
    turned = nh.section("henon_heiles", "ruth", 0.1, **how)
    assert np.array_equal(turned.t, times["up"], equal_nan=True)


@pytest.mark.slow
def test_apsides_of_kepler_are_where_the_radial_momentum_vanishes():
    """The distances there are a (1 - e) and a (1 + e); a and e of the start, to the error of the method."""
    found = nh.section(
        "kepler", "trained_orbits", 60.0, surface=lambda q, p, GM: q[0] * p[0] + q[1] * p[1], direction="both"
    )
    radius = np.hypot(*found.q[0].values.T)
    system = nh.systems["kepler"]
    (x, y), (u, v) = system.start(float)
    GM = float(system.parameters["GM"].value)
    E, L = (u * u + v * v) / 2 - GM / np.hypot(x, y), x * v - y * u
    a, e = -GM / (2 * E), np.sqrt(1 + 2 * E * L * L / GM**2)
    np.testing.assert_allclose(np.sort(radius)[: radius.size // 2], a * (1 - e), rtol=1e-8)
    np.testing.assert_allclose(np.sort(radius)[-(radius.size // 2) :], a * (1 + e), rtol=1e-8)
    assert abs(found.energy_error).max() < 1e-8


def test_trajectory_that_diverges_has_the_crossings_before_it():
    """No energy of a crossing, by the formula, is beyond the limit |H - H0| <= |H0| of the system."""
    starts = [[0, 0.1, 0.4, 0], [0.33, 0.27, 0.34, -0.2]]
    found = nh.section("henon_heiles", "leapfrog", 1.0, surface=0, starts=starts, t_end=200)
    assert found.crossings.values.tolist() == np.isfinite(found.t).sum("crossing").values.tolist()
    assert found.status.values.tolist() == ["ok", "diverged"]
    x, y, u, v = np.concatenate([found.q.values, found.p.values], axis=-1)[1, : int(found.crossings[1])].T
    H, start = ((u * u + v * v + x * x + y * y) / 2 + x * x * y - y**3 / 3 for x, y, u, v in ((x, y, u, v), starts[1]))
    assert len(H) > 5
    assert (abs(H - start) <= start).all()
    assert float(found.t[1, len(H) - 1]) <= float(found.diverged_at[1] * found.tau)


def test_diverged_steps_that_stay_finite_have_no_crossings():
    """Leapfrog at 2.1 grows by (1.05 + sqrt(1.05^2 - 1))^2 = 1.9 a step: beyond the limit 10^6 of energies in 12."""
    with pytest.warns(UserWarning, match="its step 2.1 is above a quarter of the shortest period"):
        found = nh.section("sho", "leapfrog", 2.1, surface=0, direction="both", t_end=210)
    assert found.status.item() == "diverged"
    assert found.crossings.item() < found.diverged_at.item() < 20


@pytest.mark.parametrize(("share", "warns"), [(1, True), (0.26, True), (0.24, False)])
def test_steps_above_a_quarter_period_are_warned_of(share, warns):
    """The period of the oscillator is 2 pi."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        nh.section("sho", "babps8o7h", share * 2 * np.pi, surface=0, t_end=200 * np.pi)
    assert [("above a quarter" in str(x.message), x.filename) for x in caught] == [(True, __file__)] * warns


def test_search_calls_the_surface_for_all_crossings_at_once():
    calls = []

    def surface(q, p):
        calls.append(np.shape(q[0]))
        return q[0]

    found = nh.section("henon_heiles", "babps9o7h", 0.5, surface=surface, starts=STARTS, t_end=1000)
    assert found.crossings.sum() > 300
    assert len(calls) < 40  # some ten iterations


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"surface": 2}, "surface = 2 is not allowed: a coordinate from 0 to 1, or a function"),
        ({"surface": "x"}, "surface = 'x' is not allowed"),
        ({"surface": True}, "surface = True is not allowed"),
        ({"surface": lambda q: q[0]}, "it raises TypeError"),
        ({"surface": lambda q, p: q[0] + 1j}, "it raises TypeError: Cannot cast"),
        (
            {"surface": 0, "direction": "upp"},
            "direction = 'upp' is not allowed: one of up, down, both. Did you mean 'up'",
        ),
        ({"surface": 0, "starts": [[1, 2, 3]]}, r"starts\[0\] = \[1, 2, 3\] is not allowed: an array \(M, 4\)"),
        ({"surface": 0, "starts": [[1, 2, 3, np.inf]]}, r"starts\[0\]\[3\] = inf is not allowed: a finite number"),
        ({"surface": 0, "tau": 1e-9}, "takes|steps|bytes"),
        (
            {"surface": 0, "system": spring("s", V=lambda q, t: q[0] * t, grad_V=None, time_dependent=True)},
            r"of a force of period T, states at t=\[k \* T for k in range\(n\)\] of nearharmonic.integrate",
        ),
    ],
)
def test_bad_surfaces_and_starts_are_refused_in_one_sentence(more, says):
    given = {"system": "henon_heiles", "tau": 0.5, "t_end": 10} | more
    with pytest.raises(SettingError, match=says) as caught:
        nh.section(integrator="ruth", **given)
    assert len(str(caught.value).splitlines()) == 1
