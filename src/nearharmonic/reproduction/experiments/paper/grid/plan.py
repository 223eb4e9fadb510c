"""Plan of the runs for a config: step sizes and precisions, and reasons for omissions. It computes no trajectories."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from math import ceil, floor, log10
from typing import NamedTuple

from nearharmonic.engine.batch.numba_runs import check_precision
from nearharmonic.engine.grid import check_fit, shard, steps_of, tau_grid
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, SharedSettings, Sweep, exact_decimal
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.reproduction.entries import MOST_EVALUATIONS
from nearharmonic.reproduction.experiments.paper.settings import StepSizes
from nearharmonic.systems import System, systems
from nearharmonic.systems.formulas.oscillator import check_oscillator

#: Maximum size of the trajectories in one job in bytes; the job needs about twice this memory.
MOST_BYTES = 4 * 10**8
#: Maximum number of step sizes of one system.
MOST_POINTS = 10**4

#: Rounding floor of max |dH/H0| of a compensated double run: 1e-16 to 1e-15, depending on the method.
DOUBLE_FLOOR = 1e-15
#: Extended precision is used while the double curve is within two decades of its floor.
NEAR_FLOOR = 100


@dataclass(frozen=True, kw_only=True)
class Run(SharedSettings):
    """One method on one system with some step sizes: the work of one call of the integration.

    ``steps[i]`` belongs to ``tau_per_stage[i]``. Step sizes that round to the same number of steps are neighbours and
    share one computation.
    """

    system: str
    integrator: str
    precision: str
    t_end: str
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
    """Raise an error for too many steps, runs or too much memory; keys are named as in a config.

    Raises
    ------
    SettingError
        Too many steps in a run, step sizes in the grid, evaluations in total, or bytes in a job; a method that does not
        fit the system; a system whose oscillators cannot be solved exactly.
    """
    tableaus = [integrators[name] for name in methods]
    check_precision(systems[sweep.system], sweep.precision, f"systems.{sweep.system}.precision")
    if sweep.split == EXACT_OSCILLATOR:
        check_oscillator(systems[sweep.system], f"systems.{sweep.system}.split")
    for tableau in tableaus:
        check_fit(systems[sweep.system], tableau, sweep.split)
    here = f"systems.{sweep.system}.tau_per_stage"
    steps_of(sweep.t_end, sweep.lowest * min(t.stages for t in tableaus), key=f"{here}.lowest", given=sweep.lowest)
    points = _grid_points(sweep.lowest, sweep.highest, sweep.points_per_decade)
    if points > MOST_POINTS:
        allowed = f"the grid would have {points} step sizes, and may have {MOST_POINTS}"
        raise bad_setting(f"{here}.points_per_decade", sweep.points_per_decade, allowed)
    evaluations = sum(t.evaluations(n) for t in tableaus for _, n in _points(sweep, t)) * len(sweep.precision)
    if evaluations > MOST_EVALUATIONS:
        allowed = f"all runs would take {evaluations:.2g} force evaluations, and may take {MOST_EVALUATIONS:.0e}"
        raise bad_setting(f"{here}.lowest", sweep.lowest, allowed)
    size = _bytes(systems[sweep.system], ceil(points / sweep.shards), sweep.samples)
    if size > MOST_BYTES:
        allowed = f"a job would hold {size:.2g} bytes, and may hold {MOST_BYTES:.0e}: add shards"
        raise bad_setting("samples", sweep.samples, allowed)


def _bytes(system: System, points: int, samples: int) -> int:
    """Return the bytes of the trajectories of ``points`` runs: t, q, p, and three numbers of each block."""
    return points * samples * (3 + 2 * system.dimension) * 8


def fewest_shards(system: System, grid: StepSizes, samples: int) -> int:
    """Return the smallest number of files for the runs of one method such that no file is too large."""
    points = _grid_points(grid.lowest, grid.highest, grid.points_per_decade)
    return min(points, ceil(_bytes(system, points, samples) / MOST_BYTES)) if points > 0 else 1


def _grid_points(lowest: float, highest: float, points_per_decade: int) -> int:
    return floor(log10(highest / lowest) * points_per_decade) + 1


def shards_of(sweep: Sweep, integrator: str) -> int:
    """Return the number of files of one method's runs: ``sweep.shards``, or fewer if there are fewer different runs."""
    return min(sweep.shards, len(_distinct(sweep, integrators[integrator])))


def runs_of(sweep: Sweep, integrator: str, index: int) -> list[Run]:
    """Return the runs of shard ``index`` of a method on a system: one for each precision, without empty ones."""
    tableau = integrators[integrator]
    mine = shard(_distinct(sweep, tableau), index, shards_of(sweep, integrator))
    runs = []
    for precision in sweep.precision:
        limit = _extended_up_to(sweep, tableau) if precision == "extended" else sweep.highest
        points = [point for group in mine for point in group if point[0] <= limit]
        if points:
            taus, steps = zip(*points, strict=True)
            runs.append(
                Run(
                    system=sweep.system,
                    integrator=integrator,
                    precision=precision,
                    t_end=sweep.t_end,
                    tau_per_stage=taus,
                    steps=steps,
                    samples=sweep.samples,
                    **sweep.shared_settings,
                )
            )
    return runs


GridPoint = tuple[float, int]


@cache
def _points(sweep: Sweep, tableau: Tableau) -> tuple[GridPoint, ...]:
    """Return (tau_per_stage, steps) over the grid."""
    grid = tau_grid(sweep.lowest, sweep.highest, sweep.points_per_decade)
    t_end = exact_decimal(sweep.t_end)
    return tuple((tau, tableau.steps(tau, t_end)) for tau in grid)


def _distinct(sweep: Sweep, tableau: Tableau) -> list[list[GridPoint]]:
    """Return the groups of grid points that share one computation: those with equal numbers of steps."""
    return [list(group) for _, group in groupby(_points(sweep, tableau), key=lambda point: point[1])]


def _extended_up_to(sweep: Sweep, tableau: Tableau) -> float:
    """Return the largest tau per stage for which extended precision is useful in addition to double, 0 if none is.

    For the harmonic oscillator, split into T and V, the closed form of the energy error determines it. The error
    increases with tau while it is this small, so the limit is found by bisection. For other systems, and without runs
    in double, every step size is run.
    """
    known = systems[sweep.system].harmonic and sweep.split == KINETIC_POTENTIAL
    if not known or "double" not in sweep.precision:
        return sweep.highest
    from nearharmonic.theory.oscillator import harmonic_energy_error

    grid = tau_grid(sweep.lowest, sweep.highest, sweep.points_per_decade)
    near = bisect_left(
        grid, NEAR_FLOOR * DOUBLE_FLOOR, key=lambda tau: float(harmonic_energy_error(tableau, tau * tableau.stages))
    )
    return grid[near - 1] if near else 0.0


def omissions(sweep: Sweep, integrator: str) -> Iterator[Omission]:
    """Yield the omissions among the runs of a method on a system."""
    tableau = integrators[integrator]
    groups = _distinct(sweep, tableau)

    def cost(steps: Iterable[int]) -> int:
        return sum(tableau.evaluations(n) for n in steps)

    for precision in sweep.precision:
        limit = _extended_up_to(sweep, tableau) if precision == "extended" else sweep.highest
        kept = [n for group in groups for tau, n in group[:1] if tau <= limit]
        repeated = [n for group in groups for tau, n in group[1:] if tau <= limit]
        far = [n for group in groups for tau, n in group if tau > limit]
        again = kept if systems[sweep.system].observables else []
        # The force of the last kick of a step is reused by the next step.
        handed_on = [n for n in kept if tableau.first_same_as_last and n > 1]
        for what, reason, runs, evaluations in (
            ("runs of a step size", "it rounds to as many steps as its neighbour", repeated, cost(repeated)),
            ("runs in extended precision", "in double, the error is over 100 times the rounding floor", far, cost(far)),
            ("runs for the perihelion alone", "figures 4 and 5 share one pass", again, cost(again)),
            ("the force that opens a step", "it closed the step before", handed_on, sum(n - 1 for n in handed_on)),
        ):
            if runs:
                yield Omission(sweep.system, integrator, precision, what, reason, len(runs), evaluations)
