"""Ensembles against single runs, other units, synthetic data with known answers, and an integrator written here."""

from __future__ import annotations

from fractions import Fraction
from math import atan2, hypot, log, pi, sqrt

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.engine import batch
from nearharmonic.engine.batch import integrate_batch, kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.experiments.stability.henon_heiles import run as hh
from nearharmonic.experiments.stability.henon_heiles.reduce import trusted_up_to
from nearharmonic.experiments.stability.henon_heiles.run import henon_heiles_surface
from nearharmonic.experiments.stability.initial_conditions import kepler_apoapsis
from nearharmonic.experiments.stability.kepler import run as maps
from nearharmonic.experiments.stability.rounding import run as rounding
from nearharmonic.experiments.stability.rounding.reduce import growth
from nearharmonic.experiments.stability.settings import (
    EnsembleSettings,
    EvaluationsGrid,
    EvenStepSizes,
    MapSettings,
    RoundingSettings,
)
from nearharmonic.integrators.tableau import Tableau


def dataset(contents):
    """The contents of a run file, as they are read from it."""
    return xr.Dataset(contents.variables)


MAP = MapSettings(
    eccentricities=8,
    highest_eccentricity=0.9,
    orbits=4,
    evaluations_per_orbit=EvaluationsGrid(lowest=20.0, highest=5000.0, points_per_decade=10),
)  # fmt: skip


def looked_at(integrator, tau, start, samples=2, **how):
    """Runs of ``start`` at one step size, looked at as the ensembles are."""
    steps, look = hh.schedule(Fraction(100), tau)
    numerics = Numerics(**{"every_step": False, "look": look, **how})
    return integrate_batch(
        nh.systems["henon_heiles"], nh.integrators[integrator], t_end=steps * tau, steps=[steps] * len(start),
        samples=samples, numerics=numerics, start=start,
    )  # fmt: skip


@pytest.mark.parametrize("tau", [Fraction(7, 20), Fraction(22, 10), Fraction(45, 10)])
def test_looks_divide_a_run_that_keeps_its_step_size_and_covers_its_interval(tau):
    steps, look = hh.schedule(Fraction(250), tau)
    assert steps % look == 0
    assert 250 <= steps * tau < 250 + look * tau
    assert steps // look >= hh.LOOKS - 5


@pytest.mark.parametrize("tau", [Fraction(1, 2), Fraction(11, 4)])
def test_a_trajectory_in_an_ensemble_is_the_trajectory_alone_bit_for_bit(monkeypatch, tau):
    """At the larger step size about half of them escape, so that lanes are refilled at different times."""
    start = henon_heiles_surface(Fraction(1, 6), 200, 1)
    widths = []
    monkeypatch.setattr(batch, "kernel_of", lambda *asked: widths.append((found := kernel_of(*asked)).width) or found)
    together = looked_at("aba864", tau, start, width=16)
    alone = looked_at("aba864", tau, start[37::23], width=1)
    assert widths == [16, 1]
    assert (together.left_at > 0).any() == (tau > 1)
    assert np.array_equal(together.max_energy_error[37::23], alone.max_energy_error)
    assert np.array_equal(together.left_at[37::23], alone.left_at)
    assert np.array_equal(together.q[37::23], alone.q, equal_nan=True)


def test_looks_see_the_energy_error_of_their_instants_alone_and_miss_little_of_the_largest():
    """Sampled at the same instants, a run that measures every step has the same errors; between them are larger ones.

    Of 25 looks at an error that swings, the largest reaches half of its amplitude in nearly every run.
    """
    start = henon_heiles_surface(Fraction(1, 12), 64, 1)
    tau = Fraction(7, 10)
    steps, look = hh.schedule(Fraction(100), tau)
    looks = looked_at("aba864", tau, start)
    every = looked_at("aba864", tau, start, every_step=True, look=None, samples=steps // look + 1)
    assert (np.diff(every.marks, axis=1) == look).all()
    assert np.array_equal(looks.max_energy_error, np.abs(every.energy_error).max(axis=1))
    assert (looks.max_energy_error < every.max_energy_error).mean() > 0.5
    assert np.median(looks.max_energy_error / every.max_energy_error) > 0.5
    assert np.isnan(looks.mean_energy_error).all()
    assert (every.mean_energy_error > 0).all()


def test_all_escape_beyond_the_last_linear_limit_and_none_at_a_tenth_of_it():
    """Ruth's steps are unstable for good beyond tau = 1.573401947, of which the origin's neighbourhood knows all."""
    start = np.concatenate(
        [henon_heiles_surface(Fraction(1, 24), 100, 1), henon_heiles_surface(Fraction(1, 6), 100, 1)]
    )
    beyond = hh.integrate_ensemble(nh.integrators["ruth"], Fraction("1.6"), Fraction(250), start, surfaces=2)
    assert beyond.escaped.tolist() == [1.0, 1.0]
    assert np.isinf(beyond.quantiles).all()
    below = hh.integrate_ensemble(nh.integrators["ruth"], Fraction("0.16"), Fraction(250), start, surfaces=2)
    assert below.escaped.tolist() == [0.0, 0.0]
    assert (np.diff(below.quantiles, axis=1) >= 0).all()
    assert np.isfinite(below.quantiles).all()
    # The force is taken three times a step by those that escape as by those that stay; the first stop early.
    assert below.evaluations == 3 * 200 * below.steps
    assert beyond.evaluations < 3 * 200 * beyond.steps


@pytest.mark.parametrize(("tau", "escapes"), [(Fraction(1, 2), False), (Fraction(21, 10), True)])
def test_quantiles_and_fraction_are_those_of_the_sorted_runs(tau, escapes):
    """The quantile f of 30 errors is the smallest that a fraction f of them does not exceed."""
    start = henon_heiles_surface(Fraction(1, 6), 30, 1)
    result = hh.integrate_ensemble(nh.integrators["aba864"], tau, Fraction(100), start, surfaces=1)
    errors = looked_at("aba864", tau, start).max_energy_error
    assert (result.escaped[0] > 0) == escapes
    assert result.escaped[0] == np.isinf(errors).mean()
    expected = [min(e for e in errors if (errors <= e).mean() >= f) for f in hh.QUANTILES]
    assert result.quantiles[0].tolist() == expected


def test_a_step_size_is_trusted_as_far_as_no_smaller_one_loses_too_many():
    escaped = [[0.0, 0.01, 0.02, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]]
    cube = xr.Dataset({"escaped": (("energy", "tau_per_stage"), escaped)}, {"tau_per_stage": [0.1, 0.2, 0.3, 0.4]})
    assert trusted_up_to(cube).values.tolist() == pytest.approx([0.2, np.nan, 0.4], nan_ok=True)


def test_the_ensemble_map_is_bit_for_bit_reproducible_and_depends_on_its_seed():
    grid = EvenStepSizes(lowest="0.2", highest="0.3", spacing="0.1")
    settings = {"trajectories": 20, "energies": ("1/12",), "t_end": "20", "tau_per_stage": grid}
    first, again, other = (
        dataset(hh.ensemble_map(nh.integrators["ruth"], EnsembleSettings(**settings, seed=seed))) for seed in (1, 1, 2)
    )
    assert first.identical(again)
    assert not np.array_equal(first.energy_error, other.energy_error)
    assert first.tau_per_stage.values.tolist() == [0.2, 0.3]


def stepper(tableau, q, p, tau, steps):
    """States (x, y, u, v) of every step of a Kepler orbit, GM = 1, in plain Python."""
    rows = {"drift": [float(c) for c in tableau.drift], "kick": [float(c) for c in tableau.kick]}
    other = "kick" if tableau.first == "drift" else "drift"
    order = [tableau.first, other] * tableau.stages + [tableau.first]
    (x, y), (u, v) = q, p
    for _ in range(steps):
        taken = {"drift": 0, "kick": 0}
        for name in order:
            h = rows[name][taken[name]] * tau
            taken[name] += 1
            if name == "drift":
                x, y = x + h * u, y + h * v
            else:
                r = hypot(x, y)
                u, v = u - h * x / r**3, v - h * y / r**3
        yield x, y, u, v


@pytest.mark.parametrize("integrator", ["ruth", "babs7o7h"])
def test_a_cell_of_the_kepler_map_is_what_a_plain_integrator_finds(integrator):
    """Both round differently, by 1e-16 a step: 1e-12 over a thousand steps, of errors above 1e-4."""
    e, steps, orbits = 0.6, 300, 4
    tableau = nh.integrators[integrator]
    paths = maps.orbit_runs(tableau, steps, orbits, np.array([e]))
    states = list(stepper(tableau, (1 + e, 0.0), (0.0, sqrt((1 - e) / (1 + e))), 2 * pi / steps, steps * orbits))
    errors = [abs((u * u + v * v) / 2 - 1 / hypot(x, y) + 0.5) * 2 for x, y, u, v in states]
    assert paths.max_energy_error[0] == pytest.approx(max(errors), rel=1e-7)
    angles = [pi]  # the perihelion lies opposite to the start
    for x, y, u, v in states[steps - 1 :: steps]:
        L, r = x * v - y * u, hypot(x, y)
        angles.append(atan2(-u * L - y / r, v * L - x / r) % (2 * pi))
    slope = np.polyfit(range(orbits + 1), angles, 1)[0]
    assert maps.perihelion_advance(paths.q, paths.p)[0] == pytest.approx(slope, rel=1e-6)


def test_the_units_of_the_orbit_and_those_of_mercury_give_the_same_error():
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
def test_the_advance_is_the_rate_at_which_an_ellipse_is_turned(rate):
    x, y, _, _, u, v, _, _ = kepler_apoapsis(np.full(9, 0.3), rate * np.arange(9)).T
    advance = maps.perihelion_advance(np.stack([x, y], -1)[None], np.stack([u, v], -1)[None])
    assert advance[0] == pytest.approx(rate, rel=1e-12, abs=1e-15)


def test_an_ellipse_that_turns_by_more_than_a_quarter_has_no_advance():
    x, y, _, _, u, v, _, _ = kepler_apoapsis(np.full(9, 0.3), 1.6 * np.arange(9)).T
    assert np.isnan(maps.perihelion_advance(np.stack([x, y], -1)[None], np.stack([u, v], -1)[None])[0])


def test_orbits_that_are_not_run_would_err_less_than_the_floor():
    tableau = nh.integrators["yoshida_s7o6a"]
    result = dataset(maps.orbit_map(tableau, MAP))
    skipped = np.argwhere(np.isnan(result.energy_error.values))
    assert len(skipped)
    for j in set(skipped[:, 1]):
        assert (result.energy_error[:, j] < maps.FLOOR).sum() == 2
    for i, j in skipped[::4]:
        one = maps.orbit_runs(tableau, int(result.steps_per_orbit[i]), MAP.orbits, result.eccentricity.values[[j]])
        assert one.max_energy_error[0] < maps.FLOOR


def test_a_map_tells_lost_orbits_from_kept_ones_and_circles_from_ellipses():
    result = dataset(maps.orbit_map(nh.integrators["ruth"], MAP))
    lost = np.isinf(result.energy_error)
    assert lost.any()
    assert (result.orbits_kept.where(lost, drop=True) < MAP.orbits).any()
    assert (result.orbits_kept.where(~lost & result.energy_error.notnull(), MAP.orbits) == MAP.orbits).all()
    assert not lost.isel(tau_per_stage=-1, eccentricity=0)
    assert result.perihelion_advance.sel(eccentricity=0).isnull().all()
    assert result.perihelion_advance.isel(tau_per_stage=-1, eccentricity=4).notnull()
    assert result.eccentricity.values[[0, -1]].tolist() == pytest.approx([0, 0.9])
    assert np.diff(np.log(1 - result.eccentricity)) == pytest.approx(log(0.1) / 7)


def test_the_contour_of_a_power_law_is_where_algebra_puts_it():
    """100 n^-4 meets 1e-6 at n = 1e2; from 1e9 n^-4 on the curve never does; what is not run counts as below."""
    n = np.array([10.0, 30.0, 90.0, 300.0, 1000.0])
    error = np.stack([100 * n**-4, 1e9 * n**-4, np.where(n > 200, np.nan, 100 * n**-4)], axis=1)
    error[0, 0] = np.inf
    found = maps.evaluations_below(n, error, 1e-6)
    assert found[0] == pytest.approx(100, rel=1e-12)
    assert np.isnan(found[1])
    assert found[2] == pytest.approx(300, rel=1e-12)
    dip = np.array([1e-7, 1e-3, 1e-7, 1e-5, 1e-9])[:, None]  # a dip below the level is not yet the end
    assert maps.evaluations_below(n, dip, 1e-6)[0] == pytest.approx(300 * (10 / 3) ** 0.25, rel=1e-12)


LONG = RoundingSettings(ensemble=32, steps=40_000, evaluations_per_orbit=400, seed=1)


@pytest.fixture(scope="module")
def lost_digits():
    return dataset(rounding.rounding_errors(nh.integrators["aba104"], LONG))


def law(result, source, variable):
    return growth(result[variable].sel(source=source).values, result.time.values)


def test_rounding_grows_as_brouwer_says_in_every_arithmetic(lost_digits):
    """The 95 % interval, and half as much again because six exponents are tested at once."""
    for source in ("plain", "compensated", "extended"):
        for variable, exponent in (("energy_error", 0.5), ("lag", 1.5)):
            one = law(lost_digits, source, variable)
            assert one["interval"] < 0.2
            assert abs(one["exponent"] - exponent) < 1.5 * one["interval"]
            assert one["bias"] < 0.75 * one["rms"]  # four standard errors, 1/sqrt(32), of a mean without bias


def test_compensation_gains_an_order_of_magnitude_and_double_double_its_digits(lost_digits):
    """Unit roundoff is 2^-53 and 2^-106 or so: 16 digits apart, of which a random walk of 1e5 operations keeps 14."""
    rms = {source: law(lost_digits, source, "energy_error")["rms"] for source in rounding.SOURCES}
    assert rms["plain"] > 10 * rms["compensated"]
    assert rms["compensated"] > 1e13 * rms["extended"]
    assert rms["extended"] > 1e-32


def test_rounded_coefficients_alone_shift_the_phase_in_proportion_to_time(lost_digits):
    one = law(lost_digits, "coefficients", "lag")
    assert one["exponent"] == pytest.approx(1, abs=0.01)
    assert one["rms"] > 1e-15


def test_coefficients_that_are_doubles_shift_nothing():
    """Leapfrog's 1/2 and 1 times a period over 64 are doubles: what is left is the rounding of double-double."""
    leapfrog = Tableau(
        name="leapfrog", label="leapfrog", order=2, first="kick", kick=("0.5", "0.5"), drift=("1",), source="here",
        digits=30,
    )  # fmt: skip
    settings = RoundingSettings(ensemble=3, steps=2000, evaluations_per_orbit=64, seed=1)
    assert np.abs(dataset(rounding.rounding_errors(leapfrog, settings)).lag.sel(source="coefficients")).max() < 1e-25


def test_the_scaled_orbit_is_the_same_orbit():
    """Lengths times 9 and momenta over 3 leave the eccentricity; H/9 to the rounding of double-double, 2^-105."""
    start = rounding.starts(LONG)
    scaled = rounding._scaled(start)
    for row, large in zip(start[:4], scaled[:4], strict=True):
        for k, factor in ((0, 9), (1, 9), (4, Fraction(1, 3)), (5, Fraction(1, 3))):
            exact = Fraction(row[k]) * factor
            assert abs(Fraction(large[k]) + Fraction(large[k + 2]) - exact) <= abs(exact) / 2**105


def test_errors_are_those_that_were_put_in():
    """A run moved by 1e-9 along its velocity lags by 1e-9 over its speed; a faster one has p dp more energy."""
    from dataclasses import replace

    paths = integrate_batch(
        maps.SYSTEM, nh.integrators["ruth"], t_end=Fraction(6), steps=[60], samples=2,
        start=kepler_apoapsis(np.array([0.3])),
    )  # fmt: skip
    q, p = paths.q[0, -1], paths.p[0, -1]
    speed = float(np.hypot(*p))
    moved, faster = paths.q.copy(), paths.p.copy()
    moved[0, -1] += 1e-9 * p / speed
    faster[0, -1] *= 1 + 1e-9
    last = np.array([1])
    energy, lag = rounding.errors(rounding._Paths(replace(paths, q=moved)), rounding._Paths(paths), last)
    assert lag[0, 0] == pytest.approx(1e-9 / speed, rel=1e-6)  # 1e-16 of q in a step of 1e-9
    assert energy[0, 0] == pytest.approx(2 * 1e-9 * float(q @ p) / speed / float(np.hypot(*q)) ** 3, rel=1e-5)
    energy, lag = rounding.errors(rounding._Paths(replace(paths, p=faster)), rounding._Paths(paths), last)
    assert energy[0, 0] == pytest.approx(2e-9 * speed**2, rel=1e-6)
    assert lag[0, 0] == 0


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5])
def test_the_growth_of_a_power_law_is_its_exponent(exponent):
    time, size = np.geomspace(1, 1000, 30), np.array([1.0, -2.0, 0.5, 3.0])
    found = growth(size[:, None] * time**exponent, time)
    assert found["exponent"] == pytest.approx(exponent, rel=1e-12)
    assert found["interval"] < 1e-12
    assert found["rms"] == pytest.approx(1000**exponent * sqrt((1 + 4 + 0.25 + 9) / 4), rel=1e-12)
    assert found["bias"] == pytest.approx(1000**exponent * 2.5 / 4, rel=1e-12)


def test_intervals_hold_the_exponent_of_random_walks_as_often_as_they_say():
    """95 % of 200 ensembles, give or take three standard errors of 1.5 %; jackknifed intervals run a little short."""
    rng = np.random.default_rng(1)
    steps = np.unique(np.geomspace(1, 1000, 30).astype(int))
    held = 0
    for _ in range(200):
        walks = rng.standard_normal((24, 1000)).cumsum(axis=1)[:, steps - 1]
        found = growth(walks, steps.astype(float))
        held += abs(found["exponent"] - 0.5) < found["interval"]
    assert 0.88 < held / 200 <= 1


@pytest.mark.parametrize("stages", [1, 3, 9])
def test_samples_of_long_runs_are_whole_periods_apart(stages):
    settings = RoundingSettings(ensemble=3, steps=1_000_000, evaluations_per_orbit=400, seed=1)
    plan = rounding.schedule(settings, stages)
    per_orbit = round(400 / stages)
    assert plan.samples == rounding.SAMPLES
    assert plan.steps == plan.periods * per_orbit
    assert plan.periods % plan.samples == 0
    assert 1_000_000 <= plan.steps < 1_000_000 + per_orbit * plan.samples


def test_warming_up_compiles_what_the_runs_use():
    for module, uses in (
        (hh, [("henon_heiles", "double", "compensated", False)]),
        (maps, [("kepler", "double", "compensated", True)]),
        (
            rounding,
            [
                ("kepler", p, s, False)
                for p, s in (("double", "plain"), ("double", "compensated"), ("extended", "compensated"))
            ],
        ),
    ):
        kernel_of.cache_clear()
        assert module.warm_up() == {}
        before = kernel_of.cache_info().misses
        for system, precision, summation, every_step in uses:
            problem = nh.systems["henon_heiles"] if system == "henon_heiles" else maps.SYSTEM
            how = {"precision": precision, "summation": summation, "width": module.WIDTH, "every_step": every_step}
            kernel_of(problem, Numerics(**how))
        assert kernel_of.cache_info().misses == before
