"""Run time against error, for every method and peer on one machine, in interleaved measurements."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.reference import position_t_end, reference
from nearharmonic.engine.settings import Sweep, tau_grid
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import machine, pinned
from nearharmonic.output.store import Contents
from nearharmonic.recommendation import measure as engine
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision import WorkPrecisionSettings
from nearharmonic_paper.experiments.work_precision.peers import PEERS, Peer, States, missing, version_of
from nearharmonic_paper.tasks.provenance import measures_time

if TYPE_CHECKING:
    import xarray as xr

# --- Errors of the solvers of other libraries over their settings -----------------------------------------------------
#
# Adaptive solvers are given tolerances, the others step sizes. The time is for a run from start to end in a user's
# code; errors come from a second run with the states at the solver's own steps. Energies are computed in double
# precision, so errors below 1e-15 are only upper bounds.

#: An error above this that does not decrease with the step is an exception; below it rounding dominates.
NEAR_ROUNDING = 1e-9
#: Energy error of a run that does not follow the trajectory.
ASTRAY = 1.0
#: Step sizes per decade of the peers.
POINTS_PER_DECADE = 4


def measured_peer(
    peer: Peer, problem: engine.Interval, taus_per_stage: Sequence[float], longest: float
) -> engine.Solver:
    """Return the errors of ``peer`` with the calls for the timing.

    Settings become finer until a path takes more than ``longest`` seconds; ``taus_per_stage`` ascend. With a missing
    library or an unsupported system there is no setting, and the status is the reason.
    """
    solver = engine.Solver(method=peer.name, label=peer.label, kind="peer")
    problem = problem._replace(system=problem.system.autonomous())
    solver.status = missing(peer.module) or _misfit(peer, problem.system) or "ok"
    if solver.status != "ok":
        return solver
    solver.version = version_of(peer.module)
    points: list[dict[str, float]] = []
    with engine.quiet():
        for setting in peer.settings or [tau * peer.stages for tau in reversed(taus_per_stage)]:
            point, calls, seconds = _measured(peer, problem, setting)
            # A diverging coarse run may take very long; finer runs are then still useful.
            if seconds > longest:
                if point["max_energy_error"] < ASTRAY or seconds == inf:
                    solver.status = f"stopped where a run took longer than {longest:g} s"
                    break
                calls = {}
            solver.calls |= {(mode, len(points)): call for mode, call in calls.items()}
            points.append(point)
            if _settled(points):
                break
    solver.columns = {name: np.array([point.get(name, nan) for point in points]) for name in engine.COLUMNS}
    return solver


def _misfit(peer: Peer, system: System) -> str:
    if system.time_dependent:
        return "not written for a potential that depends on time"
    if not system.energies[0].traced:
        return "written from the expression of V, and V is a function of numba"
    if peer.regularised and system.regularisation is None:
        return "does not fit: it requires a system with a regularisation"
    if system.regularisation is not None and not peer.regularised:
        return "not written for regularised equations: see those on the original ones"
    if peer.gravity_only and not system.gravity:
        return "does not fit: it requires V = -GM/|q|"
    return "" if system.unit_masses or not peer.quadratic_only else "does not fit: it requires T = p.p/2"


def _measured(peer: Peer, problem: engine.Interval, setting: float) -> tuple[dict[str, float], dict[str, Any], float]:
    """Return numbers and calls of one setting, and the seconds of its path, which also warms up the solver."""
    point = {"tolerance" if peer.adaptive else "tau": setting, "max_energy_error": inf, "mean_energy_error": inf}
    calls: dict[str, Any] = {}
    try:
        attempt = peer.attempt(problem.system, float(problem.t_end), setting)
        begin = time.perf_counter()
        states, evaluations = attempt.path()
        seconds = time.perf_counter() - begin
    except TimeoutError:
        return point, calls, inf
    except (ArithmeticError, RuntimeError, ValueError):
        return point, calls, 0.0  # a failed run has an infinite error
    point["max_energy_error"], point["mean_energy_error"] = energy_errors(problem.system, states)
    if problem.exact is not None:
        point["position_error"] = float(problem.exact.error(states[-1, : problem.system.dimension]))
    if isfinite(point["max_energy_error"]):
        point["steps"], point["evaluations"] = len(states) - 1, evaluations
        calls["trajectory"] = attempt.run
        if attempt.lanes is not None:
            attempt.lanes()  # warm-up, as for the path
            calls["lanes"], point["members"] = attempt.lanes, attempt.members
        if not peer.adaptive:
            point["tau"] = float(problem.t_end) / point["steps"]
    if not peer.adaptive:
        point["tau_per_stage"] = point["tau"] / peer.stages
    return point, calls, seconds


def energy_errors(system: System, states: States) -> tuple[float, float]:
    """Return maximum and mean of |H - H0|/|H0| over the states (n + 1, 2 d) after the first; infinite if one is NaN."""
    q, p = (tuple(half) for half in np.split(states.T, 2))
    H = system.energy(q, p, system.constants(float))
    error = np.abs(H[1:] - H[0]) / abs(H[0])
    if not np.isfinite(error).all():
        return inf, inf
    return float(error.max()), float(error.mean())


def _settled(points: list[dict[str, float]]) -> bool:
    """Return True if finer settings do not reduce the error, because rounding dominates."""
    if len(points) < 2:
        return False
    known = [name for name in ("max_energy_error", "position_error") if isfinite(points[-1].get(name, nan))]
    pairs = [(points[-2].get(name, nan), points[-1][name]) for name in known]
    return bool(pairs) and all(new < NEAR_ROUNDING and new > old / 2 for old, new in pairs)


# --- The measurement --------------------------------------------------------------------------------------------------

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
    groups, problems = {}, {}
    versions = {f"{library} {version_of(library)}" for library in ("nearharmonic", "numba", "numpy")}
    with pinned() as core:
        facts = machine(core)
        for sweep in sweeps:
            system = systems[sweep.system]
            for name, (t_end, measures) in intervals(system, sweep.t_end).items():
                exact = reference(system, t_end) if "position" in measures else None
                solvers = solvers_on(engine.Interval(system, t_end, exact), measures, tableaus, sweep, settings)
                groups[name] = engine.variables(solvers, system.units["t"])
                versions |= {f"{PEERS[s.method].module} {s.version}" for s in solvers if s.version}
                source = exact.source if exact else ""
                problems[name] = {"system": system.name, "t_end": t_end, "measures": measures, "reference": source}
    facts["libraries"] = ", ".join(sorted(versions))
    facts["load_average"] = f"{facts['load_average']} before, {machine(core)['load_average']} after"
    attributes = {**facts, "problems": json.dumps(problems)}
    cube = Contents(variables={}, attributes=attributes, coordinates=("label", "kind", "version"), groups=groups)
    return {"cube": cube}


def intervals(system: System, t_end: str) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Return ends of intervals and the errors of interest there, keys of :data:`MEASURES`, by the name of their group.

    They are [0, t_end], and a shorter one for positions if the system is chaotic.
    """
    short = position_t_end(system, t_end)
    if Fraction(short) == Fraction(t_end):
        return {system.name: (t_end, tuple(engine.MEASURES))}
    return {system.name: (t_end, ("max", "mean")), f"{system.name}_position": (short, ("position",))}


def solvers_on(
    here: engine.Interval,
    measures: Sequence[str],
    tableaus: Sequence[Tableau],
    sweep: Sweep,
    settings: WorkPrecisionSettings,
) -> list[engine.Solver]:
    """Return methods, then peers, measured on one interval, timed in interleaved order on this thread.

    ``sweep`` has the range of step sizes and the summation.
    """
    taus = tau_grid(sweep.lowest, sweep.highest, settings.points_per_decade)
    solvers = [engine.measured(here, tableau, taus, sweep.summation, settings.evaluations) for tableau in tableaus]
    taus = tau_grid(sweep.lowest, sweep.highest, POINTS_PER_DECADE)
    solvers += [measured_peer(PEERS[name], here, taus, settings.longest) for name in settings.solvers()]
    engine.clock(solvers, ("trajectory", "energy"))
    front = front_runners(engine.curves_of(engine.dataset_of(solvers, "")), measures)
    for solver in solvers:
        if solver.method in front:
            solver.prepare(here, integrators[solver.method], "lanes")
    engine.clock(solvers, ("lanes",))
    return solvers


def front_runners(curves: Iterable[xr.Dataset], measures: Sequence[str]) -> list[str]:
    """Return the names of the methods of this package that are among the fastest :data:`FRONT` at some error.

    Only their ensembles are timed: a slow method is slow in lanes too.
    """
    own = engine.of_kind(curves, "splitting")
    leading = (engine.fastest(own, measure, target)[:FRONT] for measure in measures for target in engine.TARGETS)
    return list(dict.fromkeys(curve["solver"].item() for pairs in leading for curve, _ in pairs))
