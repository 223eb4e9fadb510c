"""A tailored method: its search, its gain on other starts, and its file."""

from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.integrators import load_tableaus
from nearharmonic.training import tailor
from nearharmonic.training.family import Family, published
from nearharmonic.training.objective import Objective, mean_errors
from nearharmonic.training.question import contenders, orbit_of, question, registered, step_sizes, window_at

# --- The search: its budget, its best at any time, and the same method from the same seed.


@pytest.fixture(scope="module")
def problems():
    """(starts of the search, starts of the test, published methods, step sizes, their errors) of a window."""
    asked = question("henon_heiles", window="0.1:0.15")
    first, second = tailor.ensembles(asked, orbit_of(asked.system))
    methods = [one for one in published(registered(asked.system)) if not one.modified]
    taus = step_sizes(asked.window)
    return first, second, methods, taus, mean_errors(first, methods, taus.tolist())


def searched(problems, trials, seed=0, stages=(6,), **more):
    ensemble, _, methods, taus, errors = problems
    budget = tailor.Budget(None, trials)
    return tailor.TailorSearch(
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


def test_starts_are_published_methods_in_the_order_of_their_objective(problems):
    branches = searched(problems, 10**6, stages=(8,))._branches()
    values = [one.best.value for one in branches]
    assert values == sorted(values)
    assert max(values) < values[0] + tailor.Rounds().far_behind
    assert {one.start.origin for one in branches} >= {"babps8o7h", "nystrom_6a8", "babs7o7h, grown"}
    several = searched(problems, 10**6, stages=(6, 8, 11))._branches()
    assert [one.best.family.stages for one in several[:3]] != [8, 8, 8]
    assert {one.best.family.stages for one in several[:3]} == {6, 8, 11}


def test_settings_of_the_rounds_are_those_asked_for(problems):
    found = searched(problems, 300, rounds=tailor.Rounds(most_starts=2, trials=40, around_best=30)).run()
    # Two in the first round, one around the best; the random points behind it spend the budget.
    assert found.searches == 3
    few = searched(problems, 10**6, stages=(8,), rounds=tailor.Rounds(far_behind=0.1))._branches()
    assert 0 < len(few) < len(searched(problems, 10**6, stages=(8,))._branches())


def test_a_budget_in_time_ends_by_itself():
    shown = []
    budget = tailor.Budget(1e-3, None, lambda part, best: shown.append((part, best)))
    with pytest.raises(tailor.BudgetSpentError):
        list(iter(partial(budget.spend, 10, -0.5), False))
    assert shown[-1] == (1.0, -0.5)
    assert budget.trials == 10 * len(shown)


def test_families_have_free_coefficients_and_need_quadratic_T_if_stated():
    plain, quadratic = tailor.families((4, 8), quadratic=False), tailor.families((4, 8), quadratic=True)
    assert {one.order for one in plain} == {4}
    assert {one.order for one in quadratic} == {4, 6}
    for one in quadratic:
        assert one.unknowns > len(one.equations)
    assert Family(stages=4, first="drift") in plain


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


# --- The gain of a method: by runs of ``nh.ensemble``, with an interval by scipy, and the answer where there is none.

METHODS = tuple(nh.integrators[name] for name in ("babps8o7h", "babs7o7h", "ruth"))


@pytest.fixture(scope="module")
def held_out():
    asked = question("henon_heiles", window="0.1:0.15", energy="same")
    return tailor.ensembles(asked, orbit_of(asked.system))[1]


def errors(ensemble, method, tau):
    """max |dH/H0| of each start by ``nh.ensemble``, in plain sums as well."""
    rows, d = ensemble.start, ensemble.system.dimension
    many = nh.ensemble(
        ensemble.system, method, tau * (method.stages + method.gradients), t_end=ensemble.t_end, q0=rows[:, :d],
        p0=rows[:, 2 * d : 3 * d], samples=2, summation="plain",
    )  # fmt: skip
    return many.max_energy_error.values


def test_gains_are_those_of_runs_at_equal_cost(held_out):
    taus = np.array([0.1, 0.15])
    found = tailor.comparison(nh.integrators["nystrom_6a8"], METHODS, held_out, taus, seed=0)
    for i, tau in enumerate(taus):
        own = np.log10(errors(held_out, nh.integrators["nystrom_6a8"], tau))
        others = [np.log10(errors(held_out, one, tau)) for one in METHODS]
        best = int(np.argmin([one.mean() for one in others]))
        # the two kernels round otherwise, to 1e-15 of errors that are 1e-7 at least
        assert found.error[i] == pytest.approx(10 ** own.mean(), rel=1e-6)
        assert found.best_error[i] == pytest.approx(10 ** others[best].mean(), rel=1e-6)
        assert found.best[i] == METHODS[best].name
        assert found.gains[i].mean == pytest.approx((others[best] - own).mean(), abs=1e-6)
    assert found.gain.mean == pytest.approx(np.mean([one.mean for one in found.gains]), abs=1e-12)


@pytest.mark.parametrize("taus", [(0.05, 0.2, 0.4), (0.05, 0.4, 0.42, 0.44)])
def test_best_of_all_is_best_over_all_step_sizes(held_out, taus):
    """One is ahead at small steps, others at large ones; the second of the two sets has more of these."""
    methods = [nh.integrators[name] for name in ("leapfrog", "babps8o7h", "babs7o7h")]
    means = np.array([[np.log10(np.minimum(errors(held_out, one, t), 1)).mean() for t in taus] for one in methods])
    found = tailor.comparison(nh.integrators["ruth"], methods, held_out, np.array(taus), seed=0)
    assert found.best == tuple(methods[i].name for i in means.argmin(axis=0))
    assert found.best[0] != found.best[-1]
    assert found.overall is methods[means.mean(axis=1).argmin()]


def test_errors_of_all_starts_are_relative_to_one_energy(held_out):
    """That of the given start, 1/8; a system that declares an energy scale has that in its place."""
    assert held_out.scale == pytest.approx(0.125, rel=1e-15)
    plain, halved = (
        tailor.comparison(METHODS[0], METHODS[1:], one, np.array([0.12]), seed=0)
        for one in (held_out, replace(held_out, scale=0.25))
    )
    assert halved.error == pytest.approx(plain.error / 2, rel=1e-12)
    well = question(str(Path(__file__).parents[3] / "examples/double_well.py"))
    assert well.scale == 0.25


def test_the_interval_is_the_bootstrap_of_scipy(held_out):
    stats = pytest.importorskip("scipy.stats")
    found = tailor.comparison(nh.integrators["nystrom_6a8"], METHODS[:1], held_out, np.array([0.12]), seed=0).gain
    won = np.log10(errors(held_out, METHODS[0], 0.12)) - np.log10(errors(held_out, nh.integrators["nystrom_6a8"], 0.12))
    interval = stats.bootstrap((won,), np.mean, method="percentile", n_resamples=20000, rng=0).confidence_interval
    # of 2000 resamples: the ends of an interval are sure to about a tenth of the standard error
    sure = 0.2 * won.std() / np.sqrt(len(won))
    assert found.low == pytest.approx(interval.low, abs=sure)
    assert found.high == pytest.approx(interval.high, abs=sure)


def test_what_may_be_a_loss_is_no_gain():
    assert tailor.Gain(mean=0.2, low=0.01, high=0.4).is_one
    assert not tailor.Gain(mean=0.2, low=-0.01, high=0.4).is_one


def test_without_gain_registered_method_comes_back_with_warning():
    with pytest.warns(tailor.NoGainWarning, match="no gain over registered methods .*; this is trained_fine"):
        found = nh.tailor("henon_heiles", stages=5, window=(0.08, 0.12), trials=20)
    assert found is nh.integrators["trained_fine"]


@pytest.mark.slow
def test_test_uses_longer_runs_from_starts_outside_search():
    found = tailor.tailored(question("sho", window=(0.1, 0.2), trials=20, energy="same"))
    assert not {*map(tuple, found.ensemble.start)} & {*map(tuple, found.held_out.start)}
    assert found.held_out.t_end > 1.9 * found.ensemble.t_end  # a run has 24 steps at least
    for starts, compared in ((found.ensemble, found.training), (found.held_out, found.test)):
        own = np.log10(errors(starts, found.tableau, compared.tau_per_stage[1])).mean()
        assert compared.error[1] == pytest.approx(10**own, rel=1e-4)


@pytest.mark.slow
def test_registered_methods_that_fit_are_compared_and_other_authors_apart():
    found = tailor.tailored(question("sho", window=(0.1, 0.2), trials=20))
    means = {
        name: np.log10(errors(found.held_out, one, 0.1)).mean()
        for name, one in nh.integrators.items()
        if not (one.processed or one.implicit)
    }
    assert found.test.best[0] == min(means, key=means.get)
    ours = ("nearharmonic_2026", "nearharmonic_2026_modified", "trained", "trained_polynomial")
    others = {name: error for name, error in means.items() if nh.integrators.module_of(name).split(".")[-1] not in ours}
    assert found.published.best[0] == min(others, key=others.get)
    free = tailor.tailored(question("relativistic_oscillator", window=(0.1, 0.2), trials=20))
    assert not any(nh.integrators[name].requires for name in free.test.best)


# --- The file of a method: valid Python with all digits, for any texts.


@pytest.mark.parametrize("name", ["babps8o7h", "srkn_b11", "babs7o7h", "abas5o6h"])
def test_file_returns_every_digit_of_odd_and_even_rows(name, tmp_path):
    given = replace(nh.integrators[name], note="for a test", benchmarked=False, generalised_order=None)
    (tmp_path / "mine.py").write_text(tailor.file_text(given, "mine"), encoding="utf-8")
    (found,) = load_tableaus(tmp_path / "mine.py").values()
    assert found.name == "mine"
    for key in ("kick", "drift"):
        assert list(map(Fraction, getattr(found, key))) == list(map(Fraction, getattr(given, key)))
    same = ("label", "order", "first", "digits", "requires", "harmonic_order", "source", "note", "symmetric")
    assert [getattr(found, key) for key in same] == [getattr(given, key) for key in same]


@pytest.mark.parametrize("text", ['a "b" \\ c', '"""', "it's\nnew", "ü \\N{x} " * 30, "\\"])
def test_texts_with_quotes_and_backslashes_do_no_harm(text, tmp_path):
    given = replace(nh.integrators["babs7o7h"], label=text, source=text, note=text)
    (tmp_path / "mine.py").write_text(tailor.file_text(given, "mine"), encoding="utf-8")
    (found,) = load_tableaus(tmp_path / "mine.py").values()
    assert (found.label, found.source, found.note) == (text, text, text)
