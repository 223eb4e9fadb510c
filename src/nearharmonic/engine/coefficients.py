"""What a kernel is given in doubles, from exact numbers: coefficients times step sizes, initial states, parameters."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.core.layout import ENERGY, LIMIT, TALLY, parameter_rows
from nearharmonic.integrators.tableau import Tableau

Floats = NDArray[np.float64]


def start_row(q: Sequence[Fraction], p: Sequence[Fraction], *, plain: bool = False) -> Floats:
    """Return one start (4 d,) as the kernel takes it: q, the digits below q, p, the digits below p.

    Parameters
    ----------
    q, p : sequence of d Fraction
        Exact position and momentum.
    plain : bool
        Whether the digits below a double are dropped.
    """
    pairs = [[rounded_pair(*x.as_integer_ratio()) for x in row] for row in (q, p)]
    keep = 0.0 if plain else 1.0
    return np.array([part for row in pairs for part in ([h for h, _ in row], [low * keep for _, low in row])]).ravel()


def parameter_row(values: Sequence[Fraction]) -> Floats:
    """Return parameters (2 P,) as the kernel takes them: each rounded to a double, and the digits below it."""
    pairs = [rounded_pair(*value.as_integer_ratio()) for value in values]
    return np.array(pairs, dtype=np.float64).reshape(-1)


def lane_rows(start: Floats, parameters: Floats, width: int, room: int = 0) -> Floats:
    """Return the rows of a kernel (flat) whose lanes all hold one start, with H0 = 1 and no limit of the energy error.

    Parameters
    ----------
    start, parameters : arrays of float
        As :func:`start_row` and :func:`parameter_row` lay them out.
    width : int
        Number of lanes.
    room : int
        Doubles behind the rows that the kernel works in.
    """
    rows = np.zeros((start.size + TALLY + parameter_rows(parameters.size // 2), width))
    rows[: start.size] = start[:, None]
    rows[start.size + ENERGY], rows[start.size + LIMIT] = 1.0, np.inf
    rows[start.size + TALLY : start.size + TALLY + parameters.size] = parameters[:, None]
    return np.append(rows, np.zeros(room))


def coefficients(tableau: Tableau, taus: Sequence[Fraction], parts: int) -> tuple[Floats, Floats]:
    """Return drift and kick coefficients (len(taus), s + 1, parts), multiplied by tau exactly and rounded once.

    Parameters
    ----------
    tableau : Tableau
        Method of s stages.
    taus : sequence of Fraction
        Step sizes.
    parts : {1, 2}
        Doubles that make a number: 2 for double-doubles.
    """
    arrays = np.empty((2, len(taus), tableau.stages + 1, parts))
    for i, tau in enumerate(taus):
        arrays[:, i] = _products(tableau, tau.numerator, tau.denominator, parts)
    return arrays[0], arrays[1]


def scaled_rows(tableau: Tableau, taus: Sequence[Fraction], parts: int, rounded: bool) -> tuple[Floats, Floats]:
    """Return :func:`coefficients`, with zeros for the second parts if they are ``rounded`` to doubles."""
    if not rounded or parts == 1:
        return coefficients(tableau, taus, parts)
    drift, kick = (np.concatenate([row, np.zeros_like(row)], axis=2) for row in coefficients(tableau, taus, 1))
    return drift, kick


@lru_cache(maxsize=256)
def _ratios(tableau: Tableau) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """The rows of drift and kick as quotients of whole numbers; kicks have the sign of the force."""
    outer, inner = tableau.rows_exact()
    drift, kick = (inner, outer) if tableau.first == "kick" else (outer, inner)
    return [c.as_integer_ratio() for c in drift], [(-c).as_integer_ratio() for c in kick]


@lru_cache(maxsize=1024)  # half a kilobyte each; most calls take step sizes that an earlier one took
def _products(tableau: Tableau, numerator: int, denominator: int, parts: int) -> Floats:
    """Drift and kick coefficients (2, s + 1, parts) of one step size; the shorter row ends with 0."""
    array = np.zeros((2, tableau.stages + 1, parts))
    for row, ratios in zip(array, _ratios(tableau), strict=True):
        for j, (top, bottom) in enumerate(ratios):
            product = top * numerator, bottom * denominator
            row[j] = product[0] / product[1] if parts == 1 else rounded_pair(*product)
    return array
