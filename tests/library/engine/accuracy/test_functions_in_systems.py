"""Systems whose formulas have functions: kernels against steps in mpmath, and what other libraries make of them."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.core.number import FUNCTIONS, Constant
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.math import atan2, cbrt, cos, cosh, erf, exp, hypot, log, pi, pow, sin, sinh, sqrt, tan, tanh
from nearharmonic.systems import System
from nearharmonic.systems.gradients import velocity, velocity_text
from support.oracles.multiprecision import energy_errors, trajectory

#: A fraction, because mpmath's numbers take a float for its binary value.
A = Fraction(7, 10)


def one_dimensional(name, V, derivative, q0="0.75", p0="0.5"):
    return System(name=name, V=V, grad_V=lambda q: (derivative(q),), q0=(q0,), p0=(p0,), t_end="10")


def gaussian(q):
    return 2 * exp(-q[0] * q[0]) / sqrt(pi)


#: Potentials with their derivatives: each function in one or the other, pi among them.
SYSTEMS = [
    one_dimensional("pendulum", lambda q: -cos(q[0]), lambda q: sin(q[0])),
    one_dimensional("morse", lambda q: (1 - exp(-q[0])) ** 2, lambda q: 2 * exp(-q[0]) * (1 - exp(-q[0]))),
    one_dimensional("soft wall", lambda q: log(cosh(q[0])), lambda q: tanh(q[0])),
    one_dimensional("catenary", lambda q: cosh(q[0]), lambda q: sinh(q[0])),
    one_dimensional("real power", lambda q: (1 + q[0] ** 2) ** A, lambda q: 2 * A * q[0] * pow(1 + q[0] ** 2, A - 1)),
    one_dimensional("exponential", lambda q: 2 ** q[0], lambda q: log(Constant(2)) * 2 ** q[0], q0="-0.25"),
    one_dimensional("bell", lambda q: erf(q[0]), gaussian),
    one_dimensional("pole", lambda q: -log(cos(q[0])), lambda q: tan(q[0])),
    one_dimensional("cubic", lambda q: 0.75 * cbrt(2 + q[0]) ** 4, lambda q: cbrt(2 + q[0])),
    one_dimensional("angle", lambda q: atan2(q[0], 2) / pi, lambda q: 2 / (4 + q[0] ** 2) / pi),
    one_dimensional("length", lambda q: hypot(q[0], 1), lambda q: q[0] / hypot(q[0], 1)),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "system",
    [SYSTEMS[0], *(pytest.param(system, marks=pytest.mark.long) for system in SYSTEMS[1:])],
    ids=lambda system: system.name,
)
def test_kernels_of_both_precisions_make_the_steps_of_mpmath(system):
    """20 steps: 160 stages of some u each for positions; in double-double some 2^-100 for energies."""
    tableau = nh.integrators["aba864"]
    tau, steps = mpf("0.125"), 20
    (q, p), worst = trajectory(tableau, system, tau, steps)[-1], max(energy_errors(tableau, system, tau, steps))
    for precision in ("double", "extended"):
        run = nh.integrate(system, tableau, tau="0.125", t_end="2.5", precision=precision)
        assert float(run.q[-1, 0]) == pytest.approx(float(q[0]), rel=1e-13, abs=1e-13)
        assert float(run.p[-1, 0]) == pytest.approx(float(p[0]), rel=1e-13, abs=1e-13)
    assert float(run.max_energy_error) == pytest.approx(float(worst), abs=1e-26, rel=1e-12)


@pytest.mark.slow
def test_numba_and_heyoka_understand_every_function():
    """One system whose force is the sum of all of them."""
    whole = one_dimensional("sum", lambda q: 0, lambda q: sum(system.grad_V(q)[0] + system.V(q) for system in SYSTEMS))
    assert set(FUNCTIONS) <= set(re.findall(r"\w+", velocity_text(whole)))
    rates = velocity(whole)(0.75, 0.5)
    numba = pytest.importorskip("numba")
    assert numba.njit(velocity(whole))(0.75, 0.5) == pytest.approx(rates, rel=1e-13)
    heyoka = pytest.importorskip("heyoka")
    from nearharmonic_paper.experiments.work_precision.peers.heyoka import functions_of

    q, p = heyoka.make_vars("q", "p")
    compiled = heyoka.cfunc(list(velocity(whole, functions_of(heyoka))(q, p)), [q, p])
    assert compiled([0.75, 0.5]) == pytest.approx(rates, rel=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "extended"])
def test_rotating_pendulum_lanes_equal_single_runs_bitwise(precision):
    """A momentum of 1e6 brings angles beyond those that are reduced in floating point, in some lanes only."""
    made = one_dimensional("rotor", lambda q: -cos(q[0]), lambda q: sin(q[0]), p0="1000000")
    steps = [20, 25, 31, 40, 50, 63, 80, 100, 126]
    lanes, single = (
        integrate_batch(
            made, nh.integrators["aba864"], t_end=Fraction(2), steps=steps, samples=5,
            numerics=Numerics(width=width, precision=precision),
        )
        for width in (8, 1)
    )  # fmt: skip
    assert np.abs(lanes.q).max() > 2.0**20
    assert np.array_equal(lanes.q, single.q)
    assert np.array_equal(lanes.max_energy_error, single.max_energy_error)
