"""Envelopes: the drawing of a curve of many points is that of its envelope."""

from __future__ import annotations

import io

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import nearharmonic as nh
from nearharmonic.plotting.profile import COLUMNS, envelope
from nearharmonic.plotting.style import draw_profile


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
