"""The one kernel: every tableau, every system, every precision, one trajectory or many in SIMD lanes.

:func:`build` turns a system's formulas into compiled code for one choice of ``precision``, ``summation`` and lane
``width``. The tableau is data (coefficient arrays), so one compilation serves all methods.

Layout of a lane's row block, ``width`` doubles a row: d positions, their d carries, d momenta, their d carries; then
the tally: largest and summed |H - H0| of the block, the sum's carry, the latest H - H0, H0 as a pair, and the largest
|H - H0| allowed. In extended precision the carries are the low halves of double-doubles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from nearharmonic.core.native import core_digest, native
from nearharmonic.core.rules import Physics, Rules, fingerprint

#: Arguments of the compiled functions, a letter and a digit each: see :func:`nearharmonic.core.compile.machine_code`.
ADVANCE = "i0i0b0f1f1f1"
RUN = "i1i2i1f2f0i0i0b0f3f3f3f2f2f2f2i1f1f1f1f1i1i1i1"

__all__ = ["Kernel", "Physics", "build"]


@dataclass(frozen=True)
class Kernel:
    """Compiled code for one system, precision and width, with the layout its arrays must have.

    ``advance()`` compiles the inner kernel by itself, for benchmarks and ensembles that schedule their own lanes:
    ``advance()(count, stages, kick_first, drift, kick, rows) -> steps done``: ``drift`` and ``kick`` are float64
    (stages + 1, parts, width) with the step size multiplied in, ``rows`` float64 (4 d + 7, width), changed in place. It
    returns before ``count`` when a lane's energy error passes its limit.

    ``run(...)``: see :func:`nearharmonic.core.scheduler.lane_scheduler`.
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
    text = f"{core_digest()} {fingerprint(rules)} {extended} {compensated} {width} {every_step}"
    key = sha256(text.encode()).hexdigest()

    def compiled(name: str, arguments: str, result: str) -> Callable[..., Any]:
        def make() -> tuple[str, bytes]:
            from nearharmonic.core import compile

            function = getattr(compile, f"{name}_function")(rules, width, every_step, key)
            return compile.machine_code(function, arguments, result)

        return native(f"{name}-{key}", arguments, result, make)

    return Kernel(
        width=width,
        dimension=physics.dimension,
        parts=rules.parts,
        advance=lambda: compiled("advance", ADVANCE, "i"),
        run=compiled("run", RUN, "v"),
    )
