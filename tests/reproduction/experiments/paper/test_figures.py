"""Figures 1, 3 and 5: the curves are the cube's, in the panel, look and legend entry of their method."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_hex

from nearharmonic.plotting.style import mark_every
from nearharmonic.reproduction.experiments.paper.figures import fig1_sho, fig3_henon_heiles, fig5_kepler
from support.cubes.artists import SOLID, drawn, entries, line_of, look, look_of, looks, slope
from support.cubes.figure_cubes import GAPS, METHODS, TAU, errors, label

MODULES = (fig1_sho, fig3_henon_heiles, fig5_kepler)
DASHED = (4, 2)


def drawing(module):
    """The figure that a module declares, a function of its own name."""
    return getattr(module, module.__name__.rpartition(".")[2])


@pytest.mark.parametrize("module", MODULES)
def test_the_upper_panel_shows_maxima_and_the_lower_one_means(module):
    cube = errors()
    upper, lower = drawing(module)(cube).axes
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
    for axes, variable in zip(fig1_sho.fig1_sho(cube).axes, ("max_energy_error", "mean_energy_error"), strict=True):
        for name in METHODS:
            solid, dashed = (
                line_of(axes, TAU, cube[variable].sel(integrator=name, precision=precision))
                for precision in ("double", "extended")
            )
            assert look(solid) == look_of(name)
            assert look(dashed) == (look_of(name)[0], None, None, DASHED)
            assert dashed.get_zorder() < solid.get_zorder()
        assert len(axes.get_lines()) == 2 * len(METHODS) + 2


@pytest.mark.parametrize("module", MODULES)
def test_each_legend_entry_has_look_of_curve_that_it_names(module):
    cube = errors()
    figure = drawing(module)(cube)
    (legend,) = figure.legends
    assert looks(legend) == {label(name): look_of(name) for name in METHODS}
    for axes, variable in zip(figure.axes, ("max_energy_error", "mean_energy_error"), strict=True):
        for name in METHODS:
            curve = line_of(axes, TAU, cube[variable].sel(integrator=name))
            assert look(curve) == looks(legend)[label(name)]
        assert axes.get_legend() is None


def test_the_legend_follows_the_cube_when_its_order_changes():
    backwards = METHODS[::-1]
    assert list(looks(fig1_sho.fig1_sho(errors(backwards)).legends[0])) == [label(name) for name in backwards]
    cube = errors(backwards)
    for name in METHODS:
        curve = line_of(fig1_sho.fig1_sho(cube).axes[0], TAU, cube.max_energy_error.sel(integrator=name))
        assert look(curve) == look_of(name)


def test_legend_names_extended_precision_only_where_drawn():
    (legend,) = fig1_sho.fig1_sho(errors(precision=True)).legends
    assert list(entries(legend)) == [*map(label, METHODS), "extended precision"]
    _, marker, _, line = looks(legend)["extended precision"]
    assert (marker, line) == (None, DASHED)


def test_nan_zero_and_infinity_leave_gaps_in_curve():
    cube = errors(precision=True)
    for axes, variable in zip(fig1_sho.fig1_sho(cube).axes, ("max_energy_error", "mean_energy_error"), strict=True):
        for name in METHODS:
            for precision in ("double", "extended"):
                curve = line_of(axes, TAU, cube[variable].sel(integrator=name, precision=precision))
                np.testing.assert_array_equal(np.flatnonzero(~drawn(curve)), list(GAPS))


@pytest.mark.parametrize("module", MODULES)
def test_guides_have_the_slopes_that_they_say(module):
    for axes in drawing(module)(errors()).axes:
        said = {}
        for note in axes.texts:
            (guide,) = [line for line in axes.get_lines() if tuple(np.transpose(line.get_data())[-1]) == note.xy]
            said[note.get_text()] = slope(guide)
            assert (look(guide)[1], look(guide)[3]) == (None, SOLID)
        assert said == {"order 4": pytest.approx(4, abs=1e-9), "order 6": pytest.approx(6, abs=1e-9)}


def test_guides_lie_inside_the_panel_and_do_not_stretch_it():
    upper, _ = fig1_sho.fig1_sho(errors()).axes
    (left, right), (bottom, top) = upper.get_xlim(), upper.get_ylim()
    for note in upper.texts:
        assert left < note.xy[0] < right
        assert bottom < note.xy[1] < top
    # No run of the first and last step size can be drawn.
    assert TAU[1] / 1.5 < left < TAU[1]
    assert TAU[-2] < right < 1.5 * TAU[-2]


def test_both_panels_share_limits_that_hold_every_finite_point():
    cube = errors(precision=True)
    upper, lower = fig1_sho.fig1_sho(cube).axes
    assert upper.get_ylim() == lower.get_ylim()
    both = np.concatenate([cube.max_energy_error.values.ravel(), cube.mean_energy_error.values.ravel()])
    positive = both[np.isfinite(both) & (both > 0)]
    bottom, top = upper.get_ylim()
    assert bottom < positive.min() < 1e-8
    assert positive.max() < top < 1


def test_an_error_of_many_energies_does_not_stretch_the_axis():
    cube = errors()
    cube["max_energy_error"][1, -2] = 1e6
    assert fig1_sho.fig1_sho(cube).axes[0].get_ylim()[1] == 10


def test_markers_of_the_curves_of_a_panel_take_turns():
    cube = errors(precision=True)
    for axes in fig1_sho.fig1_sho(cube).axes:
        marked = [line.get_markevery() for line in axes.get_lines() if line.get_marker() not in ("None", "none")]
        assert marked == [mark_every(position, len(METHODS), TAU.size) for position in range(len(METHODS))]


@pytest.mark.parametrize("module", MODULES)
@pytest.mark.parametrize(("unit", "ending"), [("1", ""), ("h", "  (h)")])
def test_the_unit_of_the_step_stands_on_the_axis(module, unit, ending):
    assert drawing(module)(errors(unit=unit)).axes[1].get_xlabel() == r"step size per stage, $\tau/s$" + ending


def test_unlisted_method_has_same_style_in_curve_and_legend():
    cube = errors(("a_method_of_tomorrow", "babs7o7h"))
    figure = fig1_sho.fig1_sho(cube)
    curve = line_of(figure.axes[0], TAU, cube.max_energy_error[0])
    assert look(curve) == looks(figure.legends[0])[label("a_method_of_tomorrow")] == look_of("a_method_of_tomorrow")


def test_the_methods_of_these_tests_look_different():
    for one, other in combinations(METHODS, 2):
        assert look_of(one) != look_of(other)
    assert {look_of(name)[2] for name in METHODS} == {to_hex("white"), look_of("babps9o7h")[0]}
