"""Validation of run settings before any job runs; functions and configs share it.

A function returns a value that is allowed. Anything else raises a SettingError with the key, the value, what is allowed
and the nearest match.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from decimal import Decimal
from difflib import get_close_matches
from fractions import Fraction
from functools import lru_cache
from math import inf
from numbers import Integral
from sys import float_info
from typing import Any

from nearharmonic.errors import bad_setting
from nearharmonic.numerics.written import ALL_DIGITS, decimal, decimal_of, is_integer, is_real

#: Steps of one run: at 3 ns a stage, half a minute for ten stages. More is a slip of the decimal point.
MOST_STEPS = 10**9
#: Kept states of one run: about half a gigabyte for a planar system.
MOST_SAMPLES = 10**7
#: Step sizes of a sweep.
MOST_TAUS = 10**6
#: SIMD lanes of a kernel: one AVX-512 register of doubles. On narrower processors the compiler splits it, with the same
#: bits.
WIDTH = 8
#: Eight such registers.
MOST_LANES = 64
#: Threads of an ensemble.
MOST_THREADS = 1024

PRECISIONS = ("double", "extended")
SUMMATIONS = ("compensated", "plain")
OPERATORS = ("drift", "kick")
#: What the two operators of a splitting solve: T and V; or T with the oscillators of V, and the rest of V.
KINETIC_POTENTIAL, EXACT_OSCILLATOR = SPLITS = ("kinetic_potential", "exact_oscillator")
ENERGIES = ("every", "samples", "none")


def positive(key: str, value: object) -> Decimal:
    """Return ``value``, a number above 0 or a decimal string (YAML 1.1 reads 1e-4 as one), exactly."""
    allowed = "a finite number above 0"
    number = _decimal(key, value, allowed)
    if number < 0:
        raise bad_setting(key, value, allowed)
    return number


def _decimal(key: str, value: object, allowed: str) -> Decimal:
    """``value``, a number other than 0, exactly; subnormal numbers, of few digits, count as 0."""
    text = decimal(value)
    try:
        number = decimal_of(str(text) if isinstance(text, str | Decimal) else "")
        usable = float_info.min <= abs(float(number)) < inf
    except (ValueError, OverflowError):
        usable = False
    if not usable:
        raise bad_setting(key, value, allowed)
    return number


def checked_tau(tau: object, key: str = "tau") -> float:
    """Return ``tau`` as a float, if it is a finite number above 0 (or the decimal string of one)."""
    if type(tau) is float and float_info.min <= tau < inf:
        return tau
    return float(positive(key, tau))


def checked_t_end(t_end: object) -> str:
    """Return ``t_end`` as a plain decimal string, if it is a finite number (or the decimal string of one) but 0."""
    number = _decimal("t_end", t_end, "a finite number above 0, or below 0 to run backwards")
    return format(number.normalize(ALL_DIGITS), "f")


def checked_count(key: str, value: object, most: int) -> int:
    """Return ``value``, the setting named ``key``, as an int if it is an integer from 1 to ``most``."""
    if not is_real(value) or not isinstance(value, Integral) or not 1 <= int(value) <= most:
        raise bad_setting(key, value, f"an integer from 1 to {most}")
    return int(value)


def whole_number(text: str, key: str) -> int:
    """Return an integer of at least 0 that was given as text."""
    if not is_integer(text) or int(text) < 0:
        raise bad_setting(key, text, "an integer of at least 0")
    return int(text)


def checked_samples(samples: object) -> int:
    """Return ``samples`` as an int, if it is an integer from 1 to :data:`MOST_SAMPLES`."""
    return checked_count("samples", samples, MOST_SAMPLES)


def one_of(key: str, value: object, allowed: Sequence[str]) -> str:
    """Return ``value``, the setting named ``key``, if it is among ``allowed``."""
    if isinstance(value, str) and value in allowed:
        return value
    nearest = get_close_matches(str(value), allowed, n=1, cutoff=0.4)
    hint = f". Did you mean {nearest[0]!r}?" if nearest else ""
    raise bad_setting(key, value, f"one of {', '.join(allowed)}{hint}")


@dataclass(frozen=True, kw_only=True)
class SharedSettings:
    """Settings that a config hands on to the kernels unchanged; all carriers between the two inherit them.

    Parameters
    ----------
    summation : {"compensated", "plain"}
        Summation of the steps in double precision. Double-double sums are compensated always.
    split : {"kinetic_potential", "exact_oscillator"}
        What the two operators of a method solve: the drift T and the kick V; or the drift T with the oscillators of the
        frequencies that the system declares, and the kick the rest of V.
    """

    summation: str = "compensated"
    split: str = KINETIC_POTENTIAL

    @property
    def shared_settings(self) -> dict[str, Any]:
        """These settings by name."""
        return shared_settings_from(self)


def shared_settings_from(*sources: object) -> dict[str, Any]:
    """Return the fields of :class:`SharedSettings` by name, each from the first source that gives it, if one does."""
    found = {field.name: [getattr(source, field.name, None) for source in sources] for field in fields(SharedSettings)}
    given = {name: next((x for x in values if x is not None), None) for name, values in found.items()}
    return {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True, kw_only=True)
class Numerics(SharedSettings):
    """Arithmetic of runs, and how often their energy is evaluated.

    Parameters
    ----------
    precision : {"double", "extended"}
        Arithmetic of the state; "extended" is double-double.
    width : int or None
        Number of SIMD lanes, 1 to 64; if None, as many as suit the runs.
    energy : {"every", "samples", "none"}
        When the energy is measured: at every step; at the samples, where errors are over the samples and a run counts
        as diverged at the first sample that says so; never, where errors are NaN and only a state that is not finite
        counts as diverged.
    look : int or None
        With "samples", measure the energy also every so many steps, for the maxima and to find what has diverged.
        Errors are independent of which runs share the lanes if ``look`` divides the number of steps between samples.
    double_coefficients : bool
        True if the products of step size and coefficient are rounded to double in extended precision too.

    See Also
    --------
    SharedSettings : the other parameters.

    Raises
    ------
    SettingError
        A value outside what is allowed.
    """

    precision: str = "double"
    width: int | None = None
    energy: str = "every"
    look: int | None = None
    double_coefficients: bool = False

    def __post_init__(self) -> None:
        one_of("precision", self.precision, PRECISIONS)
        one_of("summation", self.summation, SUMMATIONS)
        if self.width is not None:
            checked_count("width", self.width, MOST_LANES)
        one_of("energy", self.energy, ENERGIES)
        if self.look is not None:
            checked_count("look", self.look, MOST_STEPS)
        one_of("split", self.split, SPLITS)

    @property
    def exact_oscillator(self) -> bool:
        """True if T and the oscillators of V are solved exactly together."""
        return self.split == EXACT_OSCILLATOR

    @property
    def compensated(self) -> bool:
        """True if the digits below a double are kept from step to step."""
        return self.precision == "extended" or self.summation == "compensated"

    @property
    def parts(self) -> int:
        """Doubles that make a number of the state."""
        return 2 if self.precision == "extended" else 1

    @property
    def compiled(self) -> Numerics:
        """Numerics of the compiled code alone: equal code has equal ``compiled``."""
        summation = "compensated" if self.compensated else "plain"
        if (self.summation, self.look, self.double_coefficients) == (summation, None, False):
            return self  # most are: a copy takes longer than the look-up of their kernel
        return replace(self, summation=summation, look=None, double_coefficients=False)


@lru_cache(maxsize=128)
def exact_decimal(text: str) -> Fraction:
    """Return the exact value of a decimal string."""
    return Fraction(text)


@dataclass(frozen=True, kw_only=True)
class Sweep(SharedSettings):
    """The runs of every method on one system; :class:`SharedSettings` has the other attributes.

    Attributes
    ----------
    system : str
        Name of the system.
    t_end : str
        End of the interval [0, t_end], a decimal string in the system's unit of time.
    lowest, highest : float
        Range of the step sizes per stage, in the system's unit of time.
    points_per_decade : int
        Step sizes in each factor of ten.
    precision : tuple of str
        Arithmetic of the runs: "double", "extended" or both.
    samples : int
        States that a run keeps at most; 0 for reduced numbers alone.
    shards : int
        Files that share the step sizes of a method.
    """

    system: str
    t_end: str
    lowest: float
    highest: float
    points_per_decade: int
    precision: tuple[str, ...]
    samples: int
    shards: int
