"""The objective of a search: what it compares, what it refuses, and that a member's value is its own."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.training.family import Family
from nearharmonic.training.objective import (
    LARGEST_SUM,
    OUTSIDE,
    Objective,
    errors_of,
    mean_errors,
    tableau_of,
)
from nearharmonic_studies.trained.problems import orbit_ensemble, random_ensemble
from support.methods.family_members import members

WINDOW = (0.06, 0.09)
ENSEMBLES = (
    random_ensemble(2, 6, 1, band=(0.05, 0.4), t_end=15.0),
    orbit_ensemble(5, 1, eccentricities=(0.02, 0.3), orbits=2.0),
)
REFERENCES = (np.array([-6.0, -5.0]), np.array([-4.0, -3.5]))


def objective_of(family, size=20, **more):
    return Objective(family, ENSEMBLES, WINDOW, REFERENCES, size=size, **more)


@pytest.mark.parametrize(
    "family", [Family(stages=6, first="kick"), Family(stages=4, first="drift", squares=(0, 1))], ids=str
)
def test_value_is_worst_difference_and_half_of_mean(family):
    x = members(family, 3)
    found = objective_of(family, charge=0.5)(x)
    for value, one in zip(found, x, strict=True):
        tableau = tableau_of(family, one, digits=20, name="one", source="here")
        differences = []
        for i, tau in enumerate(WINDOW):
            of_ensembles = [
                np.log10(np.maximum(errors_of(ensemble, tableau, [tau], 0.5)[0], 1e-16)).mean() - reference[i]
                for ensemble, reference in zip(ENSEMBLES, REFERENCES, strict=True)
            ]
            differences.append(sum(of_ensembles) / 2)
        # Coefficients of members and of the polished tableau differ by rounding, whose part of an error is 1e-6.
        assert value == pytest.approx(max(differences) + sum(differences) / 4, abs=1e-4)


def test_gains_are_decades_below_reference_by_ensemble_and_step_size():
    family = Family(stages=6, first="kick")
    x = members(family, 4)
    objective = objective_of(family)
    gains = objective.gains(x)
    assert gains.shape == (2, 4, 2)
    worst = (-gains).mean(axis=0)
    assert objective(x) == pytest.approx(worst.max(axis=1) + worst.mean(axis=1) / 2, abs=1e-6)
    tableau = tableau_of(family, x[1], digits=20, name="one", source="here")
    for k in range(2):
        wanted = REFERENCES[k] - mean_errors(ENSEMBLES[k], [tableau], WINDOW)[0]
        assert gains[k, 1] == pytest.approx(wanted, abs=1e-4)


def test_value_of_point_is_that_of_member_next_to_it():
    family = Family(stages=6, first="kick")
    near = members(family, 3) + 1e-3
    objective = objective_of(family)
    assert objective(near) == pytest.approx(objective(family.project(near)[0]), abs=1e-6)


def test_outside_points_are_worse_than_members_increasing_with_distance():
    family = Family(stages=6, first="kick")
    x = members(family, 3)
    objective = objective_of(family)
    outside = np.full((5, family.unknowns), np.nan)
    outside[1] = 1e200
    outside[2] = -np.inf
    outside[3] = 30.0  # too far for as many Newton steps
    outside[4] = 300.0
    found = objective(np.concatenate([outside, x]))
    assert (found[5:] < OUTSIDE).all()
    assert (found[:5] >= OUTSIDE).all()
    assert np.isfinite(found).all()
    assert found[3] <= found[4] <= found[0] == found[1] == found[2] == OUTSIDE + 1
    assert found[5:].tobytes() == objective(x).tobytes()


def test_members_with_large_coefficients_are_outside():
    family = Family(stages=6, first="kick")
    x = members(family, 5)
    sums = np.array([sum(np.abs(row).sum() for row in family.rows(one)[:2]) for one in x])
    bound = np.sort(sums)[1:3].mean()  # between two members: the sum of one on the bound is rounded to either side
    found = objective_of(family, largest_sum=bound)(x)
    assert ((found >= OUTSIDE) == (sums >= bound)).all()
    beyond = sums[sums >= bound]
    assert found[sums >= bound] == pytest.approx(OUTSIDE + 0.01 * beyond, abs=1e-9)
    assert (sums < LARGEST_SUM).all()


def test_every_point_is_a_trial():
    family = Family(stages=6, first="kick")
    objective = objective_of(family, size=2)
    assert objective.trials == 0
    objective(members(family, 5))
    objective(np.full((3, family.unknowns), np.nan))
    assert objective.trials == 8


def test_a_gradient_of_the_square_is_charged():
    tableau, ensemble = nh.modified_integrators["omelyan_g5o6"], ENSEMBLES[0]
    cost = 5 + 0.7 * tableau.gradients
    free = errors_of(ensemble, tableau, [0.05 * cost / 5])
    assert errors_of(ensemble, tableau, [0.05], 0.7) == pytest.approx(free, rel=1e-6)
    assert (errors_of(ensemble, tableau, [0.05]) < free).mean() > 0.8
