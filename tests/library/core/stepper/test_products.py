"""Products of rational coefficients and powers of a step size against rational arithmetic, and their cache."""

from __future__ import annotations

import random
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numba
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, REST
from nearharmonic.core.stepper import SLOTS, address_of, empty_slots, fill, recall, table_of
from nearharmonic.engine.numbers import exact_products, moves
from nearharmonic.integrators import plain_integrators

RNG = random.Random(1)
#: Kinds of step sizes: any; short decimals; few bits; multiples of 3 and 5, for which n/24 or n/5 may be half-way
#: between two doubles; 27 bits, whose square is half-way; both ends of what is promised.
TAUS = (
    lambda: RNG.uniform(-1, 1),
    lambda: round(RNG.uniform(0.01, 9), 2),
    lambda: RNG.randint(-999, 999) * 2.0**-9,
    lambda: 3 * RNG.randint(1, 2**51) * 2.0**-52,
    lambda: 5 * RNG.randint(1, 2**50) * 2.0**-51,
    lambda: (2 * RNG.randint(2**25, 2**26) + 1) * 2.0**-30,
    lambda: 10.0 ** RNG.uniform(-80, -70),
    lambda: -(10.0 ** RNG.uniform(70, 80)),
)


def filled(rows, power, tau, flags=None):
    table, found = table_of(rows, (1, 1, power)), np.empty(COLUMNS * len(rows))
    fill(table, np.zeros(len(rows)) if flags is None else flags, power, tau, found)
    return found.reshape(len(rows), COLUMNS)


@pytest.mark.slow
@pytest.mark.parametrize("draws", [1, pytest.param(5, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", plain_integrators)
def test_moves_have_the_bits_of_rational_arithmetic(name, draws):
    tableau = nh.integrators[name]
    rows = [tuple(Fraction(*x) for x in row) for row in exact_products(tableau)]
    for tau in [draw() for draw in TAUS for _ in range(draws)]:
        np.testing.assert_array_equal(filled(rows, 2, tau), moves(tableau, [Fraction(tau)], 1)[0], repr(tau))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, t in nh.modified_integrators.items() if not t.processed])
def test_modified_moves_have_the_bits_of_rational_arithmetic(name):
    tableau = nh.modified_integrators[name]
    for tau in [draw() for draw in TAUS for _ in range(4)]:
        exact = moves(tableau, [Fraction(tau)], 1)[0]
        np.testing.assert_array_equal(filled(tableau.moves(), 3, tau, exact[:, -1]), exact, repr(tau))


#: Seven over a multiple of 3 or 5, or decimals of that, with the factor of step sizes that cancels it.
SEVENTHS = {
    "seven 24ths": (Fraction(7, 24), 3),
    "decimals below": (Fraction("0.2916" + "6" * 72), 3),
    "decimals above": (Fraction("0.2916" + "6" * 71 + "7"), 3),
    "a hundred digits": (Fraction("1.1" + "6" * 98 + "7"), 3),
    "seven 20ths": (Fraction(7, 20), 5),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SEVENTHS)
def test_ties_and_what_is_near_them_are_rounded_once(name):
    k, factor = SEVENTHS[name]
    for _ in range(100):
        # 7 m is odd and has 54 bits: half-way between two doubles.
        m = RNG.randrange(2**53 // 7 // 2 + 1, 2**53 // 5 // 2) * 2 + 1
        tau = Fraction(factor * m, 2**50)
        found = filled([(k, -k, -k * k)], 2, float(tau))[0]
        assert found[:REST].tolist() == [float(x) for x in (k * tau, -k * tau, -((k * tau) ** 2))], m
        rest = Fraction(found[KICK]) * Fraction(found[DRIFT]) - Fraction(found[PRODUCT])
        assert found[REST] == float(rest)


@pytest.mark.slow
def test_a_step_size_that_is_no_number_gives_none():
    for tau in (np.nan, np.inf):
        assert not np.isfinite(filled([(Fraction(1, 3), Fraction(1, 3), Fraction(1, 9))], 2, tau)).any()


@pytest.mark.slow
def test_threads_recall_the_moves_that_they_ask_for():
    """Different moves at one memory address."""
    rows = [(Fraction(1, k), Fraction(-k, 7), Fraction(-1, 7)) for k in range(1, 10)]
    table, flags = table_of(rows, (1, 1, 2)), np.zeros(len(rows))
    slots = address_of(empty_slots(COLUMNS * len(rows)))

    @numba.njit(nogil=True)
    def differences(taus):
        found, expected, wrong = np.empty(COLUMNS * len(flags)), np.empty(COLUMNS * len(flags)), 0
        for tau in taus:
            recall(slots(), table, flags, 2, tau, found)
            fill(table, flags, 2, tau, expected)
            wrong += (found != expected).any()
        return wrong

    values = np.random.default_rng(1).uniform(0.1, 1, 2 * SLOTS)  # so that most slots have readers and writers
    taus = np.random.default_rng(2).choice(values, (4, 200_000))
    differences(taus[0, :1])
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(differences, taus)) == [0] * 4
