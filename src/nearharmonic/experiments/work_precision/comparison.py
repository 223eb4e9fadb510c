"""This package beside other libraries: whole calls at equal error, one trajectory and ensembles, as ratios of times."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan

from nearharmonic.experiments.work_precision.curve import Crossing, Curve, crossing, ranking
from nearharmonic.experiments.work_precision.run import read_parts
from nearharmonic.output.receipts import measures_time
from nearharmonic.output.table import Table
from nearharmonic.systems import systems

#: The library that ratios are relative to, as a user gets it.
STANDARD = "heyoka"
#: Energy errors at which times are compared.
ERRORS = (1e-6, 1e-9, 1e-12)
#: System -> the one whose equations other libraries integrate in its place, where that is another.
ORIGINALS: Mapping[str, str] = {"kepler_regularised": "kepler"}
#: What is compared, as titles have it, by mode of the timing.
COMPARED = {"trajectory": "one trajectory", "lanes": "ensembles"}

CAPTION = (
    "Time of a whole call of a prepared problem that returns the final state, per trajectory, to reach a maximum of "
    "|H - H0|/|H0| over all steps: the fastest method of this package beside heyoka as a user gets it, and beside the "
    "fastest of all others, a plain loop in C among them. Both read off curves of time against error, by a straight "
    "line through the logarithms between two settings. Ratios of least times; ratio_of_medians is that of medians."
)


@dataclass(frozen=True, kw_only=True)
class Pair:
    """The curves on one system: this package's, and those of other libraries on it or on the original equations."""

    system: str
    t_end: str
    own: Sequence[Curve]
    others: Sequence[Curve]

    @property
    def label(self) -> str:
        """The system, as titles have it."""
        return systems[self.system].label

    def fastest(self, error: float, mode: str) -> list[tuple[Curve, Crossing]]:
        """This package's methods that reach ``error``, the fastest first."""
        return [found for found in ranking(self.own, "max", error, mode) if isfinite(found[1].time)]

    def rivals(self, error: float, mode: str) -> list[tuple[Curve, Crossing]]:
        """Other libraries' solvers that reach ``error``, the fastest first."""
        return [found for found in ranking(self.others, "max", error, mode) if isfinite(found[1].time)]

    def standard(self, error: float, mode: str) -> float:
        """Seconds of the library that ratios are relative to, NaN if it was not timed."""
        return next((crossing(c, "max", error, mode).time for c in self.others if c.method == STANDARD), nan)


def pairs(cube: str, names: Sequence[str], quartile: str = "min") -> tuple[list[Pair], dict[str, object]]:
    """Return what was measured on each system, and the facts of the machine.

    Parameters
    ----------
    cube : str
        Path of the cube that :func:`nearharmonic.experiments.work_precision.run.measure` makes.
    names : sequence of str
        Systems.
    quartile : str
        Which time of each point: one of :data:`nearharmonic.engine.clock.QUARTILES`.
    """
    curves, ends = {}, {}
    facts: dict[str, object] = {}
    for name in names:
        parts, facts = read_parts(cube, name, quartile)
        ends[name], curves[name] = next((end, curves) for end, measures, curves in parts if "max" in measures)
    found = []
    for name in names:
        original = ORIGINALS.get(name, name)
        own, others = curves[name], curves.get(original, curves[name])
        found.append(
            Pair(
                system=name, t_end=ends[name],
                own=[curve for curve in own if curve.kind == "splitting"],
                others=[curve for curve in others if curve.kind == "peer" and curve.points],
            )
        )  # fmt: skip
    return found, facts


HEADER = (
    "compared", "system", "error", "method", "sums", "ms", f"{STANDARD}_ms", "ratio", "ratio_of_medians",
    "fastest_other", "fastest_other_ms", "ratio_to_fastest_other",
)  # fmt: skip


@measures_time
def comparison(names: Sequence[str], cube: str) -> dict[str, Table]:
    """Compare this package with other libraries at equal error.

    Parameters
    ----------
    names : sequence of str
        Systems.
    cube : str
        Path of the cube that :func:`nearharmonic.experiments.work_precision.run.measure` makes.

    Returns
    -------
    dict
        ``table``: a row for each mode, system and error that a method of this package reaches.
    """
    least, _ = pairs(cube, names)
    medians, _ = pairs(cube, names, "median")
    rows = [
        row
        for mode in COMPARED
        for pair, median in zip(least, medians, strict=True)
        for row in _rows(pair, median, mode)
    ]
    return {"table": Table(header=HEADER, rows=rows, caption=CAPTION)}


def _rows(least: Pair, median: Pair, mode: str) -> Iterator[list[object]]:
    for error in ERRORS:
        own, others = least.fastest(error, mode), least.rivals(error, mode)
        if not own:
            continue
        (curve, found), standard = own[0], least.standard(error, mode)
        medians = [there.time for same, there in median.fastest(error, mode) if same.method == curve.method]
        other, other_time = (others[0][0].label, others[0][1].time) if others else ("", nan)
        yield [
            COMPARED[mode], least.label, f"{error:.0e}", curve.label, _sums(curve, found), 1e3 * found.time,
            1e3 * standard, found.time / standard, medians[0] / median.standard(error, mode), other, 1e3 * other_time,
            found.time / other_time,
        ]  # fmt: skip


def _sums(curve: Curve, found: Crossing) -> str:
    """The summation at the setting nearest to where the error is reached."""
    nearest = min(curve.points, key=lambda point: abs(point.tau / found.tau - 1))
    return "compensated" if nearest.compensated else "plain"
