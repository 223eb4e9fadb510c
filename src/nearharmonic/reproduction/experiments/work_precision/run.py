"""Run time against error, for every method and peer on one machine: measured in turns, then kept with the machine."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite

from nearharmonic.engine.reference import Reference, position_t_end, reference
from nearharmonic.engine.settings import Sweep
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import (
    STANDARD,
    Patience,
    interleaved,
    machine,
    pinned,
)
from nearharmonic.output.dataset import Contents
from nearharmonic.recommendation.curve import (
    MEASURES,
    TARGETS,
    Curve,
    Point,
    ranking,
)
from nearharmonic.recommendation.own import ensemble_call, grid, splitting_curve, way_of
from nearharmonic.recommendation.timings import variables
from nearharmonic.reproduction.experiments.work_precision.measure import peer_curve, quiet, version_of
from nearharmonic.reproduction.experiments.work_precision.peers import PEERS
from nearharmonic.reproduction.experiments.work_precision.settings import WorkPrecisionSettings
from nearharmonic.reproduction.tasks.receipts import measures_time
from nearharmonic.systems import systems
from nearharmonic.systems.definition.system import System

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
        Errors of interest, keys of :data:`nearharmonic.recommendation.curve.MEASURES`.
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
        Of :data:`nearharmonic.recommendation.curve.MODES`.
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
