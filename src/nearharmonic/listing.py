"""Text of the command ``nearharmonic``: rankings of methods and the two registries, as aligned columns."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from math import isfinite

from nearharmonic.engine.grid import steps_of
from nearharmonic.experiments.work_precision.recommend.choices import Choice, Recommendation
from nearharmonic.experiments.work_precision.tables import NAMES
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import systems

#: Significant digits of a printed step, unless another number of steps would come of it.
DIGITS = 4


def recommendation_lines(found: Recommendation) -> Iterator[str]:
    """Yield ``found`` as text, a line at a time: a row for each method that meets the bound, then the others."""
    unit = found.system.units["t"]
    yield f"{found.system.label}, t = {found.t_end} {unit if unit != '1' else ''}".rstrip() + (
        f": {NAMES[found.measure]} <= {found.error:g}"
    )
    best = found.ranked
    if best:
        head = ("", "method", "tau", "evaluations", "ms", "ratio", "error")
        rows = [_cells(rank, choice, best[0], found.t_end) for rank, choice in enumerate(best, start=1)]
        yield from _aligned([head, *rows], numbers=(2, 3, 4, 5, 6))
    else:
        yield f"  no method reaches this error within {found.budget} evaluations"
    missed = [choice for choice in found.choices if choice.status == "missed"]
    for kind, limit in (("splitting", f"within {found.budget} evaluations"), ("peer", "at any setting timed")):
        words = [_missed(choice, found) for choice in missed if choice.kind == kind]
        if words:
            yield f"not {limit}: {'; '.join(words)}"
    absent = [f"{choice.label} ({choice.reason})" for choice in found.choices if choice.status == "not run"]
    if absent:
        yield f"not run: {'; '.join(absent)}"
    if any(choice.kind == "peer" for choice in best):
        yield "* another library, as its users use it"
    yield f"Time is that of one trajectory on one core, without start-up. Based on: {found.basis}"


def printed_step(t_end: str, tau: float, steps: int) -> str:
    """Return ``tau`` in the fewest digits, four at least, that give ``steps`` steps over [0, ``t_end``] again."""
    texts = (f"{tau:.{digits}g}" for digits in range(DIGITS, 18))
    return next(text for text in texts if steps_of(t_end, float(text)) == steps)


def _setting(choice: Choice, t_end: str) -> str:
    if not isfinite(choice.tau):
        return f"tolerance {choice.tolerance:.1g}"
    return printed_step(t_end, choice.tau, int(choice.steps)) if isfinite(choice.steps) else f"{choice.tau:.{DIGITS}g}"


def _cells(rank: int, choice: Choice, best: Choice, t_end: str) -> tuple[str, ...]:
    name = choice.label + ("*" if choice.kind == "peer" else "")
    evaluations = f"{choice.evaluations:.0f}" if isfinite(choice.evaluations) else "-"
    ratio = f"{choice.time / best.time:.2f}"
    return (
        f"{rank}.", name, _setting(choice, t_end), evaluations, f"{1e3 * choice.time:.3g}", ratio, f"{choice.error:.1e}"
    )  # fmt: skip


def _missed(choice: Choice, found: Recommendation) -> str:
    """The best that ``choice`` does, in words."""
    if not isfinite(choice.error):
        says = "every run fails"
    else:
        setting = _setting(choice, found.t_end)
        says = f"{choice.error:.1e} at {setting if setting.startswith('tolerance') else f'tau {setting}'}"
        says += ", but not at all finer ones" if choice.error <= found.error else " at best"
    return f"{choice.label} ({says}" + (f"; {choice.reason})" if choice.reason else ")")


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
    """Yield names and descriptions of the ``integrators`` or ``systems``, one a line."""
    if kind == "integrators":
        head = ("name", "label", "stages", "order", "first", "source")
        rows = [(t.name, t.label, str(t.stages), str(t.order), str(t.first), _needs(t)) for t in integrators.values()]
    else:
        head = ("name", "label", "coordinates", "t_end", "unit of t", "source")
        rows = [(s.name, s.label, str(s.dimension), s.t_end, s.units["t"], s.source) for s in systems.values()]
    yield from _aligned([head, *rows], numbers=(2, 3))


def _needs(tableau: Tableau) -> str:
    return f"{tableau.source}; requires a {tableau.requires}" if tableau.requires else tableau.source
