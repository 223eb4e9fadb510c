"""Verdicts over ranges of step sizes: limits of a range, local slopes, and the part where a statement is true."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from support.second_opinion.runs import Curves

#: A curve counts from 100 times the rounding of a double on, up to a maximum error of 1 %.
CLEAR, LOST = 100 * 2.0**-53, 0.01
#: Intervals of the grid, forty to a decade.
HALF, QUARTER = 20, 10
#: A local slope is fitted to so many points on either side, 0.05 decade.
AROUND = 2
#: A share of the range that leaves out its edges only.
NEARLY_ALL = 0.95


def compared(rows: Iterable[tuple[Curves, str]]) -> slice:
    """Return the part of the grid where all rows are clear of rounding and no maximum error is above 1 %."""
    rows = list(rows)
    unclear = np.any([getattr(one, row) < CLEAR for one, row in rows], axis=0)
    lost = np.any([one.largest > LOST for one, _ in rows], axis=0)
    if not (unclear[0] and lost[-1]):
        message = "the grid does not contain the range"
        raise ValueError(message)
    return slice(int(np.flatnonzero(unclear)[-1]) + 1, int(np.argmax(lost)))


def longest(good: np.ndarray) -> slice:
    """Return the longest run of true values; slice(0, 0) if there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]]))).reshape(-1, 2)
    pieces = (slice(int(start), int(stop)) for start, stop in edges)
    return max(pieces, key=lambda piece: piece.stop - piece.start, default=slice(0, 0))


def over(good: np.ndarray) -> str:
    """Return the verdict of a statement that is true at these step sizes of its range."""
    piece = longest(good)
    inside = piece.stop - piece.start
    if good.all():
        return "holds"
    if inside == good.sum() >= NEARLY_ALL * good.size:
        return "holds but for edges"
    return "holds in part" if inside - 1 >= HALF else "fails"


def local_slopes(one: Curves) -> np.ndarray:
    """Return slopes of a maximum error at the step sizes of its range, fitted to their neighbours in the range."""
    part = compared([(one, "largest")])
    x, y = np.log10(one.x[part]), np.log10(one.largest[part])
    windows = [slice(max(i - AROUND, 0), i + AROUND + 1) for i in range(x.size)]
    return np.array([np.polyfit(x[near], y[near], 1)[0] for near in windows])


def descent(several: Iterable[Curves], order: int) -> str:
    """Return the verdict that slopes stay within 0.5 of an order for half a decade, or a quarter in part."""
    pieces = [longest(np.abs(local_slopes(one) - order) <= 0.5) for one in several]
    widths = [piece.stop - piece.start - 1 for piece in pieces]
    if all(width >= HALF for width in widths):
        return "holds"
    return "fails" if all(width < QUARTER for width in widths) else "holds in part"
