"""Figures 1, 3 and 5: the curves are the cube's, in the panel, look and legend entry of their method."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.plotting.style import draw_profile
from support.cubes.artists import SOLID, drawn, line_of, look, look_of, slope
from support.cubes.figure_cubes import GAPS, METHODS, TAU, errors

DASHED = (4, 2)


def test_the_upper_panel_shows_maxima_and_the_lower_one_means():
    cube = errors()
    upper, lower = draw_profile(cube).axes
    for axes, variable, letter, title, ylabel in (
        (upper, "max_energy_error", "A", "maximum over all steps", r"$\max\,|\Delta H/H_0|$"),
        (lower, "mean_energy_error", "B", "mean over all steps", r"$\mathrm{mean}\,|\Delta H/H_0|$"),
    ):
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert axes.get_title(loc="left") == rf"$\mathbf{{{letter}}}$  {title}"
        assert axes.get_ylabel() == ylabel
        for name in METHODS:
            assert look(line_of(axes, TAU, cube[variable].sel(integrator=name))) == look_of(name)
        assert len(axes.get_lines()) == len(METHODS) + 2  # and two guides
    # The upper panel is the upper one on paper.
    assert upper.get_position().y0 > lower.get_position().y1


def test_double_precision_is_solid_and_extended_precision_dashed():
    cube = errors(precision=True)
    for axes, variable in zip(draw_profile(cube).axes, ("max_energy_error", "mean_energy_error"), strict=True):
        for name in METHODS:
            solid, dashed = (
                line_of(axes, TAU, cube[variable].sel(integrator=name, precision=precision))
                for precision in ("double", "extended")
            )
            assert look(solid) == look_of(name)
            assert look(dashed) == (look_of(name)[0], None, None, DASHED)
            assert dashed.get_zorder() < solid.get_zorder()
        assert len(axes.get_lines()) == 2 * len(METHODS) + 2


def test_nan_zero_and_infinity_leave_gaps_in_curve():
    cube = errors(precision=True)
    for axes, variable in zip(draw_profile(cube).axes, ("max_energy_error", "mean_energy_error"), strict=True):
        for name in METHODS:
            for precision in ("double", "extended"):
                curve = line_of(axes, TAU, cube[variable].sel(integrator=name, precision=precision))
                np.testing.assert_array_equal(np.flatnonzero(~drawn(curve)), list(GAPS))


def test_guides_have_the_slopes_that_they_say():
    for axes in draw_profile(errors()).axes:
        said = {}
        for note in axes.texts:
            (guide,) = [line for line in axes.get_lines() if tuple(np.transpose(line.get_data())[-1]) == note.xy]
            said[note.get_text()] = slope(guide)
            assert (look(guide)[1], look(guide)[3]) == (None, SOLID)
        assert said == {"order 4": pytest.approx(4, abs=1e-9), "order 6": pytest.approx(6, abs=1e-9)}


def test_both_panels_share_limits_that_hold_every_finite_point():
    cube = errors(precision=True)
    upper, lower = draw_profile(cube).axes
    assert upper.get_ylim() == lower.get_ylim()
    both = np.concatenate([cube.max_energy_error.values.ravel(), cube.mean_energy_error.values.ravel()])
    positive = both[np.isfinite(both) & (both > 0)]
    bottom, top = upper.get_ylim()
    assert bottom < positive.min() < 1e-8
    assert positive.max() < top < 1


def test_an_error_of_many_energies_does_not_stretch_the_axis():
    cube = errors()
    cube["max_energy_error"][1, -2] = 1e6
    assert draw_profile(cube).axes[0].get_ylim()[1] == 10


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "ending"), [("1", ""), ("h", "  (h)")])
def test_the_unit_of_the_step_stands_on_the_axis(unit, ending):
    assert draw_profile(errors(unit=unit)).axes[1].get_xlabel() == r"step size per stage, $\tau/s$" + ending
