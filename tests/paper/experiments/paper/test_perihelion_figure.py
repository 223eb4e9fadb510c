"""Figure 4: advances with their intervals, significance, and the axis in arcseconds per century."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex

from nearharmonic_paper.experiments.paper import figures as fig4_perihelion
from support.cubes.artists import NO_LINE, SOLID, drawn, line_of, lines_of, look, look_of
from support.cubes.figure_cubes import METHODS, advances

#: Indices of the step sizes whose advance the cube tells from zero, and of those it does not.
TOLD = [0, 1, 2, *range(6, 12)]
NOT_TOLD = list(range(12, 25))


@pytest.fixture
def cube():
    return advances()


def at(values, indices):
    """``values`` at ``indices``, NaN elsewhere."""
    return np.where(np.isin(np.arange(values.size), indices), values, np.nan)


def curves(cube, name):
    """Evaluations, the absolute advances that are told from zero, and those that are not."""
    one = cube.sel(integrator=name)
    size = np.abs(one.perihelion_advance.values)
    return one.evaluations_per_orbit.values, at(size, TOLD), at(size, NOT_TOLD)


def test_advance_beyond_its_interval_is_dot_and_some_have_markers(cube):
    axes = fig4_perihelion.fig4_perihelion(cube).axes[0]
    for name in METHODS:
        x, told, _ = curves(cube, name)
        dots, marks = lines_of(axes, x, told)
        colour = look_of(name)[0]
        assert look(dots) == (colour, ".", colour, SOLID)
        assert look(marks) == look_of(name, NO_LINE)
        assert np.flatnonzero(drawn(dots)).tolist() == TOLD


def test_advance_within_its_interval_or_equal_to_it_is_cross(cube):
    axes = fig4_perihelion.fig4_perihelion(cube).axes[0]
    for name in METHODS:
        x, _, not_told = curves(cube, name)
        crosses = line_of(axes, x, not_told)
        colour, marker, _, line = look(crosses)
        assert (colour, marker, line) == (look_of(name)[0], "x", NO_LINE)
        assert np.flatnonzero(drawn(crosses)).tolist() == NOT_TOLD


def test_error_bars_are_intervals_of_nonzero_advances(cube):
    axes = fig4_perihelion.fig4_perihelion(cube).axes[0]
    assert len(axes.containers) == len(METHODS)
    for name, container in zip(METHODS, axes.containers, strict=True):
        one = cube.sel(integrator=name)
        _, _, (bars,) = container
        segments = [s for s in bars.get_segments() if len(s) and np.isfinite(s).all()]
        size, interval = np.abs(one.perihelion_advance.values), one.perihelion_advance_interval.values
        assert len(segments) == len(TOLD)
        for i, segment in zip(TOLD, segments, strict=True):
            np.testing.assert_array_equal(segment[:, 0], one.evaluations_per_orbit.values[i])
            np.testing.assert_allclose(segment[:, 1], [size[i] - interval[i], size[i] + interval[i]], rtol=1e-14)
        (colour,) = bars.get_color()
        assert to_hex(colour) == look_of(name)[0]


def test_the_second_axis_reads_arcseconds_per_century(cube):
    axes = fig4_perihelion.fig4_perihelion(cube).axes[0]
    (century,) = axes.child_axes
    axes.set_ylim(1e-7, 1e-6)
    axes.figure.draw_without_rendering()
    # 206264.806247096355 arcseconds in a radian (IAU), 876600 h in a Julian century, 2000 h in this cube's orbit.
    factor = 206264.806247096355 * 876600 / 2000
    np.testing.assert_allclose(century.get_ylim(), [1e-7 * factor, 1e-6 * factor], rtol=1e-12)


def relativistic_line(figure):
    (line,) = [line for line in figure.axes[0].get_lines() if line.is_dashed()]
    low, high = line.get_ydata()
    assert low == high
    assert list(line.get_xdata()) == [0, 1]  # from the left edge to the right one
    return line, low


def test_relativistic_line_is_labelled_at_42_98_arcseconds_per_century(cube):
    figure = fig4_perihelion.fig4_perihelion(cube)
    _, level = relativistic_line(figure)
    assert level * 206264.806247096355 * 876600 / 2000 == pytest.approx(42.98, rel=1e-12)
    (note,) = figure.axes[0].texts
    assert note.get_text() == "general relativity: 42.98″ per century"
    assert note.xy[1] == level


def test_the_relativistic_line_of_mercury_is_what_general_relativity_gives(cube):
    # 6 pi GM / (c^2 a (1 - e^2)) rad per orbit; GM in m^3/s^2, a in m. The line rests on 42.98: 4 digits.
    c, GM, a, e = 299792458.0, 1.32712440018e20, 5.790905e10, 0.20563
    cube.attrs["orbital_period"] = 2 * np.pi * np.sqrt(a**3 / GM) / 3600
    _, level = relativistic_line(fig4_perihelion.fig4_perihelion(cube))
    assert level == pytest.approx(6 * np.pi * GM / (c**2 * a * (1 - e**2)), rel=5e-4)
