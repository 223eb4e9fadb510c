"""Maps of the stress tests: the colour at each place of the picture is that of the number that belongs there."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_hex

from nearharmonic_paper.experiments.stability.figures import henon_heiles_stability, kepler_stability
from support.cubes.artists import (
    SOLID,
    drawn,
    entries,
    line_of,
    lines_of,
    look,
    look_of,
    looks,
    pixels,
    ticks,
)
from support.cubes.figure_cubes import METHODS, label
from support.cubes.stability_cubes import LOST, TURNED, ensembles, orbits

#: A colour of the picture has 8 bits a channel, a colour map 256 entries.
CHANNEL = 1.01 / 255
#: Where there is no number to show.
GREY = np.full(3, 0xB8 / 255)


def shade(colours, value, low, high):
    """The colour of a decimal logarithm between those of ``low`` and ``high``."""
    return np.array(colormaps[colours]((np.log10(value) - np.log10(low)) / (np.log10(high) - np.log10(low)))[:3])


# Henon-Heiles


@pytest.fixture(scope="module")
def henon_heiles():
    cube = ensembles()
    figure = henon_heiles_stability(cube)
    return cube, figure, [axes for axes in figure.axes if axes.images], pixels(figure)


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
        assert ticks(axes.yaxis) == {"1/24": 0, "1/8": 1, "1/6": 2}
        heights = [axes.transData.transform((0.3, row))[1] for row in range(3)]
        assert heights == sorted(heights, reverse=True)
    assert maps[-1].get_xlabel() == r"step size per stage, $\tau/s$"
    assert maps[0].get_position().y0 > maps[1].get_position().y0 > maps[2].get_position().y0


def test_white_edged_line_is_at_first_linear_limit_inside_map():
    cube = ensembles()
    cube["linear_limit"] = ("integrator", [0.27, 0.56, 0.35])
    figure = henon_heiles_stability(cube)
    maps = [axes for axes in figure.axes if axes.images]
    colour = look(entries(figure.legends[0])["first linear limit"][0])
    assert colour[1] is None
    for axes, limits in zip(maps, ([0.27], [], [0.35]), strict=True):
        lines = [line for line in axes.get_lines() if look(line) == colour]
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
    assert bar.get_title() == r"median over the ensemble of $\max\,|\Delta H/H_0|$"
    assert bar.get_xlim() == pytest.approx((-8, 0), abs=1e-12)
    assert ticks(bar.xaxis) == {rf"$10^{{{k}}}$": pytest.approx(k, abs=1e-12) for k in (-8, -6, -4, -2, 0)}
    assert [axes.images[0].get_clim() for axes in maps] == [bar.get_xlim()] * len(METHODS)


# Kepler


@pytest.fixture(scope="module")
def kepler():
    cube = orbits()
    cube["evaluations_for_contour"] *= np.nan  # no white line over the cells
    figure = kepler_stability(cube)
    return cube, figure, pixels(figure)


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
    places = ticks(axes.yaxis)
    assert places == {text: pytest.approx(1 - float(text), rel=1e-12) for text in places}
    assert list(places) == ["0", "0.5", "0.8", "0.9", "0.95", "0.98", "0.99"]
    assert axes.get_ylim() == (1.0, pytest.approx(0.01, rel=1e-12))
    assert axes.get_yscale() == "log"


def test_map_colour_bars_and_legends_explain_colours(kepler):
    _, figure, _ = kepler
    for part in figure.subfigs[:2]:
        bar = part.axes[-1]
        assert bar.get_ylim() == pytest.approx((-10, 0), abs=1e-12)
        assert ticks(bar.yaxis) == {rf"$10^{{{k}}}$": pytest.approx(k, abs=1e-12) for k in (-10, -8, -6, -4, -2, 0)}
        assert [axes.collections[0].get_clim() for axes in maps_of(part)] == [bar.get_ylim()] * len(METHODS)
        assert to_hex(entries(part.legends[0])["lost"][0].get_facecolor()) == "#b8b8b8"


def test_white_map_line_is_method_contour_on_energy_map_only():
    cube = orbits()
    energy, advance, _ = kepler_stability(cube).subfigs
    for axes, name in zip(maps_of(energy), METHODS, strict=True):
        contour = line_of(axes, cube.evaluations_for_contour.sel(integrator=name), 1 - cube.eccentricity)
        assert look(contour) == ("#ffffff", None, None, SOLID)
        assert drawn(contour).tolist() == [True] * 5 + [False]
    assert not any(axes.get_lines() for axes in maps_of(advance))


@pytest.mark.slow
def test_panel_c_shows_contour_of_each_method_named_in_legend():
    cube = orbits()
    part = kepler_stability(cube).subfigs[2]
    (axes,) = part.axes
    for name in METHODS:
        (contour,) = lines_of(axes, cube.evaluations_for_contour.sel(integrator=name), 1 - cube.eccentricity)
        assert look(contour) == look_of(name)
    assert len(axes.get_lines()) == len(METHODS)
    assert looks(part.legends[0]) == {label(name): look_of(name) for name in METHODS}
    assert axes.get_title(loc="left") == r"$\mathbf{C}$  evaluations for $\max\,|\Delta H/H_0| < 10^{-6}$"
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_xscale()) == ("force evaluations per orbit", "e", "log")
    assert_eccentricities(axes)
