"""Random runs with every setting: states and energies within the bound of their rounding errors, bits in any order."""

from __future__ import annotations

import random
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine import ensemble
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.numbers import start_row
from nearharmonic.engine.settings import Numerics
from support.oracles.multiprecision import digits_of
from support.stress.random_cases import random_case
from support.stress.rounding_bounds import bounded_run, formulas

#: Steps are drawn, and many are no divisor of the interval.
pytestmark = pytest.mark.filterwarnings("ignore:taus?.* runs as")
STATES = ("q", "p", "energy_error")


def assert_bounded(case, run):
    """Compare a run with its steps in mpmath; return True if all of it could be compared."""
    method, tau = case.method, Fraction(case.t_end) / case.steps
    limit = nh.systems[case.system].surface_limit
    exact = bounded_run(
        method, formulas(case.system, limit), (case.q0, case.p0), tau, case.steps, case.precision, case.summation
    )
    assert run.steps.item() == case.steps
    errors, bounds = np.array([float(abs(x)) for x in exact.errors]), np.array(exact.error_bounds)
    known = len(errors) - 1 - exact.lost
    assert_left(run, method, errors, bounds, limit, known)
    marks = np.rint(run.t.values / float(tau)).astype(int)
    assert_even(marks, case)
    for sample, n in enumerate(marks):
        if n > known or (run.diverged_at.item() and n >= run.diverged_at.item()):
            break
        assert run.t[sample].item() == pytest.approx(float(n * tau), rel=4e-16)
        found = digits_of(run, "q", sample) + digits_of(run, "p", sample)
        for x, y, bound in zip(found, exact.states[n], exact.bounds[n], strict=True):
            assert abs(x - y) <= bound + abs(y) * mpf(2) ** -104, (n, float(x - y), bound)
        signed = float(mpf(run.energy_error[sample].item()) - exact.errors[n])
        assert abs(signed) <= bounds[n] + 4e-16 * errors[n], (n, signed, bounds[n])
    return known == case.steps or bool(run.diverged_at.item())


def assert_left(run, method, errors, bounds, limit, known):
    """A run leaves at a step at which it can leave, and not later than it must; else its errors are those of mpmath."""
    left = run.diverged_at.item()
    may = np.flatnonzero(errors[: known + 1] + bounds[: known + 1] > limit)
    must = np.flatnonzero(errors - bounds > limit)
    assert (run.status.item() == "diverged") == (left > 0) == np.isinf(run.max_energy_error.item())
    done = left or run.steps.item()
    assert run.evaluations.item() == done * method.stages + (method.first == "kick")
    if left:
        assert left >= (may[0] if may.size else known + 1)
    if must.size and must[0] <= known:
        assert 0 < left <= must[0]
    if not left and known == run.steps.item():
        slack = bounds[1:].max() + 4e-16 * errors.max()
        assert abs(run.max_energy_error.item() - errors[1:].max()) <= slack
        assert abs(run.mean_energy_error.item() - errors[1:].mean()) <= slack


def assert_even(marks, case):
    """Samples from the first step to the last, evenly spaced to a step; a single sample is the end."""
    assert len(marks) <= max(1 if case.samples == 1 else 2, min(case.samples, case.steps + 1))
    if len(marks) > 1:
        gaps = np.diff(marks)
        assert marks[0] == 0
        assert 1 <= gaps.min() <= gaps.max() <= gaps.min() + 1


def assert_same_bits(case, run, monkeypatch):
    """The run beside other step sizes in shards, in lanes of the width asked for, and among members on threads."""
    order = random.Random(case.t_end)
    taus = order.sample([*case.taus, case.tau], len(case.taus) + 1)
    assert_equal(in_shards(case, taus), run, ("max_energy_error", "diverged_at", "evaluations"))
    assert_equal(in_lanes(case, taus, run.sizes["sample"]), run, (*STATES, "max_energy_error", "diverged_at"))
    monkeypatch.setattr(ensemble, "BLOCK", 2)
    member = among_members(case, order.randrange(5))
    assert_equal(member.isel(sample=slice(run.sizes["sample"])), run, (*STATES, "max_energy_error", "diverged_at"))


def in_shards(case, taus):
    """The run in a sweep over its part of the step sizes."""
    parts = [taus[i :: case.shards] for i in range(case.shards) if case.tau in taus[i :: case.shards]]
    swept = nh.sweep(case.system, case.integrator, parts[0], q0=case.q0, p0=case.p0, **case.settings)
    return swept.isel(tau=parts[0].index(case.tau))


def in_lanes(case, taus, samples):
    """The run in lanes beside the other step sizes."""
    plain = (case.precision, case.summation) == ("double", "plain")
    start = start_row(*(tuple(map(Fraction, half)) for half in (case.q0, case.p0)), plain=plain)
    found = integrate_batch(
        nh.systems[case.system], case.method, t_end=Fraction(case.t_end), start=start[None, :], samples=case.samples,
        steps=[max(1, round(abs(Fraction(case.t_end)) / Fraction(tau))) for tau in taus],
        numerics=Numerics(precision=case.precision, summation=case.summation, width=case.width),
    )  # fmt: skip
    i = taus.index(case.tau)
    alone = {name: getattr(found, name)[i][:samples] for name in STATES}
    return alone | {"max_energy_error": found.max_energy_error[i], "diverged_at": found.left_at[i]}


def among_members(case, place):
    """The run among four others, in blocks of two members."""
    q0 = [case.q0 if k == place else [str(Fraction(x) * (k + 9) / 10) for x in case.q0] for k in range(5)]
    many = nh.ensemble(
        case.system, case.integrator, case.tau, q0=q0, p0=[case.p0] * 5, threads=case.threads, samples=case.samples,
        **case.settings,
    )  # fmt: skip
    return many.isel(member=place)


def assert_equal(found, expected, names):
    for name in names:
        np.testing.assert_array_equal(found[name], expected[name], name)


def integrated(case):
    return nh.integrate(
        case.system, case.integrator, case.tau, samples=case.samples, q0=case.q0, p0=case.p0, **case.settings
    )


def tried(kind, cases, monkeypatch):
    compared = []
    for case in cases:
        with kind.case(case):
            run = integrated(case)
            compared.append(assert_bounded(case, run))
            assert_same_bits(case, run, monkeypatch)
    # Bounds of the others say nothing about their last steps.
    assert sum(compared) >= 0.8 * len(compared)


def test_random_runs_are_those_of_mpmath_to_rounding(trials, monkeypatch):
    few = {"most_steps": 12, "most_stages": 7, "widths": (8,), "systems": ("sho", "henon_heiles", "kepler")}
    tried(trials("G. random runs against mpmath"), [random_case(seed, **few) for seed in range(12)], monkeypatch)


@pytest.mark.parametrize(("precision", "fault"), [("double", 2.0**-40), ("extended", 2.0**-90)])
def test_a_coefficient_with_a_wrong_digit_is_outside_the_bound(precision, fault):
    """Bounds of twelve steps are a thousand roundings of a step wide at most."""
    case = replace(random_case(0, most_steps=12), precision=precision, samples=1000)
    assert_bounded(case, integrated(case))
    wrong = integrated(replace(case, t_end=str(Decimal(case.t_end) * (1 + Decimal(fault)))))
    with pytest.raises(AssertionError):
        assert_bounded(case, wrong.assign(t=integrated(case).t))


@pytest.mark.long
def test_many_random_runs_are_those_of_mpmath_to_rounding(trials, monkeypatch):
    """500 runs: five minutes."""
    cases = [random_case(seed, most_steps=150) for seed in range(1000, 1500)]
    tried(trials("G. random runs against mpmath"), cases, monkeypatch)
