"""Growth of rounding errors over 10^10 steps of 16 oscillators on one core."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from support.oracles.reference_solutions import oscillator_step

MEMBERS = 16
#: From 10^5 to 10^10 steps.
MARKS = [round(10 ** (k / 4)) for k in range(20, 41)]


def rounding_errors(summation, tau, marks):
    """Root mean squares over members of the relative error of the conserved energy and of the phase at these steps.

    A step of leapfrog, kick first, turns (q sqrt(1 - tau^2 / 4), p) by a fixed angle, so that p^2 + (1 - tau^2 / 4) q^2
    is conserved and exact states are powers of the step matrix.
    """
    amplitudes = np.linspace(0.75, 1.25, MEMBERS)
    start = np.zeros((MEMBERS, 4))
    start[:, 0] = amplitudes
    found = integrate_batch(
        nh.systems["sho"], nh.integrators["leapfrog"], t_end=tau * marks[-1], steps=[marks[-1]] * MEMBERS, samples=2,
        marks=np.tile(np.array([0, *marks]), (MEMBERS, 1)), start=start,
        numerics=Numerics(summation=summation, width=MEMBERS, energy="none"),
    )  # fmt: skip
    assert (found.done == marks[-1]).all()
    h = mpf(tau.numerator) / tau.denominator
    scale, step = mpmath.sqrt(1 - h**2 / 4), oscillator_step(nh.integrators["leapfrog"], h)
    errors = np.empty((len(marks), MEMBERS, 2))
    for i, mark in enumerate(marks):
        q, p = (step**mark * mpmath.matrix([1, 0]))[:]
        for k, amplitude in enumerate(amplitudes.tolist()):
            x, u = (mpf(getattr(found, name)[k, i + 1, 0]) + mpf(getattr(found, name + "_low")[k, i + 1, 0])
                    for name in ("q", "p"))  # fmt: skip
            exact, ours = mpmath.mpc(q * scale, p) * amplitude, mpmath.mpc(x * scale, u)
            errors[i, k] = float((abs(ours / exact)) ** 2 - 1), float(mpmath.arg(ours / exact))
    return np.sqrt((errors**2).mean(axis=1))


def exponents(marks, sizes):
    """Slopes of straight lines through logarithms."""
    return np.polyfit(np.log(marks), np.log(sizes), 1)[0]


@pytest.mark.long
@pytest.mark.parametrize(("summation", "largest"), [("compensated", 0.5), ("plain", 2.0)])
def test_rounding_errors_of_ten_billion_steps_grow_as_their_root(summation, largest, trials):
    """A minute: steps of 1/4 multiply exactly, so that only sums are rounded, with errors of either sign.

    The frequency of an oscillator does not depend on its energy, so that its phase error grows as that of the energy.
    16 members have root mean squares to 18 %, and exponents over five decades to 0.05: three times that.
    """
    sizes = rounding_errors(summation, Fraction(1, 4), MARKS)
    with trials("G. 10^10 steps").case(summation):
        assert np.polyfit(np.log(MARKS), np.log(sizes), 1)[0] == pytest.approx([0.5, 0.5], abs=0.15)
        assert (sizes < largest * 2.0**-53 * np.sqrt(MARKS)[:, None]).all()


@pytest.mark.long
@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_rounding_errors_of_ten_billion_steps_grow_linearly_at_most(summation, trials):
    """A minute: products by a rounded step have a bias, which is below a tenth of a rounding for each step."""
    sizes = rounding_errors(summation, Fraction(0.3), MARKS)
    with trials("G. 10^10 steps").case(summation):
        assert (sizes < 0.1 * 2.0**-53 * np.array(MARKS)[:, None]).all()
