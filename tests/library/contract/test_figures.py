"""Every figure: a cube with one method, a cube without numbers, and the content of the caption."""

from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from nearharmonic.integrators import BENCHMARKED, integrators
from nearharmonic.recommendation.measure import Solver
from nearharmonic_paper.experiments.paper.figures import fig6_substeps
from nearharmonic_paper.experiments.work_precision.figures import work_precision_figure
from nearharmonic_paper.tasks.experiment import experiments, figures_of
from nearharmonic_paper.tasks.provenance import function_of
from support.cubes import figure_cubes as made
from support.cubes.artists import NO_LINE, entries, look, look_of, luminance
from support.cubes.colour_vision import difference

#: Figure -> what it draws for some methods, and the variables that a cube has even without a number: EXAMPLES in
#: example_cubes.py, in the folder of the tests of each experiment.
CUBES = {
    stem: example
    for place in ("paper/experiments/*/example_cubes.py", "studies/*/example_cubes.py")
    for path in sorted(Path(__file__).parents[2].glob(place))
    for stem, example in run_path(str(path))["EXAMPLES"].items()
}
#: All methods of the figures of trained methods, and all of the other figures.
TRAINED = [name for name in integrators if name.startswith("trained_")]
TOGETHER = [*BENCHMARKED, "rnia12", "na7"]
EXPERIMENTS = experiments()
SHOWN = [stem for one in EXPERIMENTS.values() for stem in one.cubes]
DECLARED = {one.stem: one for one in figures_of(("henon_heiles", "kepler", "sho"), SHOWN)}
# Every system that the paper has no figure of is shown like this.
(DECLARED["sho_energy_error"],) = (
    replace(one, stem="sho_energy_error") for one in figures_of(("other",)) if one.profile
)


#: One of each kind: figures 3 and 5 are drawn as figure 1 is, of other systems, and the other path of figure 6 as it.
FAST = {"gain", "fig1_sho", "fig2_decomposition", "fig4_perihelion", "fig6_substeps"}


def fast_for_the_paper(names):
    """Parameters of a test: all figures but one of each kind of the paper make it slow."""
    return [pytest.param(name, marks=[] if name in FAST else pytest.mark.slow) for name in names]


def drawing(name):
    """The function that draws the figure ``name``."""
    return function_of({"function": DECLARED[name].draw})


@cache
def figure_of(name):
    """The figure ``name`` of three methods, laid out."""
    figure = (
        fig6_substeps(made.toy_panels()) if name == "fig6_substeps" else drawing(name)(CUBES[name][0](made.METHODS))
    )
    figure.draw_without_rendering()
    return figure


def legend_of(name):
    """Text -> the artists beside it, of all legends of a figure."""
    return {text: artists for one in figure_of(name).findobj(Legend) for text, artists in entries(one).items()}


def colours_of(artist):
    """Colours of an artist that draws lines, faces or both."""
    if isinstance(artist, Line2D):
        return {to_hex(artist.get_color()), to_hex(artist.get_markerfacecolor())}
    return {to_hex(one) for one in (*np.atleast_2d(artist.get_facecolor()), *np.atleast_2d(artist.get_edgecolor()))}


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


@pytest.mark.slow
@pytest.mark.parametrize("name", fast_for_the_paper(CUBES))
def test_figure_draws_single_method_without_style(name):
    cube, _ = CUBES[name]
    is_drawn(drawing(name)(cube(["a_method_of_tomorrow"])))


@pytest.mark.slow
@pytest.mark.parametrize("name", fast_for_the_paper(CUBES))
def test_a_figure_draws_a_cube_without_a_number(name):
    cube, kept = CUBES[name]
    is_drawn(drawing(name)(made.emptied(cube(["ruth", "babps9o7h"]), *kept)))


@pytest.mark.slow
def test_figure_6_draws_one_panel_alone_and_path_without_number():
    panels = made.toy_panels()
    is_drawn(fig6_substeps({"A": panels["A"]}))
    is_drawn(fig6_substeps({k: made.emptied(panel, "H", "hamiltonian") for k, panel in panels.items()}))


@pytest.mark.slow
def test_work_precision_figure_draws_single_method_and_empty_curves():
    single = made.curves(made.timed("ruth", [1e-3], [1e-4]))
    is_drawn(work_precision_figure("toy", [("20", ("max",), single)], made.FACTS))
    absent = made.curves(*(Solver(method=name, label=name, kind="splitting", status="no") for name in made.METHODS))
    is_drawn(work_precision_figure("toy", [("20", ("max", "mean"), absent), ("5", ("position",), absent)], made.FACTS))


@pytest.mark.slow
@pytest.mark.parametrize("name", fast_for_the_paper(DECLARED))
def test_each_entry_of_legend_has_look_of_what_is_drawn(name):
    """A method has its own; what stands for all methods is of the grey of no method, and of a form that is drawn."""
    artists = [one for axes in figure_of(name).axes for one in axes.findobj() if one.axes is axes]
    lines = [one for one in artists if isinstance(one, Line2D)]
    colours = set().union(*(colours_of(one) for one in artists if isinstance(one, (Line2D, Patch, Collection))))
    pictures = any(axes.images or axes.collections for axes in figure_of(name).axes)
    for text, (one, *_) in legend_of(name).items():
        for method in made.METHODS:
            assert text != made.label(method) or look(one) in (look_of(method), look_of(method, NO_LINE))
        if isinstance(one, Patch):
            assert pictures or colours_of(one) & colours, text
        elif to_hex(one.get_color()) == "#404040":
            assert look(one)[1] in {look(line)[1] for line in lines}, text
            assert look(one)[3] in {look(line)[3] for line in lines}, text
        else:
            assert to_hex(one.get_color()) in colours, text


def form_of(line):
    """(colour, all else that tells an entry of a legend apart: marker, filling and dashes)."""
    colour, marker, face, dashes = look(line)
    return colour, (marker, face == colour, dashes)


@pytest.mark.parametrize("name", fast_for_the_paper(CUBES))
def test_entries_of_legend_are_told_apart_by_all_readers(name):
    """By marker, filling or dashes; or by a colour that readers with deuteranopia see too."""
    figure = drawing(name)(CUBES[name][0](TRAINED if name.startswith("trained") else TOGETHER))
    of_figure = [legend for part in (figure, *figure.subfigs) for legend in part.legends]
    groups = [of_figure, *([axes.get_legend()] for axes in figure.axes if axes.get_legend())]
    for legends in groups:
        artists = [one for legend in legends for one, *_ in entries(legend).values()]
        forms = [form_of(one) for one in artists if isinstance(one, Line2D)]
        for (colour, form), (other, like) in combinations(forms, 2):
            assert form != like or difference(colour, other, "deuteranopia") >= 10, (colour, other, form)


@pytest.mark.parametrize("name", fast_for_the_paper(DECLARED))
def test_a_figure_names_each_method_or_curve(name):
    said = " ".join(text.get_text() for text in figure_of(name).findobj(Text))
    # Names of orbits, of ensembles with the best methods, of ensembles, of ideas, of kinds of methods, of crystals, of
    # strengths.
    of_one = ("fig6_displaced", "fig6_substeps", "trained_error", "trained_gain", "trained_ideas")
    of_one += ("crystals_map", "crystals_gain", "samplers_trained")
    assert name in of_one or all(made.label(m) in said or m in said for m in made.METHODS)
    assert name not in of_one or len(legend_of(name)) > 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crystals_map", "trained_ideas"])
def test_numbers_on_cells_have_the_contrast_of_text(name):
    contrasts = []
    for axes in (one for one in figure_of(name).axes if one.images):
        for text in axes.texts:
            x, y = map(round, text.get_position())
            dark, light = sorted(map(luminance, (text.get_color(), axes.images[0].get_array()[y, x])))
            contrasts.append((light + 0.05) / (dark + 0.05))
    assert len(contrasts) > 10
    assert min(contrasts) >= 4.5


def is_lettered(text):
    return text.get_fontweight() == "bold" or text.get_text().startswith(r"$\mathbf{")


@pytest.mark.parametrize("name", fast_for_the_paper(DECLARED))
def test_panels_are_lettered_in_order_and_both_axes_are_labelled(name):
    figure = figure_of(name)
    texts = {text.get_text().removeprefix(r"$\mathbf{"): text for text in figure.findobj(Text) if is_lettered(text)}
    boxes = {letter[0]: texts[letter].get_window_extent() for letter in sorted(texts)}
    assert [*boxes] == [*"ABCDEFGHI"[: len(boxes)]]
    assert all(b.x0 > a.x0 or b.y1 < a.y1 for a, b in pairwise(boxes.values()))
    parts = figure.subfigs or [figure]
    for part in parts:
        for get, over in (("get_xlabel", "get_supxlabel"), ("get_ylabel", "get_supylabel")):
            assert getattr(part, over)() or any(getattr(axes, get)() for axes in part.axes)


@pytest.mark.parametrize("name", fast_for_the_paper(DECLARED))
def test_titles_labels_and_notes_do_not_overlap(name):
    figure = figure_of(name)
    boxes = {}
    for axes in figure.axes:
        for text in (axes._left_title, axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts):
            if text.get_text().strip() and axes.get_visible():
                boxes[text] = text.get_window_extent()
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        assert min(a.x1, b.x1) - max(a.x0, b.x0) < 2 or min(a.y1, b.y1) - max(a.y0, b.y0) < 2, (one, other)
