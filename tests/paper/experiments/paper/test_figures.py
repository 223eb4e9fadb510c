"""Figures of the paper, read back from their artists."""

from __future__ import annotations

import re
from decimal import Decimal
from itertools import combinations, pairwise, zip_longest

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D
from matplotlib.text import Text

import nearharmonic as nh
from nearharmonic.plotting.column import narrow
from nearharmonic.plotting.style import draw_profile
from nearharmonic_paper.experiments.paper import figures
from nearharmonic_paper.experiments.paper import tableaus as decompose
from nearharmonic_paper.experiments.paper.orbits import paper_panels
from support.cubes import figure_cubes as made
from support.cubes.artists import NO_LINE, SOLID, drawn, entries, line_of, lines_of, look, look_of, seen, slope, ticks

# --- The gain over Ruth's method.


@pytest.mark.parametrize("variable", ["max_energy_error", "mean_energy_error"])
def test_gain_is_ratio_of_errors_until_ruths_reaches_one_percent(variable):
    cube = made.errors() * 0.1
    cube[variable].loc[{"integrator": "ruth", "tau_per_stage": made.TAU[20]}] = 0.0101
    axes, other = figures.gain(cube, cube, variable=variable).axes
    assert axes.get_ylim() == other.get_ylim()
    for name in made.METHODS:
        curve = dict(zip(made.TAU, line_named(axes, made.label(name)).get_ydata(), strict=True))
        for tau in made.TAU[[2, 9, 19]]:
            at = cube[variable].sel(tau_per_stage=tau)
            assert curve[tau] == pytest.approx(float(at.sel(integrator="ruth") / at.sel(integrator=name)), rel=1e-14)
        assert np.isnan([curve[tau] for tau in made.TAU[[*made.GAPS, *range(20, made.TAU.size)]]]).all()


def test_gain_in_column_has_legible_labels_apart_and_inside():
    figure = figures.gain(made.crowded(), made.crowded(), narrow=True)
    narrow(figure)  # as the job does; the labels have their places for this width already
    figure.draw_without_rendering()
    assert figure.get_figwidth() * 25.4 == pytest.approx(85)
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in texts) >= 6
    groups = [(figure, [figure._suptitle.get_window_extent(), *(axes.get_tightbbox() for axes in figure.axes)])]
    for axes in figure.axes:
        assert {text.get_text() for text in axes.texts} == {*made.crowded().label.values}
        groups.append((axes, [text.get_window_extent() for text in axes.texts]))
    for outer, boxes in groups:
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
        assert all(outer.bbox.contains(*corner) for box in boxes for corner in box.corners())


def line_named(axes, text):
    (line,) = (line for line in axes.get_lines() if line.get_label() == text)
    return line


# --- Figures 1, 3 and 5: the curves are the cube's, in the panel, look and legend entry of their method.

DASHED = (4, 5)


def test_the_upper_panel_shows_maxima_and_the_lower_one_means():
    cube = made.errors()
    upper, lower = draw_profile(cube).axes
    for axes, variable, letter, title, ylabel in (
        (upper, "max_energy_error", "A", "maximum over all steps", r"$\max\,|\Delta H/H_0|$"),
        (lower, "mean_energy_error", "B", "mean over all steps", r"$\mathrm{mean}\,|\Delta H/H_0|$"),
    ):
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert (axes.get_title(), axes.get_title(loc="left")) == (letter, title)
        assert axes.get_ylabel() == ylabel
        for name in made.METHODS:
            assert look(line_of(axes, made.TAU, cube[variable].sel(integrator=name))) == look_of(name)
        assert len(axes.get_lines()) == len(made.METHODS) + 2  # and two guides
    # The upper panel is the upper one on paper.
    assert upper.get_position().y0 > lower.get_position().y1


def test_double_precision_is_solid_and_extended_precision_dashed():
    cube = made.errors(precision=True)
    for axes, variable in zip(draw_profile(cube).axes, ("max_energy_error", "mean_energy_error"), strict=True):
        for name in made.METHODS:
            solid, dashed = (
                line_of(axes, made.TAU, cube[variable].sel(integrator=name, precision=precision))
                for precision in ("double", "extended")
            )
            assert look(solid) == look_of(name)
            assert look(dashed) == (look_of(name)[0], None, None, DASHED)
            assert dashed.get_zorder() < solid.get_zorder()
        assert len(axes.get_lines()) == 2 * len(made.METHODS) + 2


def test_every_run_is_seen_in_its_panel_or_above_it():
    cube = made.errors(precision=True, gaps=made.LONELY)
    for axes, variable in zip(draw_profile(cube).axes, ("max_energy_error", "mean_energy_error"), strict=True):
        runs = cube[variable].stack(run=("precision", "integrator")).transpose("run", ...)
        for values in runs.values:
            np.testing.assert_array_equal(seen(line_of(axes, made.TAU, values)), np.isfinite(values) & (values > 0))
        (strip,) = axes.child_axes
        rows = [(to_hex(line.get_color()), line.get_xdata().tolist()) for line in strip.lines]
        assert rows == [(look_of(one)[0], made.TAU[runs[0] > 10].tolist()) for one in runs.integrator.values]
        assert (strip.get_ylabel(), strip.get_xlim()) == ("diverged,\nor > 10", axes.get_xlim())
    assert not draw_profile(made.errors(gaps={0: np.nan})).axes[0].child_axes


def test_dashes_of_one_curve_are_seen_for_each_method():
    cube = made.errors(["aba104", "abas5o6h", "aba864"], precision=True)
    for values in (cube.max_energy_error, cube.mean_energy_error):
        values[0], values[1] = np.nan, made.TAU**4
    figure = draw_profile(cube)
    figure.draw_without_rendering()
    x, y = (slice(*map(int, ends)) for ends in figure.axes[0].bbox.get_points().T)
    FigureCanvasAgg(figure).draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[::-1, :, :3][y, x] / 255
    for name in cube.integrator.values:
        assert (abs(picture - to_rgb(look_of(name)[0])).max(axis=-1) < 0.15).sum() > 40, name


def test_guides_have_the_slopes_that_they_say():
    for axes in draw_profile(made.errors()).axes:
        said = {}
        for note in axes.texts:
            (guide,) = [line for line in axes.get_lines() if tuple(np.transpose(line.get_data())[-1]) == note.xy]
            said[note.get_text()] = slope(guide)
            assert (look(guide)[1], look(guide)[3]) == (None, SOLID)
        assert said == {"order 4": pytest.approx(4, abs=1e-9), "order 6": pytest.approx(6, abs=1e-9)}


def test_both_panels_share_limits_that_hold_every_finite_point():
    cube = made.errors(precision=True)
    upper, lower = draw_profile(cube).axes
    assert upper.get_ylim() == lower.get_ylim()
    both = np.concatenate([cube.max_energy_error.values.ravel(), cube.mean_energy_error.values.ravel()])
    positive = both[np.isfinite(both) & (both > 0)]
    bottom, top = upper.get_ylim()
    assert bottom < positive.min() < 1e-8
    assert positive.max() < top < 1


def test_an_error_of_many_energies_does_not_stretch_the_axis():
    cube = made.errors()
    cube["max_energy_error"][1, -2] = 1e6
    assert draw_profile(cube).axes[0].get_ylim()[1] == 10


# --- Figure 2: kappa of both compositions, vanishing orders, and the legend.

#: Orders that vanish in the cube, by the row that is outermost.
VANISH = {"drift": [1, 2, 4], "kick": [1, 2, 3, 6]}
ORDERS = np.arange(1, 10)


cube = pytest.fixture(made.terms)


def remaining(cube, name, first):
    """Kappa by order, NaN where it vanishes or there is none."""
    return np.where(np.isin(ORDERS, VANISH[first]), np.nan, cube.kappa.sel(integrator=name, first=first).values)


def test_kick_first_error_terms_are_lines_in_method_colour(cube):
    upper, _ = figures.fig2_decomposition(cube).axes
    assert (upper.get_yscale(), upper.get_ylabel()) == ("log", r"error term of the position, $\kappa_\lambda$")
    for name in made.METHODS:
        curve = line_of(upper, ORDERS, remaining(cube, name, "kick"))
        assert look(curve) == (look_of(name)[0], None, None, SOLID)
        np.testing.assert_array_equal(ORDERS[drawn(curve)], [4, 5, 7, 8])


def test_drift_first_error_terms_are_circles_around_markers(cube):
    upper, _ = figures.fig2_decomposition(cube).axes
    for name in made.METHODS:
        circle, inside = lines_of(upper, ORDERS, remaining(cube, name, "drift"))
        assert look(circle) == (look_of(name)[0], "o", "none", NO_LINE)
        assert look(inside) == look_of(name, NO_LINE)
        assert circle.get_markersize() > inside.get_markersize()
        np.testing.assert_array_equal(ORDERS[drawn(circle)], [3, 5, 6, 7, 8, 9])
    assert len(upper.get_lines()) == 3 * len(made.METHODS)


def test_methods_of_large_terms_have_an_inset(cube):
    name = str(cube.integrator.values[0])
    cube.kappa.loc[name, "kick", 9] = 1e9
    upper, _ = figures.fig2_decomposition(cube).axes
    (inset,) = upper.child_axes
    assert inset.get_title() == cube.label.values[0]
    colours = [{line.get_color() for line in axes.lines} for axes in (inset, upper)]
    assert (colours[0], look_of(name)[0] in colours[1]) == ({look_of(name)[0]}, False)


def test_vanishing_terms_are_bars_for_kick_circles_for_drift_first(cube):
    _, lower = figures.fig2_decomposition(cube).axes
    for row, name in enumerate(made.METHODS):
        bars = line_of(lower, VANISH["kick"], row)
        assert (look(bars)[0], look(bars)[1], look(bars)[3]) == (look_of(name)[0], "_", NO_LINE)
        circle, inside = lines_of(lower, VANISH["drift"], row)
        assert look(circle) == (look_of(name)[0], "o", "none", NO_LINE)
        assert look(inside) == look_of(name, NO_LINE)
    assert len(lower.get_lines()) == 3 * len(made.METHODS)


def test_rows_are_named_downwards_in_order_of_methods(cube):
    _, lower = figures.fig2_decomposition(cube).axes
    assert ticks(lower.yaxis) == {made.label(name): row for row, name in enumerate(made.METHODS)}
    heights = [lower.transData.transform((1, row))[1] for row in range(len(made.METHODS))]
    assert heights == sorted(heights, reverse=True)
    bottom, top = lower.get_ylim()
    assert top < 0 < len(made.METHODS) - 1 < bottom


def test_rounded_coefficients_of_twenty_digits_keep_the_vanishing_terms(monkeypatch):
    """Suzuki's five leapfrogs, u = 1/(4 - 4^(1/3)): order 4 on every system, and kappa_5 is no rounding error."""
    u = round(1 / (4 - Decimal(4) ** (Decimal(1) / 3)), 20)
    drift = (u, u, 1 - 4 * u, u, u)
    kick = (u / 2, u, (1 - 3 * u) / 2, (1 - 3 * u) / 2, u, u / 2)
    suzuki = nh.Tableau(
        name="suzuki", label="Suzuki", kick=tuple(map(str, kick)), drift=tuple(map(str, drift)), first="kick",
        order=4, digits=20, source="doi:10.1016/0375-9601(90)90962-N",
    )  # fmt: skip
    monkeypatch.setattr(decompose, "registry", {"suzuki": suzuki})
    kappa = decompose.decompose(["suzuki"])["cube"].kappa.sel(integrator="suzuki").values
    assert (kappa[:, :4] == 0).all()
    assert (kappa[:, 4] > 0.1).all()


# --- Figure 4: advances with their intervals, significance, and the axis in arcseconds per century.

#: Indices of the step sizes whose advance the cube tells from zero, and of those it does not.
TOLD = [0, 1, 2, *range(6, 12)]
NOT_TOLD = list(range(12, 25))


advance_cube = pytest.fixture(made.advances)


def at(values, indices):
    """``values`` at ``indices``, NaN elsewhere."""
    return np.where(np.isin(np.arange(values.size), indices), values, np.nan)


def curves(advance_cube, name):
    """Evaluations, the absolute advances that are told from zero, and those that are not."""
    one = advance_cube.sel(integrator=name)
    size = np.abs(one.perihelion_advance.values)
    return one.evaluations_per_orbit.values, at(size, TOLD), at(size, NOT_TOLD)


def test_advance_is_dot_beyond_its_interval_and_cross_within_it_or_at_its_end(advance_cube):
    axes = figures.fig4_perihelion(advance_cube).axes[0]
    for name in made.METHODS:
        x, told, not_told = curves(advance_cube, name)
        dots, marks = lines_of(axes, x, told)
        colour = look_of(name)[0]
        assert look(dots) == (colour, ".", colour, SOLID)
        assert look(marks) == look_of(name, NO_LINE)
        crosses = line_of(axes, x, not_told)
        assert [look(crosses)[i] for i in (0, 1, 3)] == [colour, "x", NO_LINE]
        assert [np.flatnonzero(drawn(line)).tolist() for line in (dots, crosses)] == [TOLD, NOT_TOLD]


def test_error_bars_are_intervals_of_nonzero_advances(advance_cube):
    axes = figures.fig4_perihelion(advance_cube).axes[0]
    assert len(axes.containers) == len(made.METHODS)
    for name, container in zip(made.METHODS, axes.containers, strict=True):
        one = advance_cube.sel(integrator=name)
        _, _, (bars,) = container
        segments = [s for s in bars.get_segments() if len(s) and np.isfinite(s).all()]
        size, interval = np.abs(one.perihelion_advance.values), one.perihelion_advance_interval.values
        assert len(segments) == len(TOLD)
        for i, segment in zip(TOLD, segments, strict=True):
            np.testing.assert_array_equal(segment[:, 0], one.evaluations_per_orbit.values[i])
            np.testing.assert_allclose(segment[:, 1], [size[i] - interval[i], size[i] + interval[i]], rtol=1e-14)
        (colour,) = bars.get_color()
        assert to_hex(colour) == look_of(name)[0]


def test_bars_that_their_dots_would_hide_are_left_out(advance_cube):
    short = advance_cube.assign(perihelion_advance_interval=4e-3 * abs(advance_cube.perihelion_advance))
    for _, _, (bars,) in figures.fig4_perihelion(short).axes[0].containers:
        assert bars.get_segments() == []


def test_the_second_axis_reads_arcseconds_per_century(advance_cube):
    axes = figures.fig4_perihelion(advance_cube).axes[0]
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


def test_relativistic_line_is_labelled_at_42_98_arcseconds_per_century(advance_cube):
    figure = figures.fig4_perihelion(advance_cube)
    _, level = relativistic_line(figure)
    assert level * 206264.806247096355 * 876600 / 2000 == pytest.approx(42.98, rel=1e-12)
    (note,) = [text for text in figure.axes[0].texts if "relativity" in text.get_text()]
    assert note.get_text() == "general relativity: 42.98″ per century"
    assert note.xy[1] == level


def test_advances_that_are_no_results_are_shaded(advance_cube):
    size = advance_cube.perihelion_advance.size
    advance_cube.perihelion_advance[...] = np.geomspace(1e-17, 10, size).reshape(len(made.METHODS), -1)
    axes = figures.fig4_perihelion(advance_cube).axes[0]
    low, high = axes.get_ylim()
    spans = [patch.get_window_extent().transformed(axes.transData.inverted()).intervaly for patch in axes.patches]
    np.testing.assert_allclose(spans, [[0.1, high], [low, 1e-15]], rtol=1e-9)


def test_the_relativistic_line_of_mercury_is_what_general_relativity_gives(advance_cube):
    # 6 pi GM / (c^2 a (1 - e^2)) rad per orbit; GM in m^3/s^2, a in m. The line rests on 42.98: 4 digits.
    c, GM, a, e = 299792458.0, 1.32712440018e20, 5.790905e10, 0.20563
    advance_cube.attrs["orbital_period"] = 2 * np.pi * np.sqrt(a**3 / GM) / 3600
    _, level = relativistic_line(figures.fig4_perihelion(advance_cube))
    assert level == pytest.approx(6 * np.pi * GM / (c**2 * a * (1 - e**2)), rel=5e-4)


# --- The figure of panel D outside its plane: curves, crosses at divergence, and legend.


displaced_cube = pytest.fixture(made.displaced)


@pytest.fixture
def figure(displaced_cube):
    return figures.fig6_displaced(displaced_cube)


def curve(displaced_cube, summation, run):
    """The points of a curve: finite samples, and where it leaves at the limit."""
    one = displaced_cube.isel(summation=summation, displacement=run)
    kept = np.isfinite(one.block_max_energy_error.values)
    x, y = displaced_cube.iteration.values[kept], one.block_max_energy_error.values[kept]
    left_at = int(one.left_at)
    return (np.append(x, left_at), np.append(y, 1.5)) if left_at else (x, y)


@pytest.mark.parametrize("summation", [0, 1])
def test_a_curve_ends_at_the_limit_where_the_path_leaves(displaced_cube, figure, summation):
    for run in range(3):
        line = line_of(figure.axes[summation], *curve(displaced_cube, summation, run))
        left_at = int(displaced_cube.left_at[run, summation])
        crosses = lines_of(figure.axes[summation], [left_at], [1.5])
        assert len(crosses) == (left_at > 0)
        for cross in crosses:
            assert look(cross)[1::2] == ("X", NO_LINE)
            assert cross.get_color() == line.get_color()


# --- Figure 6: dots coloured by the next signs, the path between them, and the text of each panel.

#: Text of the legend, by whether the drift and the kick of the pair that follows are negative.
SAYS = {
    (False, False): "next drift and kick forward",
    (True, False): "next drift backward",
    (False, True): "next kick backward",
    (True, True): "next drift and kick backward",
}


panels = pytest.fixture(made.toy_panels, scope="module")


@pytest.fixture(scope="module")
def panels_figure(panels):
    return figures.fig6_substeps(panels)


def grid(panels_figure):
    return [axes for axes in panels_figure.axes if axes.get_xlabel().strip("$").startswith("q")]


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
def test_dots_carry_the_signs_of_the_pair_that_follows(panels_figure, panels, first):
    rows = {"drift": (made.TOY_KICK, made.TOY_DRIFT), "kick": (made.TOY_DRIFT, made.TOY_KICK)}[first]
    pairs = list(zip_longest(*(map(float, row) for row in rows), fillvalue=0.0))
    index = {"drift": 0, "kick": 1}[first]
    panel = list(panels.values())[index]
    states = zip(panel.q.values.tolist(), panel.p.values.tolist(), strict=True)
    path = [list(zip(*rows, strict=True)) for rows in states]
    expected = []
    for points in path:
        for (c, d), (q, p) in zip(pairs[1:], points[1:-1], strict=True):
            expected.append((q, p, SAYS[c < 0, d < 0]))
        expected += [(*points[0], "initial position"), (*points[-1], "final position")]
    # The end of the first iteration is the start of the second: circle and cross over each other, no one's entry.
    both = path[0][-1]
    expected = [entry for entry in expected if entry[:2] != both] + [(*both, None)]
    assert {text for *_, text in expected} >= set(SAYS.values())
    compare(marks(grid(panels_figure)[index], panels_figure.legends[0]), expected)


@pytest.fixture(scope="module")
def paper():
    panels = paper_panels()
    return panels, figures.fig6_substeps(panels)


def test_path_follows_q_in_drifts_and_p_in_kicks(panels_figure, panels):
    for axes, panel, moves_p in zip(grid(panels_figure), panels.values(), (False, True), strict=True):
        ways = [line for line in axes.get_lines() if len(line.get_xdata()) > 1]
        for line, q, p in zip(ways, panel.q.values, panel.p.values, strict=True):
            np.testing.assert_array_equal(line.get_xydata()[::2], np.column_stack([q, p]))
            rests = line.get_xdata() if moves_p else line.get_ydata()  # in the first leg of each pair
            assert not np.diff(rests)[::2].any()
            assert look(line)[1] is None
            assert look(line)[3] != NO_LINE


def number(text):
    return float(text.replace(" × 10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))


def test_each_panel_states_step_and_energy_errors_below_its_frame(panels_figure, panels):
    for axes, panel in zip(grid(panels_figure), panels.values(), strict=True):
        q, p = (panel[name].values[-1, -1] for name in "qp")
        says = axes.texts[-1].get_text()
        form = r"τ = 0\.3, \|ΔH/H₀\| = (.+) after 2 iterations,\nat most (.+) in 1000 iterations"
        error, largest = re.fullmatch(form, says).groups()
        assert number(error) == pytest.approx(abs((q * q + p * p) / 2 - 0.5) / 0.5, rel=0.05)
        assert number(largest) == pytest.approx(panel.max_energy_error.item(), rel=0.05)
        assert axes.texts[-1].get_window_extent().y1 < axes.bbox.y0


def test_a_panel_states_where_its_path_leaves_its_energy_surface(paper):
    panels, panels_figure = paper
    texts = dict(zip(panels, (axes.texts[-1].get_text() for axes in grid(panels_figure)), strict=True))
    assert [texts[letter].split(",")[0] for letter in "ABCD"] == ["τ = π/4", "τ = π/4", "τ = 2", "τ = 2"]
    assert texts["C"].endswith(f"leaves its energy surface at iteration {int(panels['C'].left_at)}")
    assert all("leaves" not in texts[letter] for letter in "ABD")


def test_labels_number_substeps_and_name_H_beside_dots_and_paths(paper):
    panels, panels_figure = paper
    for axes, panel in zip(grid(panels_figure), panels.values(), strict=True):
        texts = {text.get_text(): text for text in axes.texts[:-1]}
        dots = axes.transData.transform(np.column_stack([panel.q.values[0], panel.p.values[0]]))
        levels = [text for text in texts if text.startswith("H = ")]
        assert set(texts) == {*map(str, range(1, len(dots) - 1)), *levels}
        assert len(levels) == 3
        for text in levels:
            q, p = texts[text].xy
            expected = p**2 / 2 + q**2 / 2 - (q**3 / 3 if panel.attrs["system"] == "henon_heiles" else 0)
            assert float(text.removeprefix("H = ")) == pytest.approx(expected, rel=0.01)  # linear within a cell
        boxes = [text.get_window_extent().padded(-1) for text in texts.values()]
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
        for line in axes.get_lines():
            along = axes.transData.transform(line.get_xydata())
            points = [a + (b - a) * np.arange(0, 1, 0.01)[:, None] for a, b in pairwise(along)] or [along]
            assert not any(box.contains(*point) for box in boxes for point in np.concatenate(points))
        for i, dot in enumerate(dots[1:-1], start=1):
            assert np.hypot(*(axes.transData.transform(texts[str(i)].xy) - dot)) < 0.08 * axes.bbox.width


def test_dashed_contour_runs_through_start_and_window_is_cubes(panels_figure, panels):
    for axes, panel in zip(grid(panels_figure), panels.values(), strict=True):
        assert axes.get_xlim() == (-1.5, 1.5)
        assert axes.get_ylim() == (-1.5, 1.6)
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("q", "p")
        _, _, surface = axes.collections
        (path,) = [path for path in surface.get_paths() if len(path.vertices)]
        # The oscillator's surface is a circle of radius 1; linear interpolation of H in a cell, 81 over 3.1, errs by
        # no more than the square of the cell.
        radii = np.hypot(*path.vertices[:-1].T)
        assert np.abs(radii - 1).max() < (3.1 / 80) ** 2
        found = entries(panels_figure.legends[0])["energy surface of the start"][0]
        assert to_hex(surface.get_edgecolor()[0]) == to_hex(found.get_color())
        width = surface.get_linewidths()[0]
        assert surface.get_linestyles()[0][1] == pytest.approx([d * width for d in look(found)[3]])
        assert panel.H.values[0, 0] == 0.5


def test_shades_are_hamiltonian_with_p_upwards_on_colour_scale(panels_figure, panels):
    bars = [axes for axes in panels_figure.axes if axes.get_title() == "H"]
    for axes, bar in zip(grid(panels_figure), bars, strict=True):
        shades = axes.collections[0]
        low, high = shades.get_clim()
        assert bar.get_ylim() == (low, high)
        assert low <= 0.0  # in the middle
        assert high >= (1.5**2 + 1.6**2) / 2  # in the upper corners
        # Within the innermost shade, H is below its upper level.
        inner = shades.get_paths()[0].vertices
        assert (np.hypot(*inner.T) ** 2 / 2).max() <= shades.levels[1] + 1e-3
