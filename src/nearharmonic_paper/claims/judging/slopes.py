"""Local slopes of errors over step sizes, and lengths of ranges where they agree with an order.

All statements about slopes are decided in this way. A fit over half a decade would mix the end of one power law with
the beginning of the next one; local slopes with the length of their range distinguish them.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import log10
from typing import NamedTuple

import numpy as np

from nearharmonic.math import log
from nearharmonic.numerics import portable
from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic.numerics.statistics import line_slope, mean
from nearharmonic_paper.claims.claim import Decide, Decision, Verdict, combined
from nearharmonic_paper.claims.judging.curves import FEWEST, LOST, Curves, Range, curves_of
from nearharmonic_paper.claims.judging.definitions import SLOPES
from nearharmonic_paper.claims.results import label, once, require, short

#: Half width in decades of the fit of a local slope: five step sizes in total, with forty per decade.
WINDOW = 0.05
#: Tolerance of a local slope: within it no other integer is nearer.
BAND = SLOPES.number
#: Required length in decades of agreement with an order; for "in part" two windows without a common step size.
LONG, SHORT = 0.5, 4 * WINDOW
SLOPE = (
    f"local slopes of the maximum error within {BAND} of the order over {LONG} decades or more of its range of "
    f"comparison; in part: over {SHORT:.1f} decades"
)
_ROUNDED = 1e-5  # decades: step sizes of a grid are rounded to six digits


class Stretch(NamedTuple):
    """The longest range of step sizes per stage whose slopes are all within the band; 0 and 0 if there is none."""

    low: float
    high: float

    @property
    def decades(self) -> float:
        """Its length."""
        return log10(self.high / self.low) if self.high > 0 else 0.0

    def words(self, unit: str) -> str:
        """The stretch for a reader."""
        if self.decades == 0:
            return "nowhere"
        return f"τ/s = {short(self.low)} to {short(self.high)}{unit} ({self.decades:.2f} decades)"


@once
def local_slopes(curves: Curves, name: str) -> Floats:
    """Return the slope around each step size; NaN if an error around it is not finite or fewer than three exist.

    If no step size has as many around it, the grid is too coarse whatever the errors are: this is
    :class:`Undecided`.
    """
    error, places = curves.errors([name])[0], portable.log10(curves.x)
    good = np.isfinite(error) & (error > 0)
    x, y = log(curves.x), log(np.where(good, error, 1.0))
    found = np.full(curves.x.size, np.nan)
    around = [np.abs(places - place) <= WINDOW + _ROUNDED for place in places]
    dense = any(near.sum() >= FEWEST for near in around)
    require(dense, f"the results have fewer than three step sizes in {2 * WINDOW:g} decades, too few for a local slope")
    for i, near in enumerate(around):
        if near.sum() >= FEWEST and good[near].all():
            found[i] = line_slope(x[near] - mean(x[near]), y[near])
    return found


def stretch(asked: Range, slopes: Floats, order: float, band: float) -> Stretch:
    """Return the longest range of the requested step sizes with slopes within ``band`` of an order."""
    good: Bools = np.abs(slopes - order) <= band
    low, high = asked.longest(good)
    return Stretch(low, high) if high > 0 else Stretch(0.0, 0.0)


@once
def truncation_of(curves: Curves, name: str) -> Range:
    """Return the step sizes at which the error of a method is neither rounding nor above 1 %."""
    return curves.compared(curves.errors([name]))


def judged(found: Stretch) -> Verdict:
    """Return the verdict on one range."""
    if found.decades >= LONG - _ROUNDED:
        return "holds"
    return "holds in part" if found.decades >= SHORT - _ROUNDED else "fails"


def slopes_are(system: str, expected: Mapping[str, int]) -> Decide:
    """Return the judge of statements about the orders of methods in a figure of one system."""
    return lambda results, band: orders(curves_of(results, system), expected, band)


def orders(curves: Curves, expected: Mapping[str, int], band: float) -> Decision:
    """Decide whether each method has its order as a slope."""
    verdicts, told = [], []
    for name, order in expected.items():
        found = stretch(truncation_of(curves, name), local_slopes(curves, name), order, band)
        verdicts.append(judged(found))
        told.append(f"{label(name)} {order} over {found.words(curves.unit)}")
    return combined(verdicts, "; ".join(told))


def large_steps(curves: Curves, *names: str) -> Range:
    """Return the step sizes of the decade that ends at the first maximum error above 1 %.

    With fewer than three step sizes, or without such an error, :class:`Undecided` is raised.
    """
    end = curves.x[(curves.errors(names) > LOST).any(axis=0)].min(initial=np.inf)
    asked = (curves.x > end / 10) & (curves.x < end)
    known = asked.sum() >= FEWEST and np.isfinite(end)
    require(known, "the results have fewer than three step sizes in the decade below an error of 1 %")
    return Range(curves.x, asked, curves.unit)
