"""Comparison with other libraries: ratios of times of whole calls at equal error, for one trajectory and ensembles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import xarray as xr

from nearharmonic.output.table import Table
from nearharmonic.recommendation.measure import Crossing, crossing, of_kind, ranking, read_parts
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.tasks.provenance import measures_time

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
