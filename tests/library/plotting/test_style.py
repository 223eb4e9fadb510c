"""The house style: methods told apart in print and by colour-blind readers, logarithmic axes, files written whole."""

from __future__ import annotations

import subprocess
import sys
from itertools import combinations
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex

from nearharmonic.integrators import integrators
from nearharmonic.plotting.style import (
    Style,
    draw_profile,
    house_style,
    log_scale,
    mark_every,
    method_handles,
    new_figure,
    panel_letter,
    save,
    style_of,
)
from support.cubes import figure_cubes as made
from support.cubes.artists import NO_LINE, SOLID, drawn, look, luminance

BENCHMARKED = [name for name, tableau in integrators.items() if tableau.benchmarked]


def line_on_log_axes(x, y, directions="xy"):
    axes = new_figure(3, 2).subplots()
    (line,) = axes.plot(x, y)
    log_scale(axes, directions)
    return axes, line


def test_no_two_integrators_look_alike():
    for one, other in combinations(integrators, 2):
        assert style_of(one) != style_of(other), f"{one} looks like {other}: give it an entry of its own in style.py"


def test_the_benchmarked_methods_are_told_apart_without_colour():
    assert len({(style_of(n).marker, style_of(n).filled) for n in BENCHMARKED}) == len(BENCHMARKED) == 10


def test_filled_markers_are_methods_of_nielsen_and_of_this_project():
    # What the captions of Figures 1, 3 and of other systems say.
    ours = ("Nielsen", "found by", "trained by")
    assert sum(not tableau.source.startswith(ours) for tableau in integrators.values()) >= 30
    assert {
        name for name, tableau in integrators.items() if style_of(name).filled != tableau.source.startswith(ours)
    } == set()


@pytest.mark.parametrize("name", [*integrators, *(f"new method {i}" for i in range(40))])
def test_every_colour_stands_out_from_white_paper(name):
    # WCAG 2.1, 1.4.11: graphics need a contrast of 3 to 1.
    assert 1.05 / (luminance(style_of(name).colour) + 0.05) >= 3


def test_unlisted_method_has_reproducible_style():
    assert style_of("rkn_11") == style_of("rkn_11")
    assert style_of("rkn_11") not in [style_of(name) for name in BENCHMARKED]
    unknown = [style_of(f"new method {i}") for i in range(200)]
    assert {style.filled for style in unknown} == {False}  # filled markers are those of the paper's methods
    # All 7 x 6 looks are in use: 200 hashes miss one of 42 with probability exp(-200/42) = 0.009.
    assert len(set(unknown)) > 42 * 0.9


@pytest.mark.parametrize("filled", [True, False])
def test_line_has_colour_and_marker_of_its_style(filled):
    style = Style("#123456", "s", filled=filled)
    axes = new_figure(3, 2).subplots()
    face = "#123456" if filled else "#ffffff"
    assert look(axes.plot([1, 2], [3, 4], **style.line())[0]) == ("#123456", "s", face, SOLID)
    assert look(axes.plot([1, 2], [3, 4], **style.points())[0]) == ("#123456", "s", face, NO_LINE)
    assert look(axes.plot([1, 2], [3, 4], **style.points(marker="o"))[0]) == ("#123456", "o", face, NO_LINE)
    assert look(axes.plot([1, 2], [3, 4], **style.line(linestyle="none"))[0]) == ("#123456", "s", face, NO_LINE)


def test_legend_entries_have_styles_and_labels_in_order():
    names, labels = ["ruth", "babps9o7h", "leapfrog"], ["one", "two", "three"]
    handles = method_handles(names, labels, markersize=4)
    assert [handle.get_label() for handle in handles] == labels
    assert [handle.get_markersize() for handle in handles] == [4, 4, 4]
    for name, handle in zip(names, handles, strict=True):
        colour = to_hex(style_of(name).colour)
        assert look(handle) == (colour, style_of(name).marker, colour if name == "babps9o7h" else "#ffffff", SOLID)
    with pytest.raises(ValueError, match="zip"):
        method_handles(names, labels[:2])


@pytest.mark.parametrize(("methods", "points", "marks"), [(10, 161, 12), (3, 25, 12), (37, 500, 7), (1, 90, 12)])
def test_markers_of_curves_drawn_together_take_turns(methods, points, marks):
    every = [mark_every(position, methods, points, marks) for position in range(methods)]
    places = [range(points)[first::step] for first, step in every]
    (step,) = {place.step for place in places}
    # About as many as asked for on each curve, the first ones spread evenly over one step.
    assert all(marks <= len(place) + 1 and len(place) <= 2 * marks for place in places)
    assert [place.start for place in places] == [int(step * i / methods) for i in range(methods)]


@pytest.mark.slow
def test_logarithmic_axes_have_ticks_and_labels_at_powers_of_ten():
    axes, _ = line_on_log_axes([1, 1000], [1e-5, 1e3])
    axes.figure.draw_without_rendering()
    for axis in (axes.xaxis, axes.yaxis):
        places = np.log10(axis.get_majorticklocs())
        np.testing.assert_allclose(places, np.round(places), atol=1e-12)
        assert np.diff(places).tolist() == [1] * (len(places) - 1)
        assert len(axis.get_minorticklocs()) == 8 * (len(places) - 1)
        assert {label.get_text() for label in axis.get_ticklabels(minor=True)} == {""}


def test_what_has_no_logarithm_leaves_a_gap():
    _, line = line_on_log_axes([1, 2, 3, 4, 5, 6], [1.0, 0.0, 2.0, -1.0, np.nan, 3.0])
    assert drawn(line).tolist() == [True, False, True, False, False, True]
    _, line = line_on_log_axes([1, 0, 3], [1.0, 1.0, 1.0])
    assert drawn(line).tolist() == [True, False, True]


@pytest.mark.slow
@pytest.mark.parametrize("values", [[], [np.nan, np.nan], [0.0, 0.0], [np.inf, np.inf]])
def test_an_axis_with_nothing_to_show_still_has_a_range(values):
    axes, _ = line_on_log_axes(np.arange(1, 1 + len(values)), values, "y")
    assert axes.get_ylim() == (1e-16, 1)
    axes.figure.draw_without_rendering()


def test_panel_letter_is_bold_above_left_corner_before_title():
    left, right = new_figure(3, 2).subplots(1, 2)
    panel_letter(left, "C", "the third")
    panel_letter(right, "D")
    assert [axes.get_title(loc="left") for axes in (left, right)] == [r"$\mathbf{C}$  the third", r"$\mathbf{D}$"]


def places(stem):
    return [stem.parent / f"{stem.name}.{suffix}" for suffix in ("pdf", "svg", "png")]


def plain_figure():
    @house_style
    def draw():
        figure = new_figure(2, 1.5)
        figure.subplots().plot([1, 2, 3], [3, 1, 2], label="a")
        figure.legend()
        return figure

    return draw()


@pytest.mark.slow
def test_saving_writes_three_formats_with_the_same_bytes_each_time(tmp_path):
    first = save(plain_figure(), places(tmp_path / "deeper" / "fig.v1"))
    second = save(plain_figure(), places(tmp_path / "again"))
    assert [path.name for path in first] == ["fig.v1.pdf", "fig.v1.svg", "fig.v1.png"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert sorted(path.name for path in (tmp_path / "deeper").iterdir()) == sorted(path.name for path in first)
    starts = (b"%PDF", b"<?xml", b"\x89PNG")
    assert [path.read_bytes().startswith(start) for path, start in zip(first, starts, strict=True)] == [True] * 3
    # Width and height in pixels, big-endian from byte 16 on: 2 x 1.5 inches at 200 dots per inch.
    assert [int.from_bytes(first[2].read_bytes()[i : i + 4], "big") for i in (16, 20)] == [400, 300]


def test_no_file_holds_the_time_of_its_making(tmp_path):
    pdf, svg, png = (path.read_bytes() for path in save(plain_figure(), places(tmp_path / "fig")))
    assert b"CreationDate" not in pdf
    assert b"<dc:date>" not in svg
    assert b"tIME" not in png


@pytest.mark.parametrize("failing", ["pdf", "svg", "png"])
def test_figure_that_fails_to_draw_leaves_old_files_in_place(tmp_path, monkeypatch, failing):
    figure = plain_figure()
    for suffix in ("pdf", "svg", "png"):
        (tmp_path / f"fig.{suffix}").write_bytes(b"old")

    def savefig(content, *, format, **_):
        content.write(b"half of the new")
        if format == failing:
            raise MemoryError

    monkeypatch.setattr(figure, "savefig", savefig)
    with pytest.raises(MemoryError):
        save(figure, places(tmp_path / "fig"))
    left = ["pdf", "svg", "png"][["pdf", "svg", "png"].index(failing) :]
    assert [(tmp_path / f"fig.{suffix}").read_bytes() for suffix in left] == [b"old"] * len(left)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fig.pdf", "fig.png", "fig.svg"]


def test_drawing_leaves_the_callers_matplotlib_settings_alone(tmp_path):
    with mpl.rc_context({"font.size": 17, "svg.hashsalt": "mine"}):
        before = dict(mpl.rcParams)
        save(plain_figure(), places(tmp_path / "fig"))
        assert dict(mpl.rcParams) == before


@pytest.mark.slow
def test_importing_figures_loads_no_pyplot_and_changes_no_setting():
    # Start-up time: pyplot and xarray cost more than the drawing.
    program = """
import sys, matplotlib
before = matplotlib.rcParams.copy()
from nearharmonic_paper.experiments.paper.figures import fig2_decomposition
from nearharmonic_paper.experiments.paper.figures import fig4_perihelion
from nearharmonic_paper.experiments.paper.figures import fig6_substeps
print([m for m in ("matplotlib.pyplot", "xarray", "pandas") if m in sys.modules], matplotlib.rcParams.copy() == before)
"""
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[] True"


def test_svg_has_text_as_text_and_says_what_it_shows(tmp_path):
    figure = new_figure(3, 2)
    figure.subplots().set_title("the third <panel>")
    figure.set_label("Errors & times: of <all> methods, at each step size.")
    text = save(figure, [tmp_path / "a.svg"])[0].read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)
    space = "{http://www.w3.org/2000/svg}"
    assert [one.text for one in root[:2]] == ["Errors & times", "Errors & times: of <all> methods, at each step size."]
    assert [one.tag for one in root[:2]] == [f"{space}title", f"{space}desc"]
    assert "the third <panel>" in [one.text for one in root.iter(f"{space}text")]


def fills(svg):
    """Colours of the filled outlines of an SVG file."""
    styles = [one.get("style", "") for one in ElementTree.parse(svg).iter("{http://www.w3.org/2000/svg}path")]
    return {part for style in styles for part in style.split("; ") if part.startswith("fill: #")}


def test_transparent_svg_has_no_background_and_other_files_keep_theirs(tmp_path):
    white = save(plain_figure(), places(tmp_path / "white"))
    clear = save(plain_figure(), places(tmp_path / "clear"), transparent=True)
    assert fills(white[1]) == {"fill: #ffffff"}
    assert fills(clear[1]) == set()
    assert [white[k].read_bytes() == clear[k].read_bytes() for k in range(3)] == [True, False, True]


def test_energy_error_figure_names_system_and_interval():
    cube = made.errors(["ruth"]).assign_attrs(system_label="test system", settings='{"sweep": {"t_end": "500"}}')
    cube.tau_per_stage.attrs["units"] = "h"
    assert draw_profile(cube).axes[0].get_title(loc="right") == "test system, $t$ = 500 h"
    assert draw_profile(made.errors(["ruth"])).axes[0].get_title(loc="right") == ""
