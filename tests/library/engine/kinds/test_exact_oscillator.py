"""Oscillators solved exactly: against rotations by cosine and sine in mpmath, closed forms, orders, and bits."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from mpmath import cos, log, mpf, sin, sqrt

import nearharmonic as nh
from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import NearharmonicError, SettingError, SystemDefinitionError
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


@pytest.mark.slow
def test_steps_longer_than_a_turn_are_as_exact():
    run = nh.integrate("sho", "leapfrog", 40, t_end=400, samples=11, precision="extended", **EXACT)
    assert run.max_energy_error < 1e-28
    assert run.q.values[:, 0] == pytest.approx(np.cos(run.t.values), abs=1e-13)


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


@pytest.mark.slow
def test_the_energy_floor_of_henon_heiles_is_a_few_roundings():
    """250 000 evaluations of a method whose own error is 1.1e-16 there, by its order from an error of 7.1e-15 at twice
    the step: a walk of roundings of what a stage adds, 2^-53 * 0.002, of which 3 sqrt(250 000 * 6) are 8e-16."""
    taus = [0.002 * 14, 0.004 * 14]
    floor, coarse = nh.sweep("henon_heiles", "srkn_a14", taus, **EXACT).max_energy_error.values
    (split,) = nh.sweep("henon_heiles", "srkn_a14", taus[:1]).max_energy_error.values
    assert states(PAGE, [float(f"{floor:.1e}"), float(f"{split:.1e}")], "evaluations of SRKN 14a")
    assert coarse == pytest.approx(7.1e-15, rel=0.1)
    assert floor < 1e-15
    plain = nh.sweep("henon_heiles", "srkn_a14", taus[:1], summation="plain", **EXACT).max_energy_error.values
    assert plain[0] > 20 * floor


def test_rest_of_v_is_simplified_like_hand_written_code():
    """No rounding: with Constant for x and y the gradient is (2xy, x^2 - y^2) exactly."""
    x, y = Constant(Fraction(3, 7)), Constant(Fraction(-2, 11))
    found = remainder_formulas(nh.systems["henon_heiles"]).grad_V((x, y))
    assert tuple(Fraction(c.numerator, c.denominator) for c in found) == (
        2 * Fraction(3, 7) * Fraction(-2, 11), Fraction(3, 7) ** 2 - Fraction(2, 11) ** 2,
    )  # fmt: skip
    assert remainder_formulas(nh.systems["sho"]).grad_V((x,)) == (0,)


@pytest.mark.parametrize(
    "method",
    [
        "leapfrog", "ruth", "pefrl", "aba864", "aba1064", "babps8o7h", "blanes_moan_s6o4", "srkn_b6", "srkn_b11",
        "srkn_a14", "babs8o6_7h", "s9odr6a",
    ],
)  # fmt: skip
@pytest.mark.slow
def test_a_method_keeps_its_order_with_the_oscillator_solved_exactly(method):
    """Those for quadratic T too: [B, [B, [B, A]]] = 0 if A is of degree 2 in the momenta and B depends on q alone."""
    taus = (Fraction(1, 4), Fraction(1, 8), Fraction(1, 16))
    tableau = nh.integrators[method]
    runs = nh.sweep(CHAIN.system, tableau, taus, t_end=2, precision="extended", **EXACT)
    errors = runs.max_energy_error.values
    assert log(errors[1] / errors[2], 2) == pytest.approx(tableau.order, abs=0.3)


def near_integrable(epsilon, tau, method):
    """Largest energy error of an oscillator with the rest eps q^4 / 4."""
    system = replace(
        QUARTIC.system, name="near", V=lambda q, eps: q[0] ** 2 / 2 + eps * q[0] ** 4 / 4, frequencies=("1",),
        parameters={"eps": "1"},
    )  # fmt: skip
    given = {"parameters": {"eps": epsilon}, "precision": "extended"}
    return float(nh.integrate(system, method, tau, t_end=20, **given, **EXACT).max_energy_error)


@pytest.mark.parametrize(("method", "far", "near"), [("aba864", 8, 4), ("aba1064", 10, 4), ("aba104", 10, 4)])
def test_near_integrable_errors_have_orders_of_their_sources(method, far, near):
    """eps tau^r1 where eps is small against any power of tau, and a higher power of eps times tau^4 where it is not."""
    small = [near_integrable("1e-14", tau, method) for tau in (0.5, 0.25)]
    assert np.log2(small[0] / small[1]) == pytest.approx(far, abs=0.5)
    less = near_integrable("1e-15", 0.5, method)
    assert small[0] / less == pytest.approx(10, rel=1e-3)
    large = [near_integrable("1", tau, method) for tau in (0.1, 0.05)]
    assert np.log2(large[0] / large[1]) == pytest.approx(near, abs=0.3)


def test_a_result_says_that_its_oscillators_are_solved_exactly():
    exact, split = (nh.integrate("henon_heiles", "aba864", 0.3, t_end=30, samples=2, **how) for how in (EXACT, {}))
    assert exact.attrs["split"] == "exact_oscillator"
    assert "split" not in split.attrs
    assert not np.array_equal(exact.q[-1], split.q[-1])


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
         "potentials that do not depend on time, and that of driven does"),
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


@pytest.mark.parametrize(
    ("frequencies", "words"),
    [
        (("1", "1"), r"frequencies = \('1', '1'\) is not allowed: 1 frequencies, one per coordinate"),
        (("-1",), r"frequencies\[0\] = '-1' is not allowed: it must be a decimal string or a fraction of at least 0"),
        (("omega",), r"or the name of a parameter: w$"),
        ("1", r"frequencies = '1' is not allowed"),
    ],
)
def test_frequencies_that_are_none_are_refused(frequencies, words):
    with pytest.raises(SystemDefinitionError, match=words):
        nh.System(
            name="one", V=lambda q, w: w * q[0] ** 2, q0=[1], p0=[0], t_end=1, parameters={"w": "1"},
            frequencies=frequencies,
        )  # fmt: skip


def test_a_copy_with_another_potential_declares_its_own_frequencies():
    copy = replace(nh.systems["henon_heiles"], V=lambda q: q[0] ** 4 + q[1] ** 4, grad_V=None, name="other")
    assert copy.frequencies is None
    assert replace(nh.systems["henon_heiles"], q0=("0.1", "0")).frequencies == ("1", "1")
    with pytest.raises(NearharmonicError, match="declares no frequencies"):
        nh.integrate(copy, "aba864", 0.1, **EXACT)
