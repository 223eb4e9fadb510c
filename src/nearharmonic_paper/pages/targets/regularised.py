"""The tables of docs/results/regularised.md, from the cube of times of config/regularised.yaml.

A table for each orbit and kind of error. A cell is the time in ms, and in brackets its ratio to that of the reference
library in its default configuration on the original equations.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import hypot, isfinite, nan
from typing import TYPE_CHECKING

from nearharmonic.output.page import filled_page
from nearharmonic.recommendation.measure import crossing
from nearharmonic.systems import systems as registered
from nearharmonic_paper.experiments.work_precision.comparison import COMPARED_MEASURES, ERRORS, Pair, pairs
from nearharmonic_paper.experiments.work_precision.figures.regularised import CURVES
from nearharmonic_paper.pages.targets.timings import digits, power
from nearharmonic_paper.pages.trained import table
from nearharmonic_paper.tasks.receipts import measures_time

if TYPE_CHECKING:
    import xarray as xr


@measures_time
def page(
    page: str, cube: str, names: Sequence[str], systems: Sequence[str], integrators: Sequence[str]
) -> dict[str, str]:
    """Fill the page; ``names`` are those of the systems, and the log names machine and libraries."""
    texts = []
    for measure in COMPARED_MEASURES:
        measured, facts = pairs(cube, names, measure=measure)
        texts += [times(pair) for pair in measured if pair.original]
    print(f"Machine: {facts['cpu']}; {facts['libraries']}")
    return {"page": filled_page(page, {"times": "\n\n".join(texts)})}


def times(pair: Pair) -> str:
    """Return the table of one orbit and kind of error: a row for each curve of the figure that was measured."""
    head = f"e = {eccentricity(pair.system):.3g}, {COMPARED_MEASURES[pair.measure]}"
    rows = [(label, *cells(found, pair)) for label, found in named(pair)]
    return table((head, *map(power, ERRORS)), rows)


def named(pair: Pair) -> Iterator[tuple[str, Sequence[float]]]:
    """Yield names of rows, and the least times at each error."""
    groups: dict[str, Sequence[xr.Dataset]] = {"own": pair.own, "own_original": pair.own_original}
    groups |= {curve["solver"].item(): [curve] for curve in (*pair.own, *pair.others)}
    for key, (label, _) in CURVES.items():
        if key in groups:
            yield label, [least(groups[key], pair.measure, error) for error in ERRORS]


def least(curves: Iterable[xr.Dataset], measure: str, error: float) -> float:
    """The least time in seconds in which one of the curves reaches an error; NaN if none does."""
    found = (crossing(curve, measure, error, "trajectory").time for curve in curves)
    return min(filter(isfinite, found), default=nan)


def cells(found: Sequence[float], pair: Pair) -> Iterator[str]:
    """Yield times and their ratios to the reference library, which may not reach an error."""
    for time, error in zip(found, ERRORS, strict=True):
        standard = pair.standard(error, "trajectory")
        ratio = f" ({digits(time / standard)})" if isfinite(standard) else ""
        yield f"{digits(1e3 * time)}{ratio}" if isfinite(time) else "not reached"


def eccentricity(name: str) -> float:
    """That of an orbit of Kepler's problem which begins at one of its apsides."""
    system = registered[name]
    q, p = system.start(float)
    (GM, *_) = system.constants(float)
    return abs(hypot(*q) * hypot(*p) ** 2 / GM - 1)
