"""Tables of the time and the evaluations that each method needs to reach an error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isfinite

import xarray as xr

from nearharmonic.output.page import pipes
from nearharmonic.output.table import Table
from nearharmonic.recommendation.measure import (
    NAMES,
    TARGETS,
    Crossing,
    Part,
    crossing,
    ns_per_evaluation,
    ranking,
    read_parts,
)
from nearharmonic.systems import systems
from nearharmonic_paper.tasks.provenance import measures_time

HOW = (
    "Read off each curve of least wall time against error: between the last step size or tolerance above the target "
    "and the first at or below it for good, by a straight line through the logarithms. '<=' marks a method whose "
    "coarsest setting is good enough already; '-' one that does not reach the target in the range that was run. Time "
    "is that of a whole call of a prepared problem or solver that returns the final state of one trajectory; 'lanes' "
    "is that of a whole call for an ensemble on one thread, or for a batch of another library, per trajectory, for the "
    "methods that are among the fastest. Energies are measured outside of these calls. Names in italics are other "
    "libraries, as their users use them."
)


#: A line of the CSV table: a method, an error, and what it costs, by column.
Row = Mapping[str, str | int | float]
#: Modes of timing beside that of one trajectory.
MORE = ("lanes", "energy")


@measures_time
def time_to_error(system: str, cube: str) -> dict[str, Table | str]:
    """Return the cost of each method for given errors on one system: a :func:`table`, ``csv``, and a page, ``md``."""
    parts, facts = read_parts(cube, system)
    label = systems[system].label
    return {
        "csv": table(label, [row for part in parts for row in rows(system, *part)]),
        "md": markdown(label, parts, facts),
    }


def rows(system: str, t_end: str, measures: Sequence[str], curves: Sequence[xr.Dataset]) -> Iterator[Row]:
    """Every method at every target, the fastest first, with times in ms, NaN where there is none.

    A method without a curve has its reason in ``method_status``.
    """
    for measure in measures:
        for target in TARGETS:
            for rank, (curve, found) in enumerate(ranking(curves, measure, target), start=1):
                yield {
                    "system": system,
                    "t_end": t_end,
                    "measure": measure,
                    "target": target,
                    "rank": rank if isfinite(found.time) else 0,
                    "method": curve["solver"].item(),
                    "label": curve["label"].item(),
                    "kind": curve["kind"].item(),
                    "status": found.status,
                    "time_ms": 1e3 * found.time,
                    **{f"{mode}_time_ms": 1e3 * crossing(curve, measure, target, mode).time for mode in MORE},
                    "evaluations": found.evaluations,
                    "tau": found.tau,
                    "tolerance": found.tolerance,
                    "method_status": curve["status"].item(),
                }


def table(label: str, lines: Sequence[Row]) -> Table:
    """Return the lines of :func:`rows`, one at least, as a table of text, floats to six digits."""
    return Table(
        header=list(lines[0]),
        rows=[[f"{c:.6g}" if isinstance(c, float) else str(c) for c in line.values()] for line in lines],
        caption=f"{label}: time and evaluations to reach an error.",
    )


def markdown(label: str, parts: Sequence[Part], facts: Mapping[str, object]) -> str:
    """The page for one system: a table for each measure of each part (t_end, measures, curves), who wins, how it was
    measured, and what is missing."""
    basis = (
        f"Measured {facts['measured']} on {facts['cpu']}, one thread on core {facts['pinned_core']}, repeats of all "
        f"methods in turns, least time; load average {facts['load_average']}; {facts['clock']}."
    )
    lines = [f"# {label}: time and evaluations to reach an error", "", basis, "", HOW, ""]
    for t_end, measures, curves in parts:
        for measure in measures:
            lines += [f"## {NAMES[measure]}, t = {t_end}", "", *_table(measure, curves), ""]
            lines += [*_winners(measure, curves), ""]
    lines += ["## ns per evaluation of the force, and calls around the kernel", "", *_speeds(parts[0][2]), ""]
    absent = [f"- {one['label'].item()}: {one['status'].item()}" for one in parts[0][2] if one["status"] != "ok"]
    return "\n".join([*lines, "## Missing, or ended early", "", *(absent or ["nothing"]), ""])


def _table(measure: str, curves: Sequence[xr.Dataset]) -> list[str]:
    rows = []
    for curve, _ in ranking(curves, measure, TARGETS[2]):
        label = curve["label"].item()
        cells = [f"*{label}*" if curve["kind"] == "peer" else label]
        for target in TARGETS:
            found, lanes = crossing(curve, measure, target), crossing(curve, measure, target, "lanes")
            cells += [milliseconds(found), milliseconds(lanes), count(found.evaluations)]
        rows.append(cells)
    columns = [name for target in TARGETS for name in (f"{target:.0e} ms", "lanes", "evaluations")]
    return pipes(["method", *columns], rows, align="lr")


def milliseconds(found: Crossing) -> str:
    """Return a time in ms to three digits; "-" if there is none."""
    if not isfinite(found.time):
        return "-"
    bound = "<= " if found.status == "below throughout" else ""
    return f"{bound}{1e3 * found.time:.3g}"


def count(number: float) -> str:
    """Return a number of evaluations to three digits; "-" if there is none."""
    return f"{float(f'{number:.3g}'):.0f}" if isfinite(number) else "-"


def _winners(measure: str, curves: Sequence[xr.Dataset]) -> list[str]:
    """Return one line for each target: the fastest of all, and the ratio if it is a peer."""
    lines = []
    for target in TARGETS:
        order = [(curve, found) for curve, found in ranking(curves, measure, target) if isfinite(found.time)]
        if not order:
            lines.append(f"- {target:.0e}: reached by none")
            continue
        (first, best), own = order[0], [pair for pair in order if pair[0]["kind"] == "splitting"]
        says = f"{first['label'].item()}, {milliseconds(best)} ms"
        if first["kind"] == "peer":
            ratio = f"{own[0][1].time / best.time:.3g} times as fast as {own[0][0]['label'].item()}" if own else "alone"
            says = f"**a peer wins**: {says}, {ratio}"
        lines.append(f"- {target:.0e}: {says}")
    return ["Fastest:", *lines]


def _speeds(curves: Sequence[xr.Dataset]) -> list[str]:
    columns = ["one trajectory", "each of an ensemble", "energy at every step", "a call, us", "whole sweep, ms"]
    rows = []
    for curve in curves:
        numbers = [ns_per_evaluation(curve, mode) for mode in ("trajectory", "lanes", "energy")]
        numbers += [1e6 * curve["setup"].item(), 1e3 * curve["sweep"].item()]
        if any(map(isfinite, numbers)):
            rows.append([curve["label"].item(), *(f"{x:.3g}" if isfinite(x) else "-" for x in numbers)])
    return pipes(["method", *columns], rows, align="lr")
