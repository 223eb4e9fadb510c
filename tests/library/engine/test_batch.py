"""Settings of the arithmetic, and the exact coefficients and starts that runs share."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch, sample_marks
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import moves
from nearharmonic.engine.settings import Numerics
from support.oracles.word_series import operators_of


def test_numerics_with_one_compiled_code_are_one_in_compiled_form():
    """Double-double is compensated always; how often to look and rounded coefficients are arguments of a call."""
    extended = Numerics(precision="extended")
    for other in ({"summation": "plain"}, {"look": 5}, {"double_coefficients": True}):
        assert Numerics(precision="extended", **other).compiled == extended.compiled
    kinds = [
        Numerics(**how)
        for how in ({}, {"summation": "plain"}, {"precision": "extended"}, {"width": 1}, {"energy": "samples"})
    ]
    assert len({kind.compiled for kind in kinds}) == 5


def test_a_batch_that_looks_more_often_loads_no_other_kernel():
    settings = {"t_end": Fraction(3), "steps": [6], "samples": 2}
    for look in (None, 2, 3):
        before = kernel_of.misses
        numerics = Numerics(width=1, energy="samples", look=look)
        integrate_batch(nh.systems["sho"], nh.integrators["ruth"], numerics=numerics, **settings)
        assert look is None or kernel_of.misses == before


def substeps(tableau, tau, steps):
    """Kicks and drifts of so many steps, one after the other, as (letter, coefficient) without those that are 0."""
    return [(x, c * (-tau if x == "B" else tau)) for x, c in operators_of(tableau) * steps if c]


def joined(pieces):
    """Neighbours of one operator as one; those that come to nothing are left out."""
    found = []
    for name, c in pieces:
        before = found.pop()[1] if found and found[-1][0] == name else Fraction(0)
        if before + c:
            found.append((name, before + c))
    return found


def test_moves_are_rounded_substeps_independent_of_earlier_requests():
    """Twice through methods, roles, steps and parts, so that each follows each other one; to u/2 or (u/2)^2."""
    own, other = nh.integrators["babps9o7h"], nh.integrators["aba864"]
    taus = [Fraction(9, 10), Fraction(-1, 3), Fraction(10, 9)]
    for tableau in (own, own.role("drift"), other, own):
        for parts in (1, 2, 1):
            rows = moves(tableau, taus, parts)
            assert rows.shape == (3, tableau.stages + 2, 4)
            for row, tau in zip(rows, taus, strict=True):
                opening, merged, *inner, closing = row
                run = [opening, *inner, merged, *inner, merged, *inner, closing]
                order = [(name, move[k * parts : (k + 1) * parts]) for move in run
                         for k, name in enumerate("BA") if move[k * parts]]  # fmt: skip
                exact = joined(substeps(tableau, tau, 3))
                assert [name for name, _ in order] == [name for name, _ in exact]
                for (_, found), (_, c) in zip(order, exact, strict=True):
                    assert found[0] == float(c)
                    assert abs(sum(map(Fraction, found)) - c) <= abs(c) / 2 ** (53 * parts)


def test_kick_drift_product_is_rounded_once_with_its_rest():
    tableau, tau = nh.integrators["srkn_b11"], Fraction(7, 30)
    exact = [c for _, c in joined(substeps(tableau, tau, 2))]
    opening, merged, *inner, _ = moves(tableau, [tau], 1)[0]
    for i, (kick, drift, product, rest) in enumerate([opening, *inner, merged]):
        assert product == float(exact[2 * i] * exact[2 * i + 1])
        left_out = Fraction(kick) * Fraction(drift) - Fraction(product)
        assert abs(Fraction(rest) - left_out) <= abs(left_out) / 2**52


def test_moves_of_a_rounded_method_are_exactly_its_rounded_coefficients():
    tableau, tau = nh.integrators["aba864"], Fraction(1, 3)
    pieces = [(name, Fraction(float(c))) for name, c in substeps(tableau, tau, 1)]
    opening, merged, *inner, closing = moves(tableau, [tau], 2, rounded=True)[0]
    order = [Fraction(part[0]) + Fraction(part[1]) for move in (opening, *inner, merged, *inner, closing)
             for part in (move[:2], move[2:]) if part[0]]  # fmt: skip
    assert order == [c for _, c in joined(pieces * 2)]


def test_callers_changes_of_arrays_do_not_affect_later_runs():
    tableau, sho = nh.integrators["ruth"], nh.systems["sho"]
    settings = {"t_end": Fraction(3), "steps": [6], "samples": 2}
    before = integrate_batch(sho, tableau, **settings)
    moves(tableau, [Fraction(1, 2)], 1)[:] = 9.0
    kept = before.q.copy()
    before.q[:] = before.p[:] = 5.0
    assert np.array_equal(integrate_batch(sho, tableau, **settings).q, kept)


def test_runs_start_with_digits_that_their_summation_keeps():
    """0.3 and 0.4 are no doubles; twice through every arithmetic, so that each follows each other one."""
    settings = {"t_end": Fraction(3), "steps": [6, 7], "samples": 2}
    for how in ({}, {"summation": "plain"}, {"precision": "extended", "summation": "plain"}, {}):
        numerics = Numerics(**how, width=1)
        found = integrate_batch(nh.systems["henon_heiles"], nh.integrators["ruth"], numerics=numerics, **settings)
        for high, low, i, decimal in ((found.q, found.q_low, 0, "0.3"), (found.p, found.p_low, 1, "0.4")):
            first = set(zip(high[:, 0, i].tolist(), low[:, 0, i].tolist(), strict=True))
            rest = float(Fraction(decimal) - Fraction(float(decimal)))
            assert first == {(float(decimal), 0.0 if how == {"summation": "plain"} else rest)}


def test_start_may_be_array_that_cannot_be_written_to():
    start = np.array([[0.25, 0.0, 0.5, 0.0]])
    start.flags.writeable = False
    settings = {"t_end": Fraction(3), "steps": [6], "samples": 2}
    found = integrate_batch(nh.systems["sho"], nh.integrators["ruth"], start=start, **settings)
    assert (found.q[0, 0, 0], found.p[0, 0, 0], found.energy[0]) == (0.25, 0.5, 0.15625)


@pytest.mark.parametrize("samples", [1, 2, 3, 10, 200])
def test_samples_lie_evenly_from_the_first_to_the_last_step(samples):
    steps = np.array([1, 2, 7, 100])
    marks = sample_marks(steps, samples)
    for n, row in zip(steps.tolist(), marks.tolist(), strict=True):
        kept = [m for m in row if m >= 0]
        count = min(max(samples, 2), n + 1)
        assert kept == [k * n // (count - 1) for k in range(count)]
        assert row[len(kept) :] == [-1] * (len(row) - len(kept))
    assert marks.shape[1] == min(max(samples, 2), 101)


@pytest.mark.parametrize("numerics", [Numerics(), Numerics(precision="extended", width=1)])
def test_a_single_sample_is_the_end_of_the_run(numerics):
    """With all that is measured over the steps; a run of one sample did not come back before."""
    steps = {"t_end": Fraction(40), "steps": [100, 1, 17], "numerics": numerics}
    one, two = (integrate_batch(nh.systems["henon_heiles"], nh.integrators["ruth"], samples=n, **steps) for n in (1, 2))
    assert one.marks.tolist() == [[100], [1], [17]]
    for name in ("q", "q_low", "p", "p_low", "energy_error", "block_max", "block_mean"):
        assert np.array_equal(getattr(one, name)[:, 0], getattr(two, name)[:, 1], equal_nan=True)
    for name in ("max_energy_error", "mean_energy_error", "done", "left_at", "evaluations"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
    assert nh.integrate("sho", "ruth", 0.5, t_end=9, samples=1).t.values.tolist() == [9.0]


def test_concurrent_runs_equal_sequential_runs():
    steps = [list(range(20_000 + i, 20_016 + i)) for i in range(8)]

    def errors(count):
        return nh.sweep("sho", "aba864", [500 / n for n in count]).mean_energy_error.values

    one_by_one = [errors(count) for count in steps]
    with ThreadPoolExecutor(4) as pool:
        assert all(map(np.array_equal, pool.map(errors, steps), one_by_one))
