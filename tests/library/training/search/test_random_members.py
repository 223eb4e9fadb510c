"""Members near random points: of families with few members, proved by the order of their tableaus."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nearharmonic.theory.order import order_of
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, tableau_of
from nearharmonic.training.search import Effort, Pursuit, random_members, search

#: Five equations of order six for five unknowns: members are isolated.
FAMILY = Family(stages=6, first="kick", order=6, potential_degree=3)


def found(family, count, seed=1, **settings):
    return random_members(family, count, np.random.default_rng(seed), Pursuit(**settings))


def proved(family, x):
    return order_of(tableau_of(family, x.tolist(), nearest=1e-5, name="one", source="here"), potential_degree=3)


@pytest.mark.slow
def test_isolated_members_of_order_six_are_found_again_and_again():
    x = found(FAMILY, 1500, batch=500)
    # Of the points 1 to 3 % lead to a member, which is one of a few.
    assert len(x) > 15
    assert FAMILY.met(x).all()
    different = {tuple(one) for one in np.round(x, 6).tolist()}
    assert len(different) < len(x) / 3
    assert {proved(FAMILY, np.array(one)) for one in list(different)[:2]} == {6}


@pytest.mark.slow
def test_fifteen_stages_have_order_eight_for_cubic_potentials():
    family = Family(stages=15, first="drift", order=8, potential_degree=3)
    x = found(family, 4000)
    assert family.met(x).all()
    assert proved(family, x[0]) == 8


def test_random_points_without_a_member_give_none():
    assert found(FAMILY, 0).shape == (0, 5)
    assert found(FAMILY, 100, steps=1, kept=()).shape == (0, 5)


class Size:
    """An objective: the largest unknown."""

    family, trials = FAMILY, 0

    def part(self, share):
        return self

    def __call__(self, points):
        x, inside = self.family.project(points)
        self.trials += len(x)
        return np.where(inside, np.abs(x).max(axis=1), OUTSIDE)


@pytest.mark.slow
def test_search_begins_at_the_best_members():
    effort = Effort(trials=40, members=1500, member_starts=2)
    searcher = search(Size(), iter(()), effort, 3)
    assert [one.origin for one in searcher.found] == ["random member"] * 2
    every = random_members(FAMILY, 1500, np.random.default_rng([3, 2]))
    # The members are isolated, so that a descent stays at its start.
    assert searcher.best.value == pytest.approx(np.abs(every).max(axis=1).min(), rel=1e-6)
    assert not search(Size(), iter(()), replace(effort, members=0), 3).found
