"""Run time against error, for every method and peer on one machine, in interleaved measurements."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import isfinite
from typing import NamedTuple

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
    ranking,
)
from nearharmonic.recommendation.own import ensemble_call, grid, splitting_curve, way_of
from nearharmonic.recommendation.timings import variables
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.measure import peer_curve, quiet, version_of
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from nearharmonic_paper.experiments.work_precision.settings import WorkPrecisionSettings
from nearharmonic_paper.tasks.receipts import measures_time

#: Timing of ensembles: calls take some milliseconds, and allocate new arrays.
ENSEMBLES = Patience(least=5, most=15, seconds=0.05, longest=0.1)
#: Number of methods per error whose ensembles are timed.
FRONT = 3


class Problem(NamedTuple):
    """One system over one interval."""

    name: str  # of its group in the cube
    system: System
    t_end: str  # end of the interval [0, t_end], in the unit of time of the system
    measures: tuple[str, ...]  # errors of interest, keys of :data:`nearharmonic.recommendation.curve.MEASURES`


@measures_time
def measure(
    sweeps: Sequence[Sweep], methods: Sequence[str], settings: WorkPrecisionSettings, installed: Mapping[str, bool]
) -> dict[str, Contents]:
    """Time methods and other libraries on every problem of a config.

    The measurement does not use ``installed``, which is True for each installed library. It is one of the settings that
    a workflow compares, so that the measurement is repeated after the installation of a library.

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
    """Return the intervals of the timing: [0, t_end], and a second one for positions if the system is chaotic."""
    short = position_t_end(system, t_end)
    if Fraction(short) == Fraction(t_end):
        return (Problem(system.name, system, t_end, tuple(MEASURES)),)
    positions = Problem(f"{system.name}_position", system, short, ("position",))
    return Problem(system.name, system, t_end, ("max", "mean")), positions


def curves_on(
    problem: Problem, tableaus: Sequence[Tableau], sweep: Sweep, settings: WorkPrecisionSettings
) -> tuple[list[Curve], Reference | None]:
    """Return the curves of methods, then of peers, on one problem, timed in interleaved order on this thread.

    The second result is the reference of the positions, if their errors are measured. ``sweep`` has the range of step
    sizes and the summation.
    """
    exact = reference(problem.system, problem.t_end) if "position" in problem.measures else None
    system, t_end, steps = problem.system, problem.t_end, (sweep.lowest, sweep.highest)
    curves = []
    for tableau in tableaus:
        points = grid(tableau, t_end, *steps, settings.points_per_decade, settings.evaluations)
        curves.append(splitting_curve(system, tableau, t_end, points, exact, sweep.summation))
    peers = [PEERS[name] for name in settings.solvers()]
    curves += [peer_curve(peer, system, t_end, steps, exact, settings.longest) for peer in peers]
    clock(curves, ("trajectory", "energy"))
    front = front_runners(curves, problem.measures)
    for curve in curves:
        for point in curve.points if curve.method in front else ():
            if point.calls:
                tableau = integrators[curve.method]
                call, members = ensemble_call(system, tableau, t_end, int(point.steps), way_of(point))
                point.calls["lanes"], point.members = call, members
    clock(curves, ("lanes",))
    return curves, exact


def front_runners(curves: Sequence[Curve], measures: Sequence[str]) -> list[str]:
    """Return the names of the methods of this package that are among the fastest :data:`FRONT` at some error.

    Only their ensembles are timed: a slow method is slow in lanes too.
    """
    own = [curve for curve in curves if curve.kind == "splitting"]
    names = []
    for measure in measures:
        for target in TARGETS:
            order = [curve.method for curve, found in ranking(own, measure, target) if isfinite(found.time)]
            names += order[:FRONT]
    return list(dict.fromkeys(names))


def clock(curves: Iterable[Curve], modes: Iterable[str]) -> None:
    """Time the calls of all points in interleaved order; ``times`` get the seconds of each repeat, per trajectory.

    ``modes`` are some of :data:`nearharmonic.recommendation.curve.MODES`.
    """
    waiting = [(point, mode, call) for curve in curves for point in curve.points for mode, call in point.calls.items()]
    # One mode at a time, because wide registers may reduce the clock rate for other code.
    for mode in modes:
        chosen = [(point, call) for point, own, call in waiting if own == mode]
        with quiet():
            repeats = interleaved([call for _, call in chosen], ENSEMBLES if mode == "lanes" else STANDARD)
        for (point, _), times in zip(chosen, repeats, strict=True):
            members = point.members if mode == "lanes" else 1
            point.times[mode] = [seconds / members for seconds in times]
