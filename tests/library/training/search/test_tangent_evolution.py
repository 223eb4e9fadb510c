"""Evolution in the tangent space of a family: what it ends at, what it costs, where it looks."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE
from nearharmonic.training.search import Effort, Found, Searcher, Start, descend
from support.methods.family_members import members

#: Eight unknowns, two equations of order four, and two of a harmonic order of six.
FAMILY = Family(stages=9, first="drift", harmonic_order=6)


class Distance:
    """An objective: the distance to a point that is no member; it keeps all points that it is asked for."""

    def __init__(self, family, target):
        self.family, self.target, self.trials, self.asked = family, target, 0, []

    def __call__(self, points):
        x, inside = self.family.project(points)
        self.trials += len(x)
        self.asked.append(points)
        return np.where(inside, np.sqrt(((x - self.target) ** 2).sum(axis=1)), OUTSIDE)


def descended(objective, point, descent, trials, spread=0.02, **effort):
    start = Start(origin="here", point=point, spread=spread)
    return descend(objective, start, Effort(trials=trials, descent=descent, small_value=1e-12, **effort), 3)


@pytest.mark.slow
def test_it_ends_where_no_member_nearby_is_closer():
    """At the nearest member the way to the target is normal to the members, a combination of the slopes."""
    x = members(FAMILY, 1)[0]
    objective = Distance(FAMILY, x + 0.1 * np.random.default_rng(2).normal(size=len(x)))
    value, end = descended(objective, x, "tangent_evolution", 1200)
    assert FAMILY.met(end[None])[0]
    assert value == pytest.approx(objective(end[None])[0], abs=1e-12)
    way, slopes = objective.target - end, FAMILY.slopes(end)
    rest = way - np.linalg.lstsq(slopes.T, way, rcond=None)[0] @ slopes
    # Strategies end with steps of 1e-6 or so, at which the distance changes by its rounding.
    assert np.linalg.norm(rest) < 1e-4 * np.linalg.norm(way)


def test_all_its_points_lie_in_a_tangent_space():
    objective = Distance(FAMILY, members(FAMILY, 2)[1])
    start = members(FAMILY, 1)[0]
    descended(objective, start, "tangent_evolution", 60, tangents=1)
    steps = np.concatenate(objective.asked[1:-1]) - start
    assert np.abs(steps).max() > 1e-3
    assert np.abs(FAMILY.slopes(start) @ steps.T).max() < 1e-10


def test_family_without_freedom_returns_the_projected_start():
    isolated = Family(stages=6, first="kick", order=6, potential_degree=3)
    x = np.array([0.1] * 5)
    objective = Distance(isolated, x)
    value, end = descended(objective, x, "tangent_evolution", 40)
    assert value == OUTSIDE
    assert np.array_equal(end, isolated.project(x[None])[0][0])


def test_it_is_refined_around_the_best_itself():
    best = Found(family=FAMILY, value=0.0, unknowns=members(FAMILY, 1)[0], origin="here", trials=1)
    start = Searcher(Effort(trials=1, descent="tangent_evolution"), 1).near(best, 0, "refined")
    assert np.array_equal(start.point, best.unknowns)
