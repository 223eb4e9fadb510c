"""Oscillators solved exactly: against rotations by cosine and sine in mpmath, closed forms, orders, and bits."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from mpmath import cos, mpf, sin, sqrt

import nearharmonic as nh
from nearharmonic.core.number import Constant
from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.systems.gradients import remainder_formulas
from support.oracles.multiprecision import digits_of
from support.oracles.oscillator_steps import CHAIN, QUARTIC, Oscillators, henon_heiles
from support.results.stated_numbers import states

PAGE = "docs/results/exact_oscillator.md"
EXACT = {"split": "exact_oscillator"}
HENON_HEILES = Oscillators(nh.systems["henon_heiles"], ("1", "1"), henon_heiles)
SYSTEMS = {"quartic": QUARTIC, "henon_heiles": HENON_HEILES, "chain": CHAIN}
#: Drift first and kick first, one stage, an odd and an even number of stages, a Nystrom method.
METHODS = ["leapfrog", "ruth", "aba864", "babps9o7h", "srkn_b11"]
HOW = [{}, {"summation": "plain"}, {"precision": "extended"}]
IDS = ["carry", "plain", "dd"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.long] * (name == "chain")) for name in SYSTEMS])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("first", ["drift", "kick"])
def test_runs_are_those_of_rotations_by_cosine_and_sine(name, method, first):
    """20 steps of at most 14 stages: some 300 roundings of 2e-32, or of 1e-16, which grow by less than ten."""
    known = SYSTEMS[name]
    tau, tableau = Fraction(2, 5), nh.integrators[method].role(first)
    states = known.states(tableau, mpf(2) / 5, 20)
    energies = [known.energy(q, p) for q, p in states]
    for how, tolerance in (({"precision": "extended"}, 1e-28), ({}, 3e-15), ({"summation": "plain"}, 3e-14)):
        run = nh.integrate(known.system, tableau, tau, t_end=8, samples=21, **how, **EXACT)
        for i, state in enumerate(states):
            for row, exact in zip("qp", state, strict=True):
                for found, x in zip(digits_of(run, row, i), exact, strict=True):
                    assert abs(found - x) < tolerance, (how, row, i)
        wanted = [float((H - energies[0]) / abs(energies[0])) for H in energies]
        assert run.energy_error.values == pytest.approx(wanted, rel=4e-16, abs=10 * tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["leapfrog", "aba864", "babps9o7h"])
def test_harmonic_oscillator_is_exact_to_rounding_over_hundred_thousand_steps(method):
    """A coefficient rounded once turns by an angle that is wrong by 1.5 * 2^-53 of it: in phase 1.7e-16 t. The energy
    gains a rounding of 2^-54 of what a shear adds, at random 1e-17 sqrt(4 s n); and what a product of two coefficients
    leaves out, 2^-53 x^2 for an angle x, misses one shear of x."""
    steps, t_end = 100_000, 40_000
    run = nh.integrate("sho", method, 0.4, t_end=t_end, samples=2, **EXACT)
    assert run.steps == steps
    tableau = nh.integrators[method]
    missed = sum(abs(0.4 * float(drift)) ** 3 for drift in tableau.drift) * 2.0**-53
    assert 0 < run.max_energy_error < 1e-17 * sqrt(4 * tableau.stages * steps) * 3 + missed * steps
    assert states(PAGE, [100, 0, 0.4, 1e-13, 1.7e-16], "steps of", "phase error")
    assert run.max_energy_error < 1e-13
    for name, exact in (("q", cos(t_end)), ("p", -sin(t_end))):
        assert abs(digits_of(run, name)[0] - exact) < 1.7e-16 * t_end


@pytest.mark.slow
@pytest.mark.parametrize("method", ["aba864", "babps9o7h"])
def test_extended_errors_of_hundred_thousand_steps_are_below_the_stated(method):
    run = nh.integrate("sho", method, 0.4, t_end=40_000, samples=2, precision="extended", **EXACT)
    assert states(PAGE, [1e-28], "In extended precision both")
    assert run.max_energy_error < 1e-28
    for name, exact in (("q", cos(40_000)), ("p", -sin(40_000))):
        assert abs(digits_of(run, name)[0] - exact) < 1e-28 * 40_000


def test_exact_rotation_prevents_energy_drift_of_rounded_one():
    """Ten times the interval: a random walk grows by 3.2, a map that is not symplectic by 10 and to 1e-12 at once."""
    short, long = (nh.integrate("sho", "aba864", 0.5, t_end=t, **EXACT).max_energy_error for t in (5000, 50000))
    assert long < 5e-14
    assert long < 6 * short


@pytest.mark.parametrize("how", [HOW[0], *(pytest.param(how, marks=pytest.mark.slow) for how in HOW[1:])], ids=IDS)
@pytest.mark.parametrize("method", ["ruth", "babps9o7h"])
def test_free_coordinates_have_bits_of_split_into_t_and_v(how, method):
    """A rotation of frequency 0 is a drift, and the rest of V is V: every product, and what it leaves out, is equal."""
    system = replace(nh.systems["henon_heiles"], frequencies=("0", "0"))
    free = nh.integrate(system, method, 0.2, t_end=100, samples=7, **how, **EXACT)
    split = nh.integrate(replace(system, grad_V=None), method, 0.2, t_end=100, samples=7, **how)
    names = ("q", "p", "energy_error") + (() if "summation" in how else ("q_low", "p_low"))
    for name in names:
        assert np.array_equal(free[name], split[name]), name


def test_rest_of_v_is_simplified_like_hand_written_code():
    """No rounding: with Constant for x and y the gradient is (2xy, x^2 - y^2) exactly."""
    x, y = Constant(Fraction(3, 7)), Constant(Fraction(-2, 11))
    found = remainder_formulas(nh.systems["henon_heiles"]).grad_V((x, y))
    assert tuple(Fraction(c.numerator, c.denominator) for c in found) == (
        2 * Fraction(3, 7) * Fraction(-2, 11), Fraction(3, 7) ** 2 - Fraction(2, 11) ** 2,
    )  # fmt: skip
    assert remainder_formulas(nh.systems["sho"]).grad_V((x,)) == (0,)
    named = nh.System(
        name="named", V=lambda q, w: w * w * q[0] * q[0] / 2 + q[0] ** 3, q0=[1], p0=[0], t_end=1,
        parameters={"w": "2.5"}, frequencies=("w",),
    )  # fmt: skip
    (cubic,) = remainder_formulas(named).grad_V((x,), Constant(Fraction(5, 2)))
    assert Fraction(cubic.numerator, cubic.denominator) == 3 * Fraction(3, 7) ** 2


def test_shorter_step_of_exact_oscillator_lies_between_two_steps():
    run = nh.integrate("sho", "aba864", 0.5, t_end=10, t=["0.3", "7.77"], **EXACT)
    assert run.q.values[:, 0] == pytest.approx([float(cos(mpf("0.3"))), float(cos(mpf("7.77")))], abs=1e-15)


@pytest.mark.slow
def test_a_run_backwards_returns_to_the_start():
    out = nh.integrate(CHAIN.system, "aba1064", 0.2, t_end=4, precision="extended", **EXACT)
    back = nh.integrate(CHAIN.system, "aba1064", 0.2, t_end=-4, precision="extended", start=out, **EXACT)
    assert np.abs((back.q[-1] - out.q[0]) + (back.q_low[-1] - out.q_low[0])).max() < 1e-28


@pytest.mark.slow
def test_frequency_parameter_is_fixed_and_others_are_free():
    changed = replace(CHAIN.system, parameters=dict(CHAIN.system.parameters) | {"strength": "0.1"}, name="chain_2")
    given = nh.integrate(CHAIN.system, "aba864", 0.2, parameters={"strength": "0.1"}, **EXACT)
    assert np.array_equal(given.q, nh.integrate(changed, "aba864", 0.2, **EXACT).q)
    with pytest.raises(SettingError, match=r"parameters\['w'\] = 2.5 is not allowed: it is a frequency of chain_"):
        nh.integrate(CHAIN.system, "aba864", 0.2, parameters={"w": "2.5"}, **EXACT)


def driven(q, t):
    return q[0] ** 2 * t


@pytest.mark.parametrize(
    ("system", "words"),
    [
        ("kepler", r"split = 'exact_oscillator' is not allowed: kepler declares no frequencies"),
        (nh.System(name="driven", V=driven, q0=[1], p0=[0], t_end=1, time_dependent=True, frequencies=("1",)),
         "potentials that do not depend on time, and V of driven does"),
        (nh.System(name="heavy", V=lambda q: q[0] ** 2, q0=[1], p0=[0], t_end=1, masses=["2"], frequencies=("1",)),
         r"it requires T = p.p / 2, which heavy does not have"),
        (nh.System(name="long", V=lambda q: sum((x - y) ** 4 for x, y in pairwise(q)), q0=[1] * 200,
                   p0=[0] * 200, t_end=1, frequencies=("1",) * 200), "formulas of long are compiled as loops"),
    ],
)  # fmt: skip
def test_a_system_whose_oscillators_cannot_be_solved_exactly_is_refused(system, words):
    for call in (nh.integrate, nh.ensemble, nh.problem):
        arguments = (system, "aba864") if call is nh.problem else (system, "aba864", 0.1)
        with pytest.raises(SettingError, match=words):
            call(*arguments, **EXACT)
    with pytest.raises(SettingError, match=words):
        nh.sweep(system, "aba864", [0.1], **EXACT)


def test_a_copy_with_another_potential_declares_its_own_frequencies():
    copy = replace(nh.systems["henon_heiles"], V=lambda q: q[0] ** 4 + q[1] ** 4, grad_V=None, name="other")
    assert copy.frequencies is None
    assert replace(nh.systems["henon_heiles"], q0=("0.1", "0")).frequencies == ("1", "1")
    with pytest.raises(NearharmonicError, match="declares no frequencies"):
        nh.integrate(copy, "aba864", 0.1, **EXACT)
