"""Every figure: a cube with one method, a cube without numbers, and the content of the caption."""

from __future__ import annotations

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

from nearharmonic.recommendation.curve import Curve
from nearharmonic.reproduction.experiments.paper.figures.fig6_substeps import draw_panels
from nearharmonic.reproduction.experiments.work_precision.figures.times import work_precision_figure
from nearharmonic.reproduction.tasks.declarations import figures_of
from nearharmonic.reproduction.tasks.experiment import experiments
from nearharmonic.reproduction.tasks.provenance import function_of
from support.cubes import figure_cubes as made

#: Figure -> what it draws for some methods, and the variables that a cube has even without a number: EXAMPLES in
#: example_cubes.py, in the folder of the tests of each experiment.
CUBES = {
    stem: example
    for path in sorted(Path(__file__).parents[1].glob("reproduction/experiments/*/example_cubes.py"))
    for stem, example in run_path(str(path))["EXAMPLES"].items()
}
EXPERIMENTS = experiments()
SHOWN = [stem for one in EXPERIMENTS.values() for stem in one.cubes]
DECLARED = {one.stem: one for one in figures_of("reproduction.experiments", ("henon_heiles", "kepler", "sho"), SHOWN)}
# Those of the systems that the paper has a figure of are drawn by that figure; every other system is shown like this.
OWN = {stem: DECLARED.pop(stem) for stem in ("sho_energy_error", "henon_heiles_energy_error", "kepler_energy_error")}
(DECLARED["sho_energy_error"],) = figures_of("reproduction.experiments.paper.figures.energy_error", ("sho",))


def drawing(name):
    """The function that draws the figure ``name``."""
    return function_of({"function": DECLARED[name].function})


def is_drawn(figure):
    """``figure`` can be laid out, and each of its panels has room on both axes."""
    figure.draw_without_rendering()
    assert figure.axes
    for axes in figure.axes:
        for low, high in (axes.get_xlim(), axes.get_ylim()):
            assert np.isfinite([low, high]).all()
            assert low != high


def test_every_figure_has_an_example_cube():
    """But for Figure 6, which computes what it shows and is drawn below."""
    assert set(DECLARED) == {*CUBES, "fig6_substeps"}


@pytest.mark.parametrize("experiment", EXPERIMENTS.values(), ids=lambda one: one.name)
def test_every_figure_has_title_in_declaration_of_its_experiment(experiment):
    drawn = {one.stem for one in DECLARED.values() if one.function.startswith(f"{experiment.room}.")}
    assert drawn - {"sho_energy_error"} <= {*experiment.figures}


def test_paper_system_figure_equals_paper_figure():
    for number, system in (("fig1", "sho"), ("fig3", "henon_heiles"), ("fig5", "kepler")):
        (papers,) = (one for one in DECLARED.values() if one.target == number)
        second = OWN[f"{system}_energy_error"]
        assert (second.function, second.cube, second.caption) == (papers.function, system, papers.caption)
        assert second.target == f"{system}_energy_error"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name.startswith("fig") else pytest.mark.slow) for name in CUBES]
)
def test_figure_draws_single_method_without_style(name):
    cube, _ = CUBES[name]
    is_drawn(drawing(name)(cube(["a_method_of_tomorrow"])))


@pytest.mark.parametrize("name", CUBES)
def test_a_figure_draws_a_cube_without_a_number(name):
    cube, kept = CUBES[name]
    is_drawn(drawing(name)(made.emptied(cube(["ruth", "babps9o7h"]), *kept)))


def test_figure_6_draws_one_panel_alone_and_path_without_number():
    panels = made.toy_panels()
    is_drawn(draw_panels({"A": panels["A"]}))
    is_drawn(draw_panels({k: made.emptied(panel, "H", "hamiltonian") for k, panel in panels.items()}))


def test_work_precision_figure_draws_single_method_and_empty_curves():
    is_drawn(work_precision_figure("toy", [("20", ("max",), [made.timed("ruth", [1e-3], [1e-4])])], made.FACTS))
    absent = [Curve(method=name, label=name, kind="splitting", status="no") for name in made.METHODS]
    is_drawn(work_precision_figure("toy", [("20", ("max", "mean"), absent), ("5", ("position",), absent)], made.FACTS))


@pytest.mark.parametrize("name", DECLARED)
def test_every_figure_has_a_caption_of_two_sentences_or_more(name):
    text = DECLARED[name].caption
    assert text.count(". ") >= 1
    assert text.endswith(".")
    assert "  " not in text
