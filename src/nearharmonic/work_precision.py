"""Run time against error, for every method and peer on one machine: measured in turns, then kept with the machine."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.curve import MEASURES, MODES, Curve, Part, Point
from nearharmonic.integrators import integrators
from nearharmonic.peers import PEERS, peer_curve, quiet
from nearharmonic.reference import Reference, position_t_end, reference
from nearharmonic.settings import Sweep
from nearharmonic.splitting_curves import grid, splitting_curve, warm_up
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic.tableau import Tableau
from nearharmonic.timing import QUARTILES, interleaved, machine, pinned, summary
from nearharmonic.work_precision_settings import WorkPrecision

if TYPE_CHECKING:
    import xarray as xr

Variables = dict[str, tuple[tuple[str, ...], Any, dict[str, str]]]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One system over one interval [0, t_end], for the errors ``measures`` (keys of :data:`curve.MEASURES`)."""

    name: str
    system: System
    t_end: str
    measures: tuple[str, ...]


def problems(system: System, t_end: str) -> tuple[Problem, ...]:
    """The intervals on which ``system`` is timed: one, or a shorter one more for positions where chaos forbids."""
    short = position_t_end(system, t_end)
    if Fraction(short) == Fraction(t_end):
        return (Problem(name=system.name, system=system, t_end=t_end, measures=tuple(MEASURES)),)
    return (
        Problem(name=system.name, system=system, t_end=t_end, measures=("max", "mean")),
        Problem(name=f"{system.name}_position", system=system, t_end=short, measures=("position",)),
    )


def measure(
    problem: Problem, tableaus: Sequence[Tableau], sweep: Sweep, settings: WorkPrecision
) -> tuple[list[Curve], Reference | None]:
    """The curves of ``tableaus`` and of the peers of ``settings`` on ``problem``, timed in turns on this thread."""
    exact = reference(problem.system, problem.t_end) if "position" in problem.measures else None
    warm_up(problem.system, sweep.summation)
    curves = []
    for tableau in tableaus:
        points = grid(
            tableau, problem.t_end, sweep.lowest, sweep.highest, settings.points_per_decade, settings.evaluations
        )
        curves.append(splitting_curve(problem.system, tableau, problem.t_end, points, exact, sweep.summation))
    for name in settings.peers:
        steps = (sweep.lowest, sweep.highest)
        curves.append(peer_curve(PEERS[name], problem.system, problem.t_end, steps, exact, settings.longest))
    clock(curves)
    return curves, exact


def clock(curves: Iterable[Curve], modes: Iterable[str] = tuple(MODES)) -> None:
    """Time the calls of all points in turns, into their ``times``, in seconds per trajectory, in these ``modes``."""
    waiting = [(point, mode, call) for curve in curves for point in curve.points for mode, call in point.calls.items()]
    # A mode at a time, so that no wide registers lower the clock of narrow code beside them.
    for mode in modes:
        chosen = [(point, call) for point, own, call in waiting if own == mode]
        with quiet():
            repeats = interleaved([call for _, call in chosen])
        for (point, _), times in zip(chosen, repeats, strict=True):
            point.times[mode] = [seconds / MODES[mode] for seconds in times]


def measure_all(
    sweeps: Sequence[Sweep], methods: Sequence[str], settings: WorkPrecision
) -> tuple[dict[str, Variables], dict[str, str | float]]:
    """Every problem of ``sweeps``: variables by problem, and the machine and intervals as attributes of the file."""
    tableaus = [integrators[name] for name in methods]
    groups, intervals = {}, {}
    with pinned() as core:
        facts = machine(core)
        for sweep in sweeps:
            for problem in problems(systems[sweep.system], sweep.t_end):
                curves, exact = measure(problem, tableaus, sweep, settings)
                groups[problem.name] = variables(curves, problem.system.units["t"])
                intervals[problem.name] = {
                    "system": problem.system.name,
                    "t_end": problem.t_end,
                    "measures": problem.measures,
                    "reference": exact.source if exact else "",
                }
    after = machine(core)
    facts["load_average"] = f"{facts['load_average']} before, {after['load_average']} after"
    return groups, {**facts, "problems": json.dumps(intervals)}


_COLUMNS = {
    "tau": ("{t}", "step size; NaN if the method chooses its own"),
    "tau_per_stage": ("{t}", "step size per stage"),
    "tolerance": ("1", "tolerance asked for; NaN if the step size is the setting"),
    "steps": ("1", "steps"),
    "evaluations": ("1", "evaluations of the force; NaN if unknown"),
    "max_energy_error": ("1", "maximum of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "mean_energy_error": ("1", "mean of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "position_error": ("1", "distance from the exact position at the end, over the larger of |q(0)| and |q(t)|"),
}
_MODES = {
    "trajectory": "one trajectory, without a look at the energy",
    "lanes": "each of eight trajectories in SIMD lanes, without a look at the energy",
    "energy": "one trajectory, the energy in double-double at every step",
}
_WORDS = {
    "label": "name in legends",
    "kind": "splitting: a method of this package; peer: another library's",
    "status": "ok, or why the curve is empty or ends early",
    "version": "version of the peer's library",
}
_SECONDS = {
    "setup": "a whole call for one step: exact coefficients, arrays, the kernel",
    "sweep": "one call for all step sizes in lanes, energies at every step",
}


def variables(curves: Sequence[Curve], unit: str) -> Variables:
    """``curves`` as arrays over (solver, point), padded with NaN; times also over ``quartile``."""
    length = max([len(curve.points) for curve in curves] + [1])
    # Not a dimension "method": xarray's sel() takes that word for itself.
    found: Variables = {"solver": (("solver",), [c.method for c in curves], {"units": "1", "long_name": "solver"})}
    for name, text in _WORDS.items():
        found[name] = (("solver",), [getattr(c, name) for c in curves], {"units": "1", "long_name": text})
    for name, text in _SECONDS.items():
        values = np.array([getattr(c, name) for c in curves], dtype=float)
        found[name] = (("solver",), values, {"units": "s", "long_name": text})
    for name, (units, text) in _COLUMNS.items():
        values = np.full((len(curves), length), nan)
        for row, curve in zip(values, curves, strict=True):
            row[: len(curve.points)] = [getattr(point, name) for point in curve.points]
        found[name] = (("solver", "point"), values, {"units": units.format(t=unit), "long_name": text})
    found["quartile"] = (("quartile",), list(QUARTILES), {"units": "1", "long_name": "minimum and quartiles"})
    for mode, text in _MODES.items():
        times = np.full((len(curves), length, len(QUARTILES)), nan)
        repeats = np.zeros((len(curves), length), np.int64)
        for i, curve in enumerate(curves):
            for j, point in enumerate(curve.points):
                times[i, j] = summary(point.times.get(mode, []))
                repeats[i, j] = len(point.times.get(mode, []))
        dimensions = ("solver", "point", "quartile")
        found[f"time_{mode}"] = (dimensions, times, {"units": "s", "long_name": f"wall time of {text}"})
        found[f"repeats_{mode}"] = (dimensions[:2], repeats, {"units": "1", "long_name": f"repeats of {text}"})
    return found


def curves_of(group: xr.Dataset) -> list[Curve]:
    """The curves that :func:`variables` put into ``group``, with the least time of each point."""
    return [_curve_of(group.isel(solver=i)) for i in range(group.sizes["solver"])]


def _curve_of(rows: xr.Dataset) -> Curve:
    words = {name: str(rows[name].item()) for name in _WORDS}
    seconds = {name: float(rows[name].item()) for name in _SECONDS}
    curve = Curve(method=str(rows["solver"].item()), **words, **seconds)  # type: ignore[arg-type]
    columns = {name: rows[name].values for name in _COLUMNS}
    least = {mode: rows[f"time_{mode}"].sel(quartile="min").values for mode in MODES}
    for i in range(rows.sizes["point"]):
        if np.isnan(columns["tau"][i]) and np.isnan(columns["tolerance"][i]):
            continue
        times = {mode: [float(values[i])] for mode, values in least.items() if isfinite(values[i])}
        values_here = {name: float(values[i]) for name, values in columns.items()}
        curve.points.append(Point(times=times, **values_here))  # type: ignore[arg-type]
    return curve


def read_parts(path: str | os.PathLike[str], system: str) -> tuple[list[Part], dict[str, Any]]:
    """Every interval of ``system`` in the file ``path``, and the file's attributes.

    Raises:
        ResultFileError: as :func:`nearharmonic.store.read` does.
    """
    from nearharmonic import store

    attributes = store.attributes_of(path)
    parts = groups_for(attributes, system)
    return [(t_end, measures, curves_of(store.read(path, name))) for name, t_end, measures in parts], attributes


def groups_for(attributes: Mapping[str, Any], system: str) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """(group, t_end, measures) of each interval that the file with ``attributes`` has for ``system``."""
    for name, told in json.loads(attributes["problems"]).items():
        if told["system"] == system:
            yield name, told["t_end"], tuple(told["measures"])
