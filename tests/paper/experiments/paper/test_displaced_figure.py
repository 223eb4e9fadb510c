"""The figure of panel D outside its plane: curves, crosses at divergence, and legend."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic_paper.experiments.paper.figures import fig6_displaced
from support.cubes.artists import NO_LINE, entries, line_of, lines_of, look
from support.cubes.figure_cubes import displaced

NAMES = ("$q_x$ = 0 at the start", "$q_x$ = $10^{-9}$ at the start", "$q_x$ = $10^{-2}$ at the start")


@pytest.fixture
def cube():
    return displaced()


@pytest.fixture
def figure(cube):
    return fig6_displaced.fig6_displaced(cube)


def curve(cube, summation, run):
    """The points of a curve: finite samples, and where it leaves at the limit."""
    one = cube.isel(summation=summation, displacement=run)
    kept = np.isfinite(one.block_max_energy_error.values)
    x, y = cube.iteration.values[kept], one.block_max_energy_error.values[kept]
    left_at = int(one.left_at)
    return (np.append(x, left_at), np.append(y, 1.5)) if left_at else (x, y)


@pytest.mark.parametrize("summation", [0, 1])
def test_a_curve_ends_at_the_limit_where_the_path_leaves(cube, figure, summation):
    for run in range(3):
        line = line_of(figure.axes[summation], *curve(cube, summation, run))
        left_at = int(cube.left_at[run, summation])
        crosses = lines_of(figure.axes[summation], [left_at], [1.5])
        assert len(crosses) == (left_at > 0)
        for cross in crosses:
            assert look(cross)[1::2] == ("X", NO_LINE)
            assert cross.get_color() == line.get_color()


@pytest.mark.parametrize("summation", [0, 1])
def test_nothing_is_drawn_beside_curves_crosses_and_the_limit(figure, summation):
    assert len(figure.axes[summation].get_lines()) == 3 + 2 + 1
    (limit,) = [line for line in figure.axes[summation].get_lines() if line.is_dashed()]
    assert list(limit.get_ydata()) == [1.5, 1.5]
    (note,) = figure.axes[summation].texts
    assert note.get_text() == r"surface left beyond $|\Delta H/H_0|$ = 1.5"


def test_the_legend_names_each_start_by_its_colour(cube, figure):
    (legend,) = figure.legends
    found = entries(legend)
    assert list(found) == [*NAMES, "leaves its energy surface"]
    for run, name in enumerate(NAMES):
        line = line_of(figure.axes[0], *curve(cube, 0, run))
        assert found[name][0].get_color() == line.get_color()
        assert found[name][0].get_linewidth() == line.get_linewidth()
    assert look(found["leaves its energy surface"][0])[1::2] == ("X", NO_LINE)
