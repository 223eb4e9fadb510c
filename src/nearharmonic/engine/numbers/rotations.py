"""Coefficients of the moves of a kernel that solves an oscillator exactly, from exact numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from nearharmonic.core.arithmetic import rounded_pair, two_products
from nearharmonic.core.layout import KICK, TURN, TURNS, columns
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, sin
from nearharmonic.numerics.types import Floats

#: Bits of sines and cosines: twice the bits of a double-double.
BITS = 212


@lru_cache(maxsize=1024)
def rotations(
    tableau: Tableau, tau: Fraction, frequencies: tuple[Fraction, ...], parts: int, *, rounded: bool
) -> Floats:
    """Return the moves (s + 2, columns) of one step size, each a kick and a rotation behind it.

    Rows are those of :meth:`nearharmonic.integrators.composition.Composition.moves`, and columns those of
    :mod:`nearharmonic.core.rotation`, for distinct frequencies and numbers of one or two ``parts``. Drifts that meet
    between steps turn by the sum of their angles. If ``rounded``, kicks and drifts times tau are rounded to doubles
    before anything follows from them.
    """
    found = tableau.moves(tau, rounded=rounded)
    kicks, drifts = [kick for kick, _, _ in found], [drift for _, drift, _ in found]
    array = np.zeros((len(found), columns(len(frequencies))))
    array[:, KICK : KICK + parts] = [pair_of(kick)[:parts] for kick in kicks]
    for place, frequency in enumerate(frequencies):
        shears, size = list(_shears(drifts, frequency)), 6 if parts == 2 else TURNS
        at = TURN * parts + size * place
        if parts == 2:
            array[:, at : at + size] = [[half for x in row for half in pair_of(x)] for row in shears]
        else:
            array[:, at : at + size] = _in_doubles(kicks, shears)
    return array


def rounded_rotations(kicks: Floats, drifts: Floats, frequencies: Floats) -> Floats:
    """Return moves (..., s + 2, columns) in doubles, for kicks and drifts (..., s + 2) times the step size.

    They are those of :func:`rotations` up to the rounding errors of each number, at once for many methods and step
    sizes; ``frequencies`` (..., F) may differ too, and are not 0.
    """
    w, kick = frequencies[..., None, :], kicks[..., None]
    half = w * drifts[..., None] / 2
    sine, cosine = sin(half), cos(half)
    T = w * sine / cosine
    found = np.zeros((*T.shape[:-1], columns(T.shape[-1])))
    found[..., KICK] = kicks
    b, S, product, linear_product, _, _, shear = (found[..., TURN + i :: TURNS] for i in range(TURNS))
    S[:] = 2 * sine * cosine / w
    b[..., 1, :], b[..., 2:-1, :], b[..., -1, :] = T[..., -2, :], T[..., 1:-2, :], T[..., -2, :]
    b += T
    np.negative(b, out=b)
    np.multiply(kick, S, out=product)
    np.multiply(b, S, out=linear_product)
    shear[..., 0, :], shear[..., -1, :] = T[..., 1, :] - T[..., 0, :], -T[..., -1, :]
    return found


def _in_doubles(kicks: list[Fraction], shears: list[tuple[Fraction, Fraction, Fraction]]) -> Floats:
    """The coefficients (s + 2, TURNS) of a frequency, each rounded once, from b, S and the last shear of each move."""
    rows = [(b, S, k * S, b * S, last, k) for k, (b, S, last) in zip(kicks, shears, strict=True)]
    linear, drift, product, linear_product, shear, kick = np.array([[float(x) for x in row] for row in rows]).T
    with np.errstate(over="ignore", invalid="ignore"):
        rests = [(high - x) + low for x, (high, low) in (
            (product, two_products(kick, drift)), (linear_product, two_products(linear, drift)),
        )]  # fmt: skip
    return np.stack([linear, drift, product, linear_product, *rests, shear], axis=1)


def _shears(drifts: Sequence[Fraction], frequency: Fraction) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """Yield b of each move, S and the shear behind it, which are 0 but for a run's first move and a step's last."""
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


def pair_of(x: Fraction) -> tuple[float, float]:
    """Return the double nearest to x, and the digits below it."""
    return rounded_pair(*x.as_integer_ratio())
