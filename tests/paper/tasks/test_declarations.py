"""Figures of two experiments beside each other: each has files and targets of its own, and its own function."""

import pytest

from nearharmonic_paper.tasks import experiment
from nearharmonic_paper.tasks.experiment import Experiment, Figure, figures_of


def figure(draw, cube, **more):
    return Figure(draw=draw, title="", caption="One. Two.", cube=cube, **more)


ONE = {
    "{system}_energy_error": figure("one:energy_error", "{system}", profile=True),
    "fig1_sho": figure("one:fig1_sho", "sho", target="fig1", profile=True),
}
TWO = {
    "{system}_run_times": figure("two:run_times", "{system}", category="Timings"),
    "of_a_cube": figure("two:of_a_cube", "there", settings={"columns": 3}),
    "of_a_cube_that_is_not_made": figure("two:elsewhere", "elsewhere"),
    "of_nothing": figure("two:of_nothing", None),
    "of_several": figure("two:of_several", None, cubes=("kepler", "elsewhere", "there")),
    "of_none_of_several": figure("two:of_several", None, cubes=("elsewhere",)),
    "drawn_by_another_job": "its title",
}


@pytest.fixture
def declared(monkeypatch):
    made = {name: Experiment(name=name, title="", about="", figures=of) for name, of in (("one", ONE), ("two", TWO))}
    monkeypatch.setattr(experiment, "experiments", lambda: made)
    return figures_of(("sho", "kepler"), ("there",))


def test_figures_of_each_system_have_separate_names_and_functions(declared):
    found = {one.stem: (one.draw, one.target, one.cube, one.experiment) for one in declared}
    assert found == {
        "kepler_energy_error": ("one:energy_error", "kepler_energy_error", "kepler", "one"),
        "fig1_sho": ("one:fig1_sho", "fig1", "sho", "one"),
        "sho_run_times": ("two:run_times", "sho_run_times", "sho", "two"),
        "kepler_run_times": ("two:run_times", "kepler_run_times", "kepler", "two"),
        "of_a_cube": ("two:of_a_cube", "of_a_cube", "there", "two"),
        "of_nothing": ("two:of_nothing", "of_nothing", None, "two"),
        "of_several": ("two:of_several", "of_several", None, "two"),
    }
    assert {one.stem: one.cubes for one in declared if one.cubes} == {"of_several": ("kepler", "there")}
    assert len(declared) == len(found)
    assert {one.stem: one.settings for one in declared if one.settings} == {"of_a_cube": {"columns": 3}}
