"""What is integrated, and why the rest is not: every setting is checked here, before any job runs. Pure, no arrays."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from difflib import get_close_matches
from fractions import Fraction
from numbers import Integral, Real

from nearharmonic.errors import bad_setting

#: Steps of one run: half a minute per stage count of ten at 3 ns a stage. More is a slip of the decimal point.
MOST_STEPS = 10**9
#: Kept states of one run: about half a gigabyte for a planar system.
MOST_SAMPLES = 10**7

PRECISIONS = ("double", "extended")
SUMMATIONS = ("compensated", "plain")
OPERATORS = ("drift", "kick")


def _positive(key: str, value: object) -> Decimal:
    """``value``, a number or a decimal string (YAML 1.1 reads 1e-4 as one), exactly."""
    allowed = "a finite number above 0"
    if isinstance(value, bool) or not isinstance(value, Real | Decimal | str):
        raise bad_setting(key, value, allowed)
    try:
        number = Decimal(value) if isinstance(value, str | Decimal | int) else Decimal(repr(float(value)))
        usable = number.is_finite() and 0 < float(number) < float("inf")
    except (InvalidOperation, OverflowError):
        usable = False
    if not usable:
        raise bad_setting(key, value, allowed)
    return number


def checked_tau(tau: object, key: str = "tau") -> float:
    """``tau`` as a float, if it is a finite number above 0 (or the decimal string of one).

    Raises:
        SettingError: zero, negative, NaN, infinite, a bool or no number at all.
    """
    return float(_positive(key, tau))


def checked_t_end(t_end: object, key: str = "t_end") -> str:
    """``t_end`` as a plain decimal string, if it is a finite number above 0 (or the decimal string of one).

    Raises:
        SettingError: zero, negative, NaN, infinite, a bool or no number at all.
    """
    return format(_positive(key, t_end).normalize(), "f")


def _count(key: str, value: object, most: int) -> int:
    if isinstance(value, bool) or not isinstance(value, Integral) or not 1 <= int(value) <= most:
        raise bad_setting(key, value, f"a whole number from 1 to {most}")
    return int(value)


def checked_samples(samples: object, key: str = "samples") -> int:
    """``samples`` as an int, if it is a whole number from 1 to :data:`MOST_SAMPLES`.

    Raises:
        SettingError: anything else.
    """
    return _count(key, samples, MOST_SAMPLES)


def _one_of(key: str, value: object, allowed: Sequence[str]) -> str:
    if isinstance(value, str) and value in allowed:
        return value
    nearest = get_close_matches(str(value), allowed, n=1, cutoff=0.4)
    hint = f". Did you mean {nearest[0]!r}?" if nearest else ""
    raise bad_setting(key, value, f"one of {', '.join(allowed)}{hint}")


def checked_precision(precision: object, key: str = "precision") -> str:
    """``precision``, if it is one of :data:`PRECISIONS`; raises SettingError otherwise."""
    return _one_of(key, precision, PRECISIONS)


def checked_summation(summation: object, key: str = "summation") -> str:
    """``summation``, if it is one of :data:`SUMMATIONS`; raises SettingError otherwise."""
    return _one_of(key, summation, SUMMATIONS)


def checked_first(first: object, key: str = "first") -> str | None:
    """``first``, if it is None (the tableau's own) or one of :data:`OPERATORS`; raises SettingError otherwise."""
    return None if first is None else _one_of(key, first, OPERATORS)


def steps_of(t_end: str, tau: float, key: str = "tau") -> int:
    """max(1, round(t_end / tau)), the division exact: t_end is a decimal string, tau the double it is.

    Raises:
        SettingError: more than :data:`MOST_STEPS` steps.
    """
    steps = max(1, round(Fraction(t_end) / Fraction(tau)))
    if steps > MOST_STEPS:
        raise bad_setting(key, tau, f"t_end = {t_end} would take {steps} steps, and one run takes at most {MOST_STEPS}")
    return steps
