"""Coefficients of the moves of a kernel whose kicks are of a modified potential, from exact numbers."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.core.layout import modified_columns
from nearharmonic.integrators.modified_tableau import ModifiedTableau
from nearharmonic.integrators.processed_tableau import Processor
from nearharmonic.numerics.types import Floats

#: A move: kick, with the sign of the force, drift, and coefficient of grad |grad V|^2.
Move = tuple[Fraction, Fraction, Fraction]


def modified_moves(
    tableau: ModifiedTableau | Processor, taus: Sequence[Fraction], parts: int, *, rounded: bool = False
) -> Floats:
    """Return the coefficients (len(taus), s + 2, columns) of a kernel's moves, multiplied by powers of tau exactly.

    Rows: the first move of a run, the first move of each later step, the others, and the move that closes a step.
    Columns: those of :data:`nearharmonic.core.layout.SQUARE`.

    Parameters
    ----------
    tableau : ModifiedTableau or Processor
        Step of s stages.
    taus : sequence of Fraction
        Step sizes.
    parts : {1, 2}
        Doubles that make a number: 2 for double-doubles.
    rounded : bool
        Whether coefficients times powers of tau are rounded to doubles before any are added.
    """
    return np.stack([_moves(tableau, tau, parts, rounded) for tau in taus])


def exact_moves(tableau: ModifiedTableau) -> list[Move]:
    """Return the moves (s + 2) of a step of size 1."""
    rows = ([Fraction(c) for c in row] for row in (tableau.kick, tableau.drift, tableau.square))
    kicks, drifts, squares = rows
    return _in_order([-k for k in kicks], drifts, squares, kick_first=tableau.first == "kick")


@lru_cache(maxsize=1024)
def _moves(tableau: ModifiedTableau | Processor, tau: Fraction, parts: int, rounded: bool) -> Floats:
    """The moves (s + 2, columns) of one step size."""
    rows = [tableau.kick, tableau.drift, tableau.square]
    kicks, drifts, squares = (
        [Fraction(c) * factor for c in row] for row, factor in zip(rows, (-tau, tau, tau**3), strict=True)
    )
    if rounded:
        kicks, drifts, squares = ([Fraction(float(c)) for c in row] for row in (kicks, drifts, squares))
    found = _in_order(kicks, drifts, squares, kick_first=tableau.first == "kick")
    array = np.zeros((len(found), modified_columns(parts)))
    for i, (row, move) in enumerate(zip(array, found, strict=True)):
        row[:-1] = [part for c in move for part in rounded_pair(*c.as_integer_ratio())[:parts]]
        row[-1] = any(found[k][2] for k in moves_behind(i, len(found)))
    return array


def _in_order(
    kicks: list[Fraction], drifts: list[Fraction], squares: list[Fraction], *, kick_first: bool
) -> list[Move]:
    """The moves, of which the last of a step and the first of the next are added."""
    nothing = Fraction(0)
    if kick_first:
        opening, *between = zip(kicks, drifts, squares, strict=False)
        closing = kicks[-1], nothing, squares[-1]
        return [opening, (kicks[-1] + kicks[0], drifts[0], squares[-1] + squares[0]), *between, closing]
    *between, closing = zip(kicks, drifts[1:], squares, strict=True)
    merged = kicks[-1], drifts[-1] + drifts[0], squares[-1]
    return [(nothing, drifts[0], nothing), merged, *between, closing]


def moves_behind(i: int, count: int) -> tuple[int, ...]:
    """Return the moves that may follow move ``i`` of ``count``.

    Behind the last inner one a step closes, or is merged with the next one.
    """
    closing = count - 1
    if i == closing:
        return ()
    following = 2 if i < 2 else i + 1
    return (1, closing) if following == closing else (following,)
