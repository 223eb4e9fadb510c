"""Validation of run settings before any job runs, and grids of step sizes; functions and configs share it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from decimal import Decimal
from difflib import get_close_matches
from fractions import Fraction
from functools import cache, lru_cache
from math import ceil, floor, inf, log10
from numbers import Integral
from sys import float_info
from typing import Any

import numpy as np

from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau
from nearharmonic.numerics.portable import Floats, Integers, decades
from nearharmonic.numerics.written import ALL_DIGITS, decimal, decimal_of, is_integer, is_real
from nearharmonic.systems.system import System

# --- Validation of run settings before any job runs; functions and configs share it.
#
# A function returns a value that is allowed. Anything else raises a SettingError with the key, the value, what is
# allowed and the nearest match.

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
DEVICES = ("cpu", "gpu", "auto")


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

    ``summation`` is for steps in double precision; double-double sums are always compensated. ``split`` says
    what the two operators of a method solve: the drift T and the kick V; or the drift T with the oscillators of the
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
    """Arithmetic of runs, and how often their energy is evaluated; :class:`SharedSettings` has the other fields.

    ``precision``: arithmetic of the state; "extended" is double-double. ``width``: number of SIMD lanes, 1 to 64; None
    for as many as suit the runs. ``energy``: when it is measured, at "every" step; at the "samples", where errors are
    over the samples and a run counts as diverged at the first sample that says so; or never, "none", where errors are
    NaN and only a state that is not finite counts as diverged. ``look``: with "samples", measure the energy also every
    so many steps, for the maxima and to find what has diverged; errors are independent of which runs share the lanes if
    it divides the number of steps between samples. ``double_coefficients``: True if the products of step size and
    coefficient are rounded to double in extended precision too. ``device``: "cpu" or "gpu"; it changes no bit.
    """

    precision: str = "double"
    width: int | None = None
    energy: str = "every"
    look: int | None = None
    double_coefficients: bool = False
    device: str = "cpu"

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
        if (self.summation, self.look, self.double_coefficients, self.device) == (summation, None, False, "cpu"):
            return self  # most are: a copy takes longer than the look-up of their kernel
        return replace(self, summation=summation, look=None, double_coefficients=False, device="cpu")


@lru_cache(maxsize=128)
def exact_decimal(text: str) -> Fraction:
    """Return the exact value of a decimal string."""
    return Fraction(text)


@dataclass(frozen=True, kw_only=True)
class Sweep(SharedSettings):
    """The runs of every method on one ``system``, over [0, t_end] with a decimal string in its unit of time.

    The step sizes per stage are from ``lowest`` to ``highest``, ``points_per_decade`` in each factor of ten.
    ``precision`` has "double", "extended" or both. A run keeps at most so many ``samples``, 0 for reduced numbers
    alone, and ``shards`` are the files that share the step sizes of a method.
    """

    system: str
    t_end: str
    lowest: float
    highest: float
    points_per_decade: int
    precision: tuple[str, ...]
    samples: int
    shards: int


# --- Grids of step sizes, numbers of steps, and methods that fit a system.
def grid_points(lowest: float, highest: float, points_per_decade: float) -> int:
    """Return the number of step sizes of :func:`tau_grid`, 0 if ``highest`` is below ``lowest``."""
    # The slack admits a highest that is itself written with few digits, such as 158.489 for 10^2.2.
    ratio = highest / lowest
    width = log10(ratio) if ratio < inf else log10(highest) - log10(lowest)
    return max(0, floor(width * points_per_decade + 1e-3) + 1)


@cache
def tau_grid(lowest: float, highest: float, points_per_decade: float) -> tuple[float, ...]:
    """Return ``lowest`` * 10^(i / ``points_per_decade``) up to ``highest``, each rounded as :func:`tau_range` does."""
    return tau_range(lowest, points_per_decade, 0, grid_points(lowest, highest, points_per_decade))


def tau_range(lowest: float, points_per_decade: float, begin: int, end: int) -> tuple[float, ...]:
    """Return the step sizes i of a grid for ``begin`` <= i < ``end``.

    They are rounded to six significant digits, or to more in a grid of over 10^4 points per decade, whose neighbours
    would otherwise be equal.
    """
    digits = max(6, ceil(log10(points_per_decade)) + 2)
    return tuple(float(f"{tau:.{digits}g}") for tau in decades(lowest, points_per_decade, begin, end))


def steps_over(taus: Floats, t_end: str, tableau: Tableau) -> Integers:
    """Return the steps that ``tableau`` takes over [0, t_end] with each step size per stage, as its ``steps`` does."""
    ratios = float(exact_decimal(t_end)) / (taus * tableau.stages)
    steps = np.rint(ratios)
    # A ratio is off by less than three roundings. Nearer to a half than that, exact arithmetic decides.
    unsure = np.abs(np.abs(ratios - steps) - 0.5) <= 1e-15 * ratios
    steps[unsure] = [tableau.steps(tau, exact_decimal(t_end)) for tau in taus[unsure].tolist()]
    return np.maximum(steps, 1).astype(np.int64)


def steps_of(t_end: str, tau: float, key: str = "tau", given: object = None) -> int:
    """Return max(1, round(t_end / tau)) for a decimal string and the binary value of a step size, the division exact.

    More than :data:`~nearharmonic.engine.settings.MOST_STEPS` raise an error about the setting ``key`` with the value
    ``given``, or ``tau``.
    """
    steps = max(1, round(exact_decimal(t_end) / Fraction(tau)))
    if steps > MOST_STEPS:
        number = f"{Decimal(steps):.4g}" if steps > 10**15 else str(steps)
        shown = t_end if len(t_end) <= 40 else f"{Decimal(t_end):.4g}"
        allowed = f"t_end = {shown} would take {number} steps, and one run takes at most {MOST_STEPS}"
        raise bad_setting(key, tau if given is None else given, allowed)
    return steps


def misfit(system: System, tableau: Tableau, split: str = KINETIC_POTENTIAL) -> tuple[str, str]:
    """Return the reason why a method is not for a system, and the words that name the system; two "" if it is.

    One of Runge-Kutta-Nystrom type is for kinetic energies of degree 2 in the momenta; one with kicks of a modified
    potential for formulas that are compiled as they are written, too, and for no oscillator that is solved exactly.
    """
    if tableau.requires == QUADRATIC_KINETIC_ENERGY and not system.quadratic_kinetic_energy:
        return f"it requires a {tableau.requires}", f", which {system.name} does not have"
    if not tableau.modified:
        return "", ""
    reasons = {
        "is regularised": system.regularisation is not None,
        "has a V that is a function of numba": not system.energies[0].traced,
        "has its oscillators solved exactly": split == EXACT_OSCILLATOR,
    }
    found = next((what for what, is_so in reasons.items() if is_so), "")
    if not found and system.formulas().are_loops:
        found = "has formulas that are compiled as loops"
    if not found:
        return "", ""
    return "its kicks are of a modified potential", f", which cannot be used with {system.name}: it {found}"


def check_fit(system: System, tableau: Tableau, split: str = KINETIC_POTENTIAL, key: str = "integrator") -> None:
    """Raise an error about the setting ``key`` for a method that does not fit a system, with the reason of
    :func:`misfit`.
    """
    reason = "".join(misfit(system, tableau, split))
    if reason:
        raise bad_setting(key, tableau.name, reason)
