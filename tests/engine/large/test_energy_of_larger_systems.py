"""Energy of more than eight coordinates: in double where it is far above rounding, in double-double where it is not."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from mpmath import mpf

import nearharmonic as nh
from nearharmonic.core.formulas.rules import CERTAINTY
from support.oracles.multiprecision import digits_of

SITES = 10


def height(q):
    q = (0, *q, 0)
    return sum((b - a) ** 2 / 2 + (b - a) ** 4 / 40 for a, b in pairwise(q))


#: Ends fixed, first mode displaced.
CHAIN = nh.System(
    name="chain", V=height, q0=[round(np.sin(np.pi * (i + 1) / (SITES + 1)), 6) for i in range(SITES)],
    p0=[0] * SITES, t_end=10,
)  # fmt: skip


def exact_error(run, sample):
    """(H - H0)/|H0| of the stored states, with all their digits, in multiprecision."""

    def energy(k):
        q, p = digits_of(run, "q", k), digits_of(run, "p", k)
        difference = [b - a for a, b in pairwise((mpf(0), *q, mpf(0)))]
        return sum(x * x for x in p) / 2 + sum(x * x / 2 + x**4 / 40 for x in difference)

    return float((energy(sample) - energy(0)) / energy(0))


@pytest.mark.parametrize("first", ["kick", "drift"])
@pytest.mark.parametrize("method", ["leapfrog", "aba864"])
def test_energy_error_is_that_of_states_to_four_digits(method, first):
    run = nh.integrate(CHAIN, method, 0.2, first=first, samples=11)
    exact = [exact_error(run, sample) for sample in range(11)]
    for sample in range(1, 11):
        assert run.energy_error[sample].item() == pytest.approx(exact[sample], rel=1 / CERTAINTY)
    assert np.abs(exact).max() > 1e-10


def test_near_rounding_the_energy_error_is_exact():
    """Steps so short that the error is that of rounding, 1e-16, which a sum of doubles could not tell."""
    run = nh.integrate(CHAIN, "yoshida_s7o6a", 0.01, samples=11)
    exact = [exact_error(run, sample) for sample in range(11)]
    assert 0 < np.abs(exact).max() < 1e-14
    # H in double-double: a few units of 1e-32.
    assert run.energy_error.values == pytest.approx(exact, abs=1e-30)
