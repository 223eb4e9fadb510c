"""Errors of the solvers of other libraries over their settings, with the runs for the timing.

Adaptive solvers are given tolerances, the others step sizes. The time is that of a run from start to end in a user's
code; errors come from a second run with the states at the solver's own steps. Energies are computed in double
precision, so errors below 1e-15 are only upper bounds.
"""

from __future__ import annotations

import subprocess
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from math import inf, isfinite
from shutil import which

import numpy as np

from nearharmonic.engine.reference import Reference
from nearharmonic.engine.settings import tau_grid
from nearharmonic.recommendation.curve import Curve, Point
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


def peer_curve(
    peer: Peer,
    system: System,
    t_end: str,
    steps_per_stage: tuple[float, float],
    exact: Reference | None,
    longest: float,
) -> Curve:
    """Return the errors of ``peer`` with the calls for the timing.

    Settings become finer until a path takes more than ``longest`` seconds. ``steps_per_stage`` is the range (lowest,
    highest) of step sizes per stage.

    A missing library or an unsupported system gives a curve without points, with the reason as status.
    """
    curve, system = Curve(method=peer.name, label=peer.label, kind="peer"), system.autonomous()
    curve.status = missing(peer.module) or _misfit(peer, system) or "ok"
    if curve.status != "ok":
        return curve
    curve.version = version_of(peer.module)
    end = float(t_end)
    with quiet():
        taus = reversed(tau_grid(*steps_per_stage, POINTS_PER_DECADE))
        for setting in peer.settings or [tau * peer.stages for tau in taus]:
            point, seconds = _measured(peer, system, end, setting, exact)
            # A diverging coarse run may take very long; finer runs are then still useful.
            if seconds > longest:
                if point.max_energy_error < ASTRAY or seconds == inf:
                    curve.status = f"stopped where a run took longer than {longest:g} s"
                    break
                point.calls = {}
            curve.points.append(point)
            if _settled(curve.points):
                break
    return curve


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


def _measured(peer: Peer, system: System, t_end: float, setting: float, exact: Reference | None) -> tuple[Point, float]:
    """Return the point of one setting, and the seconds of its path, which also warms up the solver."""
    point = Point(tolerance=setting) if peer.adaptive else Point(tau=setting)
    try:
        attempt = peer.attempt(system, t_end, setting)
        begin = time.perf_counter()
        states, evaluations = attempt.path()
        seconds = time.perf_counter() - begin
    except TimeoutError:
        return point, inf
    except (ArithmeticError, RuntimeError, ValueError):
        return point, 0.0  # a failed run has an infinite error
    point.max_energy_error, point.mean_energy_error = energy_errors(system, states)
    if exact is not None:
        point.position_error = float(exact.error(states[-1, : system.dimension]))
    if isfinite(point.max_energy_error):
        point.steps, point.evaluations = len(states) - 1, evaluations
        point.calls["trajectory"] = attempt.run
        if attempt.lanes is not None:
            attempt.lanes()  # warm-up, as for the path
            point.calls["lanes"], point.members = attempt.lanes, attempt.members
        if not peer.adaptive:
            point.tau = t_end / point.steps
    if not peer.adaptive:
        point.tau_per_stage = point.tau / peer.stages
    return point, seconds


def energy_errors(system: System, states: States) -> tuple[float, float]:
    """Return maximum and mean of |H - H0|/|H0| over the states (n + 1, 2 d) after the first; infinite if one is NaN."""
    q, p = (tuple(half) for half in np.split(states.T, 2))
    H = system.energy(q, p, system.constants(float))
    error = np.abs(H[1:] - H[0]) / abs(H[0])
    if not np.isfinite(error).all():
        return inf, inf
    return float(error.max()), float(error.mean())


def _settled(points: list[Point]) -> bool:
    """Return True if finer settings do not reduce the error, because rounding dominates."""
    if len(points) < 2:
        return False
    before, last = points[-2:]
    pairs = [
        (getattr(before, name), getattr(last, name))
        for name in ("max_energy_error", "position_error")
        if isfinite(getattr(last, name))
    ]
    return bool(pairs) and all(new < NEAR_ROUNDING and new > old / 2 for old, new in pairs)


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress warnings: coarse settings overflow, which the errors show, and libraries have unrelated warnings."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield
