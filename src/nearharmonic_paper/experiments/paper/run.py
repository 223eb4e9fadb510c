"""Runs of one method on one system: shards, plan, integration, and a table of the runs that the plan leaves out.

:mod:`nearharmonic_paper.experiments.paper.reductions` derives further quantities.
"""

from __future__ import annotations

import os
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.engine import settings
from nearharmonic.engine.kernels import check_precision
from nearharmonic.engine.settings import Sweep
from nearharmonic.errors import NearharmonicError, bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import decades
from nearharmonic.output.store import Contents, Variable, Variables, coordinate, counted, read
from nearharmonic.output.table import Table, from_csv
from nearharmonic.systems import systems
from nearharmonic.systems.gradients import check_oscillator

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.engine.trajectory import Problem


#: Systems of the paper.
PAPER = ("sho", "henon_heiles", "kepler")

# --- Shards: the step sizes of one method on one system, cut into jobs of about equal cost.
#
# A job computes the ends of its own shard only, in closed form, and in decimal arithmetic, so that jobs on unlike
# processors cut a grid at the same places.

#: Seconds of a force evaluation with its share of a step, and of a run apart from its steps. They are rough: only the
#: number of jobs depends on them.
PER_EVALUATION = {"double": Decimal("2e-9"), "extended": Decimal("1.2e-8")}
PER_RUN = Decimal("1e-4")
#: Bytes of the trajectories in one job; the job needs about twice this memory.
MOST_BYTES = 4 * 10**8
#: Run files of one method that the job of the cube reads itself; more are reduced by a job for each method.
REDUCED_AT_ONCE = 10


def suitable_shards(sweep: Sweep, job_seconds: float) -> int:
    """Return the number of shards of a sweep whose jobs take about ``job_seconds``, and hold few enough bytes."""
    points = points_of(sweep)
    shards = max(1, min(points, ceil(_cost(sweep, points) / Decimal(repr(float(job_seconds))))))
    while shards < points and (size := largest_job(replace(sweep, shards=shards))) > MOST_BYTES:
        shards = min(points, ceil(shards * size / MOST_BYTES))
    return shards


def largest_job(sweep: Sweep) -> int:
    """Return the bytes of the trajectories in the last shard: its runs are the shortest, and the most."""
    count = min(sweep.shards, points := points_of(sweep))
    # A run has t, q, p, and three numbers of each block.
    return (points - _cut(sweep, count - 1, count)) * sweep.samples * (3 + 2 * systems[sweep.system].dimension) * 8


def points_of(sweep: Sweep) -> int:
    """Return the number of step sizes of a sweep."""
    return settings.grid_points(sweep.lowest, sweep.highest, sweep.points_per_decade)


def shards_of(sweep: Sweep, integrator: str) -> int:
    """Return the number of files of one method's runs: ``sweep.shards``, or fewer if there are fewer different runs."""
    points = points_of(sweep)
    most, least = (_steps(sweep, integrators[integrator], index) for index in (0, points - 1))
    return min(sweep.shards, points, most - least + 1)


def shard_range(sweep: Sweep, integrator: str, index: int) -> range:
    """Return the step sizes of shard ``index``, by their numbers in the grid.

    Shards are neighbours and cost the same, as nearly as whole runs can. Step sizes with equal numbers of steps, which
    share one computation, share a shard; a shard that would begin and end among them is empty.
    """
    count = shards_of(sweep, integrator)
    begin, end = (_first(sweep, integrators[integrator], _cut(sweep, each, count)) for each in (index, index + 1))
    return range(begin, end)


def _cut(sweep: Sweep, index: int, count: int) -> int:
    """Return the number of the step size at which shard ``index`` of ``count`` begins."""
    share = _cost(sweep, points := points_of(sweep)) * index / count
    # Every shard has a step size, whatever the costs.
    return min(max(bisect_left(range(points), share, key=lambda i: _cost(sweep, i)), index), points - count + index)


def _first(sweep: Sweep, tableau: Tableau, cut: int) -> int:
    """Return the first step size from ``cut`` on that does not share the computation of the one before."""
    if cut == 0:
        return 0
    before = _steps(sweep, tableau, cut - 1)
    return bisect_right(range(points_of(sweep)), -before, lo=cut, key=lambda i: -_steps(sweep, tableau, i))


def _steps(sweep: Sweep, tableau: Tableau, index: int) -> int:
    """Return the steps of a run with step size ``index``."""
    (tau,) = settings.tau_range(sweep.lowest, sweep.points_per_decade, index, index + 1)
    return tableau.steps(tau, settings.exact_decimal(sweep.t_end))


@cache
def _cost(sweep: Sweep, count: int) -> Decimal:
    """Return the estimated seconds of the first ``count`` runs; extended precision may leave out the cheapest."""
    runs, evaluations = PER_RUN * count, _evaluations(sweep, count)
    return sum((PER_EVALUATION[each] * evaluations + runs for each in sweep.precision), Decimal(0))


def _evaluations(sweep: Sweep, count: int) -> Decimal:
    """Return about how many force evaluations one method takes with the ``count`` smallest step sizes.

    A run of a method of s stages takes t_end / (tau / s); runs with neighbouring step sizes have a fixed ratio.
    """
    (ratio,) = decades(1.0, -sweep.points_per_decade, 1, 2)
    (left,) = decades(1.0, -sweep.points_per_decade, count, count + 1)
    return Decimal(sweep.t_end) / Decimal(repr(sweep.lowest)) * (1 - left) / (1 - ratio)


# --- Plan of the runs for a config: step sizes and precisions, and reasons for omissions. It computes no trajectories.

#: Maximum number of step sizes of one method on one system: a million intervals.
MOST_POINTS = 10**6 + 1
#: Maximum number of force evaluations of all methods on one system: days of one core.
MOST_EVALUATIONS = 10**14

#: Rounding floor of max |dH/H0| of a compensated double run: 1e-16 to 1e-15, depending on the method.
DOUBLE_FLOOR = 1e-15
#: Extended precision is used while the double curve is within two decades of its floor.
NEAR_FLOOR = 100


@dataclass(frozen=True)
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
    if sweep.split == settings.EXACT_OSCILLATOR:
        check_oscillator(systems[sweep.system], f"systems.{sweep.system}.split")
    for tableau in tableaus:
        settings.check_fit(systems[sweep.system], tableau, sweep.split)
    here, lowest = f"systems.{sweep.system}.tau_per_stage", sweep.lowest
    settings.steps_of(sweep.t_end, lowest * min(t.stages for t in tableaus), key=f"{here}.lowest", given=lowest)
    if (points := points_of(sweep)) > MOST_POINTS:
        allowed = f"the grid would have {points} step sizes, and may have {MOST_POINTS}"
        raise bad_setting(f"{here}.points_per_decade", sweep.points_per_decade, allowed)
    evaluations = _evaluations(sweep, points) * len(methods) * len(sweep.precision)
    if evaluations > MOST_EVALUATIONS:
        allowed = f"all runs would take {evaluations:.2g} force evaluations, and may take {MOST_EVALUATIONS:.0e}"
        raise bad_setting(f"{here}.lowest", lowest, allowed)
    if (size := largest_job(sweep)) > MOST_BYTES:
        allowed = f"a job would hold {size:.2g} bytes, and may hold {MOST_BYTES:.0e}: add shards, or keep samples: 0"
        raise bad_setting("samples", sweep.samples, allowed)


def runs_of(sweep: Sweep, integrator: str, index: int) -> list[Run]:
    """Return the runs of shard ``index`` of a method on a system: one for each precision, without empty ones."""
    tableau, mine, runs = integrators[integrator], shard_range(sweep, integrator, index), []
    for precision in sweep.precision:
        end = min(mine.stop, _extended_points(sweep, tableau)) if precision == "extended" else mine.stop
        taus = settings.tau_range(sweep.lowest, sweep.points_per_decade, mine.start, end)
        if taus:
            steps = tuple(settings.steps_over(np.array(taus), sweep.t_end, tableau).tolist())
            runs.append(Run(sweep, integrator, precision, taus, steps, sweep.samples))
    return runs


def _extended_points(sweep: Sweep, tableau: Tableau) -> int:
    """Return the number of step sizes, from the smallest, that are run in extended precision in addition to double.

    For the harmonic oscillator, split into T and V, the closed form of the energy error determines it. The error
    increases with tau while it is this small, so the limit is found by bisection. For other systems, and without runs
    in double, every step size is run.
    """
    points = points_of(sweep)
    in_parts = sweep.split == settings.KINETIC_POTENTIAL
    if not (systems[sweep.system].harmonic and in_parts and "double" in sweep.precision):
        return points
    from nearharmonic.theory.oscillator import harmonic_energy_error

    def error(i: int) -> float:
        (tau,) = settings.tau_range(sweep.lowest, sweep.points_per_decade, i, i + 1)
        return float(harmonic_energy_error(tableau, tau * tableau.stages))

    return bisect_left(range(points), NEAR_FLOOR * DOUBLE_FLOOR, key=error)


def omissions(sweep: Sweep, integrator: str) -> Iterator[Omission]:
    """Yield the omissions among the runs of a method on a system, and the precisions that the config leaves out."""
    tableau = integrators[integrator]
    grid = np.array(settings.tau_grid(sweep.lowest, sweep.highest, sweep.points_per_decade))
    steps = settings.steps_over(grid, sweep.t_end, tableau)
    shared = np.diff(steps, prepend=0) == 0
    for precision in settings.PRECISIONS:
        if precision not in sweep.precision:
            what, every = f"runs in {precision} precision", int(tableau.evaluations(steps).sum())
            yield Omission(sweep.system, integrator, precision, what, NOT_ASKED, grid.size, every)
            continue
        run = np.arange(grid.size) < (_extended_points(sweep, tableau) if precision == "extended" else grid.size)
        kept, repeated, far = steps[run & ~shared], steps[run & shared], steps[~run]
        again = kept if systems[sweep.system].observables else kept[:0]
        # The force of the last kick of a step is reused by the next step.
        handed_on = kept[kept > 1] if tableau.first_same_as_last else kept[:0]
        for what, reason, runs, saved in (
            ("runs with as many steps as their neighbour", "each number of steps is run once", repeated, None),
            ("runs in extended precision", "in double, the error is over 100 times the rounding floor", far, None),
            ("runs for the perihelion alone", "figures 4 and 5 share one pass", again, None),
            ("first force of a step", "reused from the step before", handed_on, (handed_on - 1).sum()),
        ):
            if runs.size:
                evaluations = int(tableau.evaluations(runs).sum() if saved is None else saved)
                yield Omission(sweep.system, integrator, precision, what, reason, runs.size, evaluations)


# --- Omitted runs, with reasons and saved force evaluations: as CSV, and in one line.

#: Entry for system, integrator and precision in the rows of totals.
ALL = "all"
#: The rows of totals, by their ``what``.
DONE, FULL, SAVED = "done", "full grid", "saved"
FULL_GRID = "every step size in double and extended, each observable in a pass of its own, no early stop"
NOT_ASKED = "the config does not ask for this precision"


def skipped(sweeps: Sequence[Sweep], methods: Sequence[str], cubes: Mapping[str, xr.Dataset]) -> list[Omission]:
    """Return the omissions of the plan, and of runs in ``cubes`` (by system) that ended early."""
    planned = (row for sweep in sweeps for name in methods for row in omissions(sweep, name))
    ended = (row for system, cube in cubes.items() for row in _ended_early(system, cube))
    return [*sorted(planned, key=lambda row: row.reason == NOT_ASKED), *ended]


def totals(rows: Sequence[Omission], cubes: Mapping[str, xr.Dataset]) -> list[Omission]:
    """Return totals over all systems: work done, work of the full grid, and savings by reason, largest first.

    The full grid is every step size in both precisions to the end of its interval. It also counts work that the actual
    runs share: the second pass over Kepler orbits, and forces that a step takes over from the previous one.
    """
    done = [_distinct(cube).evaluations for cube in cubes.values()]
    count, made = sum(map(len, done)), sum(int(evaluations.sum()) for evaluations in done)
    saved: dict[str, tuple[int, int]] = {}
    for row in rows:
        because = f"{row.what}: {row.reason}"
        runs, evaluations = saved.get(because, (0, 0))
        saved[because] = runs + row.runs, evaluations + row.evaluations
    planned = count + sum(row.runs for row in rows if row.what.startswith("runs "))
    every = (FULL, FULL_GRID, planned, made + sum(row.evaluations for row in rows))
    each = [(SAVED, reason, *counts) for reason, counts in sorted(saved.items(), key=lambda entry: -entry[1][1])]
    return [Omission(ALL, ALL, ALL, *row) for row in ((DONE, "", count, made), every, *each)]


class Totals(NamedTuple):
    """Totals of the table: ``runs``, and evaluations ``done``, of the ``full`` grid, and ``saved`` by reason."""

    runs: int
    done: int
    full: int
    saved: dict[str, int]


def totals_in(text: str) -> Totals:
    """Return the totals of the table whose CSV is ``text``; a NearharmonicError says that it lacks one."""
    try:
        rows = {(row["what"], row["reason"]): row for row in from_csv(text).records() if row["system"] == ALL}
        done, full = rows[DONE, ""], rows[FULL, FULL_GRID]
        saved = {reason: int(row["evaluations"]) for (what, reason), row in rows.items() if what == SAVED}
        return Totals(int(done["runs"]), int(done["evaluations"]), int(full["evaluations"]), saved)
    except (NearharmonicError, KeyError, ValueError) as error:
        raise NearharmonicError("the table of what was skipped holds no totals") from error


def summary_line(path: str | os.PathLike[str]) -> str:
    """Return the totals of the table at ``path`` in one line."""
    _, done, full, _ = totals_in(Path(path).read_text(encoding="utf-8"))
    unit, word = (1e9, "billion") if full > 9.99e8 else (1e6, "million")
    return f"Computed {done / unit:.3g} of {full / unit:.3g} {word} force evaluations; the rest cannot change a result"


def omissions_table(sweeps: Sequence[Sweep], integrators: Sequence[str], **cubes: str) -> dict[str, Table]:
    """Return the ``table`` of omissions, then totals over all systems, from the file of the cube of each system."""
    opened = {system: read(path) for system, path in cubes.items()}
    rows = skipped(sweeps, integrators, opened)
    caption = "Omitted runs, the reason, and the number of force evaluations saved."
    return {"table": Table(header=Omission._fields, rows=[*rows, *totals(rows, opened)], caption=caption)}


def _ended_early(system: str, cube: xr.Dataset) -> Iterator[Omission]:
    """Yield one row for each integrator and precision with diverged runs."""
    runs, what, reason = _distinct(cube), "the rest of a run", "it left its energy surface"
    for (precision, name), left in runs[runs.status == "diverged"].groupby(["precision", "integrator"], sort=False):
        saved = integrators[name].evaluations(left.steps.to_numpy()).sum() - left.evaluations.sum()
        yield Omission(system, name, precision, what, reason, len(left), int(saved))


def _distinct(cube: xr.Dataset) -> Any:
    """Return the runs of a cube as a table of pandas, one row for equal numbers of steps."""
    every = cube[["steps", "evaluations", "status"]].to_dataframe(["precision", "integrator", "tau_per_stage"])
    return every[every.status != "skipped"].reset_index().drop_duplicates(["precision", "integrator", "steps"])


# --- Integration of a shard, and the variables of its file.

#: Auxiliary coordinates of a run file.
COORDINATES = ("t",)
#: Function that returns variables of runs; and one that takes runs from an earlier plan and the others from the first.
Integration = Callable[[Run], Variables]
Completion = Callable[[Run, Integration], Variables]


def integrate(
    sweep: Sweep, integrator: str, shard: int, earlier: Completion | None = None, function: Integration | None = None
) -> dict[str, Contents]:
    """Integrate one shard, numbered from 0, of the step sizes of a method on a system, as the contents ``run``.

    Runs in double precision are in the root of a file, those in extended precision in a group. If there are runs in
    double precision, the group has their step sizes and samples, so that ``xarray.open_datatree`` opens both; runs that
    the plan omits have the status "skipped". ``earlier`` takes runs over from the files of an earlier config, and
    ``function``, by default :func:`integrate_run`, makes the others.
    """
    from nearharmonic.engine.description import kernel_in_words

    made, planned = function or integrate_run, runs_of(sweep, integrator, shard)
    problems = {run.precision: problem_of(run) for run in planned}
    parts = {run.precision: earlier(run, made) if earlier else made(run) for run in planned}
    attributes: dict[str, object] = {
        "system": sweep.system, "integrator": integrator, "precision": " ".join(parts),
        "kernel": "; ".join(map(kernel_in_words, problems.values())),
    }  # fmt: skip
    attributes |= {} if not problems else next(iter(problems.values())).standard_floor()
    count = sum(map(_evaluations_made, parts.values()))
    root = parts.pop("double", {})
    groups = {name: _padded(part, root) if root else part for name, part in parts.items()}
    run = Contents(variables=root, attributes=attributes, coordinates=COORDINATES, groups=groups, evaluations=count)
    return {"run": run}


def _load_kernels(sweep: Sweep, **_: object) -> None:
    from nearharmonic.engine.trajectory import warm_up

    warm_up(sweep.system, sweep.precision)


integrate.prepare = _load_kernels  # type: ignore[attr-defined]  # FrozenJob calls it


def _evaluations_made(variables: Variables) -> int:
    """Return the force evaluations of runs; step sizes with equal numbers of steps share a run."""
    _, first = np.unique(variables["steps"][1], return_index=True)
    return int(np.asarray(variables["evaluations"][1])[first].sum())


def integrate_run(run: Run) -> Variables:
    """Return trajectories over (tau_per_stage, sample, component), blocks over the first two, and counts of runs.

    ``block_max_energy_error`` and ``block_mean_energy_error`` cover the ``block_steps`` steps since the previous
    sample, so that they determine maximum and mean over all steps.
    """
    from nearharmonic.engine.description import sampled

    problem = problem_of(run)
    grid = coordinate("tau_per_stage", run.tau_per_stage, "step size per stage", problem.system.units["t"])
    variables = grid | sampled(problem, run.steps, run.samples)
    return variables | counted(variables)


def problem_of(run: Run) -> Problem:
    """Return the system, method and settings of planned runs."""
    from nearharmonic.engine.trajectory import Problem

    sweep = run.sweep
    system = systems[sweep.system]
    return Problem(system, run.integrator, t_end=sweep.t_end, precision=run.precision, **sweep.shared_settings)


def _padded(part: Variables, whole: Mapping[str, Variable]) -> Variables:
    """Return the runs of ``part``, padded to all step sizes and samples of ``whole``."""
    taus, own = (np.asarray(one["tau_per_stage"][1]) for one in (whole, part))
    rows = np.searchsorted(taus, own).tolist()
    return gathered([(part, rows, range(own.size))], taus, len(whole["sample"][1]) if "sample" in whole else 0)


def gathered(pieces: Sequence[tuple[Variables, Sequence[int], Sequence[int]]], taus: Any, samples: int) -> Variables:
    """Return the variables of runs with step sizes ``taus``, from ``pieces``: variables, rows to fill, and their rows.

    Runs of fewer samples are padded, and rows of no piece are vacant: NaN, 0 or the status "skipped".
    """
    found: Variables = {}
    sizes = {"tau_per_stage": len(taus), "sample": samples}
    for name, (dims, values, notes) in pieces[0][0].items():
        filled = values
        if name == "tau_per_stage":
            filled = np.array(taus)
        elif name == "sample":
            filled = np.arange(samples, dtype=values.dtype)
        elif "tau_per_stage" in dims:
            vacant = "skipped" if name == "status" else np.nan if values.dtype.kind == "f" else 0
            shape = [sizes.get(dim, size) for dim, size in zip(dims, values.shape, strict=True)]
            filled = np.full(shape, vacant, values.dtype)
            for variables, rows, theirs in pieces:
                taken = variables[name][1][list(theirs)]
                if "sample" in dims:
                    taken = taken[:, :samples]
                    filled[list(rows), : taken.shape[1]] = taken
                else:
                    filled[list(rows)] = taken
        found[name] = dims, filled, notes
    return found
