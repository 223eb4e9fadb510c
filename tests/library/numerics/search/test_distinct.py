"""Distinct points: the first of near ones stands for all, in the order given."""

from __future__ import annotations

import numpy as np
import pytest

from nearharmonic.numerics.compiled import distinct


def test_points_near_an_earlier_one_are_counted_and_not_kept():
    points = np.array([[1.0, 2.0], [5.0, 0.0], [1.05, 1.95], [1.0, 2.2], [5.0, 0.1]])
    kept, hits = distinct(points, 0.11)
    assert kept.tolist() == [[1.0, 2.0], [5.0, 0.0], [1.0, 2.2]]
    assert hits == [2, 2, 1]


def test_every_unknown_has_to_be_near():
    assert distinct(np.array([[0.0, 0.0], [0.0, 1.0]]), 0.5)[1] == [1, 1]
    assert distinct(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.5)[1] == [1, 1]
    assert distinct(np.array([[0.0, 0.0], [-0.5, 0.5]]), 0.5)[1] == [2]


@pytest.mark.parametrize("relative", [False, True])
def test_distance_is_that_of_plain_rule_for_many_points(relative):
    points = np.random.default_rng(3).uniform(-3, 3, (400, 2))
    kept: list[np.ndarray] = []
    for x in points:
        reach = 0.3 * (max(1.0, np.abs(x).max()) if relative else 1.0)
        if all(np.abs(x - y).max() > reach for y in kept):
            kept.append(x)
    found, hits = distinct(points, 0.3, relative=relative)
    assert found.tolist() == np.array(kept).tolist()
    assert sum(hits) == 400


def test_at_most_wanted_number_is_kept_and_none_of_none():
    points = np.arange(10.0)[:, None]
    assert distinct(points, 0.1, most=3)[0].tolist() == [[0.0], [1.0], [2.0]]
    kept, hits = distinct(np.empty((0, 4)), 0.1)
    assert (kept.shape, hits) == ((0, 4), [])
