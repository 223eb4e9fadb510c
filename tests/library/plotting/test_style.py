"""The house style: methods told apart by all readers, logarithmic axes, envelopes of curves, files written whole."""

from __future__ import annotations

import io
import subprocess
import sys
from itertools import combinations, pairwise, product
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED, integrators
from nearharmonic.plotting.profile import COLUMNS, Style, envelope, has_style, text_on
from nearharmonic.plotting.style import (
    draw_profile,
    house_style,
    label_ends,
    log_scale,
    mark_every,
    method_handles,
    new_figure,
    save,
    style_of,
)
from nearharmonic_paper.experiments.exact_oscillator import ExactOscillatorSettings
from nearharmonic_paper.experiments.stability.figures import ESCAPED_COLOUR, LOST_COLOUR
from nearharmonic_studies.crystals import results as crystals
from nearharmonic_studies.crystals.settings import AVERAGED, DRIFTING
from nearharmonic_studies.samplers import results as samplers
from support.cubes import figure_cubes as made
from support.cubes.artists import NO_LINE, SOLID, drawn, look, luminance
from support.cubes.colour_vision import SEEN, difference, lab, least_difference


def line_on_log_axes(x, y, directions="xy"):
    axes = new_figure(3, 2).subplots()
    (line,) = axes.plot(x, y)
    log_scale(axes, directions)
    return axes, line


def test_no_two_integrators_look_alike():
    for one, other in combinations(integrators, 2):
        assert style_of(one) != style_of(other), f"{one} looks like {other}: give it an entry of its own in profile.py"


def test_the_benchmarked_methods_are_told_apart_without_colour():
    assert len({(style_of(n).marker, style_of(n).filled) for n in BENCHMARKED}) == len(BENCHMARKED) == 10


def test_filled_markers_are_methods_of_nielsen_and_of_this_project():
    # What the captions of Figures 1, 3 and of other systems say.
    ours = ("Nielsen", "found by", "trained by")
    assert {name for name, one in integrators.items() if style_of(name).filled != one.source.startswith(ours)} == set()


@pytest.mark.parametrize("name", [*integrators, *(f"new method {i}" for i in range(40))])
def test_every_colour_stands_out_from_white_paper(name):
    # WCAG 2.1, 1.4.11: graphics need a contrast of 3 to 1.
    assert 1.05 / (luminance(style_of(name).colour) + 0.05) >= 3


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
    places = [mark_every(position, methods, np.ones(points), marks) for position in range(methods)]
    (step,) = {step for place in places for step in np.diff(place)}
    # About as many as asked for on each curve, the first ones spread evenly over one step.
    assert all(marks <= len(place) + 1 and len(place) <= 2 * marks for place in places)
    assert [place[0] for place in places] == [int(step * i / methods) for i in range(methods)]


@pytest.mark.parametrize("left", [True, False])
def test_labels_stand_beside_ends_in_order_without_overlaps(left):
    axes = new_figure(3, 3).subplots()
    axes.set(xlim=(-9, 9), ylim=(0.1, 1e4), yscale="log")
    ends = [1.02, 1, 1e3, 1.01, 30, 1e3]
    curves = [axes.plot([-5, 0, 1, 5], [end, 5, np.nan, end], label=f"{end:06.2f}")[0] for end in ends]
    labels = label_ends(axes, curves, left=left)
    assert [label.get_text() for label in labels] == sorted(f"{end:06.2f}" for end in ends)
    boxes = [label.get_window_extent() for label in labels]
    assert all(lower.y1 <= upper.y0 for lower, upper in pairwise(boxes))
    edge = axes.transData.transform((-5 if left else 5, 30))
    assert all(box.x1 < edge[0] if left else box.x0 > edge[0] for box in boxes)
    assert labels[3].get_position()[1] == pytest.approx(30)  # it has room at its end


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


@pytest.mark.parametrize(
    ("least", "most", "powers", "between", "labels"),
    [
        (3e-4, 3, ["10⁻³", "10⁻²", "10⁻¹", "10⁰"], [5e-4, 2e-3, 5e-3, 0.02, 0.05, 0.2, 0.5, 2], []),
        (0.3, 6, ["10⁰"], [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 2, 3, 4, 5, 6], ["5×10⁻¹", "2×10⁰", "5×10⁰"]),
    ],
)
def test_a_logarithmic_axis_has_few_ticks_and_labels_in_plain_text(least, most, powers, between, labels):
    axes, _ = line_on_log_axes([least, most], [1, 1])
    axes.set_xlim(least * (1 - 1e-9), most * (1 + 1e-9))
    for which, shown, says in (("major", None, powers), ("minor", between, labels)):
        inside = [at for at in axes.get_xticks(minor=which == "minor") if least * 0.99 < at < most * 1.01]
        formatter = getattr(axes.xaxis, f"get_{which}_formatter")()
        assert list(filter(None, map(formatter, inside))) == says
        assert shown is None or inside == pytest.approx(shown)


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
    # Width and height in pixels, big-endian from byte 16 on: 2 x 1.5 inches at 300 dots per inch.
    assert [int.from_bytes(first[2].read_bytes()[i : i + 4], "big") for i in (16, 20)] == [600, 450]
    # Journals refuse fonts of type 3.
    fonts = first[0].read_bytes()
    assert b"/CIDFontType2" in fonts
    assert b"/Type3" not in fonts


def test_png_has_the_pixels_that_matplotlib_draws_and_the_title_in_any_script(tmp_path):
    figure = plain_figure()
    (axes,) = figure.axes
    axes.contourf([[0.0, 1.0], [1.0, 2.0]])
    axes.scatter([0.2, 0.9], [1.0, 2.0], s=[30, 90])
    axes.annotate(r"$\tau/s$", (1.0, 2.0), xytext=(5, 9), textcoords="offset points", bbox={"facecolor": "red"})
    axes.plot([0, 9], [0, 9], clip_path=mpl.patches.Circle((1, 1), 0.7, transform=axes.transData))
    figure.set_label("Hénon–Heiles: τ\nA caption.")
    (path,) = save(figure, [tmp_path / "fig.png"])
    figure.set_dpi(300)
    house_style(figure.canvas.draw)()
    with Image.open(path) as read:
        pixels = np.asarray(read).astype(int) - np.asarray(figure.canvas.buffer_rgba())[..., :3]
        # The layout of the file is in points: edges of letters may move by a part of a pixel.
        assert (np.abs(pixels).max(axis=-1) > 60).mean() < 0.004
        assert (read.info["Title"], *map(round, read.info["dpi"])) == ("Hénon–Heiles: τ", 300, 300)


def test_figure_with_an_image_is_drawn_for_each_format(tmp_path):
    figure = new_figure(1, 1)
    figure.add_axes((0, 0, 1, 1)).imshow([[0, 1], [1, 0]], cmap="gray", interpolation="nearest", aspect="auto")
    written = save(figure, places(tmp_path / "fig"))
    with Image.open(written[2]) as read:
        assert [read.getpixel(place) for place in ((60, 60), (240, 60))] == [(0, 0, 0), (255, 255, 255)]
    assert b"<image" in written[1].read_bytes()


@pytest.mark.parametrize("failing", ["pdf", "svg", "png"])
def test_figure_that_fails_to_draw_leaves_old_files_in_place(tmp_path, monkeypatch, failing):
    figure = plain_figure()
    for suffix in ("pdf", "svg", "png"):
        (tmp_path / f"fig.{suffix}").write_bytes(b"old")

    def savefig(figure, content, *, format, **_):
        content.write(b"half of the new")
        if format == failing:
            raise MemoryError

    def draw(canvas):
        raise MemoryError

    monkeypatch.setattr(Figure, "savefig", savefig)
    monkeypatch.setattr(FigureCanvasAgg, "draw", draw)
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
import nearharmonic_paper.experiments.paper.figures
print([m for m in ("matplotlib.pyplot", "xarray", "pandas") if m in sys.modules], matplotlib.rcParams.copy() == before)
"""
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[] True"


def test_svg_needs_no_fonts_and_says_what_it_shows(tmp_path):
    figure = new_figure(3, 2)
    figure.subplots().set_title("the third <panel>")
    figure.set_label("Errors & times: at equal cost\nOf <all> methods, at each step size.")
    text = save(figure, [tmp_path / "a.svg"])[0].read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)
    space = "{http://www.w3.org/2000/svg}"
    assert [one.text for one in root[:2]] == ["Errors & times: at equal cost", "Of <all> methods, at each step size."]
    assert [one.tag for one in root[:2]] == [f"{space}title", f"{space}desc"]
    assert not [*root.iter(f"{space}text")]
    assert "font" not in text


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
    assert draw_profile(cube).axes[0].get_title(loc="right") == r"test system, $t \in [0, 500]$ h"
    cube.attrs["settings"] = '{"sweep": {"t_end": "87660"}}'
    assert draw_profile(cube).axes[0].get_title(loc="right") == "test system, ten years"
    assert draw_profile(made.errors(["ruth"])).axes[0].get_title(loc="right") == ""


#: Least difference in CIELAB of colours that are told apart; 2.3 is just noticeable for large patches side by side.
APART = 13
TRAINED, TRAINED_EXACT = (
    [name for name in integrators if name.startswith("trained_") and name.startswith("trained_exact_") == exact]
    for exact in (False, True)
)
EXACT = ExactOscillatorSettings().integrators


def test_simulated_vision_confuses_red_and_green_of_one_lightness():
    assert lab("#ffffff") == pytest.approx([100, 0, 0], abs=1e-3)
    assert lab("#ff0000") == pytest.approx([53.24, 80.09, 67.20], abs=0.05)  # published values of sRGB red
    assert difference("#c05040", "#6f7a3c") > 8 * difference("#c05040", "#6f7a3c", "deuteranopia")
    assert all(difference("#404040", "#808080", vision) > 20 for vision in SEEN)


def test_methods_with_one_marker_have_colours_that_all_readers_see():
    alike = [
        (one, other)
        for one, other in combinations(filter(has_style, integrators), 2)
        if (style_of(one).marker, style_of(one).filled) == (style_of(other).marker, style_of(other).filled)
        and least_difference(style_of(one).colour, style_of(other).colour) < APART
    ]
    assert alike == []


@pytest.mark.parametrize(
    "names",
    [[*BENCHMARKED, *EXACT], TRAINED, [*EXACT, *TRAINED_EXACT], crystals.DRAWN, [*DRIFTING, *AVERAGED], samplers.DRAWN],
    ids=["with the exact oscillator", "trained", "trained exactly", "crystals", "long runs", "samplers"],
)
def test_methods_drawn_together_have_colours_that_all_readers_see(names):
    found = {
        (one, other): least_difference(style_of(one).colour, style_of(other).colour)
        for one, other in combinations(dict.fromkeys(names), 2)
    }
    assert min(found.values()) >= APART, min(found, key=found.get)


def test_text_on_any_colour_has_the_contrast_of_text():
    # WCAG 2.1, 1.4.3: text needs a contrast of 4.5 to 1.
    for colour in product((0, 0.25, 0.4, 0.5, 0.6, 0.75, 0.9, 1), repeat=3):
        dark, light = sorted((luminance(colour), luminance(text_on(np.array(colour)))))
        assert (light + 0.05) / (dark + 0.05) >= 4.5, colour


@pytest.mark.parametrize(("colours", "none"), [("plasma_r", ESCAPED_COLOUR), ("viridis_r", LOST_COLOUR)])
def test_cells_without_number_differ_from_every_colour_of_map(colours, none):
    assert min(least_difference(none, to_hex(colormaps[colours](x))) for x in np.linspace(0, 1, 64)) >= APART
    # The largest errors, beside which such cells lie, are dark: black differs from them in colour, not in lightness.
    assert lab(none)[0] - lab(colormaps[colours](1.0)[:3])[0] >= 40


def curve(points, errors):
    taus = np.geomspace(1e-4, 1, points)
    return xr.Dataset({"max_energy_error": ("tau_per_stage", errors(taus))}, coords={"tau_per_stage": taus})


def noisy(taus):
    """A slope of 4 above a floor of random errors, with a hundred single peaks."""
    random = np.random.default_rng(1)
    errors = taus**4 + 1e-15 * random.random(taus.size)
    errors[random.integers(taus.size, size=100)] *= 1e3
    return errors


def test_curve_of_few_points_is_left_as_it_is():
    few = curve(4 * COLUMNS, noisy)
    assert envelope(few, ["max_energy_error"]) is few


def test_extremes_of_each_column_are_kept():
    many = curve(100_000, noisy)
    found = envelope(many, ["max_energy_error"], columns=100)
    assert found.sizes["tau_per_stage"] <= 400
    columns = np.minimum(np.log10(many.tau_per_stage) * 25 + 100, 99.999).astype(int)
    for extreme in ("min", "max"):
        wanted = getattr(many.max_energy_error.groupby(columns), extreme)()
        assert set(wanted.values) <= set(found.max_energy_error.values)


def test_gap_of_one_point_and_first_diverged_run_are_kept():
    def errors(taus):
        values = taus**4
        values[50_000], values[90_000:] = np.nan, np.inf
        return values

    found = envelope(curve(100_000, errors), ["max_energy_error"]).max_energy_error
    assert np.isnan(found).sum() == 1
    assert np.isinf(found.values[found.tau_per_stage.values == np.geomspace(1e-4, 1, 100_000)[90_000]]).all()


def test_drawing_of_the_envelope_is_that_of_the_curve():
    """Pixel by pixel, but for the anti-aliased edges of the line."""

    def drawn(shown):
        figure = Figure(figsize=(COLUMNS / 100, 3), dpi=100)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.loglog(shown.tau_per_stage, shown.max_energy_error, linewidth=1)
        axes.set_xlim(1e-4, 1)
        axes.set_axis_off()
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., 0].astype(int)

    many = curve(200_000, noisy)
    differences = np.abs(drawn(many) - drawn(envelope(many, ["max_energy_error"])))
    assert (differences > 128).mean() < 0.002


@pytest.mark.slow
def test_profile_of_a_million_runs_is_below_a_megabyte():
    names = list(nh.integrators)[:10]
    taus = np.geomspace(1e-4, 1, 100_000)
    errors = noisy(taus) * np.arange(1, 11)[:, None]
    cube = xr.Dataset(
        dict.fromkeys(("max_energy_error", "mean_energy_error"), (("integrator", "tau_per_stage"), errors)),
        {"integrator": names, "label": ("integrator", names), "tau_per_stage": taus},
    )
    for name in ("max_energy_error", "mean_energy_error"):
        cube[name].attrs["long_name"] = "energy error"
    for kind in ("svg", "pdf", "png"):
        target = io.BytesIO()
        draw_profile(cube).savefig(target, format=kind)
        assert len(target.getvalue()) < 1_000_000, kind
