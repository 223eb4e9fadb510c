"""Judging of statements: general words, curves of errors, and local slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, log10, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.math import log
from nearharmonic.numerics import portable
from nearharmonic.numerics.portable import PLATEAU, Bools, Floats, dot, mean
from nearharmonic.output.store import double_runs
from nearharmonic_paper.claims.claim import Decision, Results, Verdict, combined, label, once, require, short

if TYPE_CHECKING:
    import xarray as xr


# --- Definitions of the paper's general words and of terms in verdicts, used for all statements.
class Meaning(NamedTuple):
    """A number, its definition with the origin, and a short definition for thresholds if the first one is long."""

    number: float
    words: str
    brief: str = ""


#: A dot of 2 pt in a figure 5 inches high over 18 decades covers a tenth of a decade.
DOT = 1.2589254117941673  # 10^(1/10)
DOT_WORDS = (
    "a tenth of a decade (a factor of 1.26). A dot of 2 pt covers as much in a figure of 5 inches over 18 decades"
)

PERFORMANCE = Meaning(
    1.0,
    "'Performance' is the energy error at equal cost: at equal step size per stage τ/s. To 'outperform' a method is to "
    "have the smaller error",
    "'Outperform' means a smaller error at equal τ/s",
)
APPROXIMATELY = Meaning(
    DOT,
    f"'Approximately' means within {DOT_WORDS}",
    "'Approximately' means within a tenth of a decade, a factor of 1.26",
)
SIGNIFICANTLY = Meaning(
    DOT, f"'Significantly' means by more than {DOT_WORDS}", "'Significantly' means by more than a tenth of a decade"
)
GENERALLY = Meaning(0.5, "'Generally', 'usually' and 'often' mean in more than half of the cases")
GREATLY = Meaning(10.0, "'Greatly', 'drastically' and 'rapidly' mean by a factor of 10 or more")
SEVERAL = Meaning(2.0, "'Several' means two or more")
SEVERAL_ORDERS = Meaning(100.0, "'Several orders of magnitude' means a factor of 100 or more")
NOT_SUITABLE = Meaning(
    10.0, "A method is 'not suitable' if its error is at least ten times the error of another method at equal cost"
)
LARGE = Meaning(
    10.0, "'Large' step sizes are the decade below the first step size at which a compared maximum error exceeds 1 %"
)
MODERATE = Meaning(
    0.5,
    "'Moderate' step sizes are at least the last half decade of the range of comparison. Smaller step sizes are left "
    "to methods of higher order",
    "'Moderate' step sizes are at least the last half decade of the range",
)
SMALL = Meaning(1.0, "A substep and its coefficient are 'small' if the substep is no longer than the whole step")
STABLE = Meaning(1.0, "A run is 'stable' while its relative energy error stays below 1")
#: Nobody would use a run with an energy error above 1 %.
RANGE = Meaning(
    0.01,
    "The 'range of comparison' contains the step sizes at which all compared curves show truncation errors, not "
    "rounding errors. It begins where each curve is 100 times its lowest point. It ends where the first of the "
    "compared maximum errors exceeds 1 %. If the threshold names methods, only their errors end the range",
)
EDGES = Meaning(
    0.95,
    "A statement about a range 'holds' if it is true at every step size of the range. It 'holds but for edges' if it "
    "is true at 95 % or more of the step sizes, and all exceptions are among the first or last tenth. It 'holds in "
    "part' if it is true over half a decade or more without a gap",
)
SLOPES = Meaning(
    0.5,
    "A curve 'has an order' where its local slopes are within 0.5 of the order, so that no other integer is nearer. A "
    "local slope is a fit to log(maximum error) within 0.05 decades of a step size. The statement holds if the slopes "
    "stay near the order over half a decade. It holds in part if they stay there over 0.2 decades, the width of two "
    "fits",
)
#: All definitions, for the page.
MEANINGS = (
    PERFORMANCE, APPROXIMATELY, SIGNIFICANTLY, GENERALLY, GREATLY, SEVERAL, SEVERAL_ORDERS, NOT_SUITABLE, LARGE,
    MODERATE, SMALL, STABLE, RANGE, EDGES, SLOPES,
)  # fmt: skip


# --- Curves of errors over step sizes: ranges without rounding errors, and comparisons of curves in these ranges.
#
# Statements about curves are decided at every step size of a range. By default this is the range of
# :meth:`Curves.compared`: from the first step size at which no curve shows rounding to the last one before a curve
# exceeds :data:`LOST`.

LOST = RANGE.number
#: Minimum width of a part of a range: half a decade, the width of fits of observed orders.
PART = sqrt(10) * (1 - 1e-9)  # less the rounding of step sizes half a decade apart
#: Minimum number of step sizes for a statement about a range.
FEWEST = 3
#: A statement holds but for edges if it is true at this fraction of the step sizes, and all exceptions are in the
#: first or last tenth.
MOST, EDGE = EDGES.number, 0.1
#: The two errors in the figures of the paper.
MEASURES = {"maximum": "max_energy_error", "mean": "mean_energy_error"}


def range_words(end: str = "") -> str:
    """Describe the step sizes of a statement; the curves ``end``, by default all compared curves, end the range."""
    where = "at every step size of the range of comparison"
    return where + (f". The range ends where the maximum error of {end} exceeds 1 %" if end else "")


class Piece(NamedTuple):
    """The ends of a range of step sizes per stage without a gap; 1 and 0 if there is none."""

    low: float
    high: float

    @property
    def decades(self) -> float:
        """Length in decades."""
        return log10(self.high / self.low) if self.high > 0 else 0.0

    def words(self, unit: str) -> str:
        """The piece and its length for a reader."""
        if self.decades == 0:
            return "nowhere"
        return f"for τ/s = {short(self.low)} to {short(self.high)}{unit} ({self.decades:.2f} decades)"


class Range(NamedTuple):
    """Step sizes per stage, the mask of the step sizes of a statement, and their unit."""

    x: Floats
    asked: Bools
    unit: str

    def words(self, chosen: Bools | None = None) -> str:
        """Describe the longest part of the range where ``chosen`` is true; by default the whole range."""
        low, high = self.longest(self.asked if chosen is None else chosen)
        return f"τ/s = {short(low)} to {short(high)}{self.unit}"

    def pieces(self, chosen: Bools) -> list[Piece]:
        """Return the parts of the range where ``chosen`` is true, at least none."""
        x = self.x[self.asked]
        edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen[self.asked], [False]]).astype(int)))
        found = [Piece(float(x[start]), float(x[stop - 1])) for start, stop in edges.reshape(-1, 2)]
        return found or [Piece(1.0, 0.0)]

    def longest(self, chosen: Bools) -> Piece:
        """Return the longest part, in decades."""
        return max(self.pieces(chosen), key=lambda piece: piece.high / piece.low)

    def but_for_edges(self, chosen: Bools) -> bool:
        """Return True if ``chosen`` is true at most step sizes of the range, and false only near its ends."""
        asked = chosen[self.asked]
        edge = int(EDGE * asked.size)
        return bool(asked.mean() >= MOST and asked[edge : asked.size - edge].all())

    def at_the_end(self, chosen: Bools) -> Piece:
        """Return the part at the end of the range."""
        last = self.pieces(chosen)[-1]
        return last if last.high == self.x[self.asked][-1] else Piece(1.0, 0.0)


#: Largest number of judged step sizes; of a finer grid every second, third, ... step size is judged.
MOST_JUDGED = 2000


class Curves:
    """The runs of one system over step sizes, from its cube: the runs in double precision cover all step sizes."""

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

    def rows(self, names: Sequence[str], variable: str) -> Floats:
        """Return a row of a variable for each method."""
        return np.array([self.of(name, variable) for name in names])

    def errors(self, names: Sequence[str], variable: str = "max_energy_error") -> Floats:
        """Return a row of errors for each method; infinite where the run diverged."""
        return self._errors(tuple(names), variable)

    @once
    def _errors(self, names: tuple[str, ...], variable: str) -> Floats:
        found = self.rows(names, variable)
        return np.where(np.isnan(found), np.inf, found)

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
        known = asked.sum() >= FEWEST
        require(known, "the results have fewer than three step sizes at which all curves show truncation errors")
        return Range(self.x, asked, self.unit)


def over(asked: Range, good: Bools, value: str = "") -> Decision:
    """Return the verdict on a statement over a range: holds everywhere, but for edges, in part, or fails."""
    count, true = int(asked.asked.sum()), int((good & asked.asked).sum())
    tail, brief = f"; {value}" if value else "", f"{true} of {count}"
    if true == count:
        return Decision("holds", f"true at all {count} step sizes of {asked.words()}{tail}", brief=brief)
    share = f"at {brief} step sizes of {asked.words()}"
    low, high = asked.longest(good)
    if high < PART * low:
        return Decision("fails", f"true {share}{tail}", brief=brief)
    verdict: Verdict = "holds but for edges" if asked.but_for_edges(good) else "holds in part"
    return Decision(verdict, f"true at every step size of {asked.words(good)}; in total {share}{tail}", brief=brief)


def for_larger_steps(asked: Range, good: Bools) -> Decision:
    """Return the verdict on a statement about large step sizes: it holds if it is true in the last half decade."""
    if good[asked.asked].all() and PART * asked.longest(good)[0] <= asked.longest(good)[1]:
        return Decision("holds", f"at all step sizes of {asked.words()}")
    low, high = asked.at_the_end(good)
    if high >= PART * low:
        return Decision("holds", f"from τ/s = {short(low)}{asked.unit} to the end of {asked.words()}")
    low, high = asked.longest(good)
    if high >= PART * low:
        return Decision("holds in part", f"for {asked.words(good)}, but not at the end of {asked.words()}")
    return Decision("fails", f"at {int((good & asked.asked).sum())} of {int(asked.asked.sum())} step sizes")


@once
def curves_of(results: Results, system: str) -> Curves:
    """Return the curves of a system."""
    return Curves(results.cube(system))


def rank_correlation(one: Floats, other: Floats) -> Floats:
    """Return Spearman's rank correlation over the rows for each column; 0 if all values of one column are equal.

    Equal numbers of the arrays (n, T) share the mean of their ranks.
    """
    # Twice the ranks, counted from the middle: the number of smaller values less the number of larger values.
    below = ((rows[:, None] > rows, rows[:, None] < rows) for rows in (one, other))
    first, second = (less.sum(axis=1) - more.sum(axis=1) for less, more in below)
    spread = np.sqrt((first**2).sum(axis=0) * (second**2).sum(axis=0))
    return np.asarray((first * second).sum(axis=0) / np.where(spread > 0, spread, 1.0))


# --- Local slopes of errors over step sizes, and lengths of ranges where the slopes agree with an order.
#
# All statements about slopes are decided in this way. A fit over half a decade would mix the end of one power law with
# the beginning of the next one. Local slopes and the lengths of their ranges distinguish the two.

#: Half width in decades of the fit of a local slope: five step sizes in total, with forty per decade.
WINDOW = 0.05
#: Tolerance of a local slope: no other integer is nearer.
BAND = SLOPES.number
#: Required length in decades of agreement with an order; "in part" requires two windows without a common step size.
LONG, SHORT = 0.5, 4 * WINDOW
SLOPE = (
    f"for each method the local slopes of the maximum error are within {BAND} of the order over {LONG} decades or more "
    f"of its range of comparison. The statement holds in part if they stay there over {SHORT:.1f} decades"
)
_ROUNDED = 1e-5  # decades: step sizes of a grid are rounded to six digits


@once
def local_slopes(curves: Curves, name: str) -> Floats:
    """Return the slope around each step size; NaN if a nearby error is not finite, or fewer than three are nearby.

    If no step size has three neighbours in its window, the grid is too coarse, and :class:`Undecided` is raised.
    """
    error, windows = curves.errors([name])[0], _windows(curves)
    good = np.isfinite(error) & (error > 0)
    y, found = log(np.where(good, error, 1.0)), np.full(curves.x.size, np.nan)
    dense = any(near.size >= FEWEST for near, _, _ in windows)
    require(dense, f"the results have fewer than three step sizes in {2 * WINDOW:g} decades, too few for a local slope")
    for i, (near, abscissas, spread) in enumerate(windows):
        if near.size >= FEWEST and good[near].all():
            found[i] = dot(abscissas, y[near]) / spread
    return found


@once
def _windows(curves: Curves) -> list[tuple[Any, Floats, float]]:
    """Return for each step size its neighbours, their centred logarithms, and the sum of squares of the logarithms."""
    places, x = portable.log10(curves.x), log(curves.x)
    around = [np.flatnonzero(np.abs(places - place) <= WINDOW + _ROUNDED) for place in places]
    abscissas = [x[near] - mean(x[near]) for near in around]
    return [(near, one, dot(one, one)) for near, one in zip(around, abscissas, strict=True)]


def judged(found: Piece) -> Verdict:
    """Return the verdict on one range."""
    if found.decades >= LONG - _ROUNDED:
        return "holds"
    return "holds in part" if found.decades >= SHORT - _ROUNDED else "fails"


def orders(curves: Curves, expected: Mapping[str, int], band: float) -> Decision:
    """Decide whether each method has its order as a slope, where its error is above rounding and below 1 %."""
    found = {}
    for name, order in expected.items():
        asked = curves.compared(curves.errors([name]))
        found[name] = asked.longest(np.abs(local_slopes(curves, name) - order) <= band)
    told = (f"{label(name)} slope {expected[name]} {piece.words(curves.unit)}" for name, piece in found.items())
    return combined(map(judged, found.values()), "; ".join(told))


def orders_on(system: str, expected: Mapping[str, int], results: Results, band: float) -> Decision:
    """Decide a statement about the orders of methods in a figure of one system."""
    return orders(curves_of(results, system), expected, band)


def large_steps(curves: Curves, *names: str) -> Range:
    """Return the step sizes of the decade that ends at the first maximum error above 1 %.

    With fewer than three step sizes, or without such an error, :class:`Undecided` is raised.
    """
    end = curves.x[(curves.errors(names) > LOST).any(axis=0)].min(initial=np.inf)
    asked = (curves.x > end / 10) & (curves.x < end)
    known = asked.sum() >= FEWEST and np.isfinite(end)
    require(known, "the results have fewer than three step sizes in the decade below an error of 1 %")
    return Range(curves.x, asked, curves.unit)
