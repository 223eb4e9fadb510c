"""Coefficients of the moves of a kernel that solves an oscillator exactly, from exact numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from nearharmonic.core.arithmetic import rounded_pair, two_products
from nearharmonic.core.layout import KICK, TURN, TURNS, columns
from nearharmonic.engine.coefficients import Floats, kicks_and_drifts
from nearharmonic.integrators.tableau import Tableau

#: Bits of sines and cosines: those of a double-double, and as many again.
BITS = 212


@lru_cache(maxsize=1024)
def rotations(
    tableau: Tableau, tau: Fraction, frequencies: tuple[Fraction, ...], parts: int, *, rounded: bool
) -> Floats:
    """Return the moves (s + 2, columns) of one step size, each a kick and a rotation behind it.

    Rows are those of :func:`nearharmonic.engine.coefficients.moves`, and columns those of
    :mod:`nearharmonic.core.rotation`. Drifts that meet between steps turn by the sum of their angles.

    Parameters
    ----------
    tableau : Tableau
        Method of s stages.
    tau : Fraction
        Step size.
    frequencies : tuple of Fraction
        Distinct frequencies.
    parts : {1, 2}
        Doubles that make a number: 2 for double-doubles.
    rounded : bool
        Whether kicks and drifts times tau are rounded to doubles before anything follows from them.
    """
    found = kicks_and_drifts(tableau, tau, rounded=rounded)
    array = np.zeros((len(found), columns(len(frequencies))))
    kicks = np.array([rounded_pair(*kick.as_integer_ratio()) for kick, _ in found])
    array[:, KICK : KICK + parts] = kicks[:, :parts]
    for place, frequency in enumerate(frequencies):
        turn = np.array([[_pair(x) for x in row] for row in _shears([drift for _, drift in found], frequency)])
        size = 6 if parts == 2 else TURNS
        at = TURN * parts + size * place
        array[:, at : at + size] = turn.reshape(-1, 6) if parts == 2 else _rounded(kicks[:, 0], turn[..., 0])
    return array


def _rounded(kick: Floats, turn: Floats) -> Floats:
    """The coefficients (s + 2, TURNS) of a frequency in doubles, from b, S and the last shear (s + 2, 3)."""
    linear, drift, shear = turn.T
    with np.errstate(over="ignore", invalid="ignore"):
        product, rest = two_products(kick, drift)
        linear_product, linear_rest = two_products(linear, drift)
    return np.stack([linear, drift, product, linear_product, rest, linear_rest, shear], axis=1)


def _shears(drifts: Sequence[Fraction], frequency: Fraction) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """Of each move b, S and the shear behind it, which are 0 but for the first move of a run and the last of a step."""
    turns = [_shear_and_drift(drift, frequency) for drift in drifts]
    shears, nothing = [T for T, _ in turns], Fraction(0)
    before = [nothing, shears[-2], *shears[1:-2], shears[-2]]
    behind = [shears[1] - shears[0], *[nothing] * (len(turns) - 2), -shears[-1]]
    for (T, S), earlier, last in zip(turns, before, behind, strict=True):
        yield -(earlier + T), S, last


def _shear_and_drift(drift: Fraction, frequency: Fraction) -> tuple[Fraction, Fraction]:
    """T = w tan(x/2) and S = sin(x)/w for a frequency w and the angle x that it turns by in a drift."""
    if not frequency * drift:
        return Fraction(0), drift
    from mpmath.libmp import from_rational, mpf_cos_sin, to_rational

    half = frequency * drift / 2
    angle = from_rational(half.numerator, half.denominator, 2 * BITS)
    c, s = (Fraction(*map(int, to_rational(x))) for x in mpf_cos_sin(angle, BITS))
    return frequency * s / c, 2 * s * c / frequency


def _pair(x: Fraction) -> tuple[float, float]:
    return rounded_pair(*x.as_integer_ratio())
