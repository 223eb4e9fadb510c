"""Which method to take for an error: from the timings of a finished run, or measured on the spot."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from types import ModuleType

from nearharmonic.curve import MEASURES, Crossing, Curve, Point, ranking
from nearharmonic.errors import NearharmonicError, SystemDefinitionError
from nearharmonic.integrators import integrators
from nearharmonic.settings import checked_tau, one_of
from nearharmonic.systems import System, systems
from nearharmonic.tableau import Tableau
from nearharmonic.time_to_error import NAMES, count, milliseconds

CUBE = Path("cubes/work_precision.h5")
RESULTS = "results/paper"

#: On the spot: enough points to read a curve off, few enough to take seconds.
POINTS_PER_DECADE = 6
EVALUATIONS = 200_000
#: The coarsest step per stage that is tried, in parts of the interval; the rest follows from EVALUATIONS.
COARSEST = 1 / 20
TIMED = ("trajectory",)


@dataclass(frozen=True, kw_only=True)
class Recommendation:
    """Methods by time to reach ``error`` in ``measure`` on ``system`` over [0, t_end], and ``basis``: whence."""

    system: System
    t_end: str
    measure: str
    error: float
    order: tuple[tuple[Curve, Crossing], ...]
    basis: str


def recommend(system: str, error: object, *, measure: object = "max", results: str | Path = RESULTS) -> Recommendation:
    """Rank every method for ``error`` on ``system``: a name, or the path of a Python file that defines SYSTEM.

    A named system is read from the timings under ``results`` if they are there; else, and for a file, each method is
    measured here and now.

    Raises:
        NearharmonicError: an unknown system or measure, an error that is no number above 0, a file that does not
            define a system, an unusable file of timings.
    """
    wanted = checked_tau(error, "error")
    kind = one_of("measure", measure, tuple(MEASURES))
    own = system.endswith(".py") or "/" in system
    subject = load_system(Path(system)) if own else systems[system]
    found = None if own else _from_cube(subject, kind, Path(results) / CUBE)
    curves, t_end, basis = found or _on_the_spot(subject, kind, own, Path(results) / CUBE)
    order = tuple(ranking(curves, kind, wanted))
    return Recommendation(system=subject, t_end=t_end, measure=kind, error=wanted, order=order, basis=basis)


def load_system(path: Path) -> System:
    """The ``SYSTEM`` that the Python file ``path`` defines.

    Raises:
        SystemDefinitionError: there is no such file, it cannot be run, or it defines no System of that name.
    """
    if not path.is_file():
        message = f"{path}: no such file. A system of your own is a Python file that defines SYSTEM"
        raise SystemDefinitionError(message)
    spec = importlib.util.spec_from_file_location(f"nearharmonic_user_{path.stem}", path)
    if spec is None or spec.loader is None:
        message = f"{path} is no Python file: its name must end in .py"
        raise SystemDefinitionError(message)
    module: ModuleType = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except NearharmonicError:
        raise
    except Exception as error:
        message = f"{path} cannot be run: {type(error).__name__}: {error}"
        raise SystemDefinitionError(message) from error
    found = getattr(module, "SYSTEM", None)
    if not isinstance(found, System):
        message = f"{path} does not define SYSTEM, a nearharmonic.systems.System; it has {found!r}"
        raise SystemDefinitionError(message)
    return found


Found = tuple[list[Curve], str, str]


def _from_cube(system: System, measure: str, path: Path) -> Found | None:
    """Curves, end of the interval and basis from the file of timings; None if it has nothing for ``system``."""
    if not path.is_file():
        return None
    from nearharmonic.work_precision import read_parts

    parts, facts = read_parts(path, system.name)
    for t_end, measures, curves in parts:
        if measure in measures:
            return list(curves), t_end, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return None


def _on_the_spot(system: System, measure: str, own: bool, path: Path) -> Found:
    """Curves of every integrator, timed now; no peers, which take minutes."""
    from nearharmonic.reference import position_t_end, reference
    from nearharmonic.splitting_curves import grid, splitting_curve, warm_up
    from nearharmonic.timing import machine, pinned
    from nearharmonic.work_precision import clock

    t_end = position_t_end(system, system.t_end) if measure == "position" else system.t_end
    exact = reference(system, t_end) if measure == "position" else None
    length = float(t_end)
    with pinned() as core:
        warm_up(system, modes=TIMED)
        curves = []
        for tableau in integrators.values():
            points = grid(tableau, t_end, length / EVALUATIONS, length * COARSEST, POINTS_PER_DECADE, EVALUATIONS)
            curves.append(splitting_curve(system, tableau, t_end, points, exact, modes=TIMED))
        clock(curves, TIMED)
        facts = machine(core)
    why = "a system of your own" if own else f"{path} has no timings of it; snakemake work_precision makes them"
    basis = (
        f"measured on the spot ({why}), {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; "
        f"up to {EVALUATIONS} evaluations a run; peers not timed"
    )
    return curves, t_end, basis


def lines(found: Recommendation) -> Iterator[str]:
    """``found`` as text, a line at a time."""
    unit = found.system.units["t"]
    yield f"{found.system.label}, t = {found.t_end} {unit if unit != '1' else ''}".rstrip() + (
        f": {NAMES[found.measure]} <= {found.error:g}"
    )
    reached = [(curve, crossing) for curve, crossing in found.order if isfinite(crossing.time)]
    if reached:
        head = ("", "method", "tau", "evaluations", "ms", "ratio")
        yield from _aligned(
            [head, *(_cells(i, *pair, reached[0][1]) for i, pair in enumerate(reached, start=1))], numbers=(2, 3, 4, 5)
        )
    else:
        yield "  no method reaches this error in the range that was run"
    absent = [(curve, crossing) for curve, crossing in found.order if not isfinite(crossing.time)]
    if absent:
        yield f"not reached: {'; '.join(_absent(curve, found.measure) for curve, _ in absent)}"
    if any(curve.kind == "peer" for curve, _ in reached):
        yield "* another library, as its users use it"
    yield f"Time is that of one trajectory on one core, without start-up. Based on: {found.basis}"


def _cells(rank: int, curve: Curve, crossing: Crossing, best: Crossing) -> tuple[str, ...]:
    setting = f"{crossing.tau:.4g}" if isfinite(crossing.tau) else f"tolerance {crossing.tolerance:.1g}"
    name = curve.label + ("*" if curve.kind == "peer" else "")
    ratio = f"{crossing.time / best.time:.2f}"
    return f"{rank}.", name, setting, count(crossing.evaluations), milliseconds(crossing), ratio


def _absent(curve: Curve, measure: str) -> str:
    if curve.points:
        least = min(_error(point, measure) for point in curve.points)
        return f"{curve.label} ({least:.1e} at best" + (")" if curve.status == "ok" else f"; {curve.status})")
    return f"{curve.label} ({curve.status})"


def _error(point: Point, measure: str) -> float:
    return float(getattr(point, MEASURES[measure]))


def _aligned(table: Sequence[Sequence[str]], numbers: Collection[int]) -> Iterator[str]:
    """Columns as wide as their widest cell; those among ``numbers`` to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        cells = [
            cell.rjust(width) if i in numbers else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  " + "  ".join(cells).rstrip()


def registry_lines(kind: str) -> Iterator[str]:
    """Names and descriptions of the ``integrators`` or ``systems``, one a line."""
    if kind == "integrators":
        head = ("name", "label", "stages", "order", "first", "source")
        rows = [(t.name, t.label, str(t.stages), str(t.order), str(t.first), _needs(t)) for t in integrators.values()]
    else:
        head = ("name", "label", "coordinates", "t_end", "unit of t", "source")
        rows = [(s.name, s.label, str(s.dimension), s.t_end, s.units["t"], s.source) for s in systems.values()]
    yield from _aligned([head, *rows], numbers=(2, 3))


def _needs(tableau: Tableau) -> str:
    return f"{tableau.source}; requires a {tableau.requires}" if tableau.requires else tableau.source
