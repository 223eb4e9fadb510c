"""The compiled functions of the search, kept on disk as machine code: numba is loaded only to compile them.

``solve(system, starts, bound, solutions, solved)``: the solution that a damped iteration reaches from each start;
``descend(system, criterion, bound, noise, x)``: a random descent of the criterion along the solutions ``x``, in place;
``assess(system, criterion, x, merits)``: e_N, e_H, A, tau* and J of the solutions ``x``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.core.layout import (
    LEAST_SQUARES,
    Group,
    Signature,
    floats,
    integers,
    least_squares_signature,
    least_squares_workspace,
)
from nearharmonic.core.native import code_key, native

#: Norm of the residuals below which an iteration has solved its equations.
SOLVED = 1e-10

_TABLE = Group("table", (integers("parent", 1), integers("letter", 1)))
#: Of ``criterion.system_of``: coefficients are ``directions`` x + ``offset``, equations are ``weights`` S = ``wanted``.
_SYSTEM = Group(
    "system",
    (
        _TABLE,
        integers("letters", 1),  # (operator,)
        floats("directions", 2),  # (operator, unknown)
        floats("offset", 1),  # (operator,)
        floats("weights", 2),  # (equation, word)
        floats("wanted", 1),  # (equation,)
    ),
)
#: Of :func:`nearharmonic.experiments.sixth_order.criterion.criterion_of`.
_CRITERION = Group(
    "criterion",
    (
        Group("criterion_table", (integers("criterion_parent", 1), integers("criterion_letter", 1))),
        floats("criterion_weights", 2),  # (error, word)
        floats("criterion_wanted", 1),  # (error,)
        integers("places", 2),  # (first letter, length)
    ),
)
_SCRATCH = Group(
    "scratch",
    (
        floats("c", 1),  # (operator,)
        floats("sums", 1),  # (word,)
        floats("slopes", 2),  # (word, unknown)
        floats("criterion_sums", 1),  # (word of the criterion,)
        floats("above", 1),  # (2,)
    ),
)
_BOUND, _X = floats("bound"), floats("x", 2)  # x: (solution, unknown)

#: Arguments of the compiled functions by name.
SIGNATURES = {
    "solve": least_squares_signature(_SYSTEM, _SCRATCH),
    "descend": Signature((_SYSTEM, _CRITERION, _BOUND, floats("noise", 3), _X, LEAST_SQUARES, _SCRATCH)),
    "assess": Signature((_SYSTEM, _CRITERION, _X, floats("merits", 2), _SCRATCH)),
}


class Kernels(NamedTuple):
    """The compiled functions."""

    solve: Callable[..., None]
    descend: Callable[..., None]
    assess: Callable[..., None]


@cache
def kernels() -> Kernels:
    """The compiled functions, from the cache on disk if they are there."""
    solve, descend, assess = (_compiled(name) for name in Kernels._fields)

    def solve_all(system: Any, starts: Any, bound: float, solutions: Any, solved: Any) -> None:
        sizes, rested = np.zeros(len(starts)), np.zeros(len(starts), np.bool_)
        solutions[:] = starts
        solve(system, solutions, bound, sizes, rested, _least_squares(system), _scratch(system, 0))
        solved[:] = (sizes < SOLVED) & (np.abs(solutions).max(axis=1) <= bound)

    def descend_all(system: Any, criterion: Any, bound: float, noise: Any, x: Any) -> None:
        scratch = _scratch(system, criterion[1].shape[1])
        descend(system, criterion, bound, noise, x, _least_squares(system), scratch)

    def assess_all(system: Any, criterion: Any, x: Any, merits: Any) -> None:
        assess(system, criterion, x, merits, _scratch(system, criterion[1].shape[1]))

    return Kernels(solve_all, descend_all, assess_all)


def key() -> str:
    """Digest of the text of the functions, and of the modules that it takes constants from."""
    modules = ("kernels", "compiled_text", "criterion", "conditions")
    return code_key(sources=[Path(__file__).with_name(f"{module}.py") for module in modules])


def _compiled(name: str) -> Callable[..., None]:
    def make() -> tuple[str, bytes]:
        from nearharmonic.core.compile import machine_code
        from nearharmonic.experiments.sixth_order import compiled_text

        return machine_code(getattr(compiled_text, name), SIGNATURES[name])

    return native(f"{name}-{key()}", SIGNATURES[name], make)


def _least_squares(system: Any) -> tuple[Any, ...]:
    _, _, directions, _, _, wanted = system
    return least_squares_workspace(len(wanted), directions.shape[1])


def _scratch(system: Any, criterion_words: int) -> tuple[Any, ...]:
    (parent, _), _, directions, offset, _, _ = system
    shapes = (len(offset), len(parent), (len(parent), directions.shape[1]), criterion_words, 2)
    return tuple(np.zeros(shape) for shape in shapes)
