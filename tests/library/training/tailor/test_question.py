"""Arguments of ``tailor``: accepted forms, and one error for each other form."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError, UnknownNameError
from nearharmonic.training.question import question
from support.methods.own_systems import spring


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


def test_a_mistyped_system_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'henon_heiles'"):
        question("henon_heilse")


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
