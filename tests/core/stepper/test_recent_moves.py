"""Cache of moves that threads share, with different moves at one memory address."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numba
import numpy as np

from nearharmonic.core.layout import COLUMNS
from nearharmonic.core.stepper.call import address_of
from nearharmonic.core.stepper.products import fill, table_of
from nearharmonic.core.stepper.recent_moves import SLOTS, empty_slots, recall

ROWS = [(Fraction(1, k), Fraction(-k, 7), Fraction(-1, 7)) for k in range(1, 10)]
TABLE, FLAGS = table_of(ROWS, (1, 1, 2)), np.zeros(len(ROWS))


def test_threads_recall_the_moves_that_they_ask_for():
    slots = address_of(empty_slots(COLUMNS * len(ROWS)))

    @numba.njit(nogil=True)
    def differences(taus):
        found, expected, wrong = np.empty(COLUMNS * len(FLAGS)), np.empty(COLUMNS * len(FLAGS)), 0
        for tau in taus:
            recall(slots(), TABLE, FLAGS, 2, tau, found)
            fill(TABLE, FLAGS, 2, tau, expected)
            wrong += (found != expected).any()
        return wrong

    values = np.random.default_rng(1).uniform(0.1, 1, 2 * SLOTS)  # so that most slots have readers and writers
    taus = np.random.default_rng(2).choice(values, (4, 200_000))
    differences(taus[0, :1])
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(differences, taus)) == [0] * 4
