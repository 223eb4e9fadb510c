"""Tables of the time and the evaluations that each method needs to reach an error, and ratios to other libraries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np
import xarray as xr

from nearharmonic.output.table import Table, pipes
from nearharmonic.recommendation.measure import NAMES, TARGETS, Crossing, Part, crossing, of_kind, ranking, read_parts
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
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


def ns_per_evaluation(curve: xr.Dataset, mode: str = "trajectory") -> float:
    """Return the least nanoseconds per evaluation of the force on a curve; NaN if it was not timed."""
    each = (curve[f"time_{mode}"] / curve["evaluations"].where(curve["evaluations"] > 0)).values
    return float(1e9 * min(each[np.isfinite(each)], default=nan))


def _speeds(curves: Sequence[xr.Dataset]) -> list[str]:
    columns = ["one trajectory", "each of an ensemble", "energy at every step", "a call, us", "whole sweep, ms"]
    rows = []
    for curve in curves:
        numbers = [ns_per_evaluation(curve, mode) for mode in ("trajectory", "lanes", "energy")]
        numbers += [1e6 * curve["setup"].item(), 1e3 * curve["sweep"].item()]
        if any(map(isfinite, numbers)):
            rows.append([curve["label"].item(), *(f"{x:.3g}" if isfinite(x) else "-" for x in numbers)])
    return pipes(["method", *columns], rows, align="lr")


# --- Comparison with other libraries at equal error, for one trajectory and for ensembles -----------------------------

#: Reference library of the ratios, with its default settings.
STANDARD = "heyoka"
#: Errors at which times are compared.
ERRORS = (1e-6, 1e-9, 1e-12)
#: Kinds of errors of a work-precision curve that are compared, with their names in tables.
COMPARED_MEASURES = {"max": "energy", "position": "position"}
#: Largest relative difference of initial energies of equal systems.
SAME_ENERGY = 1e-12
#: Text in titles by mode of the timing.
COMPARED = {"trajectory": "one trajectory", "lanes": "ensembles"}

CAPTION = (
    "Time of a whole call of a prepared problem that returns the final state, per trajectory, to reach an error: "
    "energy is the maximum of |H - H0|/|H0| over all steps, position the relative distance at the end. The fastest "
    "method of this package beside heyoka as a user gets it, and beside the fastest of all others, a plain loop in "
    "C among them. Other libraries integrate the original equations of a regularised system, and heyoka the "
    "regularised ones too. All read off curves of time against error, by a straight line through the logarithms "
    "between two settings. Ratios of least times; ratio_of_medians is that of medians."
)


@dataclass(frozen=True, kw_only=True)
class Pair:
    """The curves on one system: this package, other libraries, and the original equations of a regularised system.

    For a regularised system ``others`` has curves on its original equations and on its own. ``original`` is the name of
    the system with the original equations, if there is one, and ``own_original`` has the curves of this package there.
    """

    system: str
    t_end: str
    own: Sequence[xr.Dataset]
    others: Sequence[xr.Dataset]
    measure: str = "max"
    original: str = ""
    own_original: Sequence[xr.Dataset] = ()

    @property
    def label(self) -> str:
        """The label of the system in titles."""
        return systems[self.system].label

    def fastest(self, error: float, mode: str, *, others: bool = False) -> list[tuple[xr.Dataset, Crossing]]:
        """This package's methods, or other libraries' solvers, that reach ``error``, the fastest first."""
        curves = self.others if others else self.own
        return [found for found in ranking(curves, self.measure, error, mode) if isfinite(found[1].time)]

    def standard(self, error: float, mode: str) -> float:
        """Return the seconds of the reference library, NaN if it was not timed."""
        times = (crossing(one, self.measure, error, mode).time for one in self.others if one["solver"] == STANDARD)
        return next(times, nan)


def original_of(name: str, names: Sequence[str]) -> str:
    """Return the first of ``names`` with the original equations of a regularised system, or "".

    The original system has no regularisation, but equal initial values, units and energy.
    """
    system = systems[name]
    if system.regularisation is None:
        return ""
    return next((other for other in names if _is_original(systems[other], system)), "")


def _is_original(other: System, system: System) -> bool:
    if other.regularisation is not None or (other.q0, other.p0, other.units) != (system.q0, system.p0, system.units):
        return False
    H, given = (each.energy(*each.start(float), each.constants(float)) for each in (other, system))
    return bool(abs(H - given) <= SAME_ENERGY * abs(given))


def pairs(
    cube: str, names: Sequence[str], quartile: str = "min", measure: str = "max"
) -> tuple[list[Pair], dict[str, object]]:
    """Return the measurements on each system, from the path of the cube of times, and the properties of the machine.

    ``quartile`` is that of the times, one of :data:`~nearharmonic.numerics.clock.QUARTILES`, and ``measure`` the error,
    a key of :data:`~nearharmonic.recommendation.measure.MEASURES`; systems without it are omitted.
    """
    measured: dict[str, tuple[str, Sequence[xr.Dataset]]] = {}
    facts: dict[str, object] = {}
    for name in names:
        parts, facts = read_parts(cube, name, quartile)
        measured.update((name, (end, curves)) for end, measures, curves in parts if measure in measures)
    return [_pair(name, measured, measure) for name in measured], facts


def _pair(name: str, measured: Mapping[str, tuple[str, Sequence[xr.Dataset]]], measure: str) -> Pair:
    end, curves = measured[name]
    original = original_of(name, [other for other, (its_end, _) in measured.items() if its_end == end])
    originals = measured[original][1] if original else []
    return Pair(
        system=name, t_end=end, measure=measure, original=original, own=of_kind(curves, "splitting"),
        others=[curve for curve in of_kind([*originals, *curves], "peer") if curve.sizes["point"]],
        own_original=of_kind(originals, "splitting"),
    )  # fmt: skip


HEADER = (
    "compared", "system", "measure", "error", "method", "sums", "ms", f"{STANDARD}_ms", "ratio", "ratio_of_medians",
    "fastest_other", "fastest_other_ms", "ratio_to_fastest_other",
)  # fmt: skip


@measures_time
def comparison(names: Sequence[str], cube: str) -> dict[str, Table]:
    """Return the ``table`` of this package beside other libraries at equal error, from what :func:`pairs` reads.

    It has a row for each mode, kind of error, system and error that a method of this package reaches.
    """
    least, medians = (
        {measure: pairs(cube, names, quartile, measure)[0] for measure in COMPARED_MEASURES}
        for quartile in ("min", "median")
    )
    rows = [
        row
        for mode in COMPARED
        for measure in COMPARED_MEASURES
        for pair, median in zip(least[measure], medians[measure], strict=True)
        for row in _rows(pair, median, mode)
    ]
    return {"table": Table(header=HEADER, rows=rows, caption=CAPTION)}


def _rows(least: Pair, median: Pair, mode: str) -> Iterator[list[object]]:
    for error in ERRORS:
        own, others = least.fastest(error, mode), least.fastest(error, mode, others=True)
        if not own:
            continue
        (curve, found), standard = own[0], least.standard(error, mode)
        medians = [there.time for same, there in median.fastest(error, mode) if same["solver"] == curve["solver"]]
        other, other_time = (others[0][0]["label"].item(), others[0][1].time) if others else ("", nan)
        yield [
            COMPARED[mode], least.label, COMPARED_MEASURES[least.measure], f"{error:.0e}", curve["label"].item(),
            _sums(curve, found), 1e3 * found.time, 1e3 * standard, found.time / standard,
            medians[0] / median.standard(error, mode), other, 1e3 * other_time, found.time / other_time,
        ]  # fmt: skip


def _sums(curve: xr.Dataset, found: Crossing) -> str:
    """Return the summation at the setting nearest to the error."""
    nearest = abs(curve["tau"].values / found.tau - 1).argmin()
    return "compensated" if curve["compensated"][nearest] else "plain"
