"""Populations against plain loops, and the objective of a search."""

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.training import objective as goal
from nearharmonic.training.family import Family
from nearharmonic_studies.trained.problems import orbit_ensemble, random_ensemble, with_exact_oscillators
from support.methods.family_members import members
from support.oracles.plain_runs import (
    henon_heiles_energy,
    henon_heiles_gradient,
    henon_heiles_gradient_of_square,
    largest_error,
)

# --- Populations: each lane is the run that a plain loop makes, with the coefficients, step and start of the lane.

#: Rounding of doubles in some thousand operations, relative to an energy of 0.1.
ROUNDING = 3e-13
STARTS = [(0.1, 0.2, 0.3, -0.1), (0.3, -0.2, 0.1, 0.2), (0.0, 0.1, 0.35, 0.05), (-0.2, 0.25, 0.1, 0.3)]


def henon_heiles(t_end=10.0, unit=1.0, starts=STARTS):
    start = np.zeros((len(starts), 4, 2))
    start[:, 0], start[:, 2] = np.array(starts)[:, :2], np.array(starts)[:, 2:]
    return goal.Ensemble(
        name="orbits", system=nh.systems["henon_heiles"], start=start.reshape(-1, 8), parameters=np.zeros((1, 0)),
        t_end=t_end, unit=unit,
    )  # fmt: skip


def rows_of(family, count, seed=1):
    """Symmetric rows (count, ...) of a family near leapfrog, which meet no condition."""
    random = np.random.default_rng(seed)
    x = random.normal(1 / family.stages, 0.2 / family.stages, (count, family.unknowns))
    x[:, family.stages - 1 :] *= 0.05
    return tuple(np.array([family.rows(one)[i] for one in x], dtype=float) for i in range(3))


FAMILIES = [
    Family(stages=stages, first=first, squares=squares)
    for first in ("drift", "kick")
    for stages, squares in ((3, ()), (6, ()), (3, (0, 1)), (4, (1,)), (5, (0,)), (5, (0, 2)))
]


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=str)
def test_every_lane_is_the_run_of_a_plain_loop(family):
    rows, taus_per_stage = rows_of(family, 3), (0.05, 0.09)
    ensemble = henon_heiles()
    population = goal.Population(ensemble, family.shape(), taus_per_stage, 3)
    found = population.errors(rows[0], rows[1], rows[2] if family.squares else None)
    assert found.shape == (3, 2, 4)
    square = henon_heiles_gradient_of_square if family.squares else None
    for c in range(3):
        for t, each in enumerate(taus_per_stage):
            steps = round(10 / (each * family.stages))
            for m, start in enumerate(STARTS):
                wanted = largest_error(
                    [row[c] for row in rows], family.first, 10 / steps, steps, start[:2], start[2:],
                    henon_heiles_energy, henon_heiles_gradient, square,
                )  # fmt: skip
                assert wanted > 1e-9
                assert found[c, t, m] == pytest.approx(wanted, rel=1e-9, abs=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_problems_have_parameters_of_their_own(dimension):
    ensemble = random_ensemble(dimension, 5, 3, band=(0.1, 0.5), t_end=10.0)
    family = Family(stages=4, first="kick")
    kicks, drifts, squares = rows_of(family, 2)
    found = goal.Population(ensemble, family.shape(), [0.06], 2).errors(kicks, drifts)
    steps = round(10 / 0.24)
    for m in range(5):
        values, start = ensemble.parameters[m].reshape(-1, 2)[:, 0], ensemble.start[m].reshape(4, dimension)

        def V(q, values=values):
            return ensemble.system.V(tuple(q), *values)

        def grad(q, V=V):
            return np.array([V(q + 1e-40j * e).imag / 1e-40 for e in np.eye(dimension)])

        for c in range(2):
            wanted = largest_error(
                (kicks[c], drifts[c], squares[c]), "kick", 10 / steps, steps, start[0], start[2],
                lambda q, p, V=V: p @ p / 2 + V(q), grad,
            )  # fmt: skip
            assert found[c, 0, m] == pytest.approx(wanted, rel=1e-8, abs=ROUNDING)


def rotated_error(kicks, drifts, first, tau, steps, w, force, energy, q, p):
    """Largest |dH/H0| of a plain loop over kicks by a force and rotations with the frequencies w."""
    start, worst = energy(q, p), 0.0
    for _ in range(steps):
        for i in range(max(len(kicks), len(drifts))):
            for operator in ("kick", "drift") if first == "kick" else ("drift", "kick"):
                if operator == "kick" and i < len(kicks):
                    p = p + kicks[i] * tau * force(q)
                elif operator == "drift" and i < len(drifts):
                    x = w * drifts[i] * tau
                    q, p = q * np.cos(x) + p * np.sin(x) / w, p * np.cos(x) - q * w * np.sin(x)
        worst = max(worst, abs((energy(q, p) - start) / start))
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("first", ["drift", "kick"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_exactly_solved_oscillators_have_the_frequencies_of_each_problem(dimension, first):
    plain = random_ensemble(dimension, 4, 3, band=(0.1, 0.5), t_end=10.0)
    family = Family(stages=5, first=first)
    kicks, drifts, _ = rows_of(family, 2)
    found = goal.Population(with_exact_oscillators(plain), family.shape(), [0.05, 0.09], 2).errors(kicks, drifts)
    for m in range(4):
        values, start = plain.parameters[m].reshape(-1, 2)[:, 0], plain.start[m].reshape(4, dimension)
        w = np.sqrt(values[:dimension])

        def V(q, values=values):
            return plain.system.V(tuple(q), *values)

        def force(q, V=V, w=w):
            return np.array([-V(q + 1e-40j * e).imag / 1e-40 for e in np.eye(dimension)]) + w * w * q

        for c in range(2):
            for t, each in enumerate((0.05, 0.09)):
                steps = round(10 / (5 * each))
                wanted = rotated_error(
                    kicks[c], drifts[c], first, 10 / steps, steps, w, force, lambda q, p, V=V: p @ p / 2 + V(q),
                    start[0], start[2],
                )  # fmt: skip
                assert wanted > 1e-7
                assert found[c, t, m] == pytest.approx(wanted, rel=1e-8, abs=ROUNDING)


def test_modified_kicks_with_exact_oscillators_are_refused():
    ensemble = with_exact_oscillators(random_ensemble(2, 2, 3, band=(0.1, 0.5), t_end=10.0))
    with pytest.raises(SettingError, match="shape = "):
        goal.Population(ensemble, Family(stages=5, first="drift", squares=(0, 1)).shape(), [0.05], 1)


@pytest.mark.slow
@pytest.mark.parametrize("exact", [False, True])
def test_signed_energies_at_every_step_have_the_largest_error(exact):
    ensemble = random_ensemble(2, 4, 3, band=(0.1, 0.5), t_end=10.0)
    ensemble = with_exact_oscillators(ensemble) if exact else ensemble
    family = Family(stages=5, first="kick")
    rows = rows_of(family, 3)[:2]
    largest = goal.Population(ensemble, family.shape(), [0.05, 0.1], 3).errors(*rows)
    signed = goal.Population(ensemble, family.shape(), [0.05, 0.1], 3, samples=100).energies(*rows)
    assert signed.shape == (3, 2, 4, 40)
    assert (signed[:, 1, :, 20:] == 0).all()
    assert (signed < 0).any()
    assert (signed > 0).any()
    assert np.abs(signed).max(axis=-1) == pytest.approx(largest, rel=1e-12)


@pytest.mark.filterwarnings("ignore:tau = .* runs as")
@pytest.mark.parametrize("name", ["babs7o7h", "srkn_a14", "omelyan_g5o6", "chin_4a"])
def test_errors_of_a_method_are_those_of_integrate(name):
    tableau = nh.integrators[name]
    found = goal.errors_of(henon_heiles(t_end=20.0), tableau, [0.05, 0.1])
    for t, each in enumerate((0.05, 0.1)):
        for m, start in enumerate(STARTS):
            run = nh.integrate(
                "henon_heiles", tableau, each * tableau.stages, t_end=20.0, summation="plain", samples=7,
                q0=start[:2], p0=start[2:],
            )  # fmt: skip
            assert found[t, m] == pytest.approx(float(run.max_energy_error), rel=1e-6, abs=ROUNDING)


def test_steps_cover_the_interval_at_the_cost_that_is_charged():
    ensemble = henon_heiles(t_end=50.0, unit=2.0)
    shape = Family(stages=5, first="kick").shape()
    plain = goal.Population(ensemble, shape, [0.02, 0.05, 1e6], 1)
    assert plain.steps.tolist() == [250, 100, 1]
    expensive = goal.Population(ensemble, shape, [0.02, 0.05], 1, cost=8.0)
    assert expensive.steps.tolist() == [round(50 / 0.32), round(50 / 0.8)]
    for one in (plain, expensive):
        assert one.taus * one.steps == pytest.approx(50.0, rel=1e-15)


@pytest.mark.parametrize("squares", [(), (0,)])
def test_lost_run_has_error_one_without_effect_on_others(squares):
    starts = [*STARTS[:2], (0.9, 1.4, 0.2, 0.5), STARTS[3]]  # the third escapes
    family = Family(stages=3, first="drift", squares=squares)
    kicks, drifts, square = rows_of(family, 1)
    ensemble = henon_heiles(t_end=200.0, starts=starts)
    found = goal.Population(ensemble, family.shape(), [0.1], 1).errors(kicks, drifts, square if squares else None)[0, 0]
    alone = goal.Population(ensemble.part(np.array([0, 1, 3])), family.shape(), [0.1], 1)
    assert found[2] == goal.LOST
    assert (found[[0, 1, 3]] < 0.1).all()
    sampled = goal.Population(ensemble, family.shape(), [0.1], 1, samples=9)
    energies = sampled.energies(kicks, drifts, square if squares else None)[0, 0]
    assert np.isinf(energies[2]).all()
    assert np.isfinite(energies[[0, 1, 3]]).all()
    assert found[[0, 1, 3]].tobytes() == alone.errors(kicks, drifts, square if squares else None)[0, 0].tobytes()
    unstable = goal.Population(ensemble, family.shape(), [2.0], 1).errors(kicks, drifts, square if squares else None)
    assert (unstable == goal.LOST).all()


def test_invalid_coefficients_lose_only_their_own_runs():
    family = Family(stages=4, first="kick")
    kicks, drifts, _ = rows_of(family, 3)
    population = goal.Population(henon_heiles(), family.shape(), [0.05], 3)
    alone = population.errors(kicks, drifts)
    kicks[1, 2] = np.nan
    found = population.errors(kicks, drifts)
    assert (found[1] == goal.LOST).all()
    assert found[[0, 2]].tobytes() == alone[[0, 2]].tobytes()


@pytest.mark.parametrize("squares", [(), (1,)])
def test_errors_do_not_depend_on_other_methods_to_last_bit(squares):
    family = Family(stages=5, first="kick", squares=squares)
    rows = [row if squares or i < 2 else None for i, row in enumerate(rows_of(family, 7))]
    population = goal.Population(henon_heiles(), family.shape(), [0.04, 0.07], 7)
    together = population.errors(*rows)
    order = np.random.default_rng(2).permutation(7)
    shuffled = population.errors(*(None if row is None else row[order] for row in rows))
    assert shuffled.tobytes() == together[order].tobytes()
    for i in range(7):
        some = population.errors(*(None if row is None else row[i : i + 3] for row in rows))
        assert some.tobytes() == together[i : i + 3].tobytes()


def test_logarithmic_mean_replaces_unresolved_errors_by_least():
    assert goal.mean_log(np.array([[1e-4, 1e-6], [0.0, 1.0]])) == pytest.approx([-5, np.log10(goal.LEAST) / 2])


# --- The objective of a search: what it compares, what it refuses, and that a member's value is its own.

WINDOW = (0.06, 0.09)
ENSEMBLES = (
    random_ensemble(2, 6, 1, band=(0.05, 0.4), t_end=15.0),
    orbit_ensemble(5, 1, eccentricities=(0.02, 0.3), orbits=2.0),
)
REFERENCES = (np.array([-6.0, -5.0]), np.array([-4.0, -3.5]))


def objective_of(family, size=20, **more):
    return goal.Objective(family, ENSEMBLES, WINDOW, REFERENCES, size=size, **more)


@pytest.mark.parametrize(
    "family", [Family(stages=6, first="kick"), Family(stages=4, first="drift", squares=(0, 1))], ids=str
)
def test_value_is_worst_difference_and_half_of_mean(family):
    x = members(family, 3)
    found = objective_of(family, charge=0.5)(x)
    for value, one in zip(found, x, strict=True):
        tableau = goal.tableau_of(family, one, digits=20, name="one", source="here")
        differences = []
        for i, tau in enumerate(WINDOW):
            of_ensembles = [
                np.log10(np.maximum(goal.errors_of(ensemble, tableau, [tau], 0.5)[0], 1e-16)).mean() - reference[i]
                for ensemble, reference in zip(ENSEMBLES, REFERENCES, strict=True)
            ]
            differences.append(sum(of_ensembles) / 2)
        # Coefficients of members and of the polished tableau differ by rounding, whose part of an error is 1e-6.
        assert value == pytest.approx(max(differences) + sum(differences) / 4, abs=1e-4)


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
    assert (found[5:] < goal.OUTSIDE).all()
    assert (found[:5] >= goal.OUTSIDE).all()
    assert np.isfinite(found).all()
    assert found[3] <= found[4] <= found[0] == found[1] == found[2] == goal.OUTSIDE + 1
    assert found[5:].tobytes() == objective(x).tobytes()


def test_members_with_large_coefficients_are_outside():
    family = Family(stages=6, first="kick")
    x = members(family, 5)
    sums = np.array([sum(np.abs(row).sum() for row in family.rows(one)[:2]) for one in x])
    bound = np.sort(sums)[1:3].mean()  # between two members: the sum of one on the bound is rounded to either side
    found = objective_of(family, largest_sum=bound)(x)
    assert ((found >= goal.OUTSIDE) == (sums >= bound)).all()
    beyond = sums[sums >= bound]
    assert found[sums >= bound] == pytest.approx(goal.OUTSIDE + 0.01 * beyond, abs=1e-9)
    assert (sums < goal.LARGEST_SUM).all()


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
    free = goal.errors_of(ensemble, tableau, [0.05 * cost / 5])
    assert goal.errors_of(ensemble, tableau, [0.05], 0.7) == pytest.approx(free, rel=1e-6)
    assert (goal.errors_of(ensemble, tableau, [0.05]) < free).mean() > 0.8
