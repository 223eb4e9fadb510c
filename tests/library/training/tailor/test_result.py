"""The gain of a method: by runs of ``nh.ensemble``, with an interval by scipy, and the answer where there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.theory.order import harmonic_order
from nearharmonic.training.question import orbit_of, question
from nearharmonic.training.tailor import Gain, NoGainWarning, comparison, ensembles, tailored

METHODS = tuple(nh.integrators[name] for name in ("babps8o7h", "babs7o7h", "ruth"))


@pytest.fixture(scope="module")
def held_out():
    asked = question("henon_heiles", window="0.1:0.15", energy="same")
    return ensembles(asked, orbit_of(asked.system))[1]


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
    found = comparison(nh.integrators["nystrom_6a8"], METHODS, held_out, taus, seed=0)
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
    found = comparison(nh.integrators["ruth"], methods, held_out, np.array(taus), seed=0)
    assert found.best == tuple(methods[i].name for i in means.argmin(axis=0))
    assert found.best[0] != found.best[-1]
    assert found.overall is methods[means.mean(axis=1).argmin()]


def test_errors_of_all_starts_are_relative_to_one_energy(held_out):
    """That of the given start, 1/8; a system that declares an energy scale has that in its place."""
    assert held_out.scale == pytest.approx(0.125, rel=1e-15)
    plain, halved = (
        comparison(METHODS[0], METHODS[1:], one, np.array([0.12]), seed=0)
        for one in (held_out, replace(held_out, scale=0.25))
    )
    assert halved.error == pytest.approx(plain.error / 2, rel=1e-12)
    well = question(str(Path(__file__).parents[4] / "examples/double_well.py"))
    assert well.scale == 0.25


def test_the_interval_is_the_bootstrap_of_scipy(held_out):
    stats = pytest.importorskip("scipy.stats")
    found = comparison(nh.integrators["nystrom_6a8"], METHODS[:1], held_out, np.array([0.12]), seed=0).gain
    won = np.log10(errors(held_out, METHODS[0], 0.12)) - np.log10(errors(held_out, nh.integrators["nystrom_6a8"], 0.12))
    interval = stats.bootstrap((won,), np.mean, method="percentile", n_resamples=20000, rng=0).confidence_interval
    # of 2000 resamples: the ends of an interval are sure to about a tenth of the standard error
    sure = 0.2 * won.std() / np.sqrt(len(won))
    assert found.low == pytest.approx(interval.low, abs=sure)
    assert found.high == pytest.approx(interval.high, abs=sure)


def test_what_may_be_a_loss_is_no_gain():
    assert Gain(mean=0.2, low=0.01, high=0.4).is_one
    assert not Gain(mean=0.2, low=-0.01, high=0.4).is_one


def test_a_registered_method_gains_nothing_over_itself(held_out):
    found = comparison(METHODS[0], METHODS, held_out, np.array([0.1, 0.12]), seed=0)
    assert found.gain.mean <= 0
    assert not found.gain.is_one


def test_without_gain_registered_method_comes_back_with_warning():
    with pytest.warns(NoGainWarning, match="no gain over registered methods .*; this is trained_fine"):
        found = nh.tailor("henon_heiles", stages=5, window=(0.08, 0.12), trials=20)
    assert found is nh.integrators["trained_fine"]


@pytest.mark.slow
def test_henon_heiles_method_gains_third_of_decade_on_other_starts():
    """The trial of this idea gained 0.3 to 0.9 decade in windows like this one."""
    found = nh.tailor("henon_heiles", window=(0.08, 0.12), trials=900)
    assert (found.stages, found.order, found.symmetric, found.digits) == (8, 4, True, 60)
    assert nh.order_of(found) == 4
    assert harmonic_order(found) == found.harmonic_order
    # a start that is neither of the search nor of the test: the system's own, and many others on its surface
    random = np.random.default_rng(5)
    q, p = random.normal(size=(2, 64, 2)) * 0.15
    x, y = q.T
    p *= np.sqrt((0.25 - 2 * ((x * x + y * y) / 2 + x * x * y - y**3 / 3)) / (p * p).sum(axis=1))[:, None]
    gains = []
    for tau in (0.085, 0.1, 0.115):
        runs = [
            nh.ensemble("henon_heiles", one, tau * one.stages, t_end=300, q0=q, p0=p, samples=2).max_energy_error
            for one in (found, nh.integrators["babps8o7h"], nh.integrators["babs7o7h"])
        ]
        own, *others = (np.log10(run.values).mean() for run in runs)
        gains.append(min(others) - own)
    assert min(gains) > 0.2
    assert np.mean(gains) > 0.3


@pytest.mark.slow
def test_test_uses_longer_runs_from_starts_outside_search():
    found = tailored(question("sho", window=(0.1, 0.2), trials=20, energy="same"))
    assert not {*map(tuple, found.ensemble.start)} & {*map(tuple, found.held_out.start)}
    assert found.held_out.t_end > 1.9 * found.ensemble.t_end  # a run has 24 steps at least
    for starts, compared in ((found.ensemble, found.training), (found.held_out, found.test)):
        own = np.log10(errors(starts, found.tableau, compared.tau_per_stage[1])).mean()
        assert compared.error[1] == pytest.approx(10**own, rel=1e-4)


def test_a_gradient_costs_a_force_beside_modified_kicks(held_out):
    taus, name = np.array([0.1, 0.15]), "chin_4a"
    found = comparison(METHODS[0], [nh.integrators[name]], held_out, taus, seed=0)
    method = nh.integrators[name]
    assert (method.stages, method.gradients, found.best) == (2, 1, (name, name))
    for i, tau in enumerate(taus):
        rows, step = held_out.start, tau * (method.stages + method.gradients)
        many = nh.ensemble(
            "henon_heiles", method, step, t_end=held_out.t_end, q0=rows[:, :2], p0=rows[:, 4:6], samples=2,
            summation="plain",
        )  # fmt: skip
        assert found.best_error[i] == pytest.approx(10 ** np.log10(many.max_energy_error.values).mean(), rel=1e-6)


@pytest.mark.slow
def test_registered_methods_that_fit_are_compared_and_other_authors_apart():
    found = tailored(question("sho", window=(0.1, 0.2), trials=20))
    means = {
        name: np.log10(errors(found.held_out, one, 0.1)).mean()
        for name, one in nh.integrators.items()
        if not (one.processed or one.implicit)
    }
    assert found.test.best[0] == min(means, key=means.get)
    ours = ("nearharmonic_2026", "nearharmonic_2026_modified", "trained", "trained_polynomial")
    others = {name: error for name, error in means.items() if nh.integrators.module_of(name).split(".")[-1] not in ours}
    assert found.published.best[0] == min(others, key=others.get)
    free = tailored(question("relativistic_oscillator", window=(0.1, 0.2), trials=20))
    assert not any(nh.integrators[name].requires for name in free.test.best)
