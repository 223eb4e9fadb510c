"""The search: its budget, its best at any time, and the same method from the same seed."""

from __future__ import annotations

from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.training import search as module
from nearharmonic.training import tailor as budget_module
from nearharmonic.training.family import Family, published
from nearharmonic.training.objective import Objective, mean_errors
from nearharmonic.training.question import contenders, orbit_of, question, registered, step_sizes, window_at
from nearharmonic.training.tailor import Budget, BudgetSpentError, Rounds, TailorSearch, ensembles, families


@pytest.fixture(scope="module")
def problems():
    """(starts of the search, those of the test, published methods, step sizes, their errors) of a window."""
    asked = question("henon_heiles", window="0.1:0.15")
    first, second = ensembles(asked, orbit_of(asked.system))
    methods = [one for one in published(registered(asked.system)) if not one.modified]
    taus = step_sizes(asked.window)
    return first, second, methods, taus, mean_errors(first, methods, taus.tolist())


def searched(problems, trials, seed=0, stages=(6,), **more):
    ensemble, _, methods, taus, errors = problems
    budget = Budget(None, trials)
    return TailorSearch(
        ensemble, taus, errors.min(axis=0), methods, stages=stages, quadratic=True, budget=budget, seed=seed, **more
    )


@pytest.mark.slow
def test_a_seed_gives_the_same_method_and_another_one_another(problems):
    one, two, other = (searched(problems, 400, seed).run().best for seed in (1, 1, 2))
    assert (one.value, one.unknowns.tolist(), one.trials) == (two.value, two.unknowns.tolist(), two.trials)
    assert one.unknowns.tolist() != other.unknowns.tolist()


def test_best_method_matches_objective_and_beats_published_ones_of_shape(problems):
    ensemble, _, methods, taus, errors = problems
    found = searched(problems, 300).run()
    objective = Objective(found.best.family, [ensemble], taus, [errors.min(axis=0)], size=1)
    # the member is the projection of the point that was tried: Newton's last step is of 1e-10 at most
    assert objective(found.best.unknowns[None])[0] == pytest.approx(found.best.value, abs=1e-5)
    own = errors - errors.min(axis=0)
    known = [row.max() + row.mean() / 2 for one, row in zip(methods, own, strict=True) if one.stages == 6]
    assert found.best.value <= min(known) + 1e-5
    assert (found.trials, found.stopped) == (pytest.approx(300, abs=20), "spent")


def test_ctrl_c_gives_best_so_far_even_before_any_member(problems, monkeypatch):
    calls, plain = [], Objective.__call__

    def interrupted(self, points):
        calls.append(len(points))
        if len(calls) == last:
            raise KeyboardInterrupt
        return plain(self, points)

    monkeypatch.setattr(Objective, "__call__", interrupted)
    last = 9
    found = searched(problems, 10**6).run()
    assert found.stopped == "Ctrl-C"
    assert found.trials == sum(calls[:-1])
    assert found.best.value < 20
    calls.clear()
    last = 1
    with pytest.raises(KeyboardInterrupt):
        searched(problems, 10**6).run()


def test_best_third_goes_on_with_three_times_as_many_trials(problems, monkeypatch):
    asked = []

    def descend(objective, start, effort, seed):
        if effort.trials == Rounds().around_best:
            raise BudgetSpentError("enough")
        asked.append((objective.family, start.origin, effort.trials))
        return float(len(asked)) - 100, np.zeros(objective.family.unknowns)

    monkeypatch.setattr(module, "descend", descend)
    search = searched(problems, 10**6, stages=(7, 8))
    starts = search._branches()
    search.run()
    rounds = [[a for a in asked if a[2] == Rounds().trials * 3**k] for k in range(4)]
    assert [len(r) for r in rounds] == [len(starts), -(-len(starts) // 3), -(-len(starts) // 9), 0]
    assert 9 < len(starts) <= Rounds().most_starts
    # the first of a round are the best of it, as their values rise
    assert [a[:2] for a in rounds[1]] == [a[:2] for a in rounds[0][: len(rounds[1])]]


def test_starts_are_published_methods_in_the_order_of_their_objective(problems):
    branches = searched(problems, 10**6, stages=(8,))._branches()
    values = [one.best.value for one in branches]
    assert values == sorted(values)
    assert max(values) < values[0] + Rounds().far_behind
    assert {one.start.origin for one in branches} >= {"babps8o7h", "nystrom_6a8", "babs7o7h, grown"}
    several = searched(problems, 10**6, stages=(6, 8, 11))._branches()
    assert [one.best.family.stages for one in several[:3]] != [8, 8, 8]
    assert {one.best.family.stages for one in several[:3]} == {6, 8, 11}


def test_settings_of_the_rounds_are_those_asked_for(problems):
    found = searched(problems, 300, rounds=Rounds(most_starts=2, trials=40, around_best=30)).run()
    # Two in the first round, one around the best; the random points behind it spend the budget.
    assert found.searches == 3
    few = searched(problems, 10**6, stages=(8,), rounds=Rounds(far_behind=0.1))._branches()
    assert 0 < len(few) < len(searched(problems, 10**6, stages=(8,))._branches())


def test_a_budget_in_time_ends_by_itself(monkeypatch):
    ticks, shown = count(), []
    monkeypatch.setattr(budget_module, "time", SimpleNamespace(monotonic=lambda: 4e-4 * next(ticks)))
    budget = Budget(1e-3, None, lambda part, best: shown.append((part, best)))

    def spend_all():
        while True:
            budget.spend(10, -0.5)

    with pytest.raises(BudgetSpentError):
        spend_all()
    assert shown[-1] == (1.0, -0.5)
    assert (len(shown), budget.trials) == (3, 30)  # after 0.4, 0.8 and 1.2 ms


def test_families_have_free_coefficients_and_need_quadratic_T_if_stated():
    plain, quadratic = families((4, 8), quadratic=False), families((4, 8), quadratic=True)
    assert {one.order for one in plain} == {4}
    assert {one.order for one in quadratic} == {4, 6}
    for one in quadratic:
        assert one.unknowns > len(one.equations)
    assert Family(stages=4, first="drift") in plain


def test_published_methods_are_neither_trained_nor_of_this_project():
    names = {one.name for one in published(registered(nh.systems["henon_heiles"]))}
    assert {"babps8o7h", "srkn_b11", "leapfrog", "bcss_s4"} <= names
    assert not {name for name in names if name.startswith(("trained_", "babs8o6"))}
    general = {one.name for one in published(registered(nh.systems["relativistic_oscillator"]))}
    assert names - general == {one for one in names if nh.integrators[one].requires}


def test_the_window_of_an_error_has_it_in_its_middle(problems):
    """The best error there by ``nh.ensemble``, whose runs are others; between rungs it is interpolated."""
    ensemble, _, methods, *_ = problems
    frequency = orbit_of(ensemble.system).frequency
    low, high = window_at(ensemble, methods, 1e-6, frequency)
    assert high / low == pytest.approx(1.5, rel=0.01)  # three digits
    rows, middle = ensemble.start[:8], np.sqrt(low * high)
    means = []
    for one in contenders(dict(zip(methods, mean_errors(ensemble, methods, [middle]), strict=True))):
        many = nh.ensemble(
            ensemble.system, one, middle * one.stages, t_end=ensemble.t_end, q0=rows[:, :2], p0=rows[:, 4:6], samples=2
        )
        means.append(np.log10(many.max_energy_error.values * np.abs(many.initial_energy.values) / 0.125).mean())
    # neighbouring rungs differ by 0.4 decade, by a power of tau that is the same between them but for a tenth
    assert min(means) == pytest.approx(-6, abs=0.12)


def test_unknown_error_is_refused_with_existing_ones(problems):
    ensemble, _, methods, *_ = problems
    with pytest.raises(nh.NearharmonicError, match=r"error = 1e-20 is not allowed: between \S+e-1\d and "):
        window_at(ensemble, methods, 1e-20, 1.0)


def test_window_has_three_step_sizes_and_test_has_midpoints():
    taus, more = step_sizes((0.08, 0.12)), step_sizes((0.08, 0.12), between=True)
    assert (len(taus), taus[0], taus[-1]) == (3, 0.08, pytest.approx(0.12))
    assert more[::2] == pytest.approx(taus)
    wide = step_sizes((0.02, 0.2))
    assert (wide[1:] / wide[:-1]).max() < 1.26
