"""Contract of compiled arithmetic: bits, carries, symplecticity, backward runs, and detection of divergence."""

from __future__ import annotations

from dataclasses import fields
from fractions import Fraction

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.numbers import start_row
from nearharmonic.engine.settings import Numerics

#: Precision and summation -> widths: lanes of one register, and of several.
WIDTHS = {("double", "compensated"): (8, 16), ("double", "plain"): (8, 32), ("extended", "compensated"): (8,)}
#: Systems whose runs share lanes; a regularised one has a lane of its own (test_regularised.py).
SYSTEMS = sorted(name for name, system in nh.systems.items() if system.regularisation is None)
#: Systems whose kernels are also compiled for several registers: with T = p.p / 2 and with another.
BOTH_KINETIC_ENERGIES = ("henon_heiles", "relativistic_oscillator")
#: Step sizes per stage, in units where an orbit takes about 2 pi: smooth, coarse, and diverging.
COUNTS = [4001, 1700, 800, 444, 300, 210, 150, 90, 60, 40, 25, 13, 5]


def batch(system, integrator, **settings):
    problem, tableau = nh.systems[system], nh.integrators[integrator]
    numerics = {field.name: settings.pop(field.name) for field in fields(Numerics) if field.name in settings}
    settings = {"t_end": Fraction(problem.t_end), "steps": COUNTS, "samples": 20} | settings
    return integrate_batch(problem, tableau, numerics=Numerics(**numerics), **settings)


def same_bits(a, b):
    names = ("q", "p", "q_low", "p_low", "energy_error", "block_max", "max_energy_error", "left_at", "energy")
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in names)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(("precision", "summation"), WIDTHS)
def test_lanes_of_any_number_equal_the_scalar_bit_for_bit(system, precision, summation):
    for integrator in ("aba864", "babps9o7h"):
        numerics = {"precision": precision, "summation": summation}
        scalar = batch(system, integrator, width=1, **numerics)
        assert scalar.left_at.any()
        if summation == "plain":
            assert np.count_nonzero([scalar.q_low[0, 1:], scalar.p_low[0, 1:]]) == 0
        for width in WIDTHS[precision, summation][: 2 if system in BOTH_KINETIC_ENERGIES else 1]:
            assert same_bits(batch(system, integrator, width=width, **numerics), scalar), (integrator, width)


def test_block_holds_maximum_and_mean_of_its_own_steps_alone():
    every, few = (batch("henon_heiles", "ruth", steps=[800], samples=n) for n in (801, 9))
    errors = np.abs(every.energy_error[0])
    for k in range(1, 9):
        own = errors[few.marks[0, k - 1] + 1 : few.marks[0, k] + 1]
        assert few.block_max[0, k] == own.max()
        # A mean of 100 numbers in two orders of summation.
        assert few.block_mean[0, k] == pytest.approx(own.mean(), rel=1e-14)


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_carry_is_not_zero(system):
    """A compiler that may re-associate deletes the carry without a word."""
    compensated = batch(system, "s5odr4")
    # Now and then an increment is exact and its carry zero; a deleted carry is zero always.
    assert np.count_nonzero(compensated.q_low[0, 1:]) > 0.5 * compensated.q_low[0, 1:].size


def test_compensation_lowers_the_rounding_error_of_a_long_run():
    """At tau/s = 1e-4 truncation (1e-13 and below) is under rounding: compensated stays at it, plain is 30 times up."""
    compensated, plain = (
        nh.sweep("sho", "babs7o7h", [7e-3], t_end=5000, summation=kind).max_energy_error.item()
        for kind in ("compensated", "plain")
    )
    assert compensated < 2e-15
    assert plain > 10 * compensated


@pytest.mark.parametrize("integrator", ["ruth", "yoshida_s7o6a", "babps8o7h"])
@pytest.mark.parametrize("system", ["henon_heiles", "kepler"])
def test_one_step_is_symplectic(system, integrator):
    """M^T J M = J for the tangent map M by central differences: displacement 1e-8 in extended precision leaves 1e-16
    truncation and 1e-24 rounding; 1e-13 allows for large third derivatives. det M = 1 follows, and is checked too."""
    problem, tableau = nh.systems[system], nh.integrators[integrator]
    d, h = problem.dimension, Fraction(1, 10**8)
    start = [*map(Fraction, problem.q0), *map(Fraction, problem.p0)]
    rows = []
    for k in range(2 * d):
        for sign in (1, -1):
            moved = [x + sign * h * (i == k) for i, x in enumerate(start)]
            rows.append(start_row(moved[:d], moved[d:]))
    t_end = {"henon_heiles": Fraction(1, 2), "kepler": Fraction(100)}[system]
    out = integrate_batch(
        problem, tableau, t_end=t_end, steps=[1] * len(rows), samples=2, start=np.array(rows),
        numerics=Numerics(precision="extended"),
    )  # fmt: skip
    high = np.concatenate([out.q[:, -1], out.p[:, -1]], axis=1)
    low = np.concatenate([out.q_low[:, -1], out.p_low[:, -1]], axis=1)
    M = (((high[::2] - high[1::2]) + (low[::2] - low[1::2])) / (2 * float(h))).T
    J = np.block([[np.zeros((d, d)), np.eye(d)], [-np.eye(d), np.zeros((d, d))]])
    assert np.abs(M - np.eye(2 * d)).max() > 1e-2
    assert np.abs(M.T @ J @ M - J).max() < 1e-13
    assert np.linalg.det(M) == pytest.approx(1.0, abs=1e-13)


def test_fsal_method_counts_one_force_per_stage_plus_one():
    assert nh.sweep("sho", "babs7o7h", [0.5]).evaluations.item() == 7 * 1000 + 1
    assert nh.sweep("sho", "aba864", [0.5]).evaluations.item() == 7 * 1000


def test_a_diverged_run_says_so_and_stops():
    run = nh.integrate("henon_heiles", "ruth", 3.0)
    assert run.status.item() == "diverged"
    assert 0 < run.diverged_at.item() < run.steps.item()
    assert run.evaluations.item() == 3 * run.diverged_at.item()
    assert np.isinf(run.max_energy_error)
    assert np.isinf(run.mean_energy_error)
    assert np.isfinite(run.q).all()


@pytest.mark.parametrize(("tau", "t_end"), [(500.0, None), (250.0, None), (1e199, 1e200)])
def test_a_run_that_overflows_has_left_at_that_very_step(tau, t_end):
    """Steps of 1e199 give infinity minus infinity: NaN, which no comparison with a limit notices."""
    run = nh.sweep("henon_heiles", "yoshida_s7o6a", [tau], t_end=t_end)
    assert (run.status.item(), run.diverged_at.item()) == ("diverged", 1)
    assert run.steps.item() > 1 or t_end is None
    assert np.isinf(run.max_energy_error).all()


def test_an_energy_of_zero_at_the_start_is_measured_absolutely():
    """H = p^2/2 - q^2/2 at q = p = 1: along the unstable direction both grow as exp(t), and H stays at rounding."""
    hill = nh.System(name="hill", V=lambda q: -q[0] * q[0] / 2, q0=("1",), p0=("1",), t_end="3")
    method, run = nh.integrators["yoshida_s7o6a"], {"t_end": Fraction(3), "steps": [20], "samples": 2}
    zero, one, four = (integrate_batch(hill, method, scale=scale, **run) for scale in (0.0, 1.0, 4.0))
    assert 1e-9 < zero.max_energy_error[0] == one.max_energy_error[0] < 1e-2
    assert (zero.energy[0], four.max_energy_error[0]) == (0, one.max_energy_error[0] / 4)
