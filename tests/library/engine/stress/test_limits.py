"""Limits of doubles and of counts: overflow beside healthy lanes, denormals, 2^31 steps, the surface limit."""

from __future__ import annotations

import random
from fractions import Fraction
from math import inf

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch, sample_marks
from nearharmonic.engine.settings import MOST_STEPS, Numerics, steps_of, steps_over
from support.methods.own_systems import spring
from support.oracles.reference_solutions import oscillator_state

HEALTHY = [(0.3, 0.1), (0.05, -0.2), (-0.1, 0.25), (0.2, 0.0), (0.0, 0.3)]
#: Energies that overflow at once, later, or to infinity minus infinity.
OVERFLOWING = [(1e80, 0.0), (0.0, -1e200), (1e308, 1e308), (-3.0, 40.0)]


@pytest.mark.parametrize("settings", [{}, {"precision": "extended"}, {"summation": "plain"}, {"energy": "none"}])
def test_overflow_in_a_lane_leaves_other_lanes_alone(settings, trials):
    """Members that overflow in all places among healthy ones, which have the bits of runs alone."""
    given = {"t_end": 40, "samples": 5, **settings}
    alone = {q0: nh.integrate("henon_heiles", "aba864", 0.5, q0=q0, **given) for q0 in HEALTHY}
    kind, draw = trials("G. overflow beside healthy lanes"), random.Random(str(settings))
    for width in range(6, 12):
        members = [*(draw.choice(OVERFLOWING) for _ in range(width)), *HEALTHY]
        draw.shuffle(members)
        many = nh.ensemble(
            "henon_heiles", "aba864", 0.5, q0=np.array(members), p0=[["0", "0.4"]] * len(members), **given
        )
        for place, q0 in enumerate(members):
            with kind.case((settings, members, place)):
                one = many.isel(member=place)
                assert one.status.item() == ("ok" if q0 in alone else "diverged")
                for name in ("q", "p", "energy_error", "max_energy_error") if q0 in alone else ():
                    np.testing.assert_array_equal(one[name], alone[q0][name], name)


@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_denormal_states_are_those_of_exact_steps(summation, trials):
    """A product that is denormal is off by 2^-1075; 40 steps of 7 stages have some 20 such moves, sums add no error."""
    kind, tableau = trials("G. denormal numbers"), nh.integrators["aba864"]
    exact = oscillator_state(tableau, mpf(1) / 4, 40)
    for power in (1000, 1022, 1030, 1045, 1060, 1070):
        with kind.case((summation, power)):
            scale = mpf(2) ** -power
            run = nh.integrate("sho", "aba864", 0.25, q0=[2.0**-power], p0=[0.0], t_end=10, summation=summation)
            allowed = 40 * 20 * mpf(2) ** -1074 + mpf(10) ** -12 * scale
            for found, value in zip((run.q[-1, 0], run.p[-1, 0]), exact, strict=True):
                assert abs(mpf(found.item()) - scale * value) <= allowed
            assert run.status.item() == "ok"
            many = nh.ensemble(
                "sho", "aba864", 0.25, q0=[[1.0], [2.0**-power]] * 9, p0=[0.0], t_end=10, summation=summation
            )
            assert (many.q[1::2, -1, 0] == run.q[-1, 0].item()).all()


def test_the_smallest_difference_of_two_states_is_kept():
    """Free motion by 2^-1074 a step, which a processor that flushes denormals to zero would lose."""
    free = spring("free", V=lambda q: 0 * q[0], grad_V=lambda q: (0 * q[0],), energy_scale=1)
    run = nh.integrate(free, "leapfrog", 1, q0=[0.0], p0=[5e-324], t_end=100, samples=101)
    assert run.q[:, 0].values.tolist() == [n * 5e-324 for n in range(101)]


def test_an_energy_error_at_the_limit_has_not_diverged():
    """The limit is the largest error of the run itself, and the next double below it."""
    whole = nh.integrate(spring(), "leapfrog", 0.5, t_end=50, samples=101)
    worst, step = whole.max_energy_error.item(), int(np.abs(whole.energy_error.values).argmax())
    for limit, left in ((worst, 0), (float(np.nextafter(worst, 0)), step), (float(np.nextafter(worst, inf)), 0)):
        system = spring(surface_limit=limit)
        for width in (1, 8):
            found = integrate_batch(
                system, nh.integrators["leapfrog"], t_end=Fraction(50), steps=[100, 50, 100], samples=2,
                numerics=Numerics(width=width),
            )  # fmt: skip
            assert found.left_at[[0, 2]].tolist() == [left, left]
        run = nh.integrate(system, "leapfrog", 0.5, t_end=50)
        assert (run.diverged_at.item(), run.max_energy_error.item()) == (left, inf if left else worst)


@pytest.mark.parametrize("steps", [2**31 - 1, 2**31, 2**31 + 1, 2**32 + 3, 2**53 - 1])
def test_samples_of_more_steps_than_four_bytes_count(steps):
    marks = sample_marks(np.array([steps, 10]), 500)
    assert marks[0].tolist() == [i * steps // 499 for i in range(500)]
    assert marks[1, :11].tolist() == list(range(11))
    assert (marks[1, 11:] == -1).all()
    assert nh.integrators["babs7o7h"].evaluations(np.array([steps])).tolist() == [7 * steps + 1]


def test_steps_of_an_interval_are_its_rounded_quotient(trials):
    """Intervals that are no multiples of the step, at and beside halves, and up to the most steps of a run."""
    kind, draw = trials("G. numbers of steps"), random.Random(3)
    tableau = nh.integrators["leapfrog"]
    for _ in range(300):
        tau = draw.choice((1, 2.0**-20, 0.1)) * draw.uniform(0.5, 2)
        count = draw.choice((0, 1, 10**3, 10**8)) * draw.random() + draw.choice((0, 0.5, 1e-9))
        t_end = draw.choice((f"{tau * count + 1e-9:.17g}", f"{tau * count + 1e-9:.3g}"))
        with kind.case((t_end, tau)):
            whole, rest = divmod(Fraction(t_end), Fraction(tau))
            half = Fraction(tau) / 2
            expected = max(1, whole + (rest > half or (rest == half and whole % 2 == 1)))
            assert steps_of(t_end, tau) == expected
            assert steps_over(np.array([tau]), t_end, tableau).tolist() == [expected]


def test_too_many_steps_are_refused_with_their_number():
    with pytest.raises(nh.NearharmonicError, match=f"would take {2**31} steps, and one run takes at most {MOST_STEPS}"):
        nh.integrate("sho", "ruth", 0.5, t_end=2**30)


@pytest.mark.long
def test_a_run_counts_more_than_2_to_31_steps():
    """A minute: the phase of so many steps is right to their rounding errors, and a carry is never lost."""
    steps = 2**31 + 5
    found = integrate_batch(
        nh.systems["sho"], nh.integrators["leapfrog"], t_end=Fraction(steps, 4), steps=[steps], samples=3,
        numerics=Numerics(width=1, energy="samples"),
    )  # fmt: skip
    assert found.marks.tolist() == [[0, steps // 2, steps]]
    assert (found.steps.item(), found.done.item(), found.left_at.item()) == (steps, steps, 0)
    q, p = oscillator_state(nh.integrators["leapfrog"], mpf(1) / 4, steps)
    # Each step of one kick and one drift by exact coefficients is off by two roundings, that of the phase by their sum.
    assert abs(mpf(found.q[0, -1, 0]) - q) < steps * mpf(2) ** -52
    assert abs(mpf(found.p[0, -1, 0]) - p) < steps * mpf(2) ** -52
