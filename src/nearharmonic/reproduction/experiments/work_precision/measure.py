"""Errors of other libraries' solvers over their settings, with the runs that are to be timed.

Adaptive solvers are given tolerances, the others step sizes. The time is that of a run from start to end as a user
would write it; errors come from a second run that looks at the solver's own steps. Energies are computed in double
precision, so errors below 1e-15 mean no more than that.
"""

from __future__ import annotations

import subprocess
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from math import inf, isfinite
from shutil import which

import numpy as np

from nearharmonic.engine.grid import tau_grid
from nearharmonic.engine.reference import Reference
from nearharmonic.recommendation.curve import Curve, Point
from nearharmonic.reproduction.experiments.work_precision.peers.peer import Peer, States
from nearharmonic.systems.definition.system import System

#: Above this an error that does not fall with the step is an accident, below it the end of the fall.
NEAR_ROUNDING = 1e-9
#: An energy error of a run that no longer follows the trajectory.
ASTRAY = 1.0
#: What is looked for as a program instead of a module.
COMPILERS = ("gcc",)
#: Step-size grid of the peers, per decade.
POINTS_PER_DECADE = 4


def is_installed(library: str) -> bool:
    """Return True if ``library``, a compiler or a module that is not imported for this, exists."""
    return (which(library) if library in COMPILERS else find_spec(library)) is not None


def missing(library: str) -> str:
    """Why ``library`` cannot be used, in words for a table; empty if it can."""
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
    """The installed version of ``library``."""
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
    """The errors of ``peer`` from its coarsest setting to the first whose path takes over ``longest`` seconds, with
    calls to be timed. ``steps_per_stage`` is the range (lowest, highest) of step sizes per stage.

    A library that is missing, or a system it cannot take, gives a curve without points whose status says so.
    """
    curve, system = Curve(method=peer.name, label=peer.label, kind="peer"), system.autonomous()
    curve.status = missing(peer.module) or _misfit(peer, system) or "ok"
    if curve.status != "ok":
        return curve
    curve.version = version_of(peer.module)
    end = float(t_end)
    with quiet():
        for setting in peer.settings or _steps(peer, steps_per_stage):
            point, seconds = _measured(peer, system, end, setting, exact)
            # A coarse run that goes astray may take for ever, which says nothing about finer ones.
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


def _steps(peer: Peer, per_stage: tuple[float, float]) -> Sequence[float]:
    return [tau * peer.stages for tau in reversed(tau_grid(*per_stage, POINTS_PER_DECADE))]


def _measured(peer: Peer, system: System, t_end: float, setting: float, exact: Reference | None) -> tuple[Point, float]:
    """One setting's point, and the seconds of its path, which also warms the solver up."""
    point = Point(tolerance=setting) if peer.adaptive else Point(tau=setting)
    try:
        attempt = peer.attempt(system, t_end, setting)
        begin = time.perf_counter()
        states, evaluations = attempt.path()
        seconds = time.perf_counter() - begin
    except TimeoutError:
        return point, inf
    except (ArithmeticError, RuntimeError, ValueError):
        return point, 0.0  # a run that breaks down is as good as infinitely far off
    point.max_energy_error, point.mean_energy_error = energy_errors(system, states)
    if exact is not None:
        point.position_error = float(exact.error(states[-1, : system.dimension]))
    if isfinite(point.max_energy_error):
        point.steps, point.evaluations = len(states) - 1, evaluations
        point.calls["trajectory"] = attempt.run
        if attempt.lanes is not None:
            attempt.lanes()  # warmed up as the path was
            point.calls["lanes"], point.members = attempt.lanes, attempt.members
        if not peer.adaptive:
            point.tau = t_end / point.steps
    if not peer.adaptive:
        point.tau_per_stage = point.tau / peer.stages
    return point, seconds


def energy_errors(system: System, states: States) -> tuple[float, float]:
    """Maximum and mean of |H - H0|/|H0| over the states (n + 1, 2 d) but the first; infinite if one is no number."""
    q, p = (tuple(half) for half in np.split(states.T, 2))
    H = system.energy(q, p, system.constants(float))
    error = np.abs(H[1:] - H[0]) / abs(H[0])
    if not np.isfinite(error).all():
        return inf, inf
    return float(error.max()), float(error.mean())


def _settled(points: list[Point]) -> bool:
    """Return True if a finer setting no longer gains: rounding has taken over."""
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
    """Coarse settings overflow and warn: what comes of them is in the errors. Libraries warn of their own affairs."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield
