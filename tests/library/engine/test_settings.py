"""The checks that functions and configs share: what passes, and in which words the rest is refused."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from nearharmonic.engine.settings import (
    checked_samples,
    checked_t_end,
    checked_tau,
    steps_of,
)
from nearharmonic.errors import SettingError, shown


@pytest.mark.parametrize("value", [0.25, "0.25", "2.5e-1", np.float64(0.25), np.float32(0.25), Decimal("0.25")])
def test_a_positive_number_passes_in_any_guise(value):
    assert checked_tau(value) == 0.25
    assert checked_t_end(value) == "0.25"


@pytest.mark.parametrize(
    "value",
    [0, -1, -0.0, float("nan"), float("inf"), "nan", "-inf", "", "ten", "1e-400", 10**400, True, None, [1], 1j, b"1"],
)
def test_anything_else_is_refused_with_allowed_values(value):
    backwards = ", or below 0 to run backwards"
    for check, key, more in ((checked_tau, "tau", ""), (checked_t_end, "t_end", backwards)):
        if (key, value) == ("t_end", -1):
            continue
        with pytest.raises(SettingError) as refusal:
            check(value)
        assert str(refusal.value) == f"{key} = {shown(value)} is not allowed: a finite number above 0{more}"


def test_t_end_keeps_all_its_digits():
    assert checked_t_end("87660.123456789012345678901") == "87660.123456789012345678901"


@pytest.mark.parametrize("value", [0, -1, 1.5, "3", True, None, 10**8])
def test_samples_is_a_whole_number_within_memory(value):
    with pytest.raises(SettingError, match="an integer from 1 to 10000000"):
        checked_samples(value)


@pytest.mark.parametrize(
    ("t_end", "tau", "steps"),
    [("500", 0.25, 2000), ("500", 0.3, 1667), ("1", 3.0, 1), ("500", 400.0, 1), ("500", 300.0, 2)],
)
def test_steps_are_rounded_to_nearest_integer_of_at_least_one(t_end, tau, steps):
    assert steps_of(t_end, tau) == steps


def test_the_division_into_steps_is_exact():
    tau = 1e-6
    assert steps_of("1000", tau) == round(Fraction(1000) / Fraction(tau))
