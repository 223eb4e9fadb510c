"""Tables of the time and the evaluations that each method needs to reach an error, and ratios to other libraries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import inf, isfinite, nan

import xarray as xr

from nearharmonic.output.table import Table, pipes
from nearharmonic.recommendation import measure as engine
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.tasks.provenance import measures_time

HOW = (
    "Read off each curve of least wall time against error: between the last step size or tolerance above the target "
    "and the first at or below it for good, by a straight line through the logarithms. '<=' marks a method whose "
    "coarsest setting is good enough already; '-' one that does not reach the target in the range that was run. Time "
    "is for a whole call of a prepared problem or solver that returns the final state of one trajectory; 'lanes' is "
    "the time per trajectory of a whole call for an ensemble on one thread, or for a batch of another library, for the "
    "methods that are among the fastest. Energies are measured outside of these calls. Names in italics are other "
    "libraries, as their users use them."
)
#: A line of the CSV table: a method, an error, and what it costs, by column.
Row = Mapping[str, str | int | float]
#: Modes of timing, besides one trajectory.
MORE = ("lanes", "energy")


@measures_time
def time_to_error(system: str, cube: str) -> dict[str, Table | str]:
    """Return the cost of each method for given errors on one system: a table, ``csv``, and a page, ``md``."""
    parts, facts = engine.read_parts(cube, system)
    label = systems[system].label
    lines = [row for part in parts for row in rows(system, *part)]
    cells = [[f"{cell:.6g}" if isinstance(cell, float) else str(cell) for cell in row.values()] for row in lines]
    caption = f"{label}: time and evaluations to reach an error."
    return {
        "csv": Table(header=list(lines[0]), rows=cells, caption=caption),
        "md": markdown(label, parts, facts),
    }


def rows(system: str, t_end: str, measures: Sequence[str], curves: Sequence[xr.Dataset]) -> Iterator[Row]:
    """Every method at every target, the fastest first, with times in ms, NaN where there is none.

    A method without a curve has its reason in ``method_status``.
    """
    for measure, target in product(measures, engine.TARGETS):
        for rank, (curve, at) in enumerate(engine.ranking(curves, measure, target), start=1):
            yield {
                "system": system,
                "t_end": t_end,
                "measure": measure,
                "target": target,
                "rank": rank if isfinite(at.time) else 0,
                "method": curve["solver"].item(),
                "label": curve["label"].item(),
                "kind": curve["kind"].item(),
                "status": at.status,
                "time_ms": 1e3 * at.time,
                **{f"{mode}_time_ms": 1e3 * engine.crossing(curve, measure, target, mode).time for mode in MORE},
                "evaluations": at.evaluations,
                "tau": at.tau,
                "tolerance": at.tolerance,
                "method_status": curve["status"].item(),
            }


def markdown(label: str, parts: Sequence[engine.Part], facts: Mapping[str, object]) -> str:
    """The page for one system: a table for each measure of each part (t_end, measures, curves), who wins, how it was
    measured, and what is missing."""
    basis = (
        f"Measured {facts['measured']} on {facts['cpu']}, one thread on core {facts['pinned_core']}, repeats of all "
        f"methods in turns, least time; load average {facts['load_average']}; {facts['clock']}."
    )
    lines = [f"# {label}: time and evaluations to reach an error", "", basis, "", HOW, ""]
    for t_end, measures, curves in parts:
        for measure in measures:
            lines += [f"## {engine.NAMES[measure]}, t = {t_end}", "", *_table(measure, curves), ""]
            lines += [
                "Fastest:",
                *(f"- {target:.0e}: {_winner(measure, target, curves)}" for target in engine.TARGETS),
                "",
            ]
    lines += ["## ns per evaluation of the force, and calls around the kernel", "", *_speeds(parts[0][2]), ""]
    absent = [f"- {c['label'].item()}: {c['status'].item()}" for c in parts[0][2] if c["status"] != "ok"]
    return "\n".join([*lines, "## Missing, or ended early", "", *(absent or ["nothing"]), ""])


def _table(measure: str, curves: Sequence[xr.Dataset]) -> list[str]:
    rows = []
    for curve, _ in engine.ranking(curves, measure, engine.TARGETS[2]):
        label = curve["label"].item()
        cells = [f"*{label}*" if curve["kind"] == "peer" else label]
        for target in engine.TARGETS:
            at, lanes = engine.crossing(curve, measure, target), engine.crossing(curve, measure, target, "lanes")
            number = f"{float(f'{at.evaluations:.3g}'):.0f}" if isfinite(at.evaluations) else "-"
            cells += [milliseconds(at), milliseconds(lanes), number]
        rows.append(cells)
    columns = [name for target in engine.TARGETS for name in (f"{target:.0e} ms", "lanes", "evaluations")]
    return pipes(["method", *columns], rows, align="lr")


def milliseconds(at: engine.Crossing) -> str:
    """Return a time in ms to three digits; "-" if there is none."""
    bound = "<= " if at.status == "below throughout" else ""
    return f"{bound}{1e3 * at.time:.3g}" if isfinite(at.time) else "-"


def _winner(measure: str, target: float, curves: Sequence[xr.Dataset]) -> str:
    """Return the fastest of all in words, with the ratio if it is a peer."""
    order = engine.fastest(curves, measure, target)
    if not order:
        return "reached by none"
    (first, best), own = order[0], [pair for pair in order if pair[0]["kind"] == "splitting"]
    words = f"{first['label'].item()}, {milliseconds(best)} ms"
    if first["kind"] == "splitting":
        return words
    ratio = f"{own[0][1].time / best.time:.3g} times as fast as {own[0][0]['label'].item()}" if own else "alone"
    return f"**a peer wins**: {words}, {ratio}"


def _speeds(curves: Sequence[xr.Dataset]) -> list[str]:
    columns = ["one trajectory", "each of an ensemble", "energy at every step", "a call, us", "whole sweep, ms"]
    rows = []
    for curve in curves:
        forces = curve["evaluations"].where(curve["evaluations"] > 0)
        numbers = [
            1e9 * float((curve[f"time_{mode}"] / forces).fillna(inf).values.min(initial=inf))
            for mode in ("trajectory", *MORE)
        ]
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
#: What equal systems have in common, and the largest relative difference of their initial energies.
SAME, SAME_ENERGY = ("q0", "p0", "units"), 1e-12
#: Text in titles by mode of the timing.
COMPARED = {"trajectory": "one trajectory", "lanes": "ensembles"}

CAPTION = (
    "Time of a whole call of a prepared problem that returns the final state, per trajectory, to reach an error: "
    "energy is the maximum of |H - H0|/|H0| over all steps, position the relative distance at the end. The fastest "
    "method of this package beside heyoka as a user gets it, and beside the fastest of all others, a plain loop in "
    "C among them. Other libraries integrate the original equations of a regularised system, and heyoka the "
    "regularised ones too. All read off curves of time against error, by a straight line through the logarithms "
    "between two settings. Ratios of least times; ratio_of_medians is the ratio of medians."
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

    def fastest(self, error: float, mode: str) -> list[tuple[xr.Dataset, engine.Crossing]]:
        """This package's methods that reach ``error``, the fastest first."""
        return engine.fastest(self.own, self.measure, error, mode)

    def standard(self, error: float, mode: str) -> float:
        """Return the seconds of the reference library, NaN if it was not timed."""
        timed = (curve for curve in self.others if curve["solver"] == STANDARD)
        return next((engine.crossing(curve, self.measure, error, mode).time for curve in timed), nan)


def original_of(name: str, names: Sequence[str]) -> str:
    """Return the first of ``names`` with the original equations of a regularised system, or "".

    The original system has no regularisation, but equal initial values, units and energy.
    """
    system = systems[name]

    def is_original(other: System) -> bool:
        if other.regularisation is not None or any(getattr(other, x) != getattr(system, x) for x in SAME):
            return False
        H, given = (each.energy(*each.start(float), each.constants(float)) for each in (other, system))
        return bool(abs(H - given) <= SAME_ENERGY * abs(given))

    regularised = system.regularisation is not None
    return next((other for other in names if regularised and is_original(systems[other])), "")


def pairs(
    cube: str, names: Sequence[str], quartile: str = "min", measure: str = "max"
) -> tuple[list[Pair], dict[str, object]]:
    """Return the measurements on each system, from the path of the cube of times, and the properties of the machine.

    ``quartile`` of the times is one of :data:`~nearharmonic.numerics.clock.QUARTILES`, and ``measure`` of the error
    a key of :data:`~nearharmonic.recommendation.measure.MEASURES`; systems without it are omitted.
    """
    measured: dict[str, tuple[str, Sequence[xr.Dataset]]] = {}
    facts: dict[str, object] = {}
    for name in names:
        parts, facts = engine.read_parts(cube, name, quartile)
        measured.update((name, (end, curves)) for end, measures, curves in parts if measure in measures)
    compared = []
    for name, (end, curves) in measured.items():
        original = original_of(name, [other for other, (its_end, _) in measured.items() if its_end == end])
        originals = measured[original][1] if original else []
        compared.append(Pair(
            system=name, t_end=end, measure=measure, original=original, own=engine.of_kind(curves, "splitting"),
            others=[curve for curve in engine.of_kind([*originals, *curves], "peer") if curve.sizes["point"]],
            own_original=engine.of_kind(originals, "splitting"),
        ))  # fmt: skip
    return compared, facts


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
        for mode, measure in product(COMPARED, COMPARED_MEASURES)
        for pair, median in zip(least[measure], medians[measure], strict=True)
        for row in _rows(pair, median, mode)
    ]
    return {"table": Table(header=HEADER, rows=rows, caption=CAPTION)}


def _rows(least: Pair, median: Pair, mode: str) -> Iterator[list[object]]:
    for error in ERRORS:
        own, others = least.fastest(error, mode), engine.fastest(least.others, least.measure, error, mode)
        if not own:
            continue
        (curve, at), standard = own[0], least.standard(error, mode)
        medians = [there.time for same, there in median.fastest(error, mode) if same["solver"] == curve["solver"]]
        other, other_time = (others[0][0]["label"].item(), others[0][1].time) if others else ("", nan)
        nearest = abs(curve["tau"].values / at.tau - 1).argmin()
        yield [
            COMPARED[mode], least.label, COMPARED_MEASURES[least.measure], f"{error:.0e}", curve["label"].item(),
            "compensated" if curve["compensated"][nearest] else "plain", 1e3 * at.time, 1e3 * standard,
            at.time / standard, medians[0] / median.standard(error, mode), other, 1e3 * other_time,
            at.time / other_time,
        ]  # fmt: skip
