"""Statements on trained methods, for known errors."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic_paper.claims.performance import best_performance
from nearharmonic_paper.claims.tableaus import ENSEMBLES, FEWEST_METHODS, RELATED, minimised_coefficients
from support.results.recorded_results import held_results

THREE = ("babps9o7h", "babps8o7h", "abas5o6h")
TRAINED = held_results().cubes["trained"]["integrator"].values.tolist()
HIGH = [name for name in integrators.registered if name in TRAINED and integrators[name].order >= 4]


def total(name):
    return sum(abs(float(c)) for c in (*integrators[name].kick, *integrators[name].drift))


def with_errors(rows):
    """Results with the errors (method, four step sizes) of all methods of order four or more; others have none."""
    results = held_results()
    results.cubes["trained"] = results.cubes["trained"].isel(point=slice(0, 4))
    errors = results.cubes["trained"]["mean_log_error"]
    errors[:] = -16.0
    errors.loc[{"integrator": HIGH}] = np.broadcast_to(rows, (len(errors), *np.shape(rows)))
    return results


def test_random_order_is_related_in_one_of_twenty_cases():
    random = np.random.default_rng(1)
    share = {}
    for count in (FEWEST_METHODS - 1, FEWEST_METHODS):
        ranks = random.permuted(np.tile(np.arange(count), (200_000, 1)), axis=1)
        squares = ((ranks - np.arange(count)) ** 2).sum(axis=1)
        share[count] = (1 - 6 * squares / (count**3 - count) >= RELATED).mean()
    # Shares of 200000 draws scatter by 0.0005.
    assert 0.045 < share[FEWEST_METHODS] < 0.05 < share[FEWEST_METHODS - 1]


@pytest.mark.parametrize(("turned", "verdict"), [((), "holds"), ((0, 2), "holds in part"), ((0, 1, 2, 3), "fails")])
def test_verdict_counts_step_sizes_at_which_smaller_sums_err_less(turned, verdict):
    rows = np.array([[total(name)] * 4 for name in HIGH])
    rows[:, list(turned)] *= -1
    decision = minimised_coefficients.decision(with_errors(rows))
    assert decision.verdict == verdict
    assert f"; 0.5 or more at {4 - len(turned)} of 4 step sizes; " in decision.value


@pytest.mark.parametrize(("count", "decided"), [(FEWEST_METHODS - 1, False), (FEWEST_METHODS, True)])
def test_few_methods_are_not_compared(count, decided):
    results = held_results()
    results.cubes["trained"] = results.cubes["trained"].sel(integrator=HIGH[:count])
    verdict, value, _ = minimised_coefficients.decision(results)
    assert (verdict != "not decided here") == decided
    assert decided or value == "the results have fewer than 12 methods of order four or more, or no step size"


@pytest.mark.parametrize("missing", ENSEMBLES)
def test_without_an_ensemble_nothing_is_decided(missing):
    results = held_results()
    results.cubes["trained"] = results.cubes["trained"].drop_sel(ensemble=missing)
    expected = ("not decided here", f"the results do not have the random potentials {missing}", "")
    assert minimised_coefficients.decision(results) == expected
    assert "trained" not in best_performance.decision(results).value


def test_best_three_are_told_how_far_ahead_trained_methods_are():
    rows = np.full((len(HIGH), 4), -3.0)
    rows[HIGH.index(THREE[0])] = -6.0
    trained = [i for i, name in enumerate(HIGH) if name.startswith("trained_")]
    rows[trained[0]], rows[trained[1]] = (-6.5, -5.0, -5.0, -8.0), (-4.0, -7.0, -5.5, -7.0)
    value = best_performance.decision(with_errors(rows)).value
    assert value.endswith("are ahead of the three at 3 of 4 step sizes, the best by -0.5 to 2 decades")
