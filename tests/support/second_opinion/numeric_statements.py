"""Statements on curves of errors over ranges of step sizes, decided in floating point."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from support.second_opinion import Opinion
from support.second_opinion.runs import SYSTEMS, Curves, curves

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


NEW = ("ABAs5o6H", "BABs7o7H", "BAB's8o7H", "BAB's9o7H")
#: "Several orders of magnitude" are two at least.
SEVERAL = 100
#: A tenth of a decade is covered by a dot of the figure.
DOT = 10**0.1


def sixth_order_descent_on_henon_heiles() -> Opinion:
    return descent((curves("Henon-Heiles", label) for label in ("BAB's8o7H", "BAB's9o7H")), 6), []


def gains_on_ruth(name: str, row: str) -> np.ndarray:
    """Return Ruth's error over that of each new method, at the step sizes of the range."""
    every = [curves(name, label) for label in ("Ruth", *NEW)]
    part = compared((one, row) for one in every)
    ruth, *others = (getattr(one, row)[part] for one in every)
    return ruth / np.array(others)


def outperform_ruth() -> Opinion:
    """Compare maximum and mean errors on three systems, at each step size of each range."""
    gains = [gains_on_ruth(name, row) for name in ("oscillator", *SYSTEMS) for row in ("largest", "mean")]
    verdicts = {over(gain.min(axis=0) > 1) for gain in gains}
    return (verdicts.pop() if len(verdicts) == 1 else "holds in part"), []


def outperform_ruth_by_orders_on_kepler() -> Opinion:
    gains = gains_on_ruth("Kepler", "largest")
    worst, best = gains.min(axis=0), gains.max(axis=0)
    measured = f"worst new method {worst.min():.2g} to {worst.max():.2g}, over the best up to {best.max():.2g}"
    return over(worst >= SEVERAL), [measured]


def coincide_in_figure_4() -> Opinion:
    three = [curves("Kepler", label) for label in ("ABAs5o6H", "ABA104", "BAB's8o7H")]
    part = compared((one, row) for one in three for row in ("largest", "rotation"))
    rotations = np.array([one.rotation[part] for one in three])
    ratios = rotations.max(axis=0) / rotations.min(axis=0)
    good = ratios <= DOT
    spread = f"largest over least {ratios.min():.3g} to {ratios.max():.3g}"
    return over(good), [f"{good.sum()} of {good.size} step sizes", spread]


STATEMENTS: dict[str, Callable[[], Opinion]] = {
    "fig-3-sixth-order-descent": sixth_order_descent_on_henon_heiles,
    "outperform-ruth": outperform_ruth,
    "outperform-ruth-kepler": outperform_ruth_by_orders_on_kepler,
    "fig-4-coincide": coincide_in_figure_4,
}
