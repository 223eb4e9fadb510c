"""The comparison, the ideas and the long runs: known gains and intervals, errors against plain loops, tables."""

from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from functools import partial
from math import log10, sqrt

import numpy as np
import pytest
import xarray as xr
import yaml

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.output.store import assembled
from nearharmonic_paper.config import load
from nearharmonic_paper.tasks import job
from nearharmonic_studies.trained import reductions
from nearharmonic_studies.trained import run as made
from nearharmonic_studies.trained import run as times
from nearharmonic_studies.trained.problems import NAMED, named_ensemble, random_ensemble, with_exact_oscillators
from nearharmonic_studies.trained.reductions import gains
from nearharmonic_studies.trained.run import run
from nearharmonic_studies.trained.settings import IDEAS, ProofSettings, contestants, exact_contestants, idea_of, kind_of
from support.oracles.plain_runs import (
    henon_heiles_energy,
    henon_heiles_gradient,
    henon_heiles_gradient_of_square,
    largest_error,
)

# --- The proof: gains and intervals against known numbers, errors against a plain loop, tables and settings.

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


@pytest.mark.slow
def test_reductions_give_means_quantiles_best_and_shared_gain():
    """All errors of a problem are shifted alike, so that the interval has no width; a missing point has no best."""
    logs = curves([-6, -4], [-6.5, -4], 0.0, 5) + np.arange(5) / 4
    data = runs(np.concatenate([logs, np.full((4, 1, 5), np.nan)], axis=1))
    data["anharmonicity"] = ("ensemble", "problem"), [[0.3, 0.1, 0.5, 0.2, 0.4]]
    found = reductions.proof_reduction.of(data, over="problem").isel(ensemble=0)
    assert found.mean_log_error.sel(integrator="c").values == pytest.approx([-6, -3.5, np.nan], nan_ok=True)
    assert found.anharmonicity.values == pytest.approx([0.12, 0.3, 0.48])
    assert found.gain.values == pytest.approx([0.5, 0.5, np.nan], nan_ok=True)
    assert found.gain_interval.values[:2] == pytest.approx(np.full((2, 2), 0.5))
    assert found.best_published.values.tolist() == ["a", "b", ""]
    assert found.best_trained.values.tolist() == ["c", "d", ""]


@pytest.mark.slow
def test_intervals_of_independent_errors_are_those_of_the_normal_distribution():
    """1.96 standard deviations of a difference of means; 4000 resamples know their tails to 5 %, 400 draws theirs."""
    count = 400
    found = gains_of(curves([-6, -2], [-6.7, -2], 0.3, count), KINDS, 2, 4000)
    width = 1.96 * 0.3 * sqrt(2 / count)
    assert np.diff(found.gain_interval, axis=1)[:, 0] == pytest.approx([2 * width] * 2, rel=0.12)


@pytest.mark.slow
def test_problems_are_resampled_together_for_all_methods():
    """Common parts of the errors of problems cancel: the errors of all methods move alike, and the gain does not."""
    logs = np.full((2, 1, 50), -5.0) + np.random.default_rng(3).normal(size=50)
    logs[1] -= 0.25
    found = gains_of(logs, ("published", "trained"), 4, 100)
    assert found.gain_interval.values[0] == pytest.approx([0.25, 0.25])


@pytest.mark.slow
def test_means_of_resamples_do_not_depend_on_order_of_sums():
    """Logarithms from -16 to 0 of 192 problems are rounded to 2^-40 or finer, so that means are off by half of it."""
    logs, order = -16 * np.random.default_rng(5).random((3, 2, 192)), np.random.default_rng(7).permutation(192)
    found = reductions.resampled_means(xr.DataArray(logs, dims=("method", "point", "problem")), 6, 50).values
    counts = np.random.default_rng(6).multinomial(192, np.full(192, 1 / 192), 50)
    assert reductions._means(logs[..., order], counts[:, order]).tobytes() == found.tobytes()
    plain = [np.repeat(logs, times, axis=-1).mean(axis=-1) for times in counts]
    assert found == pytest.approx(np.stack(plain, axis=-1), abs=2.0**-41 + 1e-14)


@pytest.mark.slow
def test_the_best_are_chosen_anew_in_each_resample():
    """Two published methods that are equal in the mean: the better of them in a resample is better than the mean."""
    logs = curves([-5, -5], [-4, -4], 1.0, 40)
    logs -= logs.mean(axis=-1, keepdims=True) - np.array([-5, -5, -4, -4])[:, None, None]
    found = gains_of(logs, KINDS, 5, 2000)
    # The larger of two normal numbers is 1/sqrt(pi) deviations above the mean; trained methods gain the same.
    assert found.gain.values == pytest.approx(-1)
    one = gains_of(logs[[0, 2]], ("published", "trained"), 5, 2000)
    assert (np.diff(found.gain_interval)[:, 0] < 0.95 * np.diff(one.gain_interval)[:, 0]).all()


@pytest.mark.slow
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


@pytest.mark.slow
def test_errors_equal_those_of_operator_loop_at_equal_cost():
    """To a thousandth: the energy error at the largest is some hundred roundings of a double."""
    (one,) = (one for one in NAMED if one.name == "henon_heiles")
    ensemble = named_ensemble(one, 3, 2, 20.0)
    taus, charge = np.array([0.1, 0.15]), 0.8
    found = made.log_errors(ensemble, METHODS, taus, charge)
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
    job.write(made.proof_measure(METHODS, SMALL)["run"], [path], {})
    return reductions.reduce_proof(METHODS, SMALL, path)


@pytest.mark.slow
def test_the_cube_has_each_ensemble_with_its_own_step_sizes(small):
    values = {name: entry.values for name, entry in small["cube"].variables.items()}
    assert len(values["ensemble"]) == 8 + len(NAMED) + 1 == len(set(values["ensemble"].tolist()))
    assert values["tau_per_stage"][-1] == pytest.approx([2 * np.pi / 60, np.nan], nan_ok=True)
    assert (values["tau_per_stage"][:-1] == [0.05, 0.1]).all()
    assert np.isnan(values["mean_log_error"][-1, :, 1]).all()
    assert np.isfinite(values["mean_log_error"][:-1]).all()
    assert values["kind"].tolist() == ["published", "published", "own", "published", "own"]
    assert (np.diff(values["anharmonicity"], axis=1) >= 0).all()
    for e, trial in enumerate(made.proof_ensembles(SMALL)):
        charge = 0.3 if trial.panel == "Kepler orbits" else 1.1
        means = made.log_errors(trial.ensemble, METHODS, trial.tau_per_stage, charge).mean(axis=-1)
        assert (values["mean_log_error"][e, :, : means.shape[1]] == means).all()
        best = [METHODS[i] for i in np.where(values["kind"] == "published", means.T, np.inf).argmin(axis=1)]
        assert values["best_published"][e, : len(best)].tolist() == best


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


@pytest.mark.slow
def test_the_table_of_gains_has_each_number_in_its_column():
    table = reductions.gain_table(BY_HAND)
    assert table.rows == [
        ["one", 0.1, "a", -6.0, "b", -6.5, 0.5, 0.4, 0.6, "ahead"],
        ["one", 0.2, "a", -4.0, "b", -3.0, -1.0, -1.2, -0.9, "behind"],
        ["two", 0.3, "a", -7.0, "b", -8.25, 1.25, -0.1, 2.0, "even"],
    ]


@pytest.mark.slow
def test_the_table_of_methods_has_each_number_in_its_column():
    table = reductions.method_table(BY_HAND)
    assert table.records() == [
        {"method": "b", "ensemble": "one", "ahead_from": 0.1, "ahead_to": 0.1, "ratio": 1.0, "largest_gain": 0.5,
         "gain_at": 0.1, "largest_loss": 1.0, "loss_at": 0.2},
        {"method": "b", "ensemble": "two", "ahead_from": 0.3, "ahead_to": 0.3, "ratio": 1.0, "largest_gain": 1.25,
         "gain_at": 0.3, "largest_loss": -1.25, "loss_at": 0.3},
    ]  # fmt: skip


@pytest.mark.slow
def test_what_an_interval_says():
    assert [reductions.verdict(*pair) for pair in ((0.1, 0.2), (-0.2, -0.1), (-0.1, 0.1))] == [
        "ahead",
        "behind",
        "even",
    ]
    assert reductions.verdict(np.nan, np.nan) == "none trained"


@pytest.mark.slow
def test_the_widest_stretch_is_by_ratio_whatever_the_order():
    taus = np.array([0.01, 0.02, 0.03, 0.1, 0.2])
    assert reductions.stretch(taus, np.array([1, 1, -1, 1, 1.0])) == (0.01, 0.02)
    assert reductions.stretch(taus, np.array([-1, 1, 1, 1, -1.0])) == (0.02, 0.1)
    assert reductions.stretch(taus[::-1], np.array([-1, 1, 1, 1, -1.0])) == (0.02, 0.1)
    assert reductions.stretch(taus, np.array([1, -1, -1, 1, 1.0])) == (0.1, 0.2)
    assert np.isnan(reductions.stretch(taus, -np.ones(5))).all()


@pytest.mark.slow
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


# --- Ideas over anharmonicity and step size: systems at all strengths, errors against single runs, best idea.

OF_IDEAS = ("ruth", "blanes_moan_s6o4", "babps8o7h", "babs7o7h", "srkn_b11", "chin_4a")
EXACT = ("aba864",)
FEW_POTENTIALS = ProofSettings(systems=12, t_end="15", tau_per_stage=("0.05", "0.1"))
FOUR = np.geomspace(made.WEAKEST, made.STRONGEST, 4)


@pytest.fixture(scope="module")
def scaled():
    return made.scaled_potentials(3, FOUR, 5, 20.0)


def test_strengths_scale_cubic_and_quartic_coefficients_only(scaled):
    one = random_ensemble(2, 3, 5, band=(1.0, 1.0), t_end=20.0)
    for m, strength in enumerate(np.tile(FOUR, 3)):
        row, alone = (each.reshape(-1, 2)[:, 0] for each in (scaled.parameters[m], one.parameters[m // 4]))
        assert (row[:2] == alone[:2]).all()
        assert row[2:] == pytest.approx(strength * alone[2:], rel=1e-15)
        assert (scaled.start[m] == one.start[m // 4]).all()


def declared(whole, squares, rest):
    """One of the potentials as a system that declares its frequencies."""
    w = np.sqrt(squares)
    names = [f"w{i}" for i in range(2)] + [f"c{i}" for i in range(len(rest))]
    values = [*w.tolist(), *rest.tolist()]
    return nh.System(
        name="declared", V=lambda q, w0, w1, *c: whole.system.V(q, w0 * w0, w1 * w1, *c), q0=["0.1", "0.1"],
        p0=["0", "0"], t_end=20, parameters={name: str(Decimal(x)) for name, x in zip(names, values, strict=True)},
        frequencies=("w0", "w1"),
    )  # fmt: skip


@pytest.mark.slow
def test_exact_oscillator_errs_as_single_runs_do_at_equal_cost(scaled):
    taus = np.array([0.05, 0.1])
    found = 10 ** made.log_errors(with_exact_oscillators(scaled), ["aba864"], taus * made.CHARGE_OF_ROTATIONS, 0.0)[0]
    for m in (0, 6, 11):
        system = declared(scaled, scaled.parameters[m, :4:2], scaled.parameters[m, 4::2])
        start = scaled.start[m].reshape(4, 2)
        for t, tau in enumerate(taus):
            steps = round(20 / (tau * made.CHARGE_OF_ROTATIONS * 7))
            run = nh.integrate(
                system, "aba864", Fraction(20, steps), t_end=20, q0=start[0], p0=start[2],
                split="exact_oscillator", summation="plain", samples=2,
            )  # fmt: skip
            # Errors are rounding where the oscillator is all there is.
            assert found[t, m] == pytest.approx(float(run.max_energy_error), rel=0.02, abs=2e-15)


def of_ideas(values):
    """Ideas with one method each, whose errors on 6 problems are these at one step size and two strengths."""
    noise = np.linspace(-0.1, 0.1, 6)
    errors = {one: np.array(row)[None, :, None] + noise * (i + 1) for i, (one, row) in enumerate(values.items())}
    exact = [one for one in values if "exact" in one]
    split, over = [one for one in values if one not in exact], ("tau_per_stage", "strength", "problem")
    return xr.Dataset(
        {
            "log_error": (("integrator", *over), [errors[one] for one in split]),
            "exact_log_error": (("exact_integrator", *over), [errors[one] for one in exact]),
        },
        {
            "integrator": [f"method of {idea}" for idea in split],
            "idea": ("integrator", split),
            "exact_integrator": [f"{idea}_one" for idea in exact],
        },
        {"seed": 1},
    )


def test_leader_has_least_mean_error_and_lead_over_second():
    values = {"exact_oscillator": [-8, -4], "trained_exact": [-9, -4.25], "harmonic_conditions": [-7, -5]}
    best = reductions.ideas_reduction.of(
        of_ideas(values | {"nystrom": [-6, -5.5], "general": [-5, -5]}), over="problem"
    )
    found = {
        name: entry.values for name, entry in best.assign(reductions.ideas_reduction.of(best, over="resample")).items()
    }
    assert found["leader"].tolist() == [["trained_exact", "nystrom"]]
    assert found["lead"][0] == pytest.approx([1, 0.5])
    assert found["leader_split"].tolist() == [["harmonic_conditions", "nystrom"]]
    assert found["lead_split"][0] == pytest.approx([1, 0.5])
    assert found["exact_gain"][0] == pytest.approx([1, 0.25])
    assert found["gain"][:, 0, 0] == pytest.approx([3, 4, 2, 1, np.nan, 0], nan_ok=True)
    assert found["best_method"][:, 0, 0].tolist() == [
        "exact_oscillator_one", "trained_exact_one", "method of harmonic_conditions", "method of nystrom", "",
        "method of general",
    ]  # fmt: skip
    for name in ("lead", "exact_gain"):
        low, high = np.moveaxis(found[f"{name}_interval"][0], -1, 0)
        assert (low < found[name][0]).all()
        assert (found[name][0] < high).all()


@pytest.mark.slow
def test_table_has_row_and_equal_numbers_for_each_cell(tmp_path):
    job.write(made.ideas_measure(OF_IDEAS, EXACT, FEW_POTENTIALS)["run"], [str(tmp_path / "run.h5")], {})
    made_here = reductions.reduce_ideas(OF_IDEAS, EXACT, FEW_POTENTIALS, str(tmp_path / "run.h5"))
    values = {name: entry.values for name, entry in made_here["cube"].variables.items()}
    rows = made_here["table"].records()
    assert len(rows) == 2 * made.STRENGTHS
    for n, row in enumerate(rows):
        t, j = divmod(n, made.STRENGTHS)
        gains = {idea: row[idea] for idea in IDEAS}
        leader = max(IDEAS, key=lambda idea: np.nan_to_num(gains[idea], nan=-99))
        assert row["ahead"] == values["leader"][t, j] == leader
        second = sorted(np.nan_to_num(list(gains.values()), nan=-99))[-2]
        assert row["lead"] == pytest.approx(gains[row["ahead"]] - second)
        assert np.isnan(row["trained"])
        assert row["general"] == 0
    assert (np.diff(values["anharmonicity"][:, 1]) > 0).all()


# --- Long runs: artificial trends, backward runs, rounding as a random walk; and gains at equal time.

SHORT = ProofSettings(
    systems=4, t_end="10", tau_per_stage=("0.1",), evaluations_per_orbit=(60,), steps=2000
)  # fmt: skip


def henon_heiles_starts():
    (one,) = (one for one in NAMED if one.name == "henon_heiles")
    return named_ensemble(one, made.STARTS, 3, 100.0)


def reduced(*methods, steps=2000):
    """Reductions of long runs on the Hénon-Heiles system, by method."""
    starts = {"henon_heiles": henon_heiles_starts()}
    variables = made.long_runs(starts, [nh.integrators[name] for name in methods], steps)
    return reductions.long_reduction.of(assembled(variables, ("label", "step"), {}), over="problem").isel(system=0)


def test_a_run_is_that_of_integrate(tmp_path):
    start = henon_heiles_starts().start[2].reshape(4, 2)
    alone = nh.integrate("henon_heiles", "babps8o7h", 0.8, t_end=40, q0=start[0], p0=start[2], samples=2)
    paths = run(henon_heiles_starts(), nh.integrators["babps8o7h"], 0.1, 50, samples=2)
    assert paths.max_energy_error[2] == pytest.approx(float(alone.max_energy_error), rel=1e-9)


def test_trend_that_is_put_in_is_found_within_its_interval():
    slope, random = 3e-7, np.random.default_rng(4)
    marks = np.arange(0, 2001, 5)
    own = slope + 1e-8 * random.normal(size=(made.STARTS, 1))
    errors = own * (marks / 2000) + 1e-7 * np.sin(marks * 0.37)
    found = reductions.trends(xr.Dataset({"energy_error": (("problem", "sample"), errors), "step": ("sample", marks)}))
    width = found.trend_half_width.item()
    # Student's t of 15 degrees of freedom is 2.13; the spread of 16 numbers is known to a fifth or so.
    assert width == pytest.approx(2.13 * 1e-8 / 4, rel=0.5)
    assert abs(found.trend.item() - slope) < 2 * width + 1e-9


def test_symmetric_methods_drift_nowhere_and_one_that_is_not_does():
    """McLachlan & Atela's of order three is symplectic but not symmetric: the way back does not retrace the orbit."""
    found = reduced("babps8o7h", "mclachlan_atela_3", steps=20_000)
    own = found.sel(integrator="babps8o7h")
    assert abs(own.trend) < 3 * own.trend_half_width
    assert abs(own.trend) < own.max_energy_error / 50
    back = found.way_back.sel(summation="compensated")
    assert back[0] < 1e-12 < back[1]


def test_rounding_errors_are_few_units_and_smaller_when_compensated():
    """A random walk of 2 s + 1 roundings of 2^-53 a step: 10^4 evaluations have sqrt(2 10^4) 2^-53 = 1.6e-14."""
    compensated, plain = reduced("babps8o7h", steps=10**5).rounding.isel(integrator=0).values
    assert compensated < plain / 2
    assert 2.0**-53 < plain < 1.6e-14 * 10


@pytest.mark.slow
def test_table_has_rows_of_method_beside_and_of_all_others():
    found = made.long_runs_measure(("ruth",), "babps8o7h", SHORT)["run"]
    table = reductions.long_table(assembled(found.variables, found.coordinates, {}))
    rows = table.records()
    assert [(row["system"], row["method"]) for row in rows] == [
        (system, method) for system in ("morse", "henon_heiles") for method in ("babps8o7h", "ruth")
    ]
    assert [row["rounding_ratio"] for row in rows[::2]] == [1, 1]
    largest = found.variables["max_energy_error"][1].max(axis=-1)
    assert [row["max_energy_error"] for row in rows] == largest.ravel().tolist()
    for row in rows:
        method = nh.integrators[row["method"]]
        assert row["sum of coefficients"] == pytest.approx(sum(abs(float(c)) for c in (*method.kick, *method.drift)))
        assert row["drift"] == ("no" if abs(row["trend"]) <= row["trend_half_width"] else "yes")
        assert row["rounding_ratio"] > 0


@pytest.mark.long
def test_gains_at_equal_time_use_measured_charge(monkeypatch, tmp_path):
    methods = ("babps8o7h", "srkn_b11", "chin_4a", "mclachlan_ss5", "abag5o6")
    monkeypatch.setattr(times, "costs", lambda _, width: (2.0, 3.0) if width > 1 else (8.0, 1e-9))
    monkeypatch.setattr(times, "kind_of", lambda name: "trained" if name == "chin_4a" else "published")
    job.write(times.proof_measure(methods, SHORT)["run"], [str(tmp_path / "run.h5")], {})
    cube = reductions.reduce_proof(methods, SHORT, str(tmp_path / "run.h5"))["cube"]
    job.write(cube, [str(tmp_path / "cube.h5")], {})
    table = times.measure_times(str(tmp_path / "cube.h5"), methods, SHORT)["table"]
    rows = table.records()
    assert {(row["ns_lanes"], row["ns_single"], row["charge_lanes"]) for row in rows} == {(2.0, 8.0, 3.0)}
    for trial, row in zip(times.proof_ensembles(SHORT), rows, strict=True):
        for mode, charge in (("lanes", 3.0), ("single", 1e-9)):
            logs = times.log_errors(trial.ensemble, methods, trial.tau_per_stage, charge).mean(axis=-1)[:, 0]
            assert row[f"gain_{mode}"] == pytest.approx(min(logs[[0, 1, 3, 4]]) - logs[2]), trial.ensemble.name
    # A more expensive gradient means longer steps at equal time, which no force-gradient method gains from.
    assert np.mean([row["gain_lanes"] for row in rows]) < np.mean([row["gain_single"] for row in rows])


@pytest.mark.parametrize(("width", "problems"), [(1, 1), (16, times.TIMED_PROBLEMS)])
def test_costs_add_up_to_least_time_of_step_in_nanoseconds(monkeypatch, width, problems):
    clock = ([2e-3, 1e-3], [3.5e-3, 4e-3])  # seconds of all steps of all problems
    monkeypatch.setattr(times, "interleaved", lambda calls, patience: clock)
    nanoseconds, charge = times.costs(henon_heiles_starts(), width)
    plain, modified = times.integrators[times.PLAIN], times.integrators[times.MODIFIED]
    steps = times.TIMED_STEPS * problems
    assert plain.stages * nanoseconds == pytest.approx(1e6 / steps)
    assert (modified.stages + modified.gradients * charge) * nanoseconds == pytest.approx(3.5e6 / steps)


def test_run_back_has_same_steps_with_other_sign():
    one = partial(run, henon_heiles_starts(), nh.integrators["babps8o7h"], 0.2, 10, samples=2)
    there, back = one(), one(back=True)
    mirrored = henon_heiles_starts().start.copy()
    mirrored.reshape(-1, 4, 2)[:, 2] *= -1
    assert one(mirrored).q[:, -1] == pytest.approx(back.q[:, -1], abs=1e-14)
    assert not np.allclose(there.q[:, -1], back.q[:, -1])
