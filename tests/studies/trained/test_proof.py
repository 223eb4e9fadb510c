"""The proof: gains and intervals against known numbers, errors against a plain loop, tables and settings."""

from __future__ import annotations

from dataclasses import replace
from math import log10, sqrt

import numpy as np
import pytest
import xarray as xr
import yaml

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic_paper.config import load
from nearharmonic_paper.tasks import job
from nearharmonic_studies.trained.contestants import contestants, exact_contestants, idea_of, kind_of
from nearharmonic_studies.trained.problems import NAMED, named_ensemble
from nearharmonic_studies.trained.proof_reductions import (
    gain_table,
    gains,
    method_table,
    reduce,
    reduction,
    stretch,
    verdict,
)
from nearharmonic_studies.trained.proof_settings import ProofSettings
from nearharmonic_studies.trained.resampling import _means, resampled_means
from nearharmonic_studies.trained.run import log_errors, proof_ensembles
from nearharmonic_studies.trained.run import proof_measure as measure
from support.oracles.plain_runs import (
    henon_heiles_energy,
    henon_heiles_gradient,
    henon_heiles_gradient_of_square,
    largest_error,
)  # fmt: skip

pytestmark = pytest.mark.slow

SMALL = ProofSettings(
    systems=4, t_end="12", tau_per_stage=("0.05", "0.1"), evaluations_per_orbit=(60,)
)  # fmt: skip
#: Two published methods, one of this project, and two with kicks of a modified potential, a published one and an own.
METHODS = ("babps8o7h", "srkn_b11", "babs8o6_7h", "chin_4a", "abag5o6")


def curves(best_published, best_trained, noise, count, seed=1):
    """Logarithms (4, 2, count): two published methods, two trained ones; of each the first is best at first."""
    random = np.random.default_rng(seed)
    means = np.array([best_published, best_published[::-1], best_trained, best_trained[::-1]], dtype=float)
    return means[:, :, None] + noise * random.normal(size=(4, 2, count))


KINDS = ("published", "published", "trained", "trained")


def runs(logarithms, kinds=KINDS, seed=1):
    """The run file of one ensemble with these logarithms (methods, points, problems); methods have letters as names."""
    return xr.Dataset(
        {"log_error": (("ensemble", "integrator", "point", "problem"), [logarithms])},
        {"ensemble": ["one"], "integrator": list("abcd"[: len(kinds)]), "kind": ("integrator", list(kinds))},
        {"seed": seed},
    )


def gains_of(logarithms, kinds, seed, resamples):
    return gains(runs(logarithms, kinds, seed), resamples).isel(ensemble=0)


def test_reductions_give_means_quantiles_best_and_shared_gain():
    """All errors of a problem are shifted alike, so that the interval has no width; a missing point has no best."""
    logs = curves([-6, -4], [-6.5, -4], 0.0, 5) + np.arange(5) / 4
    data = runs(np.concatenate([logs, np.full((4, 1, 5), np.nan)], axis=1))
    data["anharmonicity"] = ("ensemble", "problem"), [[0.3, 0.1, 0.5, 0.2, 0.4]]
    found = reduction.of(data, over="problem").isel(ensemble=0)
    assert found.mean_log_error.sel(integrator="c").values == pytest.approx([-6, -3.5, np.nan], nan_ok=True)
    assert found.anharmonicity.values == pytest.approx([0.12, 0.3, 0.48])
    assert found.gain.values == pytest.approx([0.5, 0.5, np.nan], nan_ok=True)
    assert found.gain_interval.values[:2] == pytest.approx(np.full((2, 2), 0.5))
    assert found.best_published.values.tolist() == ["a", "b", ""]
    assert found.best_trained.values.tolist() == ["c", "d", ""]


def test_intervals_of_independent_errors_are_those_of_the_normal_distribution():
    """1.96 standard deviations of a difference of means; 4000 resamples know their tails to 5 %, 400 draws theirs."""
    count = 400
    found = gains_of(curves([-6, -2], [-6.7, -2], 0.3, count), KINDS, 2, 4000)
    width = 1.96 * 0.3 * sqrt(2 / count)
    assert np.diff(found.gain_interval, axis=1)[:, 0] == pytest.approx([2 * width] * 2, rel=0.12)


def test_problems_are_resampled_together_for_all_methods():
    """Common parts of the errors of problems cancel: the errors of all methods move alike, and the gain does not."""
    logs = np.full((2, 1, 50), -5.0) + np.random.default_rng(3).normal(size=50)
    logs[1] -= 0.25
    found = gains_of(logs, ("published", "trained"), 4, 100)
    assert found.gain_interval.values[0] == pytest.approx([0.25, 0.25])


def test_means_of_resamples_do_not_depend_on_order_of_sums():
    """Logarithms from -16 to 0 of 192 problems are rounded to 2^-40 or finer, so that means are off by half of it."""
    logs, order = -16 * np.random.default_rng(5).random((3, 2, 192)), np.random.default_rng(7).permutation(192)
    found = resampled_means(xr.DataArray(logs, dims=("method", "point", "problem")), 6, 50).values
    counts = np.random.default_rng(6).multinomial(192, np.full(192, 1 / 192), 50)
    assert _means(logs[..., order], counts[:, order]).tobytes() == found.tobytes()
    plain = [np.repeat(logs, times, axis=-1).mean(axis=-1) for times in counts]
    assert found == pytest.approx(np.stack(plain, axis=-1), abs=2.0**-41 + 1e-14)


def test_the_best_are_chosen_anew_in_each_resample():
    """Two published methods that are equal in the mean: the better of them in a resample is better than the mean."""
    logs = curves([-5, -5], [-4, -4], 1.0, 40)
    logs -= logs.mean(axis=-1, keepdims=True) - np.array([-5, -5, -4, -4])[:, None, None]
    found = gains_of(logs, KINDS, 5, 2000)
    # The larger of two normal numbers is 1/sqrt(pi) deviations above the mean; trained methods gain the same.
    assert found.gain.values == pytest.approx(-1)
    one = gains_of(logs[[0, 2]], ("published", "trained"), 5, 2000)
    assert (np.diff(found.gain_interval)[:, 0] < 0.95 * np.diff(one.gain_interval)[:, 0]).all()


def test_every_unprocessed_method_is_compared_and_has_one_kind():
    names = contestants()
    exact = {name for name in nh.integrators.registered if name.startswith("trained_exact_")}
    assert set(names) == {*nh.integrators.registered} - {"rowlands", *nh.implicit_integrators.registered} - exact
    assert exact < set(exact_contestants(["aba864"])) == set(plain_integrators.registered)
    kinds = {name: kind_of(name) for name in names}
    own = {name for name, kind in kinds.items() if kind == "own"}
    found_here = {name for name in names if integrators[name].source.startswith("found by")}
    assert own == {name for name in found_here if not name.startswith("trained_")}
    assert {"babs8o6_7h", "abag5o6"} <= own
    assert kinds["rnia12"] == kinds["omelyan_g5o6"] == "published"
    trained = replace(nh.integrators["leapfrog"], name="trained_x")
    assert idea_of(trained) == "trained"
    ideas = {name: idea_of(integrators[name]) for name in ("babps8o7h", "srkn_b11", "teloy_8a17b", "aba864", "chin_4a")}
    assert list(ideas.values()) == ["harmonic_conditions", "nystrom", "nystrom", "general", None]


def test_errors_equal_those_of_operator_loop_at_equal_cost():
    """To a thousandth: the energy error at the largest is some hundred roundings of a double."""
    (one,) = (one for one in NAMED if one.name == "henon_heiles")
    ensemble = named_ensemble(one, 3, 2, 20.0)
    taus, charge = np.array([0.1, 0.15]), 0.8
    found = log_errors(ensemble, METHODS, taus, charge)
    for a, name in enumerate(METHODS):
        method = integrators[name]
        rows = [list(map(float, row)) for row in (method.kick, method.drift, getattr(method, "square", ()))]
        cost = method.stages + charge * getattr(method, "gradients", 0)
        for t, tau in enumerate(taus):
            steps = round(20 / (tau * cost))
            for m, row in enumerate(ensemble.start.reshape(3, 4, 2)):
                error = largest_error(
                    rows, method.first, 20 / steps, steps, row[0], row[2], henon_heiles_energy, henon_heiles_gradient,
                    henon_heiles_gradient_of_square if method.modified else None,
                )  # fmt: skip
                assert found[a, t, m] == pytest.approx(log10(error), abs=1e-3), (name, tau, m)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = str(tmp_path_factory.mktemp("small") / "run.h5")
    job.write(measure(METHODS, SMALL)["run"], [path], {})
    return reduce(METHODS, SMALL, path)


def test_the_cube_has_each_ensemble_with_its_own_step_sizes(small):
    values = {name: entry.values for name, entry in small["cube"].variables.items()}
    assert len(values["ensemble"]) == 8 + len(NAMED) + 1 == len(set(values["ensemble"].tolist()))
    assert values["tau_per_stage"][-1] == pytest.approx([2 * np.pi / 60, np.nan], nan_ok=True)
    assert (values["tau_per_stage"][:-1] == [0.05, 0.1]).all()
    assert np.isnan(values["mean_log_error"][-1, :, 1]).all()
    assert np.isfinite(values["mean_log_error"][:-1]).all()
    assert values["kind"].tolist() == ["published", "published", "own", "published", "own"]
    assert (np.diff(values["anharmonicity"], axis=1) >= 0).all()
    for e, trial in enumerate(proof_ensembles(SMALL)):
        charge = 0.3 if trial.panel == "Kepler orbits" else 1.1
        means = log_errors(trial.ensemble, METHODS, trial.tau_per_stage, charge).mean(axis=-1)
        assert (values["mean_log_error"][e, :, : means.shape[1]] == means).all()
        best = [METHODS[i] for i in np.where(values["kind"] == "published", means.T, np.inf).argmin(axis=1)]
        assert values["best_published"][e, : len(best)].tolist() == best


def test_a_table_without_trained_methods_says_so(small):
    table = small["gains"]
    assert {row[-1] for row in table.rows} == {"none trained"}
    assert {row[4] for row in table.rows} == {"none"}
    assert len(table.rows) == 2 * (8 + len(NAMED)) + 1
    assert small["methods"].rows[0][0] == "none"


LOGARITHMS = [[[-6, -4], [-6.5, -3]], [[-7, np.nan], [-8.25, np.nan]]]
#: Two ensembles at two step sizes, the second of which has one alone; a published method and a trained one.
BY_HAND = xr.Dataset(
    {
        "mean_log_error": (("ensemble", "integrator", "point"), LOGARITHMS),
        "best_published": (("ensemble", "point"), [["a", "a"], ["a", ""]]),
        "best_trained": (("ensemble", "point"), [["b", "b"], ["b", ""]]),
        "gain": (("ensemble", "point"), [[0.5, -1], [1.25, np.nan]]),
        "gain_interval": (("ensemble", "point", "end"), [[[0.4, 0.6], [-1.2, -0.9]], [[-0.1, 2], [np.nan, np.nan]]]),
    },
    {
        "ensemble": ["one", "two"], "integrator": ["a", "b"], "kind": ("integrator", ["published", "trained"]),
        "tau_per_stage": (("ensemble", "point"), [[0.1, 0.2], [0.3, np.nan]]),
    },
)  # fmt: skip


def test_the_table_of_gains_has_each_number_in_its_column():
    table = gain_table(BY_HAND)
    assert table.header == [
        "ensemble", "tau_per_stage", "best published", "log10_error", "best trained", "log10_error_trained", "gain",
        "gain_low", "gain_high", "verdict",
    ]  # fmt: skip
    assert table.rows == [
        ["one", 0.1, "a", -6.0, "b", -6.5, 0.5, 0.4, 0.6, "ahead"],
        ["one", 0.2, "a", -4.0, "b", -3.0, -1.0, -1.2, -0.9, "behind"],
        ["two", 0.3, "a", -7.0, "b", -8.25, 1.25, -0.1, 2.0, "even"],
    ]


def test_the_table_of_methods_has_each_number_in_its_column():
    table = method_table(BY_HAND)
    assert table.records() == [
        {"method": "b", "ensemble": "one", "ahead_from": 0.1, "ahead_to": 0.1, "ratio": 1.0, "largest_gain": 0.5,
         "gain_at": 0.1, "largest_loss": 1.0, "loss_at": 0.2},
        {"method": "b", "ensemble": "two", "ahead_from": 0.3, "ahead_to": 0.3, "ratio": 1.0, "largest_gain": 1.25,
         "gain_at": 0.3, "largest_loss": -1.25, "loss_at": 0.3},
    ]  # fmt: skip


def test_what_an_interval_says():
    assert [verdict(*pair) for pair in ((0.1, 0.2), (-0.2, -0.1), (-0.1, 0.1))] == ["ahead", "behind", "even"]
    assert verdict(np.nan, np.nan) == "none trained"


def test_the_widest_stretch_is_by_ratio_whatever_the_order():
    taus = np.array([0.01, 0.02, 0.03, 0.1, 0.2])
    assert stretch(taus, np.array([1, 1, -1, 1, 1.0])) == (0.01, 0.02)
    assert stretch(taus, np.array([-1, 1, 1, 1, -1.0])) == (0.02, 0.1)
    assert stretch(taus[::-1], np.array([-1, 1, 1, 1, -1.0])) == (0.02, 0.1)
    assert stretch(taus, np.array([1, -1, -1, 1, 1.0])) == (0.1, 0.2)
    assert np.isnan(stretch(taus, -np.ones(5))).all()


def test_settings_are_keys_of_config_and_too_much_is_refused():
    given = yaml.safe_load(
        "name: x\nintegrators: [ruth]\nsystems: {sho: {tau_per_stage: {lowest: 1, highest: 2, points_per_decade: 4}}}\n"
        "trained: {proof: {systems: 5, tau_per_stage: [0.1]}}\n"
    )
    proof = load(given).trained.proof
    assert (proof.systems, proof.tau_per_stage, proof.steps) == (5, ("0.1",), 10**6)
    for key, value in (("systems", 100_000), ("steps", 10**9)):
        given["trained"]["proof"] = {key: value, "t_end": 10_000 if key != "steps" else 10}
        with pytest.raises(SettingError, match=rf"trained\.proof\.{key}.*force evaluations"):
            load(given)
