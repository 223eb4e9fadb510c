"""The tables of times in docs/results/timings.md, from the cube of times against errors.

First the times of the fastest method over those of heyoka as a user gets it, and those of the implicit method over
those of the fastest splitting and of heyoka. Then for each system two tables: one trajectory, and each of an ensemble.
A cell is the time in ms to reach a maximum energy error, and in brackets its ratio to the smallest of its column. Rows:
the fastest of the paper's methods and of those beyond it, at each error, and every other library.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite, log10, nan
from typing import TYPE_CHECKING

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.recommendation.measure import TARGETS, crossing, of_kind
from nearharmonic_paper.claims.results import power_of_ten
from nearharmonic_paper.experiments.work_precision.comparison import ERRORS, Pair, pairs
from nearharmonic_paper.tasks.receipts import measures_time

if TYPE_CHECKING:
    import xarray as xr

HEADS = {"trajectory": "one trajectory", "lanes": "each of an ensemble"}
SYSTEMS = ("sho", "henon_heiles", "kepler")
#: The implicit method, and the errors at which it is compared.
IMPLICIT, IMPLICIT_ERRORS = "gauss16", (1e-6, 1e-9, 1e-12, 1e-14)


@measures_time
def page(page: str, cube: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page; the log names machine and libraries."""
    measured, facts = pairs(cube, SYSTEMS)
    print(f"Machine: {facts['cpu']}; {facts['libraries']}")
    return {"page": filled_page(page, parts(measured))}


def parts(measured: Sequence[Pair]) -> dict[str, str]:
    """Return the tables by their marks on the page."""
    each = []
    for pair in measured:
        each += [f"### {pair.label}, t = {pair.t_end}", ""]
        for mode in HEADS:
            each += [*table([*pair.own, *pair.others], mode), ""]
    found = {"ratios": ratios(measured), "implicit": implicit(measured), "times": each[:-1]}
    return {name: "\n".join(lines) for name, lines in found.items()}


def power(error: float) -> str:
    """A power of ten as pages have it, 10⁻³."""
    return power_of_ten(round(log10(error)))


def ratios(measured: Sequence[Pair]) -> list[str]:
    """Lines of the table of our least times over heyoka's, bold where that is above 1."""
    rows = []
    for mode, head in HEADS.items():
        for pair in measured:
            cells = [pair.fastest(error, mode)[0][1].time / pair.standard(error, mode) for error in ERRORS]
            shown = (f"**{digits(x)}**" if x > 1 else digits(x) for x in cells)
            rows.append([f"{pair.label}, {head}", *shown])
    return pipes(["system", *map(power, ERRORS)], rows, align="lr")


def implicit(measured: Sequence[Pair]) -> list[str]:
    """Lines of the table of times of the implicit method over the fastest splitting's, and over heyoka's in brackets.

    A ratio is bold where the implicit method is the fastest; a dash stands where a method does not reach the error.
    """
    rows = []
    for mode, head in HEADS.items():
        for pair in measured:
            cells = []
            for error in IMPLICIT_ERRORS:
                times = {one["solver"].item(): crossing(one, pair.measure, error, mode).time for one in pair.own}
                own = times.pop(IMPLICIT, nan)
                ratio = own / min(filter(isfinite, times.values()), default=nan)
                cells.append(f"{emphasised(ratio)} ({shown_ratio(own / pair.standard(error, mode))})")
            rows.append([f"{pair.label}, {head}", *cells])
    return pipes(["system", *map(power, IMPLICIT_ERRORS)], rows, align="lr")


def emphasised(ratio: float) -> str:
    """A ratio with two digits, bold below one."""
    return f"**{shown_ratio(ratio)}**" if ratio < 1 else shown_ratio(ratio)


def shown_ratio(ratio: float) -> str:
    """A ratio with two digits, a dash if it is not known."""
    return digits(ratio) if isfinite(ratio) else "–"


def table(curves: Sequence[xr.Dataset], mode: str) -> list[str]:
    """Lines of the table of ``curves`` in one ``mode`` of timing."""
    times = {
        one["solver"].item(): [1e3 * crossing(one, "max", target, mode).time for target in TARGETS] for one in curves
    }
    times = {method: row for method, row in times.items() if any(map(isfinite, row))}
    least = [min(filter(isfinite, column)) for column in zip(*times.values(), strict=True)]
    rows = []
    for curve in curves:
        method = curve["solver"].item()
        if method in times and method in shown(curves, times):
            cells = [cell(time, best) for time, best in zip(times[method], least, strict=True)]
            rows.append([curve["label"].item(), *cells])
    return pipes([HEADS[mode], *map(power, TARGETS)], rows, align="lr")


def shown(curves: Sequence[xr.Dataset], times: dict[str, list[float]]) -> set[str]:
    """The methods that get a row."""
    own = [name for curve in of_kind(curves, "splitting") if (name := curve["solver"].item()) in times]
    groups = [[m for m in own if (m in BENCHMARKED) == paper] for paper in (True, False)]
    fastest = {
        min(group, key=lambda method: times[method][i] if isfinite(times[method][i]) else inf)
        for group in groups
        if group
        for i in range(len(TARGETS))
    }
    return fastest | {curve["solver"].item() for curve in of_kind(curves, "peer")}


def cell(time: float, best: float) -> str:
    """A time in ms and its ratio to the best; the best is bold."""
    if not isfinite(time):
        return "not reached"
    if time == best:
        return f"**{digits(time)}**"
    return f"{digits(time)} ({digits(time / best)})"


def digits(number: float) -> str:
    """A number with two significant digits, without an exponent."""
    return f"{float(f'{number:.2g}'):g}"
