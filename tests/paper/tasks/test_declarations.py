"""Figures of two experiments beside each other: each has files and targets of its own, and its own function."""

from __future__ import annotations

from collections import Counter

import pytest

from nearharmonic_paper.tasks import declarations

ONE = """
@figure(cube="{system}", caption="One. Two.", profile=True)
def energy_error(cube): ...

@figure(cube="sho", caption="Three. Four.", target="fig1", profile=True)
def fig1_sho(cube): ...
"""
TWO = """
@figure(cube="{system}", caption="Five. Six.", category="Timings")
def run_times(cube): ...

@figure(cube="there", caption="Seven. Eight.")
def of_a_cube(cube): ...

@figure(cube="elsewhere", caption="Nine. Ten.")
def of_a_cube_that_is_not_made(cube): ...

@figure(cube=None, caption="Eleven. Twelve.")
def of_nothing(): ...
"""


@pytest.fixture
def declared(tmp_path, monkeypatch):
    for name, text in (("one", ONE), ("two", TWO)):
        (tmp_path / "experiments" / name).mkdir(parents=True)
        (tmp_path / "experiments" / name / "figure.py").write_text(text)
    monkeypatch.setattr(declarations, "ROOT", tmp_path)
    return declarations.figures_of(("experiments",), ("sho", "kepler"), ("there",))


def test_figures_of_each_system_have_separate_names_and_functions(declared):
    found = {one.stem: (one.function.rpartition(".")[2], one.target, one.cube) for one in declared}
    assert found == {
        "sho_energy_error": ("figure:fig1_sho", "sho_energy_error", "sho"),
        "kepler_energy_error": ("figure:energy_error", "kepler_energy_error", "kepler"),
        "fig1_sho": ("figure:fig1_sho", "fig1", "sho"),
        "sho_run_times": ("figure:run_times", "sho_run_times", "sho"),
        "kepler_run_times": ("figure:run_times", "kepler_run_times", "kepler"),
        "of_a_cube": ("figure:of_a_cube", "of_a_cube", "there"),
        "of_nothing": ("figure:of_nothing", "of_nothing", None),
    }
    assert len(declared) == len(found)
    assert Counter(one.category for one in declared) == {"Figures": 5, "Timings": 2}


def test_figure_is_drawn_by_function_of_its_own_experiment(declared):
    folders = {one.stem: one.function.split(".")[1] for one in declared}
    assert folders["kepler_energy_error"] == "one"
    assert folders["kepler_run_times"] == folders["sho_run_times"] == "two"
