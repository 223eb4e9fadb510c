"""Run time against error, for every method and peer on one machine, in interleaved measurements."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import isfinite

import numpy as np
import xarray as xr

from nearharmonic.engine.reference import position_t_end, reference
from nearharmonic.engine.settings import Sweep, tau_grid
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import machine, pinned
from nearharmonic.output.dataset import Contents
from nearharmonic.recommendation.measure import (
    MEASURES,
    TARGETS,
    Interval,
    Solver,
    clock,
    curves_of,
    dataset_of,
    ensemble_call,
    measured,
    of_kind,
    ranking,
    settings_of,
    variables,
    way_of,
)
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.measure import POINTS_PER_DECADE, measured_peer, version_of
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from nearharmonic_paper.experiments.work_precision.settings import WorkPrecisionSettings
from nearharmonic_paper.tasks.provenance import measures_time

#: Number of methods per error whose ensembles are timed.
FRONT = 3


@measures_time
def measure(
    sweeps: Sequence[Sweep], methods: Sequence[str], settings: WorkPrecisionSettings, installed: Mapping[str, bool]
) -> dict[str, Contents]:
    """Time methods and other libraries on every problem of a config.

    The measurement does not use ``installed``, which is True for each installed library. It is one of the settings that
    a workflow compares, so that the measurement is repeated after the installation of a library.

    The result has ``cube``: a group of :func:`variables` for each problem; the machine and the ``problems`` as
    attributes.
    """
    tableaus = [integrators[name] for name in methods]
    groups, told = {}, {}
    versions = {f"{library} {version_of(library)}" for library in ("nearharmonic", "numba", "numpy")}
    with pinned() as core:
        facts = machine(core)
        for sweep in sweeps:
            system = systems[sweep.system]
            for name, (t_end, measures) in intervals(system, sweep.t_end).items():
                exact = reference(system, t_end) if "position" in measures else None
                solvers = solvers_on(Interval(system, t_end, exact), measures, tableaus, sweep, settings)
                groups[name] = variables(solvers, system.units["t"])
                versions |= {f"{PEERS[one.method].module} {one.version}" for one in solvers if one.version}
                source = exact.source if exact else ""
                told[name] = {"system": system.name, "t_end": t_end, "measures": measures, "reference": source}
    facts["libraries"] = ", ".join(sorted(versions))
    facts["load_average"] = f"{facts['load_average']} before, {machine(core)['load_average']} after"
    attributes = {**facts, "problems": json.dumps(told)}
    return {
        "cube": Contents(variables={}, attributes=attributes, coordinates=("label", "kind", "version"), groups=groups)
    }


def intervals(system: System, t_end: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return ends of intervals and the errors of interest there, keys of :data:`MEASURES`, by the name of their group.

    They are [0, t_end], and a shorter one for positions if the system is chaotic.
    """
    short = position_t_end(system, t_end)
    if Fraction(short) == Fraction(t_end):
        return {system.name: (t_end, tuple(MEASURES))}
    return {system.name: (t_end, ("max", "mean")), f"{system.name}_position": (short, ("position",))}


def solvers_on(
    here: Interval, measures: Sequence[str], tableaus: Sequence[Tableau], sweep: Sweep, settings: WorkPrecisionSettings
) -> list[Solver]:
    """Return methods, then peers, measured on one interval, timed in interleaved order on this thread.

    ``sweep`` has the range of step sizes and the summation.
    """
    taus = tau_grid(sweep.lowest, sweep.highest, settings.points_per_decade)
    solvers = [
        measured(here, tableau, settings_of(tableau, here.t_end, taus, settings.evaluations), sweep.summation)
        for tableau in tableaus
    ]
    taus = tau_grid(sweep.lowest, sweep.highest, POINTS_PER_DECADE)
    solvers += [measured_peer(PEERS[name], here, taus, settings.longest) for name in settings.solvers()]
    clock(solvers, ("trajectory", "energy"))
    front = front_runners(curves_of(dataset_of(solvers, "")), measures)
    for solver in solvers:
        if solver.method in front:
            tableau, steps = integrators[solver.method], solver.columns["steps"]
            members = solver.columns["members"] = np.full(len(steps), np.nan)
            for _, i in [key for key in solver.calls if key[0] == "trajectory"]:
                solver.calls["lanes", i], members[i] = ensemble_call(
                    here.system, tableau, here.t_end, int(steps[i]), way_of(solver, i)
                )
    clock(solvers, ("lanes",))
    return solvers


def front_runners(curves: Iterable[xr.Dataset], measures: Sequence[str]) -> list[str]:
    """Return the names of the methods of this package that are among the fastest :data:`FRONT` at some error.

    Only their ensembles are timed: a slow method is slow in lanes too.
    """
    own, names = of_kind(curves, "splitting"), []
    for measure in measures:
        for target in TARGETS:
            order = [curve["solver"].item() for curve, found in ranking(own, measure, target) if isfinite(found.time)]
            names += order[:FRONT]
    return list(dict.fromkeys(names))
