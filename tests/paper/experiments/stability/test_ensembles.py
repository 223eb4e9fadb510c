"""Ensembles against single runs, other units, synthetic data with known answers, and an integrator written here."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.engine import batch
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic_paper.experiments.stability import run
from nearharmonic_paper.experiments.stability.run import henon_heiles_surface
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings, EvenStepSizes


def dataset(contents):
    """The contents of a run file, as they are read from it."""
    return xr.Dataset(contents["run"].variables)


def looked_at(integrator, tau, start, samples=2, **how):
    """Runs of ``start`` at one step size, looked at as the ensembles are."""
    steps, look = run.henon_heiles_schedule(Fraction(100), tau)
    numerics = Numerics(**{"energy": "samples", "look": look, **how})
    return integrate_batch(
        nh.systems["henon_heiles"], nh.integrators[integrator], t_end=steps * tau, steps=[steps] * len(start),
        samples=samples, numerics=numerics, start=start,
    )  # fmt: skip


@pytest.mark.parametrize("tau", [Fraction(7, 20), Fraction(22, 10), Fraction(45, 10)])
def test_looks_divide_run_without_change_of_step_or_interval(tau):
    steps, look = run.henon_heiles_schedule(Fraction(250), tau)
    assert steps % look == 0
    assert 250 <= steps * tau < 250 + look * tau
    assert steps // look >= run.LOOKS - 5


@pytest.mark.parametrize("tau", [Fraction(1, 2), Fraction(11, 4)])
def test_trajectory_in_ensemble_is_trajectory_alone_bit_for_bit(monkeypatch, tau):
    """At the larger step size about half of them escape, so that lanes are refilled at different times."""
    start = henon_heiles_surface(Fraction(1, 6), 200, 1)
    widths = []
    monkeypatch.setattr(
        batch, "kernel_of", lambda *asked, **how: widths.append((found := kernel_of(*asked, **how)).width) or found
    )
    together = looked_at("aba864", tau, start, width=16)
    alone = looked_at("aba864", tau, start[37::23], width=1)
    assert widths == [16, 1]
    assert (together.left_at > 0).any() == (tau > 1)
    assert np.array_equal(together.max_energy_error[37::23], alone.max_energy_error)
    assert np.array_equal(together.left_at[37::23], alone.left_at)
    assert np.array_equal(together.q[37::23], alone.q, equal_nan=True)


def test_looks_measure_energy_only_at_their_instants():
    """Sampled at the same instants, a run that measures every step has the same errors; between them are larger ones.

    Of 25 looks at an error that swings, the largest reaches half of its amplitude in nearly every run.
    """
    start = henon_heiles_surface(Fraction(1, 12), 64, 1)
    tau = Fraction(7, 10)
    steps, look = run.henon_heiles_schedule(Fraction(100), tau)
    looks = looked_at("aba864", tau, start)
    every = looked_at("aba864", tau, start, energy="every", look=None, samples=steps // look + 1)
    assert (np.diff(every.marks, axis=1) == look).all()
    assert np.array_equal(looks.max_energy_error, np.abs(every.energy_error).max(axis=1))
    assert (looks.max_energy_error < every.max_energy_error).mean() > 0.5
    assert np.median(looks.max_energy_error / every.max_energy_error) > 0.5
    assert np.isnan(looks.mean_energy_error).all()
    assert (every.mean_energy_error > 0).all()


def test_all_escape_beyond_last_linear_limit_none_at_its_tenth():
    """Ruth's steps are unstable for good beyond tau = 1.573401947, of which the origin's neighbourhood knows all."""
    start = np.concatenate(
        [henon_heiles_surface(Fraction(1, 24), 100, 1), henon_heiles_surface(Fraction(1, 6), 100, 1)]
    )
    beyond = run.integrate_ensemble(nh.integrators["ruth"], Fraction("1.6"), Fraction(250), start, surfaces=2)
    assert beyond.escaped.tolist() == [1.0, 1.0]
    assert np.isinf(beyond.quantiles).all()
    below = run.integrate_ensemble(nh.integrators["ruth"], Fraction("0.16"), Fraction(250), start, surfaces=2)
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
    result = run.integrate_ensemble(nh.integrators["aba864"], tau, Fraction(100), start, surfaces=1)
    errors = looked_at("aba864", tau, start).max_energy_error
    assert (result.escaped[0] > 0) == escapes
    assert result.escaped[0] == np.isinf(errors).mean()
    expected = [min(e for e in errors if (errors <= e).mean() >= f) for f in run.QUANTILES]
    assert result.quantiles[0].tolist() == expected


def test_ensemble_map_is_bitwise_reproducible_and_depends_on_seed():
    grid = EvenStepSizes(lowest="0.2", highest="0.3", spacing="0.1")
    settings = {"trajectories": 20, "energies": ("1/12",), "t_end": "20", "tau_per_stage": grid}
    first, again, other = (
        dataset(run.henon_heiles_measure("ruth", EnsembleSettings(**settings, seed=seed))) for seed in (1, 1, 2)
    )
    assert first.identical(again)
    assert not np.array_equal(first.energy_error, other.energy_error)
    assert first.tau_per_stage.values.tolist() == [0.2, 0.3]


@pytest.mark.slow
def test_warming_up_compiles_what_the_runs_use():
    for ensemble, uses in (
        ("henon_heiles", [("henon_heiles", "double", "compensated", "samples")]),
        ("kepler", [("kepler", "double", "compensated", "every")]),
        (
            "rounding",
            [
                ("kepler", p, s, "samples")
                for p, s in (("double", "plain"), ("double", "compensated"), ("extended", "compensated"))
            ],
        ),
    ):
        kernel_of.cache_clear()
        assert run.warm_up(ensemble) == {}
        before = kernel_of.misses
        for system, precision, summation, energy in uses:
            problem = nh.systems["henon_heiles"] if system == "henon_heiles" else run.SYSTEM
            how = {"precision": precision, "summation": summation, "width": run.WIDTH, "energy": energy}
            kernel_of(problem, Numerics(**how))
        assert kernel_of.misses == before
