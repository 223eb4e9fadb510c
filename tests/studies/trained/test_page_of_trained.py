"""Figures of the proof and of ideas show the numbers of their cubes, in the panels that the cubes say."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb, to_rgba

from nearharmonic_studies.trained import page
from nearharmonic_studies.trained.settings import IDEAS
from support.cubes import figure_cubes as made
from support.cubes.artists import NO_LINE, look, look_of, pixels, span


def test_gains_stand_in_panel_of_their_ensemble_with_their_intervals():
    cube = made.contest()
    drawn = page.trained_gain(cube)
    one, other = drawn.axes
    assert [axes.get_title(loc="left") for axes in (one, other)] == ["one", "other"]
    for axes, places in ((one, (0, 2)), (other, (1,))):
        curves = [line for line in axes.lines if line.get_label()[0] != "_"]
        assert len(curves) == len(places)
        for line, e in zip(curves, places, strict=True):
            assert line.get_xdata() == pytest.approx(cube.tau_per_stage.values[e], nan_ok=True)
            assert line.get_ydata() == pytest.approx(cube.gain.values[e], nan_ok=True)
        sides = [(patch.get_facecolor(), span(patch, axis=1)) for patch in axes.patches]
        low, high = axes.get_ylim()
        assert sides == [(to_rgba(page.GAINED), (0, high)), (to_rgba(page.LOST), (low, 0))]
        for band, e in zip(axes.collections, places, strict=True):
            heights = np.concatenate([path.vertices[:, 1] for path in band.get_paths()])
            bounds = cube.gain_interval.values[e]
            assert (heights.min(), heights.max()) == pytest.approx((np.nanmin(bounds), np.nanmax(bounds)))


def test_best_published_and_best_trained_are_envelopes_of_their_kind():
    cube = made.contest()
    drawn = page.trained_error(cube)
    for e in range(3):
        lines = {line.get_color(): line.get_ydata() for line in drawn.axes[e].lines if line.get_linewidth() > 1.5}
        errors = 10 ** cube.mean_log_error.values[e]
        assert lines[page.AHEAD] == pytest.approx(errors[:-1].min(axis=0), nan_ok=True)
        assert lines[page.BEST] == pytest.approx(errors[-1], nan_ok=True)


def test_marker_names_best_trained_method_at_each_step_size():
    cube = made.contest()
    drawn = page.trained_error(cube)
    for e in range(3):
        errors = cube.mean_log_error.values[e, :-1]
        points = {line.get_xdata()[0]: look(line) for line in drawn.axes[e].lines if len(line.get_xdata()) == 1}
        expected = {
            tau: look_of(made.METHODS[column.argmin()], NO_LINE)
            for tau, column in zip(cube.tau_per_stage.values[e], errors.T, strict=True)
            if np.isfinite(tau)
        }
        assert {tau: seen for tau, seen in points.items() if np.isfinite(tau)} == expected


@pytest.mark.slow
def test_area_between_best_methods_has_colour_of_method_ahead():
    cube = made.contest()
    cube["tau_per_stage"] = cube.tau_per_stage.fillna(0.2)
    cube["mean_log_error"] = cube.mean_log_error * 0 - 6.0  # finite everywhere
    cube["mean_log_error"] = cube.mean_log_error.fillna(-6.0)
    cube["mean_log_error"][0, -1] = -4.0  # the published method errs more on the first ensemble, less on the second
    cube["mean_log_error"][1, -1] = -8.0
    figure = page.trained_error(cube)
    at = pixels(figure)
    for axes, level, colour in zip(figure.axes, (1e-5, 1e-7), (page.GAINED, page.LOST), strict=False):
        x = np.sqrt(np.prod(axes.get_xlim()))  # clear of the grid's vertical lines
        np.testing.assert_allclose(at(axes, x * 1.02, 1.5 * level), to_rgb(colour), atol=1 / 255)


def test_maps_write_lead_in_colour_of_leader():
    cube = made.ideas()
    lead = cube.lead.values
    drawn = page.trained_ideas(cube)
    gains, maps = drawn.axes[:-2], drawn.axes[-2:]
    for axes in maps:
        texts = {(text.get_position()[1], text.get_position()[0]): text.get_text() for text in axes.texts}
        assert texts == {(t, j): f"{lead[t, j]:.1f}" for t, j in np.ndindex(lead.shape)}
        (image,) = axes.images
        for (t, j), name in np.ndenumerate(cube.leader.values):
            shown, full = np.asarray(image.get_array()[t, j]), np.array(to_rgb(page.LOOKS[name][1]))
            depth = ((1 - shown) / (1 - full)).tolist()
            assert depth == pytest.approx([depth[0]] * 3)
            assert 0.2 < depth[0] <= 1
    taus = cube.tau_per_stage.values
    for axes in gains:
        (place,) = (i for i, tau in enumerate(taus) if f"= {tau:g}$" in axes.get_title(loc="left"))
        curves = np.array([line.get_ydata() for line in axes.lines])
        assert curves == pytest.approx(cube.gain.values[:, place])
    assert set(page.LOOKS) == set(IDEAS)
