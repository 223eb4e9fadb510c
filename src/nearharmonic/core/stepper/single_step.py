"""A single step on arrays of the caller, without energy or samples.

It makes the moves of :mod:`nearharmonic.core.loops.advance`, and is bitwise identical to a run of one step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nearharmonic.core.layout import INNER
from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.reals import linked_number, load_parameters, load_point, store, zero_like
from nearharmonic.core.points import motion, row_loader

_columns = linked_number("columns")


def step(form: Form) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.STEP`, to be compiled.

    A run computes a force at its start even if it drifts first, and does not use it; a step does not compute it.
    """
    row_of, steps = row_loader(form), motion(form)
    move, closed, first_force, force_behind = steps.move, steps.closed, steps.first, steps.behind
    modified, compensated = form.modified, form.compensated

    def step(stages, kick_first, moves, parameters, q, carry_q, p, carry_p):  # type: ignore[no-untyped-def]
        columns, given = _columns(), load_parameters(parameters, 0)
        x, y = load_point(q, 0), load_point(p, 0)
        low, y_low = zero_like(x), zero_like(y)
        if compensated:
            low, y_low = load_point(carry_q, 0), load_point(carry_p, 0)
        state = x, low, y, y_low, zero_like(x)
        f = zero_like((x, x) if modified else x)
        if kick_first:
            f = first_force(state, moves, given)
        row = 0
        for i in range(stages):
            state = move(state, row_of(moves, row), f, given)
            f = force_behind(state, moves, row, given)
            row = (INNER + i) * columns
        x, low, y, y_low = closed(state, row_of(moves, (stages + 1) * columns), f, given)
        store(q, 0, x)
        store(p, 0, y)
        if compensated:
            store(carry_q, 0, low)
            store(carry_p, 0, y_low)

    return step
