"""Statements on trained methods, for known errors."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic_paper.claims.statements.performance.comparisons import best_performance
from nearharmonic_paper.claims.statements.tableaus.trained import (
    ENSEMBLES,
    FEWEST_METHODS,
    RELATED,
    minimised_coefficients,
)
from nearharmonic_studies.trained.problems.random_potentials import random_ensemble
from nearharmonic_studies.trained.proof.run import BANDS, DIMENSIONS
from support.results.sound_results import PROOF_STEPS, sound_results

THREE = ("babps9o7h", "babps8o7h", "abas5o6h")
HIGH = [name for name in integrators.registered if integrators[name].order >= 4]


def total(name):
    return sum(abs(float(c)) for c in (*integrators[name].kick, *integrators[name].drift))


def with_errors(rows):
    """Results with the errors (method, step size) of all methods of order four or more; others have none at all."""
    results = sound_results()
    errors = results.cubes["trained"]["mean_log_error"]
    errors[:] = -16.0
    errors.loc[{"integrator": HIGH}] = np.broadcast_to(rows, (len(errors), *np.shape(rows)))
    return results


@pytest.fixture
def scattered():
    """Errors without any relation to coefficients, other ones at each step size."""
    return np.random.default_rng(5).uniform(-12, -2, (len(HIGH), len(PROOF_STEPS)))


def test_ensembles_are_those_of_experiment_with_widest_band():
    assert BANDS[-1] == (min(low for low, _ in BANDS[1:]), max(high for _, high in BANDS))
    assert [random_ensemble(d, 2, 0, band=BANDS[-1], t_end=1.0).name for d in DIMENSIONS] == list(ENSEMBLES)


def test_random_order_is_related_in_one_of_twenty_cases():
    random = np.random.default_rng(1)
    share = {}
    for count in (FEWEST_METHODS - 1, FEWEST_METHODS):
        ranks = random.permuted(np.tile(np.arange(count), (200_000, 1)), axis=1)
        squares = ((ranks - np.arange(count)) ** 2).sum(axis=1)
        share[count] = (1 - 6 * squares / (count**3 - count) >= RELATED).mean()
    # Shares of 200000 draws scatter by 0.0005.
    assert share[FEWEST_METHODS] < 0.05 < share[FEWEST_METHODS - 1]
    assert share[FEWEST_METHODS] > 0.045


@pytest.mark.parametrize(("turned", "verdict"), [((), "holds"), ((0, 2), "holds in part"), ((0, 1, 2, 3), "fails")])
def test_verdict_counts_step_sizes_at_which_smaller_sums_err_less(turned, verdict):
    rows = np.array([[total(name)] * len(PROOF_STEPS) for name in HIGH])
    rows[:, list(turned)] *= -1
    decision = minimised_coefficients.decision(with_errors(rows))
    assert decision.verdict == verdict
    assert f"; 0.5 or more at {4 - len(turned)} of 4 step sizes; " in decision.value


def test_value_names_best_methods_and_loss_of_least_sum(scattered):
    smallest = min(HIGH, key=total)
    scattered[HIGH.index(smallest)] = -5.0
    for step, name in enumerate(("srkn_a14", "ruth", "ruth", "aba864")):
        scattered[HIGH.index(name), step] = -13.0 - step
    value = minimised_coefficients.decision(with_errors(scattered)).value
    ruth, srkn, aba = (f"{total(name):.3g}" for name in ("ruth", "srkn_a14", "aba864"))
    listed = f"SRKN 14a ({srkn}) at 0.02, Ruth ({ruth}) at 0.05 to 0.1, ABA864 ({aba}) at 0.2"
    assert f"; least error, with the sum: {listed}; " in value
    least = f"the least sum is {total(smallest):.3g}, of {integrators[smallest].label}"
    assert value.endswith(f"; {least}, with 1 × 10⁸ to 1 × 10¹¹ times the least error")


@pytest.mark.parametrize(("count", "decided"), [(FEWEST_METHODS - 1, False), (FEWEST_METHODS, True)])
def test_few_methods_are_not_compared(count, decided):
    results = sound_results()
    low = [name for name in integrators.registered if integrators[name].order < 4]
    results.cubes["trained"] = results.cubes["trained"].sel(integrator=[*HIGH[:count], *low])
    verdict, value, _ = minimised_coefficients.decision(results)
    assert (verdict != "not decided here") == decided
    assert decided or value == "the results have fewer than 12 methods of order four or more, or no step size"


@pytest.mark.parametrize("missing", ENSEMBLES)
def test_without_an_ensemble_nothing_is_decided(missing):
    results = sound_results()
    results.cubes["trained"] = results.cubes["trained"].drop_sel(ensemble=missing)
    expected = ("not decided here", f"the results do not have the random potentials {missing}", "")
    assert minimised_coefficients.decision(results) == expected
    assert best_performance.decision(results).verdict == "holds in part"


def test_methods_that_job_does_not_name_are_not_looked_at(scattered):
    results = with_errors(scattered)
    del results.methods["babs7o7h"]
    before = minimised_coefficients.decision(results)
    results.cubes["trained"]["mean_log_error"].loc[{"integrator": ["babs7o7h", "omelyan_g5o6"]}] = -30.0
    assert minimised_coefficients.decision(results) == before


def test_best_three_are_told_how_far_ahead_trained_methods_are():
    rows = np.full((len(HIGH), len(PROOF_STEPS)), -3.0)
    rows[HIGH.index(THREE[0])] = -6.0
    trained = [i for i, name in enumerate(HIGH) if name.startswith("trained_")]
    rows[trained[0]], rows[trained[1]] = (-6.5, -5.0, -5.0, -8.0), (-4.0, -7.0, -5.5, -7.0)
    results = with_errors(rows)
    value = best_performance.decision(results).value
    assert value.endswith("are ahead of the three at 3 of 4 step sizes, the best by -0.5 to 2 decades")
    results = with_errors(rows)
    results.cubes["trained"] = results.cubes["trained"].drop_sel(integrator=[HIGH[i] for i in trained])
    assert "trained" not in best_performance.decision(results).value
