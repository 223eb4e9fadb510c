"""The figure of panel D outside its plane: curves, crosses at divergence, and legend."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic_paper.experiments.paper import figures as fig6_displaced
from support.cubes.artists import NO_LINE, line_of, lines_of, look
from support.cubes.figure_cubes import displaced


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
