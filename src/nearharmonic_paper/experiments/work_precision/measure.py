"""Errors of the solvers of other libraries over their settings, with the runs for the timing.

Adaptive solvers are given tolerances, the others step sizes. The time is that of a run from start to end in a user's
code; errors come from a second run with the states at the solver's own steps. Energies are computed in double
precision, so errors below 1e-15 are only upper bounds.
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from math import inf, isfinite, nan
from shutil import which
from typing import Any

import numpy as np

from nearharmonic.recommendation.measure import COLUMNS, Interval, Solver, quiet
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import Peer, States

#: An error above this that does not decrease with the step is an exception; below it rounding dominates.
NEAR_ROUNDING = 1e-9
#: Energy error of a run that does not follow the trajectory.
ASTRAY = 1.0
#: Names of programs instead of modules.
COMPILERS = ("gcc",)
#: Step sizes per decade of the peers.
POINTS_PER_DECADE = 4


def is_installed(library: str) -> bool:
    """Return True if ``library``, a compiler or a module, exists; the module is not imported."""
    return (which(library) if library in COMPILERS else find_spec(library)) is not None


def missing(library: str) -> str:
    """Return the reason why ``library`` cannot be used, for a table; empty if it can."""
    if library in COMPILERS:
        return "" if is_installed(library) else "not installed"
    try:
        with quiet():
            import_module(library)
    except ModuleNotFoundError:
        return "not installed"
    except (ImportError, OSError) as error:
        return f"cannot be imported: {error}"
    return ""


def version_of(library: str) -> str:
    """Return the installed version of ``library``."""
    from importlib.metadata import PackageNotFoundError, version

    if library in COMPILERS:
        return subprocess.run([library, "-dumpfullversion"], check=True, capture_output=True, text=True).stdout.strip()
    try:
        return version(library)
    except PackageNotFoundError:
        return "unknown"


def measured_peer(peer: Peer, problem: Interval, taus_per_stage: Sequence[float], longest: float) -> Solver:
    """Return the errors of ``peer`` with the calls for the timing.

    Settings become finer until a path takes more than ``longest`` seconds; ``taus_per_stage`` ascend. With a missing
    library or an unsupported system there is no setting, and the status is the reason.
    """
    solver = Solver(method=peer.name, label=peer.label, kind="peer")
    problem = problem._replace(system=problem.system.autonomous())
    solver.status = missing(peer.module) or _misfit(peer, problem.system) or "ok"
    if solver.status != "ok":
        return solver
    solver.version = version_of(peer.module)
    points: list[dict[str, float]] = []
    with quiet():
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
    solver.columns = {name: np.array([point.get(name, nan) for point in points]) for name in COLUMNS}
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


def _measured(peer: Peer, problem: Interval, setting: float) -> tuple[dict[str, float], dict[str, Any], float]:
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
