"""Plan of the runs for a config: step sizes and precisions, and reasons for omissions. It computes no trajectories."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nearharmonic.engine.kernels import check_precision
from nearharmonic.engine.settings import (
    EXACT_OSCILLATOR,
    KINETIC_POTENTIAL,
    Sweep,
    check_fit,
    exact_decimal,
    steps_of,
    steps_over,
    tau_grid,
    tau_range,
)
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import systems
from nearharmonic.systems.gradients import check_oscillator
from nearharmonic_paper.experiments.paper.grid.shards import MOST_BYTES, largest_job, points_of, shard_range

#: Maximum number of step sizes of one method on one system: a million intervals.
MOST_POINTS = 10**6 + 1
#: Maximum number of force evaluations of all methods on one system: days of one core.
MOST_EVALUATIONS = 10**14

#: Rounding floor of max |dH/H0| of a compensated double run: 1e-16 to 1e-15, depending on the method.
DOUBLE_FLOOR = 1e-15
#: Extended precision is used while the double curve is within two decades of its floor.
NEAR_FLOOR = 100


@dataclass(frozen=True, kw_only=True)
class Run:
    """One method with some step sizes of a sweep, in one precision: the work of one call of the integration.

    ``steps[i]`` belongs to ``tau_per_stage[i]``. Step sizes that round to the same number of steps are neighbours and
    share one computation.
    """

    sweep: Sweep
    integrator: str
    precision: str
    tau_per_stage: tuple[float, ...]
    steps: tuple[int, ...]
    samples: int


class Omission(NamedTuple):
    """Omitted work, the reason, and the number of ``runs`` and force ``evaluations`` saved."""

    system: str
    integrator: str
    precision: str
    what: str
    reason: str
    runs: int
    evaluations: int


def check_sweep(sweep: Sweep, methods: Sequence[str]) -> None:
    """Raise a SettingError, which names keys as in a config, for a sweep that cannot be run.

    Reasons are too many steps in a run, step sizes in the grid, evaluations in total, or bytes in a job; a method that
    does not fit the system; a system whose oscillators cannot be solved exactly.
    """
    tableaus = [integrators[name] for name in methods]
    check_precision(systems[sweep.system], sweep.precision, f"systems.{sweep.system}.precision")
    if sweep.split == EXACT_OSCILLATOR:
        check_oscillator(systems[sweep.system], f"systems.{sweep.system}.split")
    for tableau in tableaus:
        check_fit(systems[sweep.system], tableau, sweep.split)
    here = f"systems.{sweep.system}.tau_per_stage"
    steps_of(sweep.t_end, sweep.lowest * min(t.stages for t in tableaus), key=f"{here}.lowest", given=sweep.lowest)
    points = points_of(sweep)
    if points > MOST_POINTS:
        allowed = f"the grid would have {points} step sizes, and may have {MOST_POINTS}"
        raise bad_setting(f"{here}.points_per_decade", sweep.points_per_decade, allowed)
    evaluations = _evaluations(sweep) * len(methods) * len(sweep.precision)
    if evaluations > MOST_EVALUATIONS:
        allowed = f"all runs would take {evaluations:.2g} force evaluations, and may take {MOST_EVALUATIONS:.0e}"
        raise bad_setting(f"{here}.lowest", sweep.lowest, allowed)
    size = largest_job(sweep)
    if size > MOST_BYTES:
        allowed = f"a job would hold {size:.2g} bytes, and may hold {MOST_BYTES:.0e}: add shards, or keep samples: 0"
        raise bad_setting("samples", sweep.samples, allowed)


def _evaluations(sweep: Sweep) -> float:
    """Return about how many force evaluations the runs of one method in one precision take."""
    ratio = 10 ** (-1 / sweep.points_per_decade)
    return float(exact_decimal(sweep.t_end)) / sweep.lowest * (1 - ratio ** points_of(sweep)) / (1 - ratio)


def runs_of(sweep: Sweep, integrator: str, index: int) -> list[Run]:
    """Return the runs of shard ``index`` of a method on a system: one for each precision, without empty ones."""
    mine = shard_range(sweep, integrator, index)
    runs = (_run(sweep, integrator, precision, mine) for precision in sweep.precision)
    return [run for run in runs if run.steps]


def _run(sweep: Sweep, integrator: str, precision: str, among: range) -> Run:
    """Return the runs in one precision with the step sizes ``among`` those of the grid."""
    tableau = integrators[integrator]
    end = min(among.stop, _extended_points(sweep, tableau)) if precision == "extended" else among.stop
    taus = tau_range(sweep.lowest, sweep.points_per_decade, among.start, end)
    steps = steps_over(np.array(taus), sweep.t_end, tableau).tolist()
    return Run(
        sweep=sweep, integrator=integrator, precision=precision, tau_per_stage=taus, steps=tuple(steps),
        samples=sweep.samples,
    )  # fmt: skip


def _extended_points(sweep: Sweep, tableau: Tableau) -> int:
    """Return the number of step sizes, from the smallest, that are run in extended precision in addition to double.

    For the harmonic oscillator, split into T and V, the closed form of the energy error determines it. The error
    increases with tau while it is this small, so the limit is found by bisection. For other systems, and without runs
    in double, every step size is run.
    """
    points = points_of(sweep)
    known = systems[sweep.system].harmonic and sweep.split == KINETIC_POTENTIAL
    if not known or "double" not in sweep.precision:
        return points
    from nearharmonic.theory.oscillator import harmonic_energy_error

    def error(i: int) -> float:
        (tau,) = tau_range(sweep.lowest, sweep.points_per_decade, i, i + 1)
        return float(harmonic_energy_error(tableau, tau * tableau.stages))

    return bisect_left(range(points), NEAR_FLOOR * DOUBLE_FLOOR, key=error)


def omissions(sweep: Sweep, integrator: str) -> Iterator[Omission]:
    """Yield the omissions among the runs of a method on a system."""
    tableau = integrators[integrator]
    grid = np.array(tau_grid(sweep.lowest, sweep.highest, sweep.points_per_decade))
    steps = steps_over(grid, sweep.t_end, tableau)
    shared = np.diff(steps, prepend=0) == 0
    for precision in sweep.precision:
        run = np.arange(grid.size) < (_extended_points(sweep, tableau) if precision == "extended" else grid.size)
        kept, repeated, far = steps[run & ~shared], steps[run & shared], steps[~run]
        again = kept if systems[sweep.system].observables else kept[:0]
        # The force of the last kick of a step is reused by the next step.
        handed_on = kept[kept > 1] if tableau.first_same_as_last else kept[:0]
        for what, reason, runs, evaluations in (
            ("runs of a step size", "it rounds to as many steps as its neighbour", repeated, None),
            ("runs in extended precision", "in double, the error is over 100 times the rounding floor", far, None),
            ("runs for the perihelion alone", "figures 4 and 5 share one pass", again, None),
            (
                "the force that opens a step",
                "it closed the step before",
                handed_on,
                int(handed_on.sum()) - handed_on.size,
            ),
        ):
            if runs.size:
                saved = int(tableau.evaluations(runs).sum()) if evaluations is None else evaluations
                yield Omission(sweep.system, integrator, precision, what, reason, runs.size, saved)
