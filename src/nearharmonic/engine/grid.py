"""Grids of step sizes, numbers of steps, and methods that fit a system."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from functools import cache
from math import ceil, floor, inf, log10

import numpy as np

from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, MOST_STEPS, exact_decimal
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau
from nearharmonic.numerics.geometric import decades
from nearharmonic.numerics.types import Floats, Integers
from nearharmonic.systems.definition.system import System


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
    """Return max(1, round(t_end / tau)), the division exact.

    Parameters
    ----------
    t_end : str
        Length of the interval, a decimal string.
    tau : float
        Requested step size, taken as its binary value.
    key : str
        Name of the setting in the error.
    given : object
        Value of that setting in the error; ``tau`` if None.

    Raises
    ------
    SettingError
        More than :data:`~nearharmonic.engine.settings.MOST_STEPS` steps.
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
    if tableau.implicit and system.formulas().are_loops:
        return "it is implicit", f", and cannot be used with {system.name}, whose formulas are compiled as loops"
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
    """Raise an error about the setting ``key`` for a method that does not fit a system.

    Raises
    ------
    SettingError
        The method does not fit; the message holds the reason that :func:`misfit` returns.
    """
    reason = "".join(misfit(system, tableau, split))
    if reason:
        raise bad_setting(key, tableau.name, reason)
