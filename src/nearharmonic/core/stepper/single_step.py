"""A single step on arrays of the caller, without energy or samples.

It makes the moves of :mod:`nearharmonic.core.loops.advance`, and is bitwise identical to a run of one step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nearharmonic.core.layout import INNER
from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.reals import compiled, linked_number, load_parameters, load_point, store, zero_like
from nearharmonic.core.points import motion, row_loader

_columns = linked_number("columns")


@compiled
def _load_compensated(q, carry_q, p, carry_p):  # type: ignore[no-untyped-def]
    x = load_point(q, 0)
    return x, load_point(carry_q, 0), load_point(p, 0), load_point(carry_p, 0), zero_like(x)


@compiled
def _load_plain(q, carry_q, p, carry_p):  # type: ignore[no-untyped-def]
    x, zero = load_point(q, 0), zero_like(load_point(q, 0))
    return x, zero, load_point(p, 0), zero, zero


@compiled
def _store_compensated(arrays, state):  # type: ignore[no-untyped-def]
    for i in range(4):
        store(arrays[i], 0, state[i])


@compiled
def _store_plain(arrays, state):  # type: ignore[no-untyped-def]
    store(arrays[0], 0, state[0])
    store(arrays[2], 0, state[2])


def step(form: Form) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.STEP`, to be compiled.

    A run computes a force at its start even if it drifts first, and does not use it; a step does not compute it.
    """
    row_of, steps = row_loader(form), motion(form)
    move, closed, first_force, force_behind = steps.move, steps.closed, steps.first, steps.behind
    load, keep = (_load_compensated, _store_compensated) if form.compensated else (_load_plain, _store_plain)
    modified = form.modified

    def step(stages, kick_first, moves, parameters, q, carry_q, p, carry_p):  # type: ignore[no-untyped-def]
        columns, given = _columns(), load_parameters(parameters, 0)
        state = load(q, carry_q, p, carry_p)
        f = zero_like((state[0], state[0]) if modified else state[0])
        if kick_first:
            f = first_force(state, moves, given)
        row = 0
        for i in range(stages):
            state = move(state, row_of(moves, row), f, given)
            f = force_behind(state, moves, row, given)
            row = (INNER + i) * columns
        keep((q, carry_q, p, carry_p), closed(state, row_of(moves, (stages + 1) * columns), f, given))

    return step
