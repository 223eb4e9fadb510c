"""The plots of the page: they hold what the cubes hold."""

from __future__ import annotations

import json
import re

import h5py
import numpy as np
import pytest
import xarray as xr
from bokeh.document import Document

import nearharmonic as nh
from nearharmonic_paper.experiments.paper.orbits import paper_panels
from nearharmonic_paper.report.plots import energy_error, perihelion
from support.cubes import figure_cubes as made
from support.cubes.page_reader import documents
from support.methods.numba_potentials import springs

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plots(text):
    """The plots of the page, loaded by bokeh's classes, by the ids of their elements."""
    loaded = [Document.from_json(one) for one in documents(text)]
    return {plot.name: plot for one in loaded for plot in one.roots}


def hovered(plot, column, kind):
    """The glyphs of a plot that the hover has a name for, of one kind, whose y is this column."""
    found = [one for one in plot.renderers if one.name and type(one.glyph).__name__ == kind]
    return [one for one in found if getattr(one.glyph.y, "field", one.glyph.y) == column]


def test_classes_of_bokeh_load_every_model_without_complaint(text, caplog):
    """They check names and values of attributes; the page is written without them."""
    for one in documents(text):
        Document.from_json(one)
    assert not caplog.records


def test_models_are_numbered_in_order_and_differ_between_figures(text):
    found = documents(text)
    for one in found:
        first = one["roots"][0]["attributes"]["name"]
        numbered = re.findall(r'"id": "(.*?)"', json.dumps(one))
        assert list(dict.fromkeys(numbered)) == [f"{first}-{i}" for i in range(len({*numbered}))]
    assert len({one["config"]["id"] for one in found}) == len(found)


@pytest.mark.parametrize(("panel", "variable"), [(1, "max_energy_error"), (2, "mean_energy_error")])
@pytest.mark.parametrize(("figure", "system"), [(1, "sho"), (3, "henon_heiles"), (5, "kepler")])
def test_every_drawable_error_of_cube_is_in_panel_bitwise(results, plots, figure, system, panel, variable):
    plot = plots[f"figure-{figure}-panel-{panel}"]
    with h5py.File(results / "cubes" / f"{system}.h5") as cube:
        layers = cube[variable][()].reshape(-1, len(made.METHODS), made.TAU.size)
        evaluations = cube["evaluations"][()].reshape(layers.shape)
    lines = hovered(plot, variable, "Line")
    assert len(lines) == layers.shape[0] * len(made.METHODS)
    runs = (values.reshape(-1, made.TAU.size) for values in (layers, evaluations))
    for one, errors, cost in zip(lines, *runs, strict=True):
        there = np.isfinite(errors) & (errors > 0)
        data = one.data_source.data
        drawn = np.isfinite(data[variable])
        np.testing.assert_array_equal(data[variable][drawn], errors[there])
        np.testing.assert_array_equal(data["x"][drawn], made.TAU[there])
        np.testing.assert_array_equal(data["evaluations"][drawn], cost[there])
        assert made.label(one.tags[0]) in one.name


def test_interval_of_advance_is_bar_around_its_point(results, plots):
    drawn = plots["figure-4-panel-1"].renderers
    bars = [one for one in drawn if type(one.glyph).__name__ == "Segment"]
    dots = [one.data_source.data["advance"] for one in drawn if getattr(one.glyph, "size", 0) == 3.5]
    assert [one.tags[0] for one in bars] == list(made.METHODS)
    with h5py.File(results / "cubes/kepler.h5") as cube:
        advances, intervals, evaluations = (
            cube[name][()].reshape(-1, len(made.METHODS), made.TAU.size)[0]
            for name in ("perihelion_advance", "perihelion_advance_interval", "evaluations_per_orbit")
        )
    for one, dot, advance, interval, x in zip(bars, dots, abs(advances), intervals, evaluations, strict=True):
        known = interval < advance  # False for NaN
        assert known.any()
        np.testing.assert_array_equal(dot[np.isfinite(dot)], advance[known])
        expected = {"x0": x, "x1": x, "y0": advance - interval, "y1": advance + interval}
        for end, values in expected.items():
            np.testing.assert_array_equal(one.data_source.data[getattr(one.glyph, end).field], values[known])


def test_errors_near_floor_of_potential_have_it_beside_them():
    """The cube of a spring of numba: its errors come from a sweep down to rounding."""
    near = nh.sweep(springs(), "babs7o7h", [1e-3, 1e-2, 1e-1])
    far = nh.sweep(springs(), "leapfrog", [0.1, 0.2])
    for runs, count in ((near, 1), (far, 0)):
        cube = runs.rename({runs.status.dims[0]: "tau_per_stage"}).expand_dims(integrator=["any"])
        for panel in energy_error(cube.assign_coords(label=("integrator", ["any"]))):
            spans = [one for one in panel.plot.center if one.kind == "Span"]
            assert [one.location for one in spans] == [runs.energy_floor] * count


def seen(plot, name):
    """(method, error) of the errors ``name`` that a plot shows: joined to a neighbour, or with a marker."""
    found = set()
    for one in plot.renderers:
        if getattr(getattr(one.glyph, "y", None), "field", "") == name:
            values, alpha = np.asarray(one.data_source.data[name]), getattr(one.glyph, "line_alpha", 1.0)
            there = np.pad(np.isfinite(values), 1)
            shown = np.asarray(one.data_source.data[alpha.field] if hasattr(alpha, "field") else alpha) > 0
            shown = there[1:-1] & shown & (one.glyph.kind != "Line" or there[:-2] | there[2:])
            found |= {(one.tags[0], value) for value in values[shown]}
    return found


def test_every_run_is_seen_in_its_panel_or_above_it():
    cube = made.errors(precision=True, gaps=made.LONELY)
    dims, lost = cube.max_energy_error.dims, np.isinf(cube.max_energy_error)
    cube = cube.assign(
        status=xr.where(lost, "diverged", "ok"),
        diverged_at=xr.where(lost, 321, 0),
        evaluations=(dims, 7 + 0 * lost.values),
    )
    for panel, name in zip(energy_error(cube), ("max_energy_error", "mean_energy_error"), strict=True):
        found = [(str(one.integrator.values), one.item()) for one in cube[name].stack(run=dims)]
        assert seen(panel.plot, name) == {(method, error) for method, error in found if 0 < error < np.inf}
        squares = [one for one in panel.plot.renderers if "row" in one.data_source.data]
        bottom, top = panel.plot.left[0].bounds[1], panel.plot.y_range.end
        for one, method in zip(squares, 2 * made.METHODS, strict=True):
            data = one.data_source.data
            assert (one.tags, data["x"].tolist()) == ([method], made.TAU[cube[name][0, 0] > 10].tolist())
            assert ((bottom < data["row"]) & (data["row"] < top)).all()
            assert [*data["said"]] == ["∞", "∞", "2.0000e+01", "∞", "∞", "∞"]
            assert [*data["status"][1:3]] == ["diverged at step 321", "ok"]


def test_right_axis_of_figure_4_reads_arcseconds_per_century(plots, results):
    plot = plots["figure-4-panel-1"]
    with h5py.File(results / "cubes/kepler.h5") as cube:
        century = 180 * 3600 / np.pi * 36525 * 24 / cube.attrs["orbital_period"].item()
    (axis,) = plot.right
    right, left = plot.extra_y_ranges[axis.y_range_name], plot.y_range
    assert axis.axis_label == "arcseconds per century"
    np.testing.assert_allclose([right.start / left.start, right.end / left.end], century)


@pytest.mark.parametrize(("least", "most", "shaded"), [(1e-17, 10, [(0.1, None), (None, 1e-15)]), (1e-9, 1e-3, [])])
def test_advances_of_figure_4_that_are_no_results_are_shaded(least, most, shaded):
    cube = made.advances()
    cube.perihelion_advance[...] = np.geomspace(least, most, cube.perihelion_advance.size).reshape(3, -1)
    (panel,) = perihelion(cube)
    bands = [vars(one) for one in panel.plot.center if one.kind == "BoxAnnotation"]
    assert [(band.get("bottom"), band.get("top")) for band in bands] == shaded


def test_path_of_figure_6_follows_q_in_drifts_and_p_in_kicks(plots):
    for i, path in enumerate(paper_panels().values(), start=1):
        glyphs = [one for one in plots[f"figure-6-panel-{i}"].renderers if type(one.glyph).__name__ == "MultiLine"]
        (way,) = [one.data_source.data for one in glyphs if one.glyph.line_width == 1.0]
        assert all(not np.diff(line)[::2].any() for line in way["y" if path.attrs["first"] == "drift" else "x"])


def test_panels_of_figure_6_have_colour_bar_axis_names_and_labels(plots):
    for i, (letter, path) in enumerate(paper_panels().items(), start=1):
        plot = plots[f"figure-6-panel-{i}"]
        names = ["q along y", "p along y"] if letter in "CD" else ["q", "p"]
        assert [plot.below[0].axis_label, plot.left[0].axis_label] == names
        (scale,) = [one.color_mapper for one in plot.below if type(one).__name__ == "ColorBar"]
        assert scale.low <= path.hamiltonian.values.min() < path.hamiltonian.values.max() <= scale.high
        texts = [one for one in plot.renderers if type(one.glyph).__name__ == "Text"]
        said = [one.data_source.data["text"][0] for one in texts]
        assert [text for text in said if text.isdigit()] == [*"1234567"]
        assert sum(text.startswith("H = ") for text in said) == 3


def test_the_guides_have_the_slopes_of_their_orders(plots):
    for name in ("figure-1-panel-1", "figure-5-panel-2"):
        (guide,) = [one.data_source.data for one in plots[name].renderers if not one.tags]
        slopes = [np.diff(np.log(y)) / np.diff(np.log(x)) for x, y in zip(guide["x"], guide["y"], strict=True)]
        np.testing.assert_allclose(np.ravel(slopes), [4, 6])
        labels = {one.text: (one.x, one.y) for one in plots[name].center if type(one).__name__ == "Label"}
        assert labels["order 6"] == (guide["x"][1][1], guide["y"][1][1])
