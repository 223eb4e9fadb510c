"""The one kernel: every tableau, every system, every precision, one trajectory or many in SIMD lanes.

:func:`build` turns a system's formulas into compiled code for one choice of ``precision``, ``summation`` and lane
``width``. The tableau is data (coefficient arrays), so one compilation serves all methods.

Layout of a lane's row block, ``width`` doubles a row: d positions, their d carries, d momenta, their d carries; then
the tally: largest and summed |H - H0| of the block, the sum's carry, the latest H - H0, H0 as a pair, and the largest
|H - H0| allowed. In extended precision the carries are the low halves of double-doubles.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nearharmonic.core.layout import ADVANCE, BEGIN, RUN, workspace
from nearharmonic.core.native import code_key, native
from nearharmonic.core.rules import Physics, Rules, fingerprint

__all__ = ["Kernel", "Physics", "build", "inner"]


@dataclass(frozen=True)
class Kernel:
    """Compiled code for one system, precision and width, with the layout its arrays must have.

    ``advance()`` compiles the inner kernel by itself, for benchmarks and ensembles that schedule their own lanes:
    ``advance()(count, stages, kick_first, drift, kick, rows) -> steps done``: ``drift`` and ``kick`` are float64
    (stages + 1, parts, width) with the step size multiplied in, ``rows`` float64 (4 d + 7, width), changed in place. It
    returns before ``count`` when a lane's energy error passes its limit.

    ``run`` passes a queue of runs through the lanes: its arguments are :data:`nearharmonic.core.layout.RUN` without the
    addresses in front and without the workspace at the end.
    """

    width: int
    dimension: int
    parts: int
    advance: Callable[[], Callable[..., int]]
    run: Callable[..., None]


def build(physics: Physics, *, extended: bool, compensated: bool, width: int, every_step: bool = True) -> Kernel:
    """Load the kernel from the cache, or compile it into the cache; only then is numba loaded.

    ``every_step`` measures the energy at every step; otherwise once at the end of each stretch of steps.
    """
    rules = Rules(physics, extended, compensated)

    def make_begin() -> tuple[str, bytes]:
        from nearharmonic.core import compile

        return compile.machine_code(compile.begin(rules, width), BEGIN)

    def make_run() -> tuple[str, bytes]:
        from nearharmonic.core import compile, scheduler

        return compile.machine_code(scheduler.run, RUN)

    advance = _advance(rules, width, every_step)
    begin = native(f"begin-{_key(rules, width, every_step)}", BEGIN, make_begin)
    run = native(f"run-{code_key()}", RUN, make_run)
    return Kernel(
        width=width,
        dimension=physics.dimension,
        parts=rules.parts,
        advance=lambda: advance,
        run=_in_own_workspace(run, advance, begin, rules.parts, width),
    )


class _Workspaces(threading.local):
    """Work arrays of the calls of one thread, with their addresses: converting them anew takes 10 microseconds."""

    def __init__(self) -> None:
        self.kept: dict[tuple[int, int], tuple[Any, list[Any]]] = {}


def _in_own_workspace(run: Any, advance: Any, begin: Any, parts: int, width: int) -> Callable[..., None]:
    """``run`` without its first and last arguments, which do not change from call to call."""
    workspaces = _Workspaces()

    def call(order: Any, marks: Any, scheme: Any, start: Any, limit: float, look: int, stages: int, *more: Any) -> None:
        shape, kept = (start.shape[1], stages), workspaces.kept
        if shape not in kept:
            arrays = workspace(*shape, parts=parts, width=width)
            kept[shape] = arrays, run.place(*arrays)
        places = advance.address, begin.address
        run(*places, order, marks, scheme, start, limit, look, stages, *more, placed=kept[shape][1])

    return call


def inner(
    physics: Physics, *, extended: bool, compensated: bool, width: int, every_step: bool = True
) -> Callable[..., int]:
    """Load the function that ``advance()`` of :func:`build` gives, and nothing else.

    Parameters
    ----------
    physics : Physics
        The system.
    extended, compensated : bool
        Arithmetic of the state, and of the sums.
    width : int
        Number of SIMD lanes.
    every_step : bool
        Whether the energy is measured at every step.
    """
    advance: Callable[..., int] = _advance(Rules(physics, extended, compensated), width, every_step)
    return advance


def _key(rules: Rules, width: int, every_step: bool) -> str:
    return code_key(fingerprint(rules), f"{rules.extended} {rules.compensated} {width} {every_step}")


def _advance(rules: Rules, width: int, every_step: bool) -> Any:
    def make() -> tuple[str, bytes]:
        from nearharmonic.core import compile

        return compile.machine_code(compile.advance(rules, width, every_step), ADVANCE)

    return native(f"advance-{_key(rules, width, every_step)}", ADVANCE, make)
