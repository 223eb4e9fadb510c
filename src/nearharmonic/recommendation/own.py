"""Curves of this package's own methods: errors of sweeps, and calls of prepared problems to be timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from math import inf, isfinite
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.ensemble import ensemble
from nearharmonic.engine.execution import Trajectories, least_samples
from nearharmonic.engine.reference import Reference
from nearharmonic.engine.settings import Numerics, misfit, tau_grid
from nearharmonic.engine.solution import Problem
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.recommendation.curve import MEASURES, Curve, Point
from nearharmonic.systems.system import System

#: Errors below this are rounding: finer steps cost more and do not reduce them.
ROUNDING = 1e-15
#: As above for positions, relative to the distance: rounding of the phase is added.
POSITION_ROUNDING = 1e-14
#: Largest ratio of errors, plain over compensated sums, at which plain sums are used.
LOSSLESS = 1.05
#: Modes of one trajectory, and when each measures the energy.
ENERGIES = {"trajectory": "none", "energy": "every"}
#: Repeats of the call that measures the cost outside the kernel.
SETUP_REPEATS = 5
#: Evaluations of the force by all members of an ensemble, some milliseconds;
ENSEMBLE_EVALUATIONS = 2**25
#: as above for a regularised system, whose members run one by one instead of in lanes;
ONE_BY_ONE_EVALUATIONS = 2**21
#: fewest and most members, which share the cost of a call outside the kernel.
FEWEST_MEMBERS, MOST_MEMBERS = 64, 2048


def grid(
    tableau: Tableau, t_end: str, lowest: float, highest: float, points_per_decade: int, evaluations: int
) -> list[tuple[float, int]]:
    """Return (tau per stage, steps) from coarse to fine, each number of steps once, at least one step a run.

    Runs of more than ``evaluations`` of the force are left out.
    """
    taus = tau_grid(lowest, highest, points_per_decade)
    steps = {tableau.steps(tau, t_end): tau for tau in taus}
    return [(tau, n) for n, tau in sorted(steps.items()) if tableau.evaluations(n) <= evaluations]


def splitting_curve(
    system: System,
    tableau: Tableau,
    t_end: str,
    points: Sequence[tuple[float, int]],
    exact: Reference | None,
    summation: str = "compensated",
) -> Curve:
    """Return the errors of ``tableau`` at ``points`` (tau per stage, steps), with calls for one trajectory to be timed.

    Uncompensated sums are used at points where they do not increase the errors (:data:`LOSSLESS`), compensated sums at
    all others; ``summation="plain"`` makes all plain. The curve ends at the first point where every error is rounding.
    A method that does not fit the system gives a curve without points whose status has the reason.
    """
    curve = Curve(method=tableau.name, label=tableau.label, kind="splitting")
    reason, _ = misfit(system, tableau)
    if reason:
        curve.status = f"does not fit: {reason}"
        return curve
    if not points:
        curve.status = "no step size: every run would take more evaluations than allowed"
        return curve
    steps = [n for _, n in points]
    found = {}
    for way in dict.fromkeys((summation, "plain")):
        begin = time.perf_counter()
        numerics = Numerics(summation=way)
        paths = integrate_batch(
            system, tableau, t_end=Fraction(t_end), steps=steps, samples=least_samples(tableau), numerics=numerics
        )
        curve.sweep = time.perf_counter() - begin if way == summation else curve.sweep
        found[way] = _points(t_end, points, paths, exact, compensated=numerics.compensated)
    curve.points = _until_rounding([_cheaper(*both) for both in zip(found[summation], found["plain"], strict=True)])
    for point in curve.points:
        if isfinite(point.max_energy_error):
            point.calls = prepared_calls(system, tableau, t_end, int(point.steps), way_of(point))
    curve.setup = _setup(system, tableau, t_end)
    return curve


def _points(
    t_end: str,
    points: Sequence[tuple[float, int]],
    paths: Trajectories,
    exact: Reference | None,
    *,
    compensated: bool,
) -> list[Point]:
    found, (q, q_low) = [], paths.ends
    for i, (tau_per_stage, steps) in enumerate(points):
        worst, mean = float(paths.max_energy_error[i]), float(paths.mean_energy_error[i])
        off = np.nan
        if exact is not None:
            off = float(exact.error(q[i], q_low[i])) if isfinite(worst) else inf
        found.append(
            Point(
                tau=float(Fraction(t_end) / steps),
                tau_per_stage=tau_per_stage,
                steps=steps,
                evaluations=int(paths.evaluations[i]),
                compensated=float(compensated),
                max_energy_error=worst,
                mean_energy_error=mean,
                position_error=off,
            )
        )
    return found


def _cheaper(careful: Point, plain: Point) -> Point:
    """Return ``plain`` if it loses nothing, otherwise ``careful``."""
    # A NaN is a position that was compared with nothing.
    lost = any(getattr(plain, name) > LOSSLESS * getattr(careful, name) for name in MEASURES.values())
    return careful if lost else plain


def _until_rounding(points: Sequence[Point]) -> list[Point]:
    """Return the points up to the first where every error is rounding."""
    settled = (
        i for i, p in enumerate(points) if p.max_energy_error <= ROUNDING and not p.position_error > POSITION_ROUNDING
    )
    return list(points[: next(settled, len(points)) + 1])


def way_of(point: Point) -> str:
    """Return the summation of a point: "compensated" or "plain"."""
    return "compensated" if point.compensated else "plain"


def prepared_calls(
    system: System,
    tableau: Tableau,
    t_end: str,
    steps: int,
    summation: str = "compensated",
    modes: Collection[str] = tuple(ENERGIES),
) -> dict[str, Callable[[], Any]]:
    """Return complete calls of a prepared problem, to be timed, each of which returns the final q (d,) and p (d,).

    The interval [0, ``t_end``] is covered in ``steps`` equal steps. ``modes`` are of ``trajectory``, which measures no
    energy, and ``energy``, which measures it at every step. Each call has run once.
    """
    tau = float(t_end) / steps

    def prepared(mode: str) -> Callable[[], Any]:
        problem = Problem(system, tableau, t_end=t_end, summation=summation, energy=ENERGIES[mode])

        def call() -> Any:
            solution = problem(tau)
            return solution.q[-1], solution.p[-1]

        call()
        return call

    return {mode: prepared(mode) for mode in modes}


def ensemble_call(
    system: System, tableau: Tableau, t_end: str, steps: int, summation: str = "compensated"
) -> tuple[Callable[[], Any], int]:
    """Return a call of :func:`nearharmonic.ensemble` on one thread, to be timed, and the number of its members.

    All members begin at the start of the system, so that the error of one is that of all, and so that no member of
    another library's adaptive batch waits for another.
    """
    evaluations = tableau.evaluations(steps)
    most = ENSEMBLE_EVALUATIONS if system.regularisation is None else ONE_BY_ONE_EVALUATIONS
    members = min(max(most // evaluations, FEWEST_MEMBERS), MOST_MEMBERS)
    q0, p0 = (np.repeat(np.array([row]), members, axis=0) for row in system.start(float))

    def call() -> Any:
        found = ensemble(
            system, tableau, float(t_end) / steps, q0=q0, p0=p0, t_end=t_end, energy="none", summation=summation,
            samples=1,
        )  # fmt: skip
        return found.q.values, found.p.values

    call()
    return call, members


def _setup(system: System, tableau: Tableau, t_end: str) -> float:
    """Return the least seconds of a call of a prepared problem for one step: the overhead of Python."""
    call, least = prepared_calls(system, tableau, t_end, 1, "plain", ("trajectory",))["trajectory"], inf
    for _ in range(SETUP_REPEATS):
        begin = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - begin)
    return least
