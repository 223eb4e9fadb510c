"""Figure 6: dots coloured by the next signs, the path between them, and the text of each panel."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from nearharmonic_paper.experiments.paper import figures as fig6_substeps
from nearharmonic_paper.experiments.paper.orbits import paper_panels
from support.cubes.artists import NO_LINE, entries, look
from support.cubes.figure_cubes import TOY_DRIFT, TOY_KICK, toy_panels

#: Text of the legend, by whether the drift and the kick of the pair that follows are negative.
SAYS = {
    (False, False): "next c, d ≥ 0",
    (True, False): "next c < 0",
    (False, True): "next d < 0",
    (True, True): "next c, d < 0",
}


@pytest.fixture(scope="module")
def panels():
    return toy_panels()


@pytest.fixture(scope="module")
def figure(panels):
    return fig6_substeps.draw_panels(panels)


def grid(figure):
    return [axes for axes in figure.axes if axes.get_xlabel().startswith("$q")]


def coefficient_pairs(drift, kick):
    """Exact (drift, kick) pairs, the shorter row filled up with a zero."""
    drift, kick = list(map(Fraction, drift)), list(map(Fraction, kick))
    n = max(len(drift), len(kick))
    return list(zip(drift + [0] * (n - len(drift)), kick + [0] * (n - len(kick)), strict=True))


def marks(axes, legend):
    """(q, p) -> text of the legend whose markers, one over the other, lie there; the dots of ``axes``, all of them."""
    known = {tuple(stack(artists)): text for text, artists in entries(legend).items()}
    found = {}
    for line in axes.get_lines():
        if len(line.get_xdata()) == 1:
            found.setdefault((line.get_xdata()[0], line.get_ydata()[0]), []).append(line)
    return {place: known.get(tuple(stack(sorted(lines, key=Line2D.get_zorder)))) for place, lines in found.items()}


def stack(lines):
    return [(*look(line), line.get_markersize(), line.get_markeredgewidth()) for line in lines]


def compare(drawn, expected):
    """Each expected (q, p, text) is drawn there, to rounding, and nothing else."""
    assert len(drawn) == len(expected)
    for q, p, text in expected:
        place = min(drawn, key=lambda at: abs(at[0] - q) + abs(at[1] - p))
        assert place == pytest.approx((q, p), abs=1e-12)
        assert drawn[place] == text


@pytest.mark.parametrize("first", ["drift", "kick"])
def test_dots_carry_the_signs_of_the_pair_that_follows(figure, panels, first):
    rows = {"drift": (TOY_KICK, TOY_DRIFT), "kick": (TOY_DRIFT, TOY_KICK)}[first]
    pairs = coefficient_pairs(*rows)
    index = {"drift": 0, "kick": 1}[first]
    panel = list(panels.values())[index]
    path = [
        list(zip(*rows, strict=True)) for rows in zip(panel.q.values.tolist(), panel.p.values.tolist(), strict=True)
    ]
    expected = []
    for points in path:
        for (c, d), (q, p) in zip(pairs[1:], points[1:-1], strict=True):
            expected.append((q, p, SAYS[c < 0, d < 0]))
        expected += [(*points[0], "initial position"), (*points[-1], "final position")]
    # The end of the first iteration is the start of the second: circle and cross over each other, no one's entry.
    both = path[0][-1]
    expected = [entry for entry in expected if entry[:2] != both] + [(*both, None)]
    assert {text for *_, text in expected} >= set(SAYS.values())
    compare(marks(grid(figure)[index], figure.legends[0]), expected)


@pytest.fixture(scope="module")
def paper():
    panels = paper_panels()
    return panels, fig6_substeps.draw_panels(panels)


@pytest.mark.parametrize(("index", "legs"), [(0, "steps-post"), (1, "steps-pre")])
def test_path_follows_q_in_drifts_and_p_in_kicks(figure, panels, index, legs):
    # A drift first: along q to the corner, then along p; "steps-post" keeps y, then jumps. A kick first: the reverse.
    panel = list(panels.values())[index]
    ways = [line for line in grid(figure)[index].get_lines() if len(line.get_xdata()) > 1]
    assert [line.get_drawstyle() for line in ways] == [legs] * 2
    for line, q, p in zip(ways, panel.q.values, panel.p.values, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), q)
        np.testing.assert_array_equal(line.get_ydata(), p)
        assert look(line)[1] is None
        assert look(line)[3] != NO_LINE


def statement(axes):
    return axes.texts[0].get_text()


def test_each_panel_states_final_error_and_largest_later_error(figure, panels):
    for axes, panel in zip(grid(figure), panels.values(), strict=True):
        q, p = (panel[name].values[-1, -1] for name in "qp")
        error, largest = f"{abs((q * q + p * p) / 2 - 0.5) / 0.5:.1e}", f"{panel.max_energy_error.item():.1e}"
        (a, i), (b, j) = error.split("e"), largest.split("e")
        assert statement(axes) == (
            rf"$|\Delta H/H_0|$ = ${a}\times10^{{{int(i)}}}$ after 2 iterations,"
            "\n" + rf"up to ${b}\times10^{{{int(j)}}}$ in 1000 iterations"
        )


def test_a_panel_states_where_its_path_leaves_its_energy_surface(paper):
    panels, figure = paper
    texts = dict(zip(panels, map(statement, grid(figure)), strict=True))
    assert texts["C"].endswith(f"leaves its energy surface at iteration {int(panels['C'].left_at)}")
    assert all("leaves" not in texts[letter] for letter in "ABD")


def test_dashed_contour_runs_through_start_and_window_is_cubes(figure, panels):
    for axes, panel in zip(grid(figure), panels.values(), strict=True):
        assert axes.get_xlim() == (-1.5, 1.5)
        assert axes.get_ylim() == (-1.5, 1.6)
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("$q$", "$p$")
        _, _, surface = axes.collections
        (path,) = [path for path in surface.get_paths() if len(path.vertices)]
        # The oscillator's surface is a circle of radius 1; linear interpolation of H in a cell, 161 over 3.1, errs by
        # no more than the square of the cell.
        radii = np.hypot(*path.vertices[:-1].T)
        assert np.abs(radii - 1).max() < (3.1 / 160) ** 2
        found = entries(figure.legends[0])["energy surface of the start"][0]
        assert to_hex(surface.get_edgecolor()[0]) == to_hex(found.get_color())
        width = surface.get_linewidths()[0]
        assert surface.get_linestyles()[0][1] == pytest.approx([d * width for d in look(found)[3]])
        assert panel.H.values[0, 0] == 0.5


def test_shades_are_hamiltonian_with_p_upwards_on_colour_scale(figure, panels):
    bars = [axes for axes in figure.axes if axes.get_title() == "$H$"]
    for axes, bar in zip(grid(figure), bars, strict=True):
        shades = axes.collections[0]
        low, high = shades.get_clim()
        assert bar.get_ylim() == (low, high)
        assert low <= 0.0  # in the middle
        assert high >= (1.5**2 + 1.6**2) / 2  # in the upper corners
        # Within the innermost shade, H is below its upper level.
        inner = shades.get_paths()[0].vertices
        assert (np.hypot(*inner.T) ** 2 / 2).max() <= shades.levels[1] + 1e-3
