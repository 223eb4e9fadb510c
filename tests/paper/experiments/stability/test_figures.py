"""Figures of the stress tests, read back from their artists and from the colours of the picture."""

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_hex

from nearharmonic_paper.experiments.stability import figures
from support.cubes import artists
from support.cubes.figure_cubes import METHODS, TAU, label
from support.cubes.stability_cubes import LOST, TURNED, amplitudes, ensembles, orbits, rounding, traces

# --- Figures of linear stability, of the kinetic energy and of the growth of round-off, read back from their artists.


RED = 0


def colour_of(name):
    return artists.look_of(name)[0]


# Linear stability


def gaps(cube, name):
    """(start, end) per stage of the gaps of a method, cut at the edge of the panel; 2.4 is the last step size."""
    one = cube.sel(integrator=name)
    edges = [(a, b) for a, b in zip(one.start.values, one.end.values, strict=True) if not np.isnan(a)]
    return [(a / one.stages.item(), min(b / one.stages.item(), 2.4)) for a, b in edges]


def test_gaps_are_red_from_first_to_last_step_size():
    cube = traces()
    for axes, name in zip(figures.linear_stability(cube).axes, METHODS, strict=True):
        _, *patches = axes.patches  # the first is the stable band
        red = [(artists.span(patch), patch.get_facecolor()) for patch in patches]
        np.testing.assert_allclose([edges for edges, _ in red], gaps(cube, name), rtol=1e-15)
        assert all(np.argmax(colour[:3]) == RED for _, colour in red)
        (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert (low, high, -bottom) == (0, 2.4, top)
        marks = [line for line in axes.get_lines() if line.get_marker() == "v"]
        assert [(line.get_xdata()[0], line.get_ydata()[0]) for line in marks] == [(a, top) for a, _ in gaps(cube, name)]
    assert [len(gaps(cube, name)) for name in METHODS] == [1, 2, 3]


def test_curves_are_half_trace_in_method_colour_and_exact_cosine():
    cube = traces()
    tau = cube.tau_per_stage.values
    figure = figures.linear_stability(cube)
    for axes, name, stages in zip(figure.axes, METHODS, (2, 3, 4), strict=True):
        trace = cube.half_trace.sel(integrator=name).values
        curves = [line for line in axes.get_lines() if line.get_marker() in ("None", "none")]
        exact, ours = curves
        np.testing.assert_allclose(exact.get_ydata(), np.cos(stages * tau), atol=1e-12)
        np.testing.assert_array_equal(exact.get_xdata(), tau)
        np.testing.assert_array_equal(ours.get_xdata(), tau)
        # Whatever the panel can show is drawn as it is.
        shown = np.abs(trace) <= axes.get_ylim()[1]
        assert 10 < shown.sum() < tau.size - 10
        np.testing.assert_array_equal(ours.get_ydata()[shown], trace[shown])
        assert artists.look(ours) == (colour_of(name), None, None, artists.SOLID)
        assert colour_of(name) != to_hex(exact.get_color())


def test_panel_title_names_method_first_edge_and_gap_growth():
    titles = [axes.get_title(loc="left") for axes in figures.linear_stability(traces()).axes]
    assert titles == [
        r"label of ruth:  $\tau^*$ = 2.500000, for good",
        r"label of aba104:  $\tau^*$ = 2.625000, growth 2.5e-02",
        r"label of babps9o7h:  $\tau^*$ = 2.750000, growth 3.7e-02",
    ]


# Kinetic energy


def test_panels_of_kinetic_energy_show_errors_by_step_and_over_ruth_by_amplitude():
    cube = amplitudes()
    axes = figures.kinetic_energy(cube).axes
    shown = [(f"amplitude {a}", TAU, cube.max_energy_error.sel(roles="own", amplitude=a)) for a in (0.031, 1.02)]
    for roles, title in (("own", r"error / Ruth's at $\tau/s$ = 0.07"), ("exchanged", "the same, T and V exchanged")):
        shown.append((title, cube.amplitude, cube.relative_error.sel(roles=roles)))
    for panel, letter, (title, x, values) in zip(axes, "ABCD", shown, strict=True):
        assert (panel.get_title(), panel.get_title(loc="left")) == (letter, title)
        for name in METHODS:
            assert artists.look(artists.line_of(panel, x, values.sel(integrator=name))) == artists.look_of(name)
        assert len(panel.get_lines()) == len(METHODS)
        assert (panel.get_xscale(), panel.get_yscale()) == ("log", "log")
    for left, right in (axes[:2], axes[2:]):
        assert left.get_ylim() == right.get_ylim()


def test_large_error_does_not_stretch_axes_of_kinetic_energy():
    cube = amplitudes()
    cube["max_energy_error"][:, :, 0, -1] = 1e7
    assert [axes.get_ylim()[1] for axes in figures.kinetic_energy(cube).axes[:2]] == [10, 10]


# Both, and the growth of round-off


#: Sources drawn for energy and lag, and Brouwer's exponents.
VARIABLES = (
    ("energy_error", ("plain", "compensated", "extended"), 0.5),
    ("lag", ("plain", "compensated", "extended", "coefficients"), 1.5),
)


def test_rms_is_drawn_over_time_with_dashes_by_source():
    cube = rounding()
    figure = figures.rounding_growth(cube)
    sources = artists.looks(figure.legends[1])
    assert list(sources) == ["plain", "compensated", "extended", "coefficients"]
    assert len({dashes for *_, dashes in sources.values()}) == 4
    assert sources["plain"][3] == artists.SOLID
    for axes, (variable, shown, _) in zip(figure.axes[:2], VARIABLES, strict=True):
        for name in METHODS:
            time = cube.time.sel(integrator=name)
            for source in shown:
                rms = cube[f"{variable}_rms"].sel(integrator=name, source=source)
                curve = artists.line_of(axes, time, rms)
                assert artists.look(curve) == (colour_of(name), None, None, sources[source][3])
                assert artists.drawn(curve).all()
        assert len(axes.get_lines()) == len(METHODS) * len(shown) + 3


def test_grey_laws_have_brouwers_slopes_above_curve_centres():
    cube = rounding()
    for axes, (variable, _, exponent) in zip(figures.rounding_growth(cube).axes[:2], VARIABLES, strict=True):
        laws = axes.get_lines()[-3:]
        for source, law in zip(("plain", "compensated", "extended"), laws, strict=True):
            assert artists.slope(law) == pytest.approx(exponent, abs=1e-9)
            ends = cube[f"{variable}_rms"].sel(source=source).values[:, -1]
            assert law.get_ydata()[-1] == pytest.approx(6 * np.prod(ends) ** (1 / len(METHODS)), rel=1e-12)
            red, green, blue = (int(to_hex(law.get_color())[i : i + 2], 16) for i in (1, 3, 5))
            assert red == green == blue


def test_exponents_stand_in_row_of_their_method_with_their_intervals():
    cube = rounding()
    figure = figures.rounding_growth(cube)
    markers = {source: marker for source, (_, marker, _, _) in artists.looks(figure.legends[1]).items() if marker}
    assert list(markers) == ["plain", "compensated", "extended"]
    assert len(set(markers.values())) == 3
    for axes, (variable, _, exponent) in zip(figure.axes[2:], VARIABLES, strict=True):
        found = {container[0].get_xdata()[0]: container for container in axes.containers}
        assert len(found) == 3 * len(METHODS)
        rows = {label(name): row for row, name in enumerate(METHODS)}
        assert axes is not figure.axes[2] or artists.ticks(axes.yaxis) == rows
        for row, name in enumerate(METHODS):
            heights = []
            for source, marker in markers.items():
                one = cube.sel(integrator=name, source=source)
                middle, width = one[f"{variable}_exponent"].item(), one[f"{variable}_interval"].item()
                point, _, (bar,) = found[middle]
                assert artists.look(point)[:2] == (colour_of(name), marker)
                assert artists.look(point)[3] == artists.NO_LINE
                (segment,) = bar.get_segments()
                np.testing.assert_allclose(segment[:, 0], [middle - width, middle + width], rtol=1e-14)
                assert to_hex(bar.get_color()[0]) == colour_of(name)
                heights.append(point.get_ydata()[0])
            assert np.round(heights).tolist() == [row] * 3
            assert heights == sorted(set(heights))
        (law,) = [
            line
            for line in axes.get_lines()
            if artists.look(line)[1] is None and artists.look(line)[3] == artists.SOLID
        ]
        assert list(law.get_xdata()) == [exponent, exponent]


# --- Maps of the stress tests: the colour at each place of the picture shows the number that belongs there.


#: A colour of the picture has 8 bits a channel, a colour map 256 entries.
CHANNEL = 1.01 / 255
#: Where there is no number to show.
GREY = np.full(3, 0xB8 / 255)


def shade(colours, value, low, high):
    """The colour of a decimal logarithm between the colours of ``low`` and ``high``."""
    return np.array(colormaps[colours]((np.log10(value) - np.log10(low)) / (np.log10(high) - np.log10(low)))[:3])


# Henon-Heiles


@pytest.fixture(scope="module")
def henon_heiles():
    cube = ensembles()
    figure = figures.henon_heiles_stability(cube)
    return cube, figure, [axes for axes in figure.axes if axes.images], artists.pixels(figure)


@pytest.mark.slow
def test_each_cell_shows_median_error_or_grey_above_one_percent(henon_heiles):
    cube, _, maps, at = henon_heiles
    grey = 0
    for axes, name in zip(maps, METHODS, strict=True):
        for row in range(3):
            for column, tau in enumerate((0.1, 0.2, 0.3, 0.4, 0.5)):
                one = cube.sel(integrator=name).isel(energy=row, tau_per_stage=column)
                expected = shade("plasma_r", one.energy_error.sel(quantile=0.5).item(), 1e-8, 1.0)
                if one.escaped > 0.01:
                    expected, grey = GREY, grey + 1
                # Off the middle of the cell too: the black line may pass, and a shift of half a cell must show.
                for shift in (-0.035, 0.035):
                    np.testing.assert_allclose(at(axes, tau + shift, row + 0.3), expected, atol=CHANNEL)
    assert grey == 2 * len(METHODS)


def test_energies_are_fractions_in_strip_of_named_method(henon_heiles):
    _, _, maps, _ = henon_heiles
    for axes, name in zip(maps, METHODS, strict=True):
        assert axes.get_ylabel() == label(name)
        assert artists.ticks(axes.yaxis) == {"1/24": 0, "1/8": 1, "1/6": 2}
        heights = [axes.transData.transform((0.3, row))[1] for row in range(3)]
        assert heights == sorted(heights, reverse=True)
    assert maps[-1].get_xlabel() == r"step size per stage, $\tau/s$"
    assert maps[0].get_position().y0 > maps[1].get_position().y0 > maps[2].get_position().y0


def test_white_edged_line_is_at_first_linear_limit_inside_map():
    cube = ensembles()
    cube["linear_limit"] = ("integrator", [0.27, 0.56, 0.35])
    figure = figures.henon_heiles_stability(cube)
    maps = [axes for axes in figure.axes if axes.images]
    colour = artists.look(artists.entries(figure.legends[0])["first linear limit"][0])
    assert colour[1] is None
    for axes, limits in zip(maps, ([0.27], [], [0.35]), strict=True):
        lines = [line for line in axes.get_lines() if artists.look(line) == colour]
        assert [list(line.get_xdata()) for line in lines] == [[limit, limit] for limit in limits]
        # The others are the white lines between the strips.
        others = [line for line in axes.get_lines() if line not in lines]
        assert [list(line.get_ydata()) for line in others] == [[0.5, 0.5], [1.5, 1.5]]
        assert {to_hex(line.get_color()) for line in others} == {"#ffffff"}
    assert colour[0] == "#000000"
    edges = [effect._gc for line in maps[0].get_lines()[:1] for effect in line.get_path_effects()]
    assert [edge["foreground"] for edge in edges] == ["white"]


def test_colour_bar_of_ensembles_is_that_of_every_map(henon_heiles):
    _, figure, maps, _ = henon_heiles
    (bar,) = [axes for axes in figure.axes if "median" in axes.get_title()]
    assert_decades(bar.get_xlim(), artists.ticks(bar.xaxis), -8, [axes.images[0] for axes in maps])


def assert_decades(limits, places, lowest, images):
    """A colour bar from 10^lowest to 1 has a tick at each second decade, and the limits of the maps."""
    assert limits == pytest.approx((lowest, 0), abs=1e-12)
    assert places == {rf"$10^{{{k}}}$": pytest.approx(k, abs=1e-12) for k in range(lowest, 1, 2)}
    assert [image.get_clim() for image in images] == [limits] * len(METHODS)


# Kepler


@pytest.fixture(scope="module")
def kepler():
    cube = orbits()
    cube["evaluations_for_contour"] *= np.nan  # no white line over the cells
    figure = figures.kepler_stability(cube)
    return cube, figure, artists.pixels(figure)


def maps_of(part):
    return [axes for axes in part.axes if axes.get_title()]


@pytest.mark.parametrize(
    ("index", "variable", "lost"), [(0, "energy_error", {LOST}), (1, "perihelion_advance", {LOST, TURNED})]
)
def test_each_cell_shows_its_number_or_grey_for_lost_orbit(kepler, index, variable, lost):
    cube, figure, at = kepler
    for axes, name in zip(maps_of(figure.subfigs[index]), METHODS, strict=True):
        one = cube.sel(integrator=name)
        assert axes.get_title() == label(name)
        for step in (0, 1, 3, 4, 5):  # of steps 1 and 2, which are one, the first counts
            for orbit in range(index, 6):  # a circle has no perihelion
                value = abs(one[variable].values[step, orbit])
                expected = shade("viridis_r", value if np.isfinite(value) else 1e-10, 1e-10, 1.0)
                if (step, orbit) in lost:
                    expected = GREY
                x, y = one.evaluations_per_orbit.values[step], 1 - one.eccentricity.values[orbit]
                # The cells of the circle and of the last orbit are cut at the edge of the panel.
                for factor in {0: (0.75,), 5: (1.3,)}.get(orbit, (0.75, 1.3)):
                    for along in (0.8, 1.2):
                        np.testing.assert_allclose(at(axes, x * along, y * factor), expected, atol=CHANNEL)


def assert_eccentricities(axes):
    """Ticks stand at 1 - e, with e growing upwards from a circle to the last orbit."""
    places = artists.ticks(axes.yaxis)
    assert places == {text: pytest.approx(1 - float(text), rel=1e-12) for text in places}
    assert list(places) == ["0", "0.5", "0.8", "0.9", "0.95", "0.98", "0.99"]
    assert axes.get_ylim() == (1.0, pytest.approx(0.01, rel=1e-12))
    assert axes.get_yscale() == "log"


def test_map_colour_bars_and_legends_explain_colours(kepler):
    _, figure, _ = kepler
    for part in figure.subfigs[:2]:
        bar = part.axes[-1]
        assert_decades(bar.get_ylim(), artists.ticks(bar.yaxis), -10, [axes.collections[0] for axes in maps_of(part)])
        assert to_hex(artists.entries(part.legends[0])["lost"][0].get_facecolor()) == "#b8b8b8"


def test_white_map_line_is_method_contour_on_energy_map_only():
    cube = orbits()
    energy, advance, _ = figures.kepler_stability(cube).subfigs
    for axes, name in zip(maps_of(energy), METHODS, strict=True):
        contour = artists.line_of(axes, cube.evaluations_for_contour.sel(integrator=name), 1 - cube.eccentricity)
        assert artists.look(contour) == ("#ffffff", None, None, artists.SOLID)
        assert artists.drawn(contour).tolist() == [True] * 5 + [False]
    assert not any(axes.get_lines() for axes in maps_of(advance))


@pytest.mark.slow
def test_panel_c_shows_contour_of_each_method_named_in_legend():
    cube = orbits()
    part = figures.kepler_stability(cube).subfigs[2]
    (axes,) = part.axes
    for name in METHODS:
        (contour,) = artists.lines_of(axes, cube.evaluations_for_contour.sel(integrator=name), 1 - cube.eccentricity)
        assert artists.look(contour) == artists.look_of(name)
    assert len(axes.get_lines()) == len(METHODS)
    assert artists.looks(part.legends[0]) == {label(name): artists.look_of(name) for name in METHODS}
    assert axes.get_title(loc="left") == r"evaluations for $\max\,|\Delta H/H_0| < 10^{-6}$"
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_xscale()) == ("force evaluations per orbit", "e", "log")
    assert_eccentricities(axes)
