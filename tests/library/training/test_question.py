"""The request of ``tailor``: accepted arguments, starts, and the frequency of the orbit."""

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.training.question import HALF_EDGE, orbit_of, question, starts_of
from support.methods.own_systems import spring

# --- Arguments of ``tailor``: accepted forms, and one error for each other form.


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"window": "0.08:0.09"}, r"window = '0.08:0.09' is not allowed: .*1.2 to 10 times the lower one"),
        ({"window": (0.12, 0.08)}, "window = .*the higher one"),
        ({"window": "0.1"}, "window = '0.1'.*LOW:HIGH"),
        ({"window": "0:1"}, "window = '0:1'.*above 0"),
        ({"window": "a:b"}, "window = 'a:b'"),
        ({"window": (0.1, 2.0)}, "window = "),
        ({"window": "0.1:0.2", "error": 1e-6}, "error = 1e-06 is not allowed: a window is given"),
        ({"error": 1}, "error = 1 is not allowed: an energy error below 1"),
        ({"error": -1e-6}, "error = -1e-06"),
        ({"stages": 3}, "stages = 3 is not allowed: integers from 4 to 20"),
        ({"stages": "10:6"}, "stages = '10:6'"),
        ({"stages": 8.0}, "stages = 8.0"),
        ({"stages": (4, 5, 6)}, "stages = "),
        ({"seconds": 0}, "seconds = 0 is not allowed"),
        ({"trials": 0}, "trials = 0 is not allowed: an integer from 1"),
        ({"seed": -1}, "seed = -1"),
        ({"energy": "high"}, "energy = 'high' is not allowed: a finite number, or same"),
        ({"starts": np.zeros((9, 2)), "energy": 1}, "energy = 1 is not allowed: starts are given"),
        ({"starts": np.zeros((9, 3))}, "starts = 'array of shape .9, 3.'.*2 finite numbers a start"),
        ({"starts": np.zeros((7, 2))}, "at least 8 starts, and there are 7"),
        ({"starts": np.full((9, 2), np.nan)}, "finite"),
    ],
)
def test_invalid_setting_is_one_error_that_names_it(settings, words):
    with pytest.raises(SettingError, match=words):
        question("sho", **settings)


def test_regularised_system_and_one_of_thousand_coordinates_are_refused():
    with pytest.raises(SettingError, match=r"kepler_regularised.*fictitious time"):
        question("kepler_regularised")
    many = spring("many", V=lambda q: sum(x * x for x in q), grad_V=None, q0=["1"] * 101, p0=["0"] * 101)
    with pytest.raises(SettingError, match="at most 100 coordinates, and it has 101"):
        question(many)


def test_a_driven_system_has_no_energy_surface():
    driven = nh.System(
        name="driven", V=lambda q, t: q[0] * q[0] * (1 + t * 0), q0=["1"], p0=["0"], t_end="1", time_dependent=True
    )
    with pytest.raises(SettingError, match=r"energy = 'same' is not allowed.*depends on time"):
        question(driven, energy="same")


def test_text_numbers_and_pairs_mean_the_same():
    one = question("henon_heiles", window="0.08:0.12", stages="6:8", seconds="5", energy="same", seed=3)
    two = question("henon_heiles", window=(0.08, 0.12), stages=(6, 8), seconds=5.0, energy=0.125, seed=3)
    assert (one.window, one.stages, one.seconds) == (two.window, two.stages, two.seconds)
    assert (one.window, one.stages, one.seconds) == ((0.08, 0.12), (6, 7, 8), 5.0)
    # H0 = (0.09 + 0.16)/2 of the registered start
    assert one.energy == pytest.approx(two.energy, rel=1e-15)
    assert one.scale == one.energy


def test_trials_alone_leave_time_out_of_it():
    assert (question("sho", trials=5).seconds, question("sho").seconds) == (None, 30.0)
    assert question("sho", trials=5, seconds=2).seconds == 2.0


STARTS = "q,p\n" + "\n".join(f"{i / 10},0.5" for i in range(1, 9)) + "  # the last\n\n"


def test_a_file_of_starts_holds_positions_and_then_momenta(tmp_path):
    (tmp_path / "starts.csv").write_text(STARTS)
    expected = [[i / 10, 0.5] for i in range(1, 9)]
    assert question("sho", starts=tmp_path / "starts.csv").starts.tolist() == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STARTS.replace("0.3,0.5", "0.3,0.5,1"), r"starts.csv, line 4: expected 2 finite numbers, .*got '0.3,0.5,1'"),
        (STARTS.replace("0.3,0.5", "0.3,x"), "line 4: .*got '0.3,x'"),
        (STARTS.replace("0.3,0.5", "0.3,inf"), "line 4: "),
        (STARTS.replace("q,p", "0.l,1"), "line 1: .*got '0.l,1'"),
        (STARTS.replace("q,p", "q,p\nq,p"), "line 2: "),
        ("q,p\n1,2\n", "at least 8 starts, and there are 1"),
    ],
)
def test_slip_in_file_of_starts_is_named_with_its_line(text, words, tmp_path):
    (tmp_path / "starts.csv").write_text(text)
    with pytest.raises(SettingError, match=words):
        question("sho", starts=str(tmp_path / "starts.csv"))


def test_missing_file_of_starts_raises_error_of_package(tmp_path):
    with pytest.raises(SettingError, match="a file that can be read: No such file"):
        question("sho", starts=str(tmp_path / "none.csv"))


# --- Starts of a search: their energies, their distance from the orbit, their halves, and the frequency of the orbit.


def drawn(system, **settings):
    """The two halves as (q, p) of shape (M, d) each."""
    asked = question(system, **settings)
    orbit = orbit_of(asked.system)
    d = asked.system.dimension
    halves = starts_of(asked, orbit, 30.0 / orbit.frequency, 0.03 / orbit.frequency)
    return [(rows[:, :d], rows[:, 2 * d : 3 * d]) for rows in halves]


def test_starts_on_a_surface_have_its_energy():
    for energy, wanted in (("same", 0.125), (0.05, 0.05), (1e-4, 1e-4)):
        for q, p in drawn("henon_heiles", energy=energy):
            x, y = q.T
            H = (p * p + q * q).sum(axis=1) / 2 + x * x * y - y**3 / 3
            # rounding of some 80 bisections of a number of order 1, and of H itself
            assert np.abs(H / wanted - 1).max() < 1e-13
            assert len(H) == 32


def test_energy_surface_is_reached_for_non_quadratic_kinetic_energy_too():
    for q, p in drawn("relativistic_oscillator", energy="1.25"):
        H = np.sqrt(1 + p * p) + q * q / 2
        own = nh.systems["relativistic_oscillator"].energy(tuple(q.T), tuple(p.T))
        assert np.abs(own - 1.25).max() < 1e-13
        assert np.ptp(H - own[:, None]) < 1e-13  # the formula, up to the rest energy


def test_starts_of_box_are_near_orbit_and_their_energies_differ():
    for q, p in drawn("sho"):
        radius = np.hypot(q, p)
        # the orbit is the unit circle, the box has an edge of 2 * HALF_EDGE times amplitudes, which samples give to 2 %
        assert np.abs(radius - 1).max() < np.sqrt(2) * HALF_EDGE * 1.02
        assert 0.02 < radius.std() < 0.1


def test_halves_share_no_start_and_seed_gives_same_ones():
    one, two = drawn("henon_heiles", seed=1)
    assert not set(map(tuple, one[0])) & set(map(tuple, two[0]))
    again, _ = drawn("henon_heiles", seed=1)
    other, _ = drawn("henon_heiles", seed=2)
    assert (one[0] == again[0]).all()
    assert not (one[0] == other[0]).any()


def test_given_starts_are_divided_into_halves_by_seed():
    rows = np.column_stack([np.linspace(0.5, 1.5, 9), np.zeros(9)])
    chosen = set()
    for seed in range(4):
        (q, _), (also, _) = drawn("sho", starts=rows, seed=seed)
        assert len(q) == 5
        assert sorted([*q.ravel(), *also.ravel()]) == rows[:, 0].tolist()
        chosen.add(frozenset(q.ravel().tolist()))
    assert len(chosen) > 1


def test_a_given_start_that_leaves_is_named():
    rows = np.tile([0.1, 0.0, 0.0, 0.1], (9, 1))
    rows[5] = 0.0, 2.0, 0.0, 0.0  # behind the saddle at y = 1
    with pytest.raises(SettingError, match="the orbit of start 6 of 9 leaves its energy surface"):
        drawn("henon_heiles", starts=rows)


def test_energy_without_bound_orbits_and_one_below_potential_are_refused():
    with pytest.raises(SettingError, match=r"energy = 5\.0 is not allowed: one at which orbits of henon_heiles"):
        drawn("henon_heiles", energy=5)
    with pytest.raises(SettingError, match=r"energy = -1\.0 is not allowed: above 0\.00"):
        drawn("henon_heiles", energy=-1)


def test_a_start_at_rest_and_one_that_leaves_are_refused():
    with pytest.raises(SettingError, match="a start that moves"):
        orbit_of(spring(q0=("0",)))
    with pytest.raises(SettingError, match="a force that depends on the position"):
        orbit_of(spring(V=lambda q: 0 * q[0], grad_V=None, p0=("1",)))


def test_the_fastest_frequency_is_that_of_the_normal_modes():
    """M^-1 K by numpy's own solver; the products converge as (second / first eigenvalue)^40."""
    K = np.array([[3.0, -1.0, 0.2], [-1.0, 2.0, -0.5], [0.2, -0.5, 9.0]])
    masses = np.array([1.0, 0.5, 4.0])

    def V(q):
        return sum(float(K[i, j]) * q[i] * q[j] for i in range(3) for j in range(3)) / 2

    modes = spring("modes", V=V, grad_V=None, q0=("1", "0", "0.5"), p0=("0",) * 3, masses=("1", "0.5", "4"))
    expected = np.sqrt(np.linalg.eigvals(K / masses[:, None]).real.max())
    assert orbit_of(modes).frequency == pytest.approx(expected, rel=1e-6)


def test_fastest_frequency_is_smaller_for_non_quadratic_kinetic_energy():
    """T'' = (1 + p^2)^(-3/2), V'' = 1: the root of the mean of T'' over the states of the orbit."""
    orbit = orbit_of(nh.systems["relativistic_oscillator"])
    states = orbit.p[:: len(orbit.p) // 12]
    assert orbit.frequency == pytest.approx(np.sqrt(((1 + states**2) ** -1.5).mean()), rel=1e-5)
