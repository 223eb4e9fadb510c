"""The maps of the stress tests: what is black, what is light, and that all methods are there."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.integrators import integrators
from nearharmonic.render import henon_heiles_stability, kepler_stability, rounding_growth
from nearharmonic.render.style import save
from nearharmonic.stability import henon_heiles_ensemble, kepler_maps
from nearharmonic.stability import rounding_growth as growth
from nearharmonic.stability.cubes import REDUCTIONS
from nearharmonic.stability.settings import EnsembleSettings, MapSettings, RoundingSettings

METHODS = ("ruth", "babps9o7h")
SMALL = {
    "henon_heiles": (
        henon_heiles_ensemble,
        EnsembleSettings(
            trajectories=10, energies=("1/24", "1/6"), t_end="20", lowest="0.1", highest="0.7", spacing="0.1", seed=1
        ),
    ),
    "kepler": (
        kepler_maps,
        MapSettings(eccentricities=6, highest_eccentricity=0.9, orbits=3, fewest=10, most=1000, points_per_decade=4),
    ),
    "rounding": (growth, RoundingSettings(ensemble=3, steps=8000, evaluations_per_orbit=400, seed=1)),
}
RENDERERS = {"henon_heiles": henon_heiles_stability, "kepler": kepler_stability, "rounding": rounding_growth}


@pytest.fixture(scope="module")
def cubes():
    made = {}
    for name, (module, settings) in SMALL.items():
        made[name] = REDUCTIONS[name].cube({m: module.run(integrators[m], settings) for m in METHODS})
    return made


@pytest.mark.parametrize("name", SMALL)
def test_every_variable_has_units_and_a_meaning(cubes, name):
    for variable in cubes[name].variables.values():
        assert {"units", "long_name"} <= set(variable.attrs)


@pytest.mark.parametrize("name", SMALL)
def test_a_table_has_a_full_row_for_each_combination(cubes, name):
    header, rows = REDUCTIONS[name].rows(cubes[name])
    assert {len(row) for row in rows} == {len(header)}
    assert {row[0] for row in rows} == set(METHODS)
    assert len(rows) == {"henon_heiles": 2 * 2, "kepler": 2, "rounding": 2 * 4 * 2}[name]


@pytest.mark.parametrize("name", SMALL)
def test_a_figure_is_written_and_the_same_each_time(cubes, name, tmp_path):
    first = save(RENDERERS[name].figure(cubes[name]), tmp_path / "first")
    again = save(RENDERERS[name].figure(cubes[name]), tmp_path / "again")
    assert [path.suffix for path in first] == [".pdf", ".svg", ".png"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in again]


@pytest.mark.parametrize("name", SMALL)
def test_one_method_alone_can_be_drawn(cubes, name, tmp_path):
    assert save(RENDERERS[name].figure(cubes[name].isel(integrator=[0])), tmp_path / "one")[2].stat().st_size > 5000


def test_black_is_where_more_than_one_percent_escaped(cubes):
    cube = cubes["henon_heiles"]
    figure = henon_heiles_stability.figure(cube)
    for axes, method in zip(figure.axes, METHODS, strict=False):
        shown = axes.images[0].get_array()
        assert np.array_equal(np.ma.getmaskarray(shown), cube.escaped.sel(integrator=method).values > 0.01)
        median = cube.energy_error.sel(integrator=method, quantile=0.5).values
        assert shown.compressed() == pytest.approx(np.log10(median[~shown.mask]))
        assert axes.get_ylabel() == integrators[method].label
    assert cube.escaped.max() > 0.01 > cube.escaped.min()


def test_black_is_where_the_orbit_was_lost_and_lightest_where_it_need_not_run(cubes):
    cube = cubes["kepler"].sel(integrator="babps9o7h")
    part = kepler_stability.figure(cubes["kepler"]).subfigs[0]
    shown = part.axes[1].collections[0].get_array()
    _, first = np.unique(cube.evaluations_per_orbit, return_index=True)
    error = cube.energy_error.transpose("eccentricity", "tau_per_stage").values[:, first]
    assert np.array_equal(np.ma.getmaskarray(shown), np.isinf(error))
    assert np.isinf(error).any()
    assert np.isnan(error).any()
    assert (shown[np.isnan(error)] == -10).all()


def test_curves_are_the_root_mean_squares_and_bars_the_intervals(cubes):
    cube = cubes["rounding"]
    energy, lag, exponents, _ = rounding_growth.figure(cube).axes
    curves = [line.get_ydata() for line in energy.lines]
    for method in METHODS:
        for source in ("plain", "compensated", "extended"):
            errors = cube.energy_error.sel(integrator=method, source=source).transpose("orbit", "sample").values
            rms = np.sqrt((errors**2).sum(axis=0) / len(errors))
            assert any(np.allclose(rms, curve, rtol=1e-12, atol=0) for curve in curves if len(curve) == len(rms))
    assert len(lag.lines) == 2 * 4 + 3
    assert len(exponents.containers) == 2 * 3
