"""The checks that functions and configs share: what passes, and in which words the rest is refused."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from nearharmonic.engine.settings import (
    checked_t_end,
    checked_tau,
    steps_of,
)


@pytest.mark.parametrize("value", [0.25, "0.25", "2.5e-1", np.float64(0.25), np.float32(0.25), Decimal("0.25")])
def test_a_positive_number_passes_in_any_guise(value):
    assert checked_tau(value) == 0.25
    assert checked_t_end(value) == "0.25"


def test_t_end_keeps_all_its_digits():
    assert checked_t_end("87660.123456789012345678901") == "87660.123456789012345678901"


@pytest.mark.parametrize(
    ("t_end", "tau", "steps"),
    [("500", 0.25, 2000), ("500", 0.3, 1667), ("1", 3.0, 1), ("500", 400.0, 1), ("500", 300.0, 2)],
)
def test_steps_are_rounded_to_nearest_integer_of_at_least_one(t_end, tau, steps):
    assert steps_of(t_end, tau) == steps


def test_the_division_into_steps_is_exact():
    tau = 1e-6
    assert steps_of("1000", tau) == round(Fraction(1000) / Fraction(tau))
