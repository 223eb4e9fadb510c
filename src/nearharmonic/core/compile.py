"""Compiled text around the rules of a step: the loop over steps, and machine code of it that outlives the process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import binding
from numba import carray, types

from nearharmonic.core.cache import named, strict
from nearharmonic.core.lanes import Record, record_function, record_loader, record_storer, record_test
from nearharmonic.core.layout import LATEST, LIMIT, TALLY
from nearharmonic.core.native import target_machine
from nearharmonic.core.rules import Rules
from nearharmonic.core.scheduler import lane_scheduler

_SCALARS = {"i": types.int64, "f": types.float64, "b": types.boolean}


def advance_function(rules: Rules, width: int, every_step: bool, key: str) -> Callable[..., Any]:
    """The inner kernel, jitted: see :class:`nearharmonic.core.kernel.Kernel`."""
    return strict(named(_advance(rules, width, every_step), key))


def run_function(rules: Rules, width: int, every_step: bool, key: str) -> Callable[..., Any]:
    """The inner kernel under a queue, jitted: see :func:`nearharmonic.core.scheduler.lane_scheduler`."""
    inner, begin = advance_function(rules, width, every_step, key), strict(named(_begin(rules, width), key))
    return strict(named(lane_scheduler(4 * rules.physics.dimension, width, inner, begin), key))


def machine_code(function: Callable[..., Any], arguments: str, result: str) -> tuple[str, bytes]:
    """Name and object code of a C function that calls the jitted ``function``.

    ``arguments`` describes each argument by a letter for its scalar, i, f or b, and a digit for its dimensions, 0 for
    a scalar; an array arrives as its address and its lengths. ``result`` is a letter, or v for none.
    """
    kinds, names, passed = [], [], []
    for k, (letter, dimensions) in enumerate(zip(arguments[::2], arguments[1::2], strict=True)):
        scalar, lengths = _SCALARS[letter], [f"n{k}_{i}" for i in range(int(dimensions))]
        kinds += [types.CPointer(scalar) if lengths else scalar, *[types.int64] * len(lengths)]
        names += [f"a{k}", *lengths]
        passed.append(f"carray(a{k}, ({', '.join(lengths)},))" if lengths else f"a{k}")
    text = f"def entry({', '.join(names)}):\n    return function({', '.join(passed)})\n"
    scope: dict[str, Any] = {"function": function, "carray": carray}
    exec(text, scope)  # numba reads arities from text
    signature = _SCALARS.get(result, types.void)(*kinds)
    entry = numba.cfunc(signature, error_model="numpy", fastmath=False)(scope["entry"])
    module = binding.parse_assembly(entry.inspect_llvm())
    return entry.native_name, target_machine().emit_object(module)


def _advance(rules: Rules, width: int, every_step: bool) -> Callable[..., Any]:
    d, parts = rules.physics.dimension, rules.parts
    state_type, tally_type = Record(4 * d, width), Record(TALLY, width)
    step_type, rate_type = Record(parts, width), Record(parts * d, width)
    load_state, store_state = record_loader(state_type), record_storer(state_type)
    load_tally, store_tally = record_loader(tally_type), record_storer(tally_type)
    load_step = record_loader(step_type)
    force = record_function(rules.force, rate_type, state_type)
    kick = record_function(rules.kick, state_type, state_type, step_type, rate_type)
    drift = record_function(rules.drift, state_type, state_type, step_type)
    measure = record_function(rules.measure, tally_type, state_type, tally_type)
    left = record_test(lambda tally: tally[LATEST].absolute().any_not_within(tally[LIMIT]), tally_type)
    stride, tally_at = parts * width, 4 * d * width

    def advance(count, stages, kick_first, drifts, kicks, rows):  # type: ignore[no-untyped-def]
        state = load_state(rows, 0)
        tally = load_tally(rows, tally_at)
        shift = 1 if kick_first else 0
        rate = force(state)
        done = 0
        while done < count:
            if kick_first:  # the force is that of the last kick: first same as last
                state = kick(state, load_step(kicks, 0), rate)
            for i in range(stages):
                state = drift(state, load_step(drifts, i * stride))
                rate = force(state)
                state = kick(state, load_step(kicks, (i + shift) * stride), rate)
            if not kick_first:
                state = drift(state, load_step(drifts, stages * stride))
            done += 1
            if every_step:
                tally = measure(state, tally)
                if left(tally):
                    break
        if not every_step:
            tally = measure(state, tally)
        store_state(rows, 0, state)
        store_tally(rows, tally_at, tally)
        return done

    return advance


def _begin(rules: Rules, width: int) -> Callable[..., Any]:
    """Python text of ``begin(rows)``: each lane's tally anew, with the energy of its state as H0."""
    state_type, tally_type = Record(4 * rules.physics.dimension, width), Record(TALLY, width)
    load_state, load_tally = record_loader(state_type), record_loader(tally_type)
    store_tally = record_storer(tally_type)
    fresh = record_function(rules.begin, tally_type, state_type, tally_type)
    tally_at = 4 * rules.physics.dimension * width

    def begin(rows):  # type: ignore[no-untyped-def]
        store_tally(rows, tally_at, fresh(load_state(rows, 0), load_tally(rows, tally_at)))

    return begin
