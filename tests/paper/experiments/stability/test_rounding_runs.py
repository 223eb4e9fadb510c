"""Lost digits: Brouwer's powers in every arithmetic, and synthetic random walks whose exponent is known."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch
from nearharmonic_paper.experiments.stability import run as maps
from nearharmonic_paper.experiments.stability import run as rounding
from nearharmonic_paper.experiments.stability.reductions import OF_ROUNDING as reduction
from nearharmonic_paper.experiments.stability.run import kepler_apoapsis
from nearharmonic_paper.experiments.stability.settings import RoundingSettings


def dataset(contents):
    """The contents of a run file, as they are read from it."""
    return xr.Dataset(contents["run"].variables)


LONG = RoundingSettings(ensemble=32, steps=40_000, evaluations_per_orbit=400, seed=1)


@pytest.fixture(scope="module")
def lost_digits():
    return dataset(rounding.rounding_measure("aba104", LONG))


def law(result, source, variable):
    found = reduction.of(result, over="orbit").sel(source=source).isel(sample=-1)
    return {key: found[f"{variable}_{key}"].item() for key in ("exponent", "interval", "rms", "bias")}


@pytest.mark.slow
def test_rounding_grows_as_brouwer_says_in_every_arithmetic(lost_digits):
    """The 95 % interval, and half as much again because six exponents are tested at once."""
    for source in ("plain", "compensated", "extended"):
        for variable, exponent in (("energy_error", 0.5), ("lag", 1.5)):
            one = law(lost_digits, source, variable)
            assert one["interval"] < 0.2
            assert abs(one["exponent"] - exponent) < 1.5 * one["interval"]
            assert one["bias"] < 0.75 * one["rms"]  # four standard errors, 1/sqrt(32), of a mean without bias


def test_compensation_gains_order_of_magnitude_and_double_double_its_digits(lost_digits):
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
    settings = RoundingSettings(ensemble=3, steps=2000, evaluations_per_orbit=64, seed=1)
    assert np.abs(dataset(rounding.rounding_measure("leapfrog", settings)).lag.sel(source="coefficients")).max() < 1e-25


def test_the_scaled_orbit_is_the_same_orbit():
    """Lengths times 9 and momenta over 3 leave the eccentricity; H/9 to the rounding of double-double, 2^-105."""
    start = rounding.rounding_starts(LONG)
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
    energy, lag = rounding.errors(rounding.states(replace(paths, q=moved), last), rounding.states(paths, last))
    assert lag[0, 0] == pytest.approx(1e-9 / speed, rel=1e-6)  # 1e-16 of q in a step of 1e-9
    assert energy[0, 0] == pytest.approx(2 * 1e-9 * float(q @ p) / speed / float(np.hypot(*q)) ** 3, rel=1e-5)
    energy, lag = rounding.errors(rounding.states(replace(paths, p=faster), last), rounding.states(paths, last))
    assert energy[0, 0] == pytest.approx(2e-9 * speed**2, rel=1e-6)
    assert lag[0, 0] == 0


@pytest.mark.parametrize("stages", [1, 3, 9])
def test_samples_of_long_runs_are_whole_periods_apart(stages):
    settings = RoundingSettings(ensemble=3, steps=1_000_000, evaluations_per_orbit=400, seed=1)
    plan = rounding.rounding_schedule(settings, stages)
    per_orbit = round(400 / stages)
    assert plan.samples == rounding.ROUNDING_SAMPLES
    assert plan.steps == plan.periods * per_orbit
    assert plan.periods % plan.samples == 0
    assert 1_000_000 <= plan.steps < 1_000_000 + per_orbit * plan.samples
