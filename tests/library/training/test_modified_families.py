"""Methods of order six with kicks of a modified potential: found from random starts, and their digits."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.theory.order import leading_errors
from nearharmonic.training.family import Family
from nearharmonic.training.objective import tableau_of

#: The family of ``abag5o6``, whose second kick is free, and the index of that.
FREE, SECOND_KICK = Family(stages=5, first="drift", order=6, squares=(0, 1, 2)), 3
FAMILIES = {
    "abag5o6": FREE,
    "omelyan_g5o6": Family(stages=5, first="drift", order=6, squares=(0, 2)),
    "babg5o6": Family(stages=5, first="kick", order=6, squares=(0, 1)),
}
METHODS = pytest.mark.parametrize("name", list(FAMILIES))


def solutions(family, count=3000):
    """Members (R, n) from random points, the first of each row of size 1/s."""
    random = np.random.default_rng(1)
    points = random.normal(1 / family.stages, 2 / family.stages, (count, family.unknowns))
    points[:, family.stages - 1 :] *= 1 / family.stages**2
    found, inside = family.project(points)
    return found[inside]


def sums(family, x):
    """Sum of the absolute values of all kicks and drifts of each member."""
    kicks, drifts, _ = family.rows(x.T)
    return sum(np.abs(row) for row in (*kicks, *drifts))


def member_at(kick):
    unknowns = FREE.unknowns_of(nh.modified_integrators["abag5o6"])
    return tableau_of(
        FREE, unknowns, digits=30, fixed={SECOND_KICK: kick}, nearest=0.1, name="one", source="here"
    )  # fmt: skip


def test_every_registered_method_of_order_six_has_its_family_here():
    assert set(FAMILIES) == {name for name, one in nh.modified_integrators.items() if one.order == 6}
    assert {name: one.unknowns - len(one.equations) for name, one in FAMILIES.items()} == {
        "abag5o6": 1, "omelyan_g5o6": 0, "babg5o6": 0,
    }  # fmt: skip


@METHODS
def test_registered_digits_follow_from_ten_of_them(name):
    known, family = nh.modified_integrators[name], FAMILIES[name]
    fixed = {SECOND_KICK: known.kick[1]} if family is FREE else None
    near = family.unknowns_of(known) * (1 + 1e-10)
    found = tableau_of(family, near, digits=known.digits, fixed=fixed, name=name, source="here")
    for row in ("kick", "drift", "square"):
        for ours, text in zip(getattr(found, row), getattr(known, row), strict=True):
            assert abs(Fraction(ours) - Fraction(text)) < Fraction(1, 10**known.digits)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["omelyan_g5o6", "babg5o6"])
def test_random_starts_lead_to_the_registered_methods_with_nothing_free(name):
    family = FAMILIES[name]
    found = solutions(family)
    away = np.abs(found - family.unknowns_of(nh.modified_integrators[name])).max(axis=1)
    assert away.min() < 1e-10
    # It is the one with the smallest coefficients.
    assert sums(family, found).argmin() in np.flatnonzero(away < 1e-6)


def test_random_starts_lead_to_the_family_of_the_registered_method():
    found = solutions(FREE)
    assert len(found) > 100
    ours = FREE.unknowns_of(nh.modified_integrators["abag5o6"])
    # The outermost coefficients hardly change along the family.
    assert (np.abs(found - ours)[:, [0, 2]].max(axis=1) < 2e-3).any()


def test_our_parameter_minimises_degree_seven_error_to_five_digits():
    least = leading_errors(nh.modified_integrators["abag5o6"]).nystrom.norm
    assert leading_errors(member_at("0.061")).nystrom.norm == pytest.approx(least, rel=1e-12)
    for kick in ("0.057", "0.065"):
        norm = leading_errors(member_at(kick)).nystrom.norm
        assert least < norm
        assert norm == pytest.approx(least, rel=1e-3)


def test_the_published_method_has_the_digits_of_its_paper():
    tableau = nh.modified_integrators["omelyan_g5o6"]
    printed = [
        (tableau.drift[0], "0.1097059723948682"),
        (tableau.drift[1], "0.4140632267310831"),
        (tableau.kick[0], "0.2693315848935301"),
        (tableau.kick[1], "1.131980348651556"),
        (tableau.square[2], "-0.01324638643416052"),
        (tableau.square[0], "0.0008642161339706166"),
    ]
    for text, digits in printed:
        assert float(text) == pytest.approx(float(digits), rel=2e-15)
