"""The Kepler map against steps in multiprecision, other units, and synthetic data with known answers."""

from __future__ import annotations

from dataclasses import replace
from math import atan2, hypot, log, pi, sqrt

import numpy as np
import pytest
import xarray as xr
from mpmath import mpf

import nearharmonic as nh
from nearharmonic_paper.experiments.stability import run as maps
from nearharmonic_paper.experiments.stability.reductions import (
    evaluations_below,
    kepler_cube,
    rotation_per_sample,
    stacked,
)
from nearharmonic_paper.experiments.stability.run import kepler_apoapsis
from nearharmonic_paper.experiments.stability.settings import EvaluationsGrid, MapSettings
from support.oracles.multiprecision import trajectory


def dataset(contents):
    """The contents of a run file, as they are read from it."""
    return xr.Dataset(contents["run"].variables)


MAP = MapSettings(
    eccentricities=8,
    highest_eccentricity=0.9,
    orbits=4,
    evaluations_per_orbit=EvaluationsGrid(lowest=20.0, highest=5000.0, points_per_decade=10),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["ruth", "babs7o7h"])
def test_cell_of_kepler_map_is_what_plain_integrator_finds(integrator):
    """Both round differently, by 1e-16 a step: 1e-12 over a thousand steps, of errors above 1e-4."""
    e, steps, orbits = 0.6, 300, 4
    tableau = nh.integrators[integrator]
    paths = maps.orbit_runs(tableau, steps, orbits, np.array([e]))
    units = replace(nh.systems["kepler"], parameters={"GM": replace(nh.systems["kepler"].parameters["GM"], value="1")})
    start = [mpf(1 + e), mpf(0)], [mpf(0), mpf(sqrt((1 - e) / (1 + e)))]
    _, *run = trajectory(tableau, units, mpf(2 * pi / steps), steps * orbits, start)
    states = [[float(x) for x in (*q, *p)] for q, p in run]
    errors = [abs((u * u + v * v) / 2 - 1 / hypot(x, y) + 0.5) * 2 for x, y, u, v in states]
    assert paths.max_energy_error[0] == pytest.approx(max(errors), rel=1e-7)
    angles = [pi]  # the perihelion lies opposite to the start
    for x, y, u, v in states[steps - 1 :: steps]:
        L, r = x * v - y * u, hypot(x, y)
        angles.append(atan2(-u * L - y / r, v * L - x / r) % (2 * pi))
    slope = np.polyfit(range(orbits + 1), angles, 1)[0]
    assert rotation_per_sample(paths.q, paths.p)[0] == pytest.approx(slope, rel=1e-6)


def test_units_of_orbit_and_those_of_mercury_give_same_error():
    """e from NSSDC's aphelion and slowest speed; the two runs round differently, by 1e-15 of an error of 1e-4."""
    kepler = nh.systems["kepler"]
    r, v, GM = float(kepler.q0[0]), float(kepler.p0[1]), float(kepler.parameters["GM"].value)
    a = 1 / (2 / r - v**2 / GM)
    period = 2 * pi * sqrt(a**3 / GM)
    mercury = nh.sweep("kepler", "aba864", [period / 20], t_end=4 * period)
    ours = maps.orbit_runs(nh.integrators["aba864"], 20, 4, np.array([r / a - 1]))
    assert mercury.steps.item() == 80
    assert ours.max_energy_error[0] == pytest.approx(mercury.max_energy_error.item(), rel=1e-9)


@pytest.mark.parametrize("rate", [1e-9, -1e-3, 0.7, -1.5])
def test_advance_is_rate_at_which_ellipse_is_turned(rate):
    x, y, _, _, u, v, _, _ = kepler_apoapsis(np.full(9, 0.3), rate * np.arange(9)).T
    advance = rotation_per_sample(np.stack([x, y], -1)[None], np.stack([u, v], -1)[None])
    assert advance[0] == pytest.approx(rate, rel=1e-12, abs=1e-15)


def test_ellipse_that_turns_by_more_than_quarter_has_no_advance():
    x, y, _, _, u, v, _, _ = kepler_apoapsis(np.full(9, 0.3), 1.6 * np.arange(9)).T
    assert np.isnan(rotation_per_sample(np.stack([x, y], -1)[None], np.stack([u, v], -1)[None])[0])


def test_orbits_that_are_not_run_would_err_less_than_floor():
    tableau = nh.integrators["yoshida_s7o6a"]
    result = dataset(maps.kepler_measure("yoshida_s7o6a", MAP))
    skipped = np.argwhere(np.isnan(result.energy_error.values))
    assert len(skipped)
    for j in set(skipped[:, 1]):
        assert (result.energy_error[:, j] < maps.FLOOR).sum() == 2
    for i, j in skipped[::4]:
        one = maps.orbit_runs(tableau, int(result.steps_per_orbit[i]), MAP.orbits, result.eccentricity.values[[j]])
        assert one.max_energy_error[0] < maps.FLOOR


def test_map_separates_lost_from_kept_orbits_and_circles_from_ellipses():
    result = kepler_cube(stacked(["ruth"], [dataset(maps.kepler_measure("ruth", MAP))])).isel(integrator=0)
    lost = np.isinf(result.energy_error)
    assert lost.any()
    assert (result.orbits_kept.where(lost, drop=True) < MAP.orbits).any()
    assert (result.orbits_kept.where(~lost & result.energy_error.notnull(), MAP.orbits) == MAP.orbits).all()
    assert not lost.isel(tau_per_stage=-1, eccentricity=0)
    assert result.perihelion_advance.sel(eccentricity=0).isnull().all()
    assert result.perihelion_advance.isel(tau_per_stage=-1, eccentricity=4).notnull()
    assert result.eccentricity.values[[0, -1]].tolist() == pytest.approx([0, 0.9])
    assert np.diff(np.log(1 - result.eccentricity)) == pytest.approx(log(0.1) / 7)


def test_contour_of_power_law_is_where_algebra_puts_it():
    """100 n^-4 meets 1e-6 at n = 1e2; from 1e9 n^-4 on the curve never does; what is not run counts as below."""
    n = np.array([10.0, 30.0, 90.0, 300.0, 1000.0])
    error = np.stack([100 * n**-4, 1e9 * n**-4, np.where(n > 200, np.nan, 100 * n**-4)], axis=1)
    error[0, 0] = np.inf
    found = [evaluations_below(n, column, 1e-6) for column in error.T]
    assert found[0] == pytest.approx(100, rel=1e-12)
    assert np.isnan(found[1])
    assert found[2] == pytest.approx(300, rel=1e-12)
    dip = np.array([1e-7, 1e-3, 1e-7, 1e-5, 1e-9])  # a dip below the level is not yet the end
    assert evaluations_below(n, dip, 1e-6) == pytest.approx(300 * (10 / 3) ** 0.25, rel=1e-12)
