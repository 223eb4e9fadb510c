"""The curves of this package's own methods: errors of whole sweeps, and calls of the compiled kernel to be timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from functools import cache
from math import inf, isfinite

import numpy as np

from nearharmonic.core.kernel import inner, room
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.coefficients import lane_rows, lanes_of, moves, parameter_row, start_row
from nearharmonic.engine.grid import check_fit, evaluations_of, steps_of, tau_grid
from nearharmonic.engine.kernels import kernel_of, physics_of
from nearharmonic.engine.reference import Reference
from nearharmonic.engine.results import Trajectories
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import SettingError
from nearharmonic.experiments.work_precision.curve import MODES, Curve, Point
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems.system import System

#: Below this all errors are rounding: finer steps cost more and show nothing.
ROUNDING = 1e-15
#: Relative to the distance; positions lose the digits that the phase does.
POSITION_ROUNDING = 1e-14
#: Repeats of the call that measures what surrounds the kernel.
SETUP_REPEATS = 5


def grid(
    tableau: Tableau, t_end: str, lowest: float, highest: float, points_per_decade: int, evaluations: int
) -> list[tuple[float, int]]:
    """(tau per stage, steps) from coarse to fine, each number of steps once; runs of more than ``evaluations`` of the
    force are left out, and the grid begins where a run has one step at least."""
    taus = tau_grid(lowest, highest, points_per_decade)
    steps = {steps_of(t_end, tau * tableau.stages): tau for tau in taus}
    return [(tau, n) for n, tau in sorted(steps.items()) if evaluations_of(tableau, n) <= evaluations]


def splitting_curve(
    system: System,
    tableau: Tableau,
    t_end: str,
    points: Sequence[tuple[float, int]],
    exact: Reference | None,
    summation: str = "compensated",
    modes: Collection[str] = tuple(MODES),
) -> Curve:
    """The errors of ``tableau`` at ``points`` (tau per stage, steps), with calls of the kernel, one for each of
    ``modes``, that are to be timed.

    Stops at the first point where every error is down to rounding. A system that the method is not made for gives a
    curve without points whose status says so.
    """
    curve = Curve(method=tableau.name, label=tableau.label, kind="splitting")
    try:
        check_fit(system, tableau)
    except SettingError:
        curve.status = f"does not fit: it requires a {tableau.requires}"
        return curve
    if not points:
        curve.status = "no step size: every run would take more evaluations than allowed"
        return curve
    steps = [n for _, n in points]
    begin = time.perf_counter()
    numerics = Numerics(summation=summation)
    paths = integrate_batch(system, tableau, t_end=Fraction(t_end), steps=steps, samples=2, numerics=numerics)
    curve.sweep = time.perf_counter() - begin
    curve.points = _points(tableau, t_end, points, paths, exact)
    for point in curve.points:
        if isfinite(point.max_energy_error):
            point.calls = kernel_calls(system, tableau, Fraction(t_end), int(point.steps), modes, summation)
    curve.setup = _setup(system, tableau, Fraction(t_end), summation)
    return curve


def _points(
    tableau: Tableau,
    t_end: str,
    points: Sequence[tuple[float, int]],
    paths: Trajectories,
    exact: Reference | None,
) -> list[Point]:
    found = []
    for i, (tau_per_stage, steps) in enumerate(points):
        worst, mean = float(paths.max_energy_error[i]), float(paths.mean_energy_error[i])
        off = np.nan
        if exact is not None:
            off = float(exact.error(paths.q[i, -1], paths.q_low[i, -1])) if isfinite(worst) else inf
        found.append(
            Point(
                tau=float(Fraction(t_end) / steps),
                tau_per_stage=tau_per_stage,
                steps=steps,
                evaluations=int(paths.evaluations[i]),
                max_energy_error=worst,
                mean_energy_error=mean,
                position_error=off,
            )
        )
        if worst <= ROUNDING and not off > POSITION_ROUNDING:
            break
    return found


def kernel_calls(
    system: System,
    tableau: Tableau,
    t_end: Fraction,
    steps: int,
    modes: Collection[str],
    summation: str = "compensated",
) -> dict[str, Callable[[], object]]:
    """Return calls of the compiled kernel, to be timed, that make the same integration in each of ``modes``.

    Parameters
    ----------
    system, tableau
        Problem and method.
    t_end, steps
        The interval [0, ``t_end``] is covered in ``steps`` equal steps.
    modes
        Keys of :data:`nearharmonic.experiments.work_precision.curve.MODES`.
    summation
        "compensated" or "plain".

    Returns
    -------
    dict
        Call by mode; each begins at the start of the system. Formulas that are loops have no mode of several lanes.
    """
    (row,) = moves(tableau, [t_end / steps], 1)
    start = start_row(*system.extended_start(Fraction), plain=summation == "plain")
    parameters = parameter_row(system.constants(Fraction))
    calls = {}
    for mode in _possible(system, modes):
        width = MODES[mode]
        advance = _advance(system, summation, width, _measured(mode))
        fresh = lane_rows(start, parameters, width, room(physics_of(system), extended=False))
        calls[mode] = _call(advance, steps, tableau, lanes_of(row, width), fresh)
    return calls


def _possible(system: System, modes: Collection[str]) -> list[str]:
    """Those of ``modes`` for which there is a kernel of ``system``."""
    return [mode for mode in modes if MODES[mode] == 1 or not system.formulas().are_loops]


def _measured(mode: str) -> str:
    return "every" if mode == "energy" else "samples"


@cache
def _advance(system: System, summation: str, width: int, energy: str) -> Callable[..., int]:
    """The inner kernel by itself, loaded once: what a caller with arrays at hand would use."""
    compensated = summation == "compensated"
    return inner(physics_of(system), extended=False, compensated=compensated, width=width, energy=energy)


def _call(
    advance: Callable[..., int], steps: int, tableau: Tableau, given: np.ndarray, fresh: np.ndarray
) -> Callable[[], object]:
    rows, lanes = fresh.copy(), given.copy()
    kick_first = tableau.first == "kick"

    def call() -> np.ndarray:
        rows[:], lanes[:] = fresh, given
        advance(steps, tableau.stages, kick_first, lanes, rows)
        return rows

    return call


def _setup(system: System, tableau: Tableau, t_end: Fraction, summation: str) -> float:
    """Least seconds of a whole call for one step: exact coefficients, arrays and the look at the energy."""
    least, numerics = inf, Numerics(summation=summation)
    for _ in range(SETUP_REPEATS):
        begin = time.perf_counter()
        integrate_batch(system, tableau, t_end=t_end, steps=[1], samples=2, numerics=numerics)
        least = min(least, time.perf_counter() - begin)
    return least


def warm_up(system: System, summation: str = "compensated", modes: Collection[str] = tuple(MODES)) -> None:
    """Compile every kernel that a curve with these ``modes`` uses, or load it from the cache."""
    kernel_of(system, Numerics(summation=summation))
    for mode in _possible(system, modes):
        _advance(system, summation, MODES[mode], _measured(mode))
