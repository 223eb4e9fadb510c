"""Run time against error, for every method and peer on one machine: measured in turns, then kept with the machine."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.reference import Reference, position_t_end, reference
from nearharmonic.engine.settings import Sweep
from nearharmonic.experiments.work_precision.curve import MEASURES, MODES, TARGETS, Curve, Part, Point, ranking
from nearharmonic.experiments.work_precision.own import ensemble_call, grid, splitting_curve, way_of
from nearharmonic.experiments.work_precision.peers import PEERS
from nearharmonic.experiments.work_precision.peers.measure import peer_curve, quiet, version_of
from nearharmonic.experiments.work_precision.settings import WorkPrecisionSettings
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import (
    QUARTILES,
    STANDARD,
    Patience,
    interleaved,
    machine,
    pinned,
    summary,
)
from nearharmonic.output.dataset import Contents, Variables, coordinate, variable
from nearharmonic.output.receipts import measures_time
from nearharmonic.systems import systems
from nearharmonic.systems.definition.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Calls of ensembles take some milliseconds, and their arrays are new each time.
ENSEMBLES = Patience(least=5, most=15, seconds=0.05, longest=0.1)
#: Methods whose ensembles are timed, at each error.
FRONT = 3


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One system over one interval.

    Attributes
    ----------
    name : str
        Name of its group in the cube.
    system : System
        The system, from its initial state.
    t_end : str
        End of the interval [0, t_end], in the system's unit of time.
    measures : tuple of str
        Errors of interest, keys of :data:`nearharmonic.experiments.work_precision.curve.MEASURES`.
    """

    name: str
    system: System
    t_end: str
    measures: tuple[str, ...]


@measures_time
def measure(
    sweeps: Sequence[Sweep], methods: Sequence[str], settings: WorkPrecisionSettings, installed: Mapping[str, bool]
) -> dict[str, Contents]:
    """Time methods and other libraries on every problem of a config.

    Parameters
    ----------
    sweeps : sequence of Sweep
        What is asked of each system.
    methods : sequence of str
        Names of integrators.
    settings : WorkPrecisionSettings
        What is timed beside them, how finely, and for how long at most.
    installed : mapping of str to bool
        Libraries, and whether they are there. The measurement finds out by itself: as one of the settings that a
        workflow compares, this makes it measure again where a library is installed later on.

    Returns
    -------
    dict
        ``cube``: a group of :func:`variables` for each problem; the machine and the ``problems`` as attributes.
    """
    tableaus = [integrators[name] for name in methods]
    groups, intervals = {}, {}
    versions = {f"{library} {version_of(library)}" for library in ("nearharmonic", "numba", "numpy")}
    with pinned() as core:
        facts = machine(core)
        for sweep in sweeps:
            for problem in problems(systems[sweep.system], sweep.t_end):
                curves, exact = curves_on(problem, tableaus, sweep, settings)
                groups[problem.name] = variables(curves, problem.system.units["t"])
                versions |= {f"{PEERS[curve.method].module} {curve.version}" for curve in curves if curve.version}
                intervals[problem.name] = {
                    "system": problem.system.name,
                    "t_end": problem.t_end,
                    "measures": problem.measures,
                    "reference": exact.source if exact else "",
                }
    facts["libraries"] = ", ".join(sorted(versions))
    after = machine(core)
    facts["load_average"] = f"{facts['load_average']} before, {after['load_average']} after"
    told = {**facts, "problems": json.dumps(intervals)}
    return {"cube": Contents(variables={}, attributes=told, coordinates=("label", "kind", "version"), groups=groups)}


def problems(system: System, t_end: str) -> tuple[Problem, ...]:
    """Return the intervals on which a system is timed: one, or a second one for positions where chaos forbids.

    Parameters
    ----------
    system : System
        The system.
    t_end : str
        End of the interval asked for, in the system's unit of time.
    """
    short = position_t_end(system, t_end)
    if Fraction(short) == Fraction(t_end):
        return (Problem(name=system.name, system=system, t_end=t_end, measures=tuple(MEASURES)),)
    return (
        Problem(name=system.name, system=system, t_end=t_end, measures=("max", "mean")),
        Problem(name=f"{system.name}_position", system=system, t_end=short, measures=("position",)),
    )


def curves_on(
    problem: Problem, tableaus: Sequence[Tableau], sweep: Sweep, settings: WorkPrecisionSettings
) -> tuple[list[Curve], Reference | None]:
    """Return the curves of methods and peers on one problem, timed in turns on this thread.

    Parameters
    ----------
    problem : Problem
        System and interval.
    tableaus : sequence of Tableau
        Methods of this package.
    sweep : Sweep
        Range of step sizes, and the summation.
    settings : WorkPrecisionSettings
        The peers, and how finely and how long all are run.

    Returns
    -------
    curves : list of Curve
        The methods, then the peers.
    exact : Reference or None
        What positions were compared with, if they are of interest.
    """
    exact = reference(problem.system, problem.t_end) if "position" in problem.measures else None
    curves = []
    for tableau in tableaus:
        points = grid(
            tableau, problem.t_end, sweep.lowest, sweep.highest, settings.points_per_decade, settings.evaluations
        )
        curves.append(splitting_curve(problem.system, tableau, problem.t_end, points, exact, sweep.summation))
    for name in settings.solvers():
        steps = (sweep.lowest, sweep.highest)
        curves.append(peer_curve(PEERS[name], problem.system, problem.t_end, steps, exact, settings.longest))
    clock(curves, ("trajectory", "energy"))
    for name in front_runners(curves, problem.measures):
        (curve,) = (curve for curve in curves if curve.method == name)
        _prepare_ensembles(problem, integrators[name], curve.points)
    clock(curves, ("lanes",))
    return curves, exact


def front_runners(curves: Sequence[Curve], measures: Sequence[str]) -> list[str]:
    """The names of this package's methods that are among the fastest :data:`FRONT` at some error, one at a time.

    Ensembles of these alone are timed: a slow method is as slow in lanes.
    """
    own = [curve for curve in curves if curve.kind == "splitting"]
    names = []
    for measure in measures:
        for target in TARGETS:
            order = [curve.method for curve, found in ranking(own, measure, target) if isfinite(found.time)]
            names += order[:FRONT]
    return list(dict.fromkeys(names))


def _prepare_ensembles(problem: Problem, tableau: Tableau, points: Sequence[Point]) -> None:
    for point in points:
        if point.calls:
            call, members = ensemble_call(problem.system, tableau, problem.t_end, int(point.steps), way_of(point))
            point.calls["lanes"], point.members = call, members


def clock(curves: Iterable[Curve], modes: Iterable[str]) -> None:
    """Time the calls of all points in turns, into their ``times``.

    Parameters
    ----------
    curves : iterable of Curve
        Their points get the seconds of each repeat, per trajectory.
    modes : iterable of str
        Of :data:`nearharmonic.experiments.work_precision.curve.MODES`.
    """
    waiting = [(point, mode, call) for curve in curves for point in curve.points for mode, call in point.calls.items()]
    # A mode at a time, so that no wide registers lower the clock of narrow code beside them.
    for mode in modes:
        chosen = [(point, call) for point, own, call in waiting if own == mode]
        with quiet():
            repeats = interleaved([call for _, call in chosen], ENSEMBLES if mode == "lanes" else STANDARD)
        for (point, _), times in zip(chosen, repeats, strict=True):
            members = point.members if mode == "lanes" else 1
            point.times[mode] = [seconds / members for seconds in times]


_COLUMNS = {
    "tau": ("{t}", "step size; NaN if the method chooses its own"),
    "tau_per_stage": ("{t}", "step size per stage"),
    "tolerance": ("1", "tolerance asked for; NaN if the step size is the setting"),
    "steps": ("1", "steps"),
    "evaluations": ("1", "evaluations of the force; NaN if unknown"),
    "compensated": ("1", "1 if the sums are compensated, 0 if plain; NaN for other libraries"),
    "members": ("1", "trajectories that a call in lanes integrates; NaN if none was timed"),
    "max_energy_error": ("1", "maximum of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "mean_energy_error": ("1", "mean of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "position_error": ("1", "distance from the exact position at the end, over the larger of |q(0)| and |q(t)|"),
}
_MODES = {
    "trajectory": "a whole call for one trajectory, without a look at the energy",
    "lanes": "each trajectory of a whole call for many, in SIMD lanes on one thread, without a look at the energy",
    "energy": "a whole call for one trajectory, the energy measured at every step",
}
_WORDS = {
    "label": "name in legends",
    "kind": "splitting: a method of this package; peer: another library's",
    "status": "ok, or why the curve is empty or ends early",
    "version": "version of the peer's library",
}
_SECONDS = {
    "setup": "a whole call of a prepared problem for one step",
    "sweep": "one call for all step sizes in lanes, energies at every step",
}


def variables(curves: Sequence[Curve], unit: str) -> Variables:
    """Return curves as arrays over (solver, point), padded with NaN; times also over ``quartile``.

    Parameters
    ----------
    curves : sequence of Curve
        What was measured.
    unit : str
        Unit of time of the system, that of step sizes.
    """
    length = max([len(curve.points) for curve in curves] + [1])
    # Not a dimension "method": xarray's sel() takes that word for itself.
    found = coordinate("solver", [curve.method for curve in curves], "solver")
    for name, text in _WORDS.items():
        found[name] = variable("solver", [getattr(curve, name) for curve in curves], text)
    for name, text in _SECONDS.items():
        found[name] = variable("solver", np.array([getattr(curve, name) for curve in curves], dtype=float), text, "s")
    for name, (units, text) in _COLUMNS.items():
        values = np.full((len(curves), length), nan)
        for row, curve in zip(values, curves, strict=True):
            row[: len(curve.points)] = [getattr(point, name) for point in curve.points]
        found[name] = variable(("solver", "point"), values, text, units.format(t=unit))
    found |= coordinate("quartile", QUARTILES, "minimum and quartiles")
    for mode, text in _MODES.items():
        times = np.full((len(curves), length, len(QUARTILES)), nan)
        repeats = np.zeros((len(curves), length), np.int64)
        for i, curve in enumerate(curves):
            for j, point in enumerate(curve.points):
                times[i, j] = summary(point.times.get(mode, []))
                repeats[i, j] = len(point.times.get(mode, []))
        found[f"time_{mode}"] = variable(("solver", "point", "quartile"), times, f"wall time of {text}", "s")
        found[f"repeats_{mode}"] = variable(("solver", "point"), repeats, f"repeats of {text}")
    return found


def curves_of(group: xr.Dataset, quartile: str = "min") -> list[Curve]:
    """Return the curves that :func:`variables` put into ``group``, with one time of each point.

    Parameters
    ----------
    group : xarray.Dataset
        A group of the cube.
    quartile : str
        Which time: one of :data:`nearharmonic.numerics.clock.QUARTILES`.
    """
    return [_curve_of(group.isel(solver=i), quartile) for i in range(group.sizes["solver"])]


def _curve_of(rows: xr.Dataset, quartile: str) -> Curve:
    words = {name: str(rows[name].item()) for name in _WORDS}
    seconds = {name: float(rows[name].item()) for name in _SECONDS}
    curve = Curve(method=str(rows["solver"].item()), **words, **seconds)  # type: ignore[arg-type]
    columns = {name: rows[name].values for name in _COLUMNS}
    least = {mode: rows[f"time_{mode}"].sel(quartile=quartile).values for mode in MODES}
    for i in range(rows.sizes["point"]):
        if np.isnan(columns["tau"][i]) and np.isnan(columns["tolerance"][i]):
            continue
        times = {mode: [float(values[i])] for mode, values in least.items() if isfinite(values[i])}
        values_here = {name: float(values[i]) for name, values in columns.items()}
        curve.points.append(Point(times=times, **values_here))  # type: ignore[arg-type]
    return curve


def read_parts(path: str | os.PathLike[str], system: str, quartile: str = "min") -> tuple[list[Part], dict[str, Any]]:
    """Return every interval of a system in a cube, and the cube's attributes.

    Parameters
    ----------
    path : path
        The cube.
    system : str
        Name of the system.
    quartile : str
        As for :func:`curves_of`.

    Raises
    ------
    ResultFileError
        As :func:`nearharmonic.output.store.read` does.
    """
    from nearharmonic.output import store

    attributes = store.attributes_of(path)
    parts: list[Part] = [
        (told["t_end"], tuple(told["measures"]), curves_of(store.read(path, name), quartile))
        for name, told in json.loads(attributes["problems"]).items()
        if told["system"] == system
    ]
    return parts, attributes
