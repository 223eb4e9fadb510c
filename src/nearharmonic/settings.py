"""What may be set, and the checks that every setting passes before any job runs; functions and configs share them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from difflib import get_close_matches
from fractions import Fraction
from numbers import Integral, Real

from nearharmonic.errors import bad_setting

#: Steps of one run: at 3 ns a stage, half a minute for ten stages. More is a slip of the decimal point.
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


def one_of(key: str, value: object, allowed: Sequence[str]) -> str:
    """``value``, if it is among ``allowed``.

    Raises:
        SettingError: anything else; it says the nearest match.
    """
    if isinstance(value, str) and value in allowed:
        return value
    nearest = get_close_matches(str(value), allowed, n=1, cutoff=0.4)
    hint = f". Did you mean {nearest[0]!r}?" if nearest else ""
    raise bad_setting(key, value, f"one of {', '.join(allowed)}{hint}")


def checked_precision(precision: object, key: str = "precision") -> str:
    """``precision``, if it is one of :data:`PRECISIONS`; raises SettingError otherwise."""
    return one_of(key, precision, PRECISIONS)


def checked_summation(summation: object, key: str = "summation") -> str:
    """``summation``, if it is one of :data:`SUMMATIONS`; raises SettingError otherwise."""
    return one_of(key, summation, SUMMATIONS)


def checked_first(first: object, key: str = "first") -> str | None:
    """``first``, if it is None (the tableau's own) or one of :data:`OPERATORS`; raises SettingError otherwise."""
    return None if first is None else one_of(key, first, OPERATORS)


def steps_of(t_end: str, tau: float, key: str = "tau", given: object = None) -> int:
    """max(1, round(t_end / tau)), the division exact: t_end is a decimal string, tau the double it is.

    Raises:
        SettingError: more than :data:`MOST_STEPS` steps; it names ``key`` and the value ``given`` for it (tau if None).
    """
    steps = max(1, round(Fraction(t_end) / Fraction(tau)))
    if steps > MOST_STEPS:
        number = f"{Decimal(steps):.4g}" if steps > 10**15 else str(steps)
        allowed = f"t_end = {t_end} would take {number} steps, and one run takes at most {MOST_STEPS}"
        raise bad_setting(key, tau if given is None else given, allowed)
    return steps


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What a config asks of one system: step sizes per stage from ``lowest`` to ``highest`` (in the system's unit of
    time), ``points_per_decade`` of them, over [0, ``t_end``], in each of ``precision``; ``samples`` kept states a run,
    in up to ``shards`` files a method."""

    system: str
    t_end: str
    lowest: float
    highest: float
    points_per_decade: int
    precision: tuple[str, ...]
    summation: str
    samples: int
    shards: int


@dataclass(frozen=True, kw_only=True)
class Config:
    """A config, checked: its ``name``, methods, one sweep a system, and the methods that figure 2 decomposes."""

    name: str
    integrators: tuple[str, ...]
    sweeps: tuple[Sweep, ...]
    decomposition: tuple[str, ...]
