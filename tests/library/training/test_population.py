"""Populations: each lane is the run that a plain loop makes, with the coefficients, step and start of the lane."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.training.family import Family
from nearharmonic.training.objective import LEAST, LOST, Ensemble, Population, errors_of, mean_log
from nearharmonic_studies.trained.problems import random_ensemble, with_exact_oscillators
from support.oracles.plain_runs import (
    henon_heiles_energy,
    henon_heiles_gradient,
    henon_heiles_gradient_of_square,
    largest_error,
)

#: Rounding of doubles in some thousand operations, relative to an energy of 0.1.
ROUNDING = 3e-13
STARTS = [(0.1, 0.2, 0.3, -0.1), (0.3, -0.2, 0.1, 0.2), (0.0, 0.1, 0.35, 0.05), (-0.2, 0.25, 0.1, 0.3)]


def henon_heiles(t_end=10.0, unit=1.0, starts=STARTS):
    start = np.zeros((len(starts), 4, 2))
    start[:, 0], start[:, 2] = np.array(starts)[:, :2], np.array(starts)[:, 2:]
    return Ensemble(
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
    population = Population(ensemble, family.shape(), taus_per_stage, 3)
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


@pytest.mark.parametrize("first", ["drift", "kick"])
@pytest.mark.parametrize("squares", [(), (0, 1)])
def test_run_of_one_step_is_that_of_plain_loop(first, squares):
    family = Family(stages=3, first=first, squares=squares)
    kicks, drifts, square = rows_of(family, 2)
    population = Population(henon_heiles(t_end=0.4), family.shape(), [10.0], 2)
    assert population.steps.tolist() == [1]
    assert population.taus.tolist() == [0.4]
    found = population.errors(kicks, drifts, square if squares else None)
    for c in range(2):
        for m, start in enumerate(STARTS):
            wanted = largest_error(
                (kicks[c], drifts[c], square[c]), first, 0.4, 1, start[:2], start[2:], henon_heiles_energy,
                henon_heiles_gradient, henon_heiles_gradient_of_square if squares else None,
            )  # fmt: skip
            assert found[c, 0, m] == pytest.approx(wanted, rel=1e-9, abs=ROUNDING)


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_problems_have_parameters_of_their_own(dimension):
    ensemble = random_ensemble(dimension, 5, 3, band=(0.1, 0.5), t_end=10.0)
    family = Family(stages=4, first="kick")
    kicks, drifts, squares = rows_of(family, 2)
    found = Population(ensemble, family.shape(), [0.06], 2).errors(kicks, drifts)
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
    found = Population(with_exact_oscillators(plain), family.shape(), [0.05, 0.09], 2).errors(kicks, drifts)
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
        Population(ensemble, Family(stages=5, first="drift", squares=(0, 1)).shape(), [0.05], 1)


@pytest.mark.slow
@pytest.mark.parametrize("exact", [False, True])
def test_signed_energies_at_every_step_have_the_largest_error(exact):
    ensemble = random_ensemble(2, 4, 3, band=(0.1, 0.5), t_end=10.0)
    ensemble = with_exact_oscillators(ensemble) if exact else ensemble
    family = Family(stages=5, first="kick")
    rows = rows_of(family, 3)[:2]
    largest = Population(ensemble, family.shape(), [0.05, 0.1], 3).errors(*rows)
    signed = Population(ensemble, family.shape(), [0.05, 0.1], 3, samples=100).energies(*rows)
    assert signed.shape == (3, 2, 4, 40)
    assert (signed[:, 1, :, 20:] == 0).all()
    assert (signed < 0).any()
    assert (signed > 0).any()
    assert np.abs(signed).max(axis=-1) == pytest.approx(largest, rel=1e-12)


def test_diverged_runs_have_infinite_energies():
    starts = [*STARTS[:2], (0.9, 1.4, 0.2, 0.5)]  # the third escapes
    family = Family(stages=3, first="drift")
    kicks, drifts, _ = rows_of(family, 1)
    ensemble = henon_heiles(t_end=200.0, starts=starts)
    found = Population(ensemble, family.shape(), [0.1], 1, samples=9).energies(kicks, drifts)[0, 0]
    assert np.isinf(found[2]).all()
    assert np.isfinite(found[:2]).all()


@pytest.mark.filterwarnings("ignore:tau = .* runs as")
@pytest.mark.parametrize("name", ["babs7o7h", "srkn_a14", "omelyan_g5o6", "chin_4a"])
def test_errors_of_a_method_are_those_of_integrate(name):
    tableau = nh.integrators[name]
    found = errors_of(henon_heiles(t_end=20.0), tableau, [0.05, 0.1])
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
    plain = Population(ensemble, shape, [0.02, 0.05, 1e6], 1)
    assert plain.steps.tolist() == [250, 100, 1]
    expensive = Population(ensemble, shape, [0.02, 0.05], 1, cost=8.0)
    assert expensive.steps.tolist() == [round(50 / 0.32), round(50 / 0.8)]
    for one in (plain, expensive):
        assert one.taus * one.steps == pytest.approx(50.0, rel=1e-15)


@pytest.mark.parametrize("squares", [(), (0,)])
def test_lost_run_has_error_one_without_effect_on_others(squares):
    starts = [*STARTS[:2], (0.9, 1.4, 0.2, 0.5), STARTS[3]]  # the third escapes
    family = Family(stages=3, first="drift", squares=squares)
    kicks, drifts, square = rows_of(family, 1)
    ensemble = henon_heiles(t_end=200.0, starts=starts)
    found = Population(ensemble, family.shape(), [0.1], 1).errors(kicks, drifts, square if squares else None)[0, 0]
    alone = Population(ensemble.part(np.array([0, 1, 3])), family.shape(), [0.1], 1)
    assert found[2] == LOST
    assert (found[[0, 1, 3]] < 0.1).all()
    assert found[[0, 1, 3]].tobytes() == alone.errors(kicks, drifts, square if squares else None)[0, 0].tobytes()
    unstable = Population(ensemble, family.shape(), [2.0], 1).errors(kicks, drifts, square if squares else None)
    assert (unstable == LOST).all()


def test_invalid_coefficients_lose_only_their_own_runs():
    family = Family(stages=4, first="kick")
    kicks, drifts, _ = rows_of(family, 3)
    population = Population(henon_heiles(), family.shape(), [0.05], 3)
    alone = population.errors(kicks, drifts)
    kicks[1, 2] = np.nan
    found = population.errors(kicks, drifts)
    assert (found[1] == LOST).all()
    assert found[[0, 2]].tobytes() == alone[[0, 2]].tobytes()


@pytest.mark.parametrize("squares", [(), (1,)])
def test_errors_do_not_depend_on_other_methods_to_last_bit(squares):
    family = Family(stages=5, first="kick", squares=squares)
    rows = [row if squares or i < 2 else None for i, row in enumerate(rows_of(family, 7))]
    population = Population(henon_heiles(), family.shape(), [0.04, 0.07], 7)
    together = population.errors(*rows)
    order = np.random.default_rng(2).permutation(7)
    shuffled = population.errors(*(None if row is None else row[order] for row in rows))
    assert shuffled.tobytes() == together[order].tobytes()
    for i in range(7):
        some = population.errors(*(None if row is None else row[i : i + 3] for row in rows))
        assert some.tobytes() == together[i : i + 3].tobytes()


def test_part_of_an_ensemble_has_the_parameters_of_its_problems():
    ensemble = random_ensemble(2, 6, 1, band=(0.1, 0.2), t_end=5.0)
    which = np.array([4, 1])
    part = ensemble.part(which)
    assert part.size == 2
    exact = with_exact_oscillators(ensemble)
    assert (exact.part(which).frequencies == exact.frequencies[which]).all()
    for name in ("start", "parameters", "strength"):
        assert (getattr(part, name) == getattr(ensemble, name)[which]).all()
    assert (part.t_end, part.unit, part.name) == (ensemble.t_end, ensemble.unit, ensemble.name)
    one = henon_heiles()
    assert one.part(slice(1, 3)).parameters is one.parameters
    assert one.part(slice(1, 3)).size == 2


def test_logarithmic_mean_replaces_unresolved_errors_by_least():
    assert mean_log(np.array([[1e-4, 1e-6], [0.0, 1.0]])) == pytest.approx([-5, np.log10(LEAST) / 2])
