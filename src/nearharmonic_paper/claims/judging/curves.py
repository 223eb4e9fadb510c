"""Curves of errors over step sizes: where they are truncation, over which steps one is the lower, and whether they have
the order of something else.

Statements about curves are decided at every step size of a range. Unless a statement says otherwise it is the range of
:meth:`Curves.compared`: from the first step size at which every curve is clear of rounding to the last before one of
them passes :data:`LOST`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic.numerics.statistics import PLATEAU
from nearharmonic.output.dataset import double_runs
from nearharmonic_paper.claims.claim import Decision, Verdict
from nearharmonic_paper.claims.judging.definitions import EDGES, RANGE
from nearharmonic_paper.claims.results import Results, label, once, require, short

if TYPE_CHECKING:
    import xarray as xr

LOST = RANGE.number
#: Minimum width of a part of a range: half a decade, the width of fits of observed orders.
PART = sqrt(10) * (1 - 1e-9)  # step sizes that are half a decade apart are so but for rounding
#: Minimum number of step sizes for a statement about a range.
FEWEST = 3
#: A statement holds but for edges if it holds at this fraction of the step sizes, and the others are in the first or
#: last tenth.
MOST, EDGE = EDGES.number, 0.1
#: The two errors in the figures of the paper.
MEASURES = {"maximum": "max_energy_error", "mean": "mean_energy_error"}


def range_words(end: str = "") -> str:
    """Describe the step sizes of a statement; the curve ``end``, or all compared curves, determine the last one."""
    return "over the range of comparison" + (f", up to where the maximum error of {end} passes 1 %" if end else "")


class Range(NamedTuple):
    """Step sizes per stage, the mask of those of a statement, and their unit."""

    x: Floats
    asked: Bools
    unit: str

    def words(self, chosen: Bools | None = None) -> str:
        """Describe the longest part of the range where ``chosen`` is true; by default the whole range."""
        low, high = self.longest(self.asked if chosen is None else chosen)
        return f"τ/s = {short(low)} to {short(high)}{self.unit}"

    def longest(self, chosen: Bools) -> tuple[float, float]:
        """Return the ends of the longest part (in decades) of the range without a gap; (1, 0) if there is none."""
        pieces = list(_pieces(self.x[self.asked], chosen[self.asked]))
        return max(pieces, key=lambda piece: piece[1] / piece[0], default=(1.0, 0.0))

    def but_for_edges(self, chosen: Bools) -> bool:
        """Return True if ``chosen`` is true at most step sizes of the range, and false only near its ends."""
        asked = chosen[self.asked]
        edge = int(EDGE * asked.size)
        return bool(asked.mean() >= MOST and asked[edge : asked.size - edge].all())

    def at_the_end(self, chosen: Bools) -> tuple[float, float]:
        """Return the ends of the part at the end of the range; (1, 0) if there is none."""
        asked = self.x[self.asked]
        last = [piece for piece in _pieces(asked, chosen[self.asked]) if piece[1] == asked[-1]]
        return last[0] if last else (1.0, 0.0)


def _pieces(x: Floats, chosen: Bools) -> Iterator[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        yield float(x[start]), float(x[stop - 1])


#: Step sizes at which statements are judged: of more, every second, third, ....
MOST_JUDGED = 2000


class Curves:
    """The runs of one system over step sizes, from its cube: those in double precision, which have all step sizes."""

    def __init__(self, cube: xr.Dataset) -> None:
        cube = cube.isel(tau_per_stage=slice(None, None, ceil(cube.sizes["tau_per_stage"] / MOST_JUDGED) or 1))
        self.cube = double_runs(cube)
        self.x: Floats = cube["tau_per_stage"].values
        unit = cube["tau_per_stage"].attrs.get("units", "1")
        self.unit = "" if unit == "1" else f" {unit}"
        self.names = [str(name) for name in cube["integrator"].values]

    @once
    def of(self, name: str, variable: str = "max_energy_error") -> Any:
        """Return a variable of a method over the step sizes; raise :class:`Undecided` if the cube lacks the method."""
        require(name in self.names, f"the results do not have the method {label(name)}")
        return self.cube[variable].values[self.names.index(name)]

    def errors(self, names: Sequence[str], variable: str = "max_energy_error") -> Floats:
        """Return a row of errors for each method; infinite where the run diverged."""
        rows = np.array([self.of(name, variable) for name in names])
        return np.where(np.isnan(rows), np.inf, rows)

    def compared(self, *rows: Floats, kept: Floats | None = None) -> Range:
        """Return the range in which all ``rows`` of errors, or tables of them, can be compared.

        It ends at the first error of ``kept`` above 1 %; by default ``kept`` are all rows. A range with fewer than
        three step sizes raises :class:`Undecided`.
        """
        every = np.concatenate([np.atleast_2d(one) for one in rows])
        floors = np.maximum(every.min(axis=1, keepdims=True, initial=np.inf), np.finfo(float).eps / 2)
        low = self.x[(every < PLATEAU * floors).any(axis=0)].max(initial=0.0)
        high = self.x[(np.atleast_2d(every if kept is None else kept) > LOST).any(axis=0)].min(initial=np.inf)
        asked = (self.x > low) & (self.x < high)
        require(
            asked.sum() >= FEWEST, "the results have fewer than three step sizes at which all curves are truncation"
        )
        return Range(self.x, asked, self.unit)


def over(asked: Range, good: Bools, value: str = "") -> Decision:
    """Return the verdict on a statement over a range: holds everywhere, but for edges, in part, or fails."""
    count = int(asked.asked.sum())
    tail = f"; {value}" if value else ""
    if good[asked.asked].all():
        return Decision("holds", f"{asked.words()}, all {count} step sizes{tail}")
    low, high = asked.longest(good)
    share = f"{int((good & asked.asked).sum())} of {count} step sizes of {asked.words()}"
    if high < PART * low:
        return Decision("fails", f"{share}{tail}")
    verdict: Verdict = "holds but for edges" if asked.but_for_edges(good) else "holds in part"
    return Decision(verdict, f"{asked.words(good)}, in one piece; {share}{tail}")


def for_larger_steps(asked: Range, good: Bools) -> Decision:
    """Return the verdict on a statement about large step sizes: it holds if it is true in the last half decade."""
    if good[asked.asked].all() and PART * asked.longest(good)[0] <= asked.longest(good)[1]:
        return Decision("holds", f"at all step sizes of {asked.words()}")
    low, high = asked.at_the_end(good)
    if high >= PART * low:
        return Decision("holds", f"from τ/s = {short(low)}{asked.unit} on, of {asked.words()}")
    low, high = asked.longest(good)
    if high >= PART * low:
        return Decision("holds in part", f"not at the end: {asked.words(good)}, of {asked.words()}")
    return Decision("fails", f"{int((good & asked.asked).sum())} of {int(asked.asked.sum())} step sizes")


@once
def curves_of(results: Results, system: str) -> Curves:
    """Return the curves of a system."""
    return Curves(results.cube(system))


def rank_correlation(one: Floats, other: Floats) -> Floats:
    """Return Spearman's rank correlation over the rows for each column; 0 if all values of one are equal.

    Equal numbers of the arrays (n, T) share the mean of their ranks.
    """
    # Twice the ranks, from the middle: how many numbers are below each, less how many are above.
    below = ((rows[:, None] > rows, rows[:, None] < rows) for rows in (one, other))
    first, second = (less.sum(axis=1) - more.sum(axis=1) for less, more in below)
    spread = np.sqrt((first**2).sum(axis=0) * (second**2).sum(axis=0))
    found: Floats = (first * second).sum(axis=0) / np.where(spread > 0, spread, 1.0)
    return found
