"""The figures show the numbers they are given, in a style that print and colour-blind readers can follow."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.render import fig1_sho, fig2_decomposition, fig3_henon_heiles, fig4_perihelion, fig5_kepler
from nearharmonic.render import fig6_substeps as fig6
from nearharmonic.render.style import mark_every, new_figure, save, style_of
from nearharmonic.substeps import paper_panels

METHODS = ["ruth", "aba104", "babps9o7h"]
BENCHMARKED = [name for name, tableau in integrators.items() if tableau.benchmarked]


def cube(methods=METHODS, precision=False, unit="1"):
    """An error cube whose curves follow tau^4, each method at its own height, with one run diverged, one not done."""
    tau = np.geomspace(1e-4, 1, 41)
    error = np.array([1e-3 * 10.0**-i * tau**4 for i in range(len(methods))]) + 1e-16
    error[0, -1], error[-1, 0] = np.inf, np.nan
    dims = ("integrator", "tau_per_stage")
    coords = {
        "integrator": methods,
        "label": ("integrator", [f"label of {m}" for m in methods]),
        "tau_per_stage": ("tau_per_stage", tau, {"units": unit}),
    }
    data = xr.Dataset(
        {"max_energy_error": (dims, error), "mean_energy_error": (dims, error / 3)},
        coords=coords,
        attrs={"orbital_period": 87.99 * 24},
    )
    if precision:
        data = xr.concat([data, data / 100], dim=xr.Variable("precision", ["double", "extended"]))
    return data


def kepler():
    data = cube(unit="h")
    dims = data.max_energy_error.dims
    data["evaluations_per_orbit"] = (
        dims,
        np.broadcast_to(2111.76 / data.tau_per_stage.values, data.max_energy_error.shape),
    )
    data["perihelion_advance"] = -data.max_energy_error
    data["perihelion_advance_interval"] = xr.full_like(data.perihelion_advance, 3e-16)
    return data


def terms(methods=METHODS):
    kappa = np.full((len(methods), 2, 9), np.nan)
    kappa[:, :, :4] = 1e-76
    kappa[:, 0, 4:9] = 0.3
    kappa[:, 1, 4:8] = 0.2
    coords = {
        "integrator": methods,
        "label": ("integrator", methods),
        "first": ["drift", "kick"],
        "order": np.arange(1, 10),
    }
    return xr.Dataset({"kappa": (("integrator", "first", "order"), kappa)}, coords=coords)


def curves_of(axes, name, **properties):
    style = style_of(name)
    lines = [line for line in axes.get_lines() if line.get_color() == style.colour]
    return [line for line in lines if all(getattr(line, f"get_{k}")() == v for k, v in properties.items())]


def channel(value):
    return value / 12.92 if value <= 0.03928 else ((value + 0.055) / 1.055) ** 2.4


def luminance(colour):
    return float(np.dot([0.2126, 0.7152, 0.0722], [channel(c) for c in mpl.colors.to_rgb(colour)]))


def test_no_two_integrators_look_alike():
    for one, other in combinations(integrators, 2):
        assert style_of(one) != style_of(other), f"{one} looks like {other}: give it an entry of its own in style.py"


def test_the_benchmarked_methods_are_told_apart_without_colour():
    assert len({(style_of(n).marker, style_of(n).filled) for n in BENCHMARKED}) == len(BENCHMARKED) == 10


@pytest.mark.parametrize("name", [*integrators, *(f"new method {i}" for i in range(40))])
def test_every_colour_stands_out_from_white_paper(name):
    # WCAG 2.1, 1.4.11: graphics need a contrast of 3 to 1.
    assert 1.05 / (luminance(style_of(name).colour) + 0.05) >= 3


def test_a_method_the_table_does_not_know_has_its_own_style_every_time():
    assert style_of("rkn_11") == style_of("rkn_11")
    assert style_of("rkn_11") not in [style_of(name) for name in BENCHMARKED]


def test_markers_of_curves_drawn_together_take_turns():
    starts = [mark_every(position, 10, 161) for position in range(10)]
    assert len(set(starts)) == 10
    assert all(0 <= first < step for first, step in starts)
    assert mark_every(9, 10, 3) == (0, 1)


@pytest.mark.parametrize("module", [fig1_sho, fig3_henon_heiles, fig5_kepler])
def test_the_upper_panel_shows_maxima_and_the_lower_one_means(module):
    data = cube()
    upper, lower = module.figure(data).axes
    for axes, variable in ((upper, "max_energy_error"), (lower, "mean_energy_error")):
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        for name in METHODS:
            (curve,) = curves_of(axes, name)
            np.testing.assert_array_equal(curve.get_xdata(), data.tau_per_stage)
            np.testing.assert_array_equal(curve.get_ydata(), data[variable].sel(integrator=name))


def test_both_panels_share_limits_that_hold_every_finite_point():
    data = cube(precision=True)
    figure = fig1_sho.figure(data)
    upper, lower = figure.axes
    assert upper.get_ylim() == lower.get_ylim()
    assert upper.get_ylim()[0] < float(data.mean_energy_error.min())
    finite = data.max_energy_error.where(np.isfinite(data.max_energy_error))
    assert float(finite.max()) < upper.get_ylim()[1] < np.inf


def test_an_error_of_many_energies_does_not_stretch_the_axis():
    data = cube()
    data["max_energy_error"][1, -1] = 1e6
    assert fig1_sho.figure(data).axes[0].get_ylim()[1] == 10


def test_extended_precision_is_dashed_in_the_colour_of_its_method():
    data = cube(precision=True)
    axes = fig1_sho.figure(data).axes[0]
    for name in METHODS:
        solid, dashed = sorted(curves_of(axes, name), key=lambda line: line.is_dashed())
        assert (solid.is_dashed(), dashed.is_dashed()) == (False, True)
        for curve, precision in ((solid, "double"), (dashed, "extended")):
            expected = data.max_energy_error.sel(integrator=name, precision=precision)
            np.testing.assert_array_equal(curve.get_ydata(), expected)


def test_one_legend_names_every_method_by_its_label():
    for figure in (
        fig1_sho.figure(cube(precision=True)),
        fig2_decomposition.figure(terms()),
        fig4_perihelion.figure(kepler()),
    ):
        (legend,) = figure.legends
        texts = [text.get_text() for text in legend.get_texts()]
        assert sum("ruth" in text for text in texts) == 1
        assert all(axes.get_legend() is None for axes in figure.axes)
    assert "extended precision" in [t.get_text() for t in fig1_sho.figure(cube(precision=True)).legends[0].get_texts()]


def test_the_unit_of_the_step_stands_on_the_axis():
    assert fig5_kepler.figure(cube(unit="h")).axes[1].get_xlabel().endswith("(h)")
    assert "(" not in fig1_sho.figure(cube()).axes[1].get_xlabel()


@pytest.mark.parametrize("methods", [["ruth"], ["a_method_of_tomorrow", "babs7o7h"]])
def test_any_choice_of_methods_can_be_drawn(methods, tmp_path):
    save(fig1_sho.figure(cube(methods)), tmp_path / "errors")
    save(fig2_decomposition.figure(terms(methods)), tmp_path / "terms")
    assert (tmp_path / "terms.png").stat().st_size > 0


def test_runs_that_all_diverged_leave_an_empty_figure_not_an_error(tmp_path):
    data = cube(["ruth"])
    data["max_energy_error"][:], data["mean_energy_error"][:] = np.inf, np.inf
    assert len(save(fig3_henon_heiles.figure(data), tmp_path / "errors")) == 3
    runs = kepler()
    runs["perihelion_advance"][:] = np.nan
    assert len(save(fig4_perihelion.figure(runs), tmp_path / "advance")) == 3


def test_terms_that_all_vanish_leave_an_empty_panel_not_an_error(tmp_path):
    exact = terms()
    exact["kappa"][:] = 0.0
    remain, vanish = fig2_decomposition.figure(exact).axes
    assert all(np.isnan(line.get_ydata()).all() for line in remain.get_lines())
    assert len(curves_of(vanish, "ruth", marker="_")[0].get_xdata()) == 9


def test_a_term_that_vanishes_is_shown_as_satisfied_and_never_as_a_tiny_number():
    remain, vanish = fig2_decomposition.figure(terms()).axes
    assert remain.get_ylim()[0] > 1e-3
    for row, name in enumerate(METHODS):
        (line,) = curves_of(remain, name, linestyle="-")
        np.testing.assert_array_equal(line.get_ydata(), [np.nan] * 4 + [0.2] * 4 + [np.nan])
        circles = curves_of(remain, name, linestyle="None", marker="o", markersize=8)
        np.testing.assert_array_equal(circles[0].get_ydata(), [np.nan] * 4 + [0.3] * 5)
        for marker in ("_", "o"):
            marks = curves_of(vanish, name, marker=marker)[0]
            np.testing.assert_array_equal(marks.get_xdata(), [1, 2, 3, 4])
            np.testing.assert_array_equal(marks.get_ydata(), [row] * 4)


def test_orders_are_whole_numbers_on_the_axis():
    ticks = fig2_decomposition.figure(terms()).axes[1].get_xticks()
    np.testing.assert_array_equal(ticks, np.round(ticks))


def test_the_relativistic_line_lies_at_the_advance_that_general_relativity_gives():
    axes = fig4_perihelion.figure(kepler()).axes[0]
    (level,) = [line.get_ydata()[0] for line in axes.get_lines() if line.is_dashed()]
    # 6 pi GM / (c^2 a (1 - e^2)) rad per orbit; GM in m^3/s^2, a in m. The axis rests on 42.98 and 87.99 d: 4 digits.
    c, GM, a, e = 299792458.0, 1.32712440018e20, 5.790905e10, 0.20563
    assert level == pytest.approx(6 * np.pi * GM / (c**2 * a * (1 - e**2)), rel=5e-4)


def test_the_second_axis_reads_arcseconds_per_century():
    axes = fig4_perihelion.figure(kepler()).axes[0]
    (century,) = axes.child_axes
    axes.set_ylim(1e-7, 1e-6)
    axes.figure.canvas.draw()
    orbits = 36525 / 87.99
    np.testing.assert_allclose(century.get_ylim(), np.degrees([1e-7, 1e-6]) * 3600 * orbits, rtol=1e-12)


def test_a_precession_that_its_interval_does_not_tell_from_zero_is_a_cross():
    data = kepler()
    axes = fig4_perihelion.figure(data).axes[0]
    for name in METHODS:
        runs = data.sel(integrator=name)
        (crosses,) = curves_of(axes, name, marker="x")
        (dots,) = curves_of(axes, name, marker=".")
        uncertain = (abs(runs.perihelion_advance) <= 3e-16).values
        np.testing.assert_array_equal(np.isfinite(crosses.get_ydata()), uncertain)
        np.testing.assert_array_equal(dots.get_ydata() > 3e-16, ~uncertain & ~np.isnan(runs.perihelion_advance.values))


def test_substeps_are_coloured_by_the_signs_of_the_pair_that_follows():
    panels = paper_panels()
    grid = [axes for axes in fig6.figure(panels).axes if axes.get_xlabel() == "q"]
    for axes, panel in zip(grid, panels.values(), strict=True):
        for x, y, marker in ((False, False, fig6._BLUE), (True, False, fig6._RED), (False, True, fig6._GREEN)):
            drawn = {(line.get_xdata()[0], line.get_ydata()[0]) for line in _dots(axes, marker)}
            chosen = panel.where(
                (panel.kind == "substep") & ((panel.next_drift_sign < 0) == x) & ((panel.next_kick_sign < 0) == y)
            )
            points = zip(chosen.q.values.ravel(), chosen.p.values.ravel(), strict=True)
            expected = {(q, p) for q, p in points if not np.isnan(q)}
            assert expected
            assert expected <= drawn
            others = {(q, p) for q, p in zip(panel.q.values.ravel(), panel.p.values.ravel(), strict=True)} - expected
            both = panel.where((panel.next_drift_sign < 0) & (panel.next_kick_sign < 0))
            twice = set(zip(both.q.values.ravel(), both.p.values.ravel(), strict=True))
            assert not (drawn & others) - twice


def _dots(axes, colour):
    return [
        line
        for line in axes.get_lines()
        if line.get_marker() == "o" and line.get_markerfacecolor() == colour and line.get_linestyle() == "None"
    ]


def test_the_panel_states_where_a_path_leaves_its_energy_surface():
    panels = paper_panels()
    grid = [axes for axes in fig6.figure(panels).axes if axes.get_xlabel() == "q"]
    statements = {letter: axes.texts[0].get_text() for letter, axes in zip(panels, grid, strict=True)}
    assert f"leaves its energy surface at iteration {int(panels['C'].left_at)}" in statements["C"]
    assert all("leaves" not in statements[letter] for letter in "ABD")


def test_saving_writes_three_formats_with_the_same_bytes_each_time(tmp_path):
    first = save(fig1_sho.figure(cube(precision=True)), tmp_path / "deeper" / "fig.v1")
    second = save(fig1_sho.figure(cube(precision=True)), tmp_path / "again")
    assert [path.name for path in first] == ["fig.v1.pdf", "fig.v1.svg", "fig.v1.png"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert sorted(path.name for path in (tmp_path / "deeper").iterdir()) == sorted(path.name for path in first)
    assert first[2].read_bytes().startswith(b"\x89PNG")


def test_a_file_that_fails_to_write_leaves_the_old_one_in_place(tmp_path, monkeypatch):
    figure = fig1_sho.figure(cube())
    (pdf, *_) = save(figure, tmp_path / "fig")
    before = pdf.read_bytes()

    def fail(path, **_):
        path.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(figure, "savefig", fail)
    with pytest.raises(OSError, match="No space left"):
        save(figure, tmp_path / "fig")
    assert pdf.read_bytes() == before
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".pdf", ".png", ".svg"]


def test_drawing_leaves_the_callers_matplotlib_settings_alone(tmp_path):
    with mpl.rc_context({"font.size": 17, "svg.hashsalt": "mine"}):
        before = dict(mpl.rcParams)
        save(fig1_sho.figure(cube()), tmp_path / "fig")
        assert dict(mpl.rcParams) == before


def test_every_figure_has_a_caption_of_two_sentences_or_more():
    for name in (
        "fig1_sho",
        "fig2_decomposition",
        "fig3_henon_heiles",
        "fig4_perihelion",
        "fig5_kepler",
        "fig6_substeps",
    ):
        module = import_module(f"nearharmonic.render.{name}")
        assert module.CAPTION.count(". ") >= 1
        assert module.CAPTION.endswith(".")
        assert "  " not in module.CAPTION


def test_importing_the_figures_loads_neither_pyplot_nor_xarray_and_changes_no_setting():
    # Start-up time: pyplot and xarray cost more than the drawing.
    program = """
import sys, matplotlib
before = matplotlib.rcParams.copy()
from nearharmonic.render import fig1_sho, fig2_decomposition, fig3_henon_heiles, fig4_perihelion, fig5_kepler
from nearharmonic.render import fig6_substeps
print([m for m in ("matplotlib.pyplot", "xarray", "pandas") if m in sys.modules], matplotlib.rcParams.copy() == before)
"""
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[] True"


def test_a_new_figure_has_the_size_asked_for():
    assert tuple(new_figure(7, 8).get_size_inches()) == (7, 8)
