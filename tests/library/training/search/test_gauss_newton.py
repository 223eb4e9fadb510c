"""Gauss-Newton descents: they end at minima that scans find, within the family and within their trials."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective
from nearharmonic.training.search import Descent, Effort, Start, descend
from nearharmonic_studies.trained.problems import random_ensemble, with_exact_oscillators
from support.methods.family_members import members

WINDOW = (0.06, 0.09)
ENSEMBLES = (
    random_ensemble(2, 12, 1, band=(0.05, 0.4), t_end=15.0),
    random_ensemble(3, 8, 2, band=(0.05, 0.4), t_end=15),
)
REFERENCES = (np.array([-6.0, -5.0]), np.array([-5.5, -4.5]))


def objective_of(family, ensembles=ENSEMBLES, **more):
    return Objective(family, ensembles, WINDOW, REFERENCES[: len(ensembles)], size=21, **more)


@pytest.mark.slow
@pytest.mark.parametrize("exact", [False, True], ids=["kinetic_potential", "exact_oscillator"])
@pytest.mark.parametrize("first", ["drift", "kick"])
def test_descent_ends_at_minima_of_scans_along_members(first, exact):
    family = Family(stages=7, first=first)  # six unknowns, two conditions
    objective = objective_of(family, tuple(map(with_exact_oscillators, ENSEMBLES)) if exact else ENSEMBLES)
    starts = members(family, 3)
    ends = np.array([Descent(objective).minimise(start, 1000, 1e-4) for start in starts])
    at_ends = objective(ends)
    assert (objective(starts) - at_ends).min() > 0.3
    for end, value in zip(ends, at_ends, strict=True):
        for direction in np.linalg.svd(family.slopes(end))[2][2:]:
            scan, inside = family.project(end + np.linspace(-0.02, 0.02, 21)[:, None] * direction)
            # The rms over samples is minimised, and the minima of both differ by some hundredths of a decade.
            assert value < objective(scan)[inside].min() + 0.1


@pytest.mark.slow
def test_spread_moves_the_start_of_a_descent():
    family = Family(stages=7, first="drift")
    objective, point = objective_of(family), members(family, 1)[0]
    effort = Effort(trials=0, descent="gauss_newton")

    def moved(spread, seed=1):
        _, end = descend(objective, Start(origin="here", point=point, spread=spread), effort, seed)
        return np.abs(end - point).max()

    assert moved(0.0) < 1e-12
    assert 1e-4 < moved(1e-3) < 1e-2
    assert moved(1e-3) == moved(1e-3) != moved(1e-3, seed=2)


@pytest.mark.slow
def test_part_of_objective_has_its_first_problems_at_same_cost():
    family = Family(stages=6, first="kick", squares=(0,))
    x = members(family, 3)
    whole = objective_of(family, charge=0.7)
    parts = [one.part(slice(-(-one.size // 4))) for one in ENSEMBLES]
    wanted = objective_of(family, parts, charge=0.7)(x)
    assert whole.part(4)(x).tobytes() == wanted.tobytes()
    assert whole.trials == 0


@pytest.mark.slow
def test_trials_of_a_descent_are_counted_and_bounded():
    family = Family(stages=7, first="drift")
    objective, start = objective_of(family), members(family, 1)[0]
    found = [Descent(objective).minimise(start, trials, 0.0) for trials in (0, 30, 100)]
    assert found[0].tobytes() == family.project(start[None])[0][0].tobytes()
    values = objective(np.array(found))
    assert values[2] < values[1] < values[0]
    before = objective.trials
    descent = Descent(objective)
    descent.minimise(start, 100, 0.0)
    assert 100 <= objective.trials - before < 100 + 2 * descent.size


def test_start_outside_and_family_of_one_member_stay():
    only = Family(stages=3, first="kick")  # two unknowns, two conditions
    member = members(only, 1)[0]
    assert Descent(objective_of(only)).minimise(member, 100, 1e-3) == pytest.approx(member, abs=1e-12)
    family = Family(stages=6, first="kick")
    objective = objective_of(family)
    for far in (300.0, np.nan):
        start = Start(origin="far", point=np.full(family.unknowns, far), spread=0.01)
        value, _ = descend(objective, start, Effort(trials=50, descent="gauss_newton"), 1)
        assert value >= OUTSIDE


def test_bound_of_the_coefficients_holds_on_the_way():
    family = Family(stages=7, first="drift")
    start = members(family, 1)[0]
    total = sum(np.abs(row).sum() for row in family.rows(start)[:2])
    end = Descent(objective_of(family, largest_sum=total + 0.01)).minimise(start, 200, 1e-3)
    assert sum(np.abs(row).sum() for row in family.rows(end)[:2]) < total + 0.01
