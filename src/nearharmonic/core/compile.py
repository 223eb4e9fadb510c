"""Compilation by numba: the flags that all compiled text shares, and C functions made of it and called by it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from nearharmonic.core.lanes import (
    Record,
    record_function,
    record_loader,
    record_storer,
    record_test,
)
from nearharmonic.core.layout import LATEST, LIMIT, TALLY, Argument, Group, Scalar, Signature, parameter_rows
from nearharmonic.core.native import target_machine
from nearharmonic.core.rules import Rules, tallied, uncertain

_TYPES: dict[Scalar, Any] = {"int64": types.int64, "float64": types.float64, "bool": types.boolean}


def strict(py_func: Callable[..., Any]) -> Callable[..., Any]:
    """``py_func`` jitted with the flags of every kernel, compiled at its first use.

    ``error_model="numpy"`` because the check for division by zero blocks SIMD; no fastmath, which deletes the carry of
    compensated summation; no runtime of numba's own, which counts references to arrays: the text allocates nothing, so
    machine code needs nothing of numba.
    """
    return numba.njit(error_model="numpy", fastmath=False, nogil=True, _nrt=False)(py_func)  # type: ignore[no-any-return]


def inlined(py_func: Callable[..., Any]) -> Callable[..., Any]:
    """The same for a function with one caller, of which it becomes a part: it takes no compilation of its own."""
    made = numba.njit(error_model="numpy", fastmath=False, nogil=True, _nrt=False, inline="always")
    return made(py_func)  # type: ignore[no-any-return]


def machine_code(function: Callable[..., Any], signature: Signature) -> tuple[str, bytes]:
    """Name and object code of a C function that calls the jitted ``function``.

    The C function takes each array as its address and its lengths, and the members of groups in a row; if ``packed``,
    the address of a block of slots that hold these, once as integers and once as doubles.
    """
    kinds, parameters, values = _packed(signature) if signature.packed else _flat(signature)
    text = f"def entry({', '.join(parameters)}):\n    return function({_passed(signature.arguments, values)})\n"
    scope: dict[str, Any] = {"function": function, "array_at": array_at} | _ARRAYS_FROM
    exec(text, scope)  # numba reads arities from text
    result = _TYPES[signature.result] if signature.result else types.void
    entry = numba.cfunc(result(*kinds), error_model="numpy", fastmath=False, _nrt=False)(scope["entry"])
    module = binding.parse_assembly(entry.inspect_llvm())
    return entry.native_name, target_machine().emit_object(module)


def _flat(signature: Signature) -> tuple[list[Any], list[str], dict[str, str]]:
    """Types and names of the arguments of a C function, and the text of each argument as ``function`` takes it."""
    kinds: list[Any] = []
    names: list[str] = []
    values = {}
    for argument in signature.flat:
        scalar, lengths = _TYPES[argument.scalar], [f"{argument.name}_{i}" for i in range(argument.dimensions)]
        kinds += [types.CPointer(scalar) if lengths else scalar, *[types.int64] * len(lengths)]
        names += [argument.name, *lengths]
        values[argument.name] = f"array_at({argument.name}, ({', '.join(lengths)},))" if lengths else argument.name
    return kinds, names, values


def _packed(signature: Signature) -> tuple[list[Any], list[str], dict[str, str]]:
    """The same for a C function that takes a block of slots."""
    values, at = {}, 0
    for argument in signature.flat:
        if argument.dimensions:
            lengths = [f"integers[{at + 1 + i}]" for i in range(argument.dimensions)]
            values[argument.name] = f"{argument.scalar}_array(integers[{at}], ({', '.join(lengths)},))"
        else:
            slot = {"int64": f"integers[{at}]", "float64": f"doubles[{at}]", "bool": f"integers[{at}] != 0"}
            values[argument.name] = slot[argument.scalar]
        at += 1 + argument.dimensions
    return [types.CPointer(types.int64), types.CPointer(types.float64)], ["integers", "doubles"], values


def _array(context: Any, builder: ir.IRBuilder, kind: Any, data: ir.Value, lengths: ir.Value) -> ir.Value:
    """The C-contiguous array of type ``kind`` whose first number is at ``data``."""
    array = context.make_array(kind)(context, builder)
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    shape = cgutils.unpack_tuple(builder, lengths)
    strides = [itemsize]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(length, strides[0]))
    populate_array(array, data, shape, strides, itemsize, meminfo=None)
    return array._getvalue()


@intrinsic
def array_at(typingctx, address, lengths):  # type: ignore[no-untyped-def]
    """The C-contiguous array of these ``lengths``, a tuple, at ``address``."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return _array(context, builder, signature.return_type, args[0], args[1])

    return types.Array(address.dtype, len(lengths), "C")(address, lengths), codegen


def _array_from(scalar: Any) -> Callable[..., Any]:
    """An intrinsic (address as an integer, lengths) -> array of ``scalar``."""

    @intrinsic
    def array_from(typingctx, address, lengths):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
            data = builder.inttoptr(args[0], context.get_data_type(scalar).as_pointer())
            return _array(context, builder, signature.return_type, data, args[1])

        return types.Array(scalar, len(lengths), "C")(types.int64, lengths), codegen

    return array_from  # type: ignore[no-any-return]


_ARRAYS_FROM = {f"{name}_array": _array_from(kind) for name, kind in _TYPES.items()}


def call_at(signature: Signature) -> Callable[..., Any]:
    """An intrinsic (address, (arguments)) -> result: the C function of :func:`machine_code` at that address."""
    result = _TYPES[signature.result] if signature.result else types.void

    @intrinsic
    def call(typingctx, address, given):  # type: ignore[no-untyped-def]
        def codegen(context, builder, called, args):  # type: ignore[no-untyped-def]
            values = []
            for argument, kind, value in zip(
                signature.flat, given, cgutils.unpack_tuple(builder, args[1]), strict=True
            ):
                if argument.dimensions:
                    array = context.make_array(kind)(context, builder, value)
                    values += [array.data, *cgutils.unpack_tuple(builder, array.shape)]
                else:
                    scalar = _TYPES[argument.scalar]
                    cast = context.cast(builder, value, kind, scalar)
                    values.append(context.get_value_as_argument(builder, scalar, cast))
            type_of = ir.FunctionType(
                context.get_argument_type(result) if signature.result else ir.VoidType(), [v.type for v in values]
            )
            returned = builder.call(builder.inttoptr(args[0], type_of.as_pointer()), values)
            return returned if signature.result else context.get_dummy_value()

        return result(address, given), codegen

    return call  # type: ignore[no-any-return]


def _passed(arguments: tuple[Argument | Group, ...], values: dict[str, str]) -> str:
    """Text of the arguments as ``function`` takes them, with groups as tuples."""
    parts = (f"({_passed(a.members, values)},)" if isinstance(a, Group) else values[a.name] for a in arguments)
    return ", ".join(parts)


def advance(rules: Rules, width: int, energy: str) -> Callable[..., Any]:
    """The inner kernel, jitted: see :class:`nearharmonic.core.kernel.Kernel`."""
    d, parts = rules.physics.dimension, rules.parts
    state_type, tally_type = Record(4 * d, width), Record(TALLY, width)
    step_type, rate_type = Record(parts, width), Record(parts * d, width)
    given_type = Record(parameter_rows(rules.physics.parameters), width)
    load_state, store_state = record_loader(state_type), record_storer(state_type)
    load_tally, store_tally = record_loader(tally_type), record_storer(tally_type)
    load_step, load_given = record_loader(step_type), record_loader(given_type)
    force = record_function(rules.force, rate_type, state_type, given_type)
    kick = record_function(rules.kick, state_type, state_type, step_type, rate_type)
    drift = record_function(rules.drift, state_type, state_type, step_type, given_type)
    measure = record_function(rules.measure, tally_type, state_type, tally_type, given_type)
    left = record_test(lambda tally: tally[LATEST].absolute().any_not_within(tally[LIMIT]), tally_type)
    stride, tally_at, given_at = parts * width, 4 * d * width, (4 * d + TALLY) * width
    every_step, at_end = energy == "every", energy == "samples"
    if every_step and rules.quick_energy:
        return _advance_with_quick_energy(rules, width)

    @strict
    def advance(count, stages, kick_first, drifts, kicks, rows):  # type: ignore[no-untyped-def]
        state, given = load_state(rows, 0), load_given(rows, given_at)
        tally = load_tally(rows, tally_at)
        shift = 1 if kick_first else 0
        rate = force(state, given)
        done = 0
        while done < count:
            if kick_first:  # the force is that of the last kick: first same as last
                state = kick(state, load_step(kicks, 0), rate)
            for i in range(stages):
                state = drift(state, load_step(drifts, i * stride), given)
                rate = force(state, given)
                state = kick(state, load_step(kicks, (i + shift) * stride), rate)
            if not kick_first:
                state = drift(state, load_step(drifts, stages * stride), given)
            done += 1
            if every_step:
                tally = measure(state, tally, given)
                if left(tally):
                    break
        if at_end:
            tally = measure(state, tally, given)
        store_state(rows, 0, state)
        store_tally(rows, tally_at, tally)
        return done

    return advance


def _advance_with_quick_energy(rules: Rules, width: int) -> Callable[..., Any]:
    """The inner kernel with an energy that shares the work of the last force of each step."""
    d = rules.physics.dimension
    state_type, tally_type, rate_type = Record(4 * d, width), Record(TALLY, width), Record(d, width)
    step_type, look_type = Record(1, width), Record(2, width)
    given_type, pull_type = Record(parameter_rows(rules.physics.parameters), width), Record(d + 1, width)
    load_state, store_state = record_loader(state_type), record_storer(state_type)
    load_tally, store_tally = record_loader(tally_type), record_storer(tally_type)
    load_step, load_given = record_loader(step_type), record_loader(given_type)
    force = record_function(rules.force, rate_type, state_type, given_type)
    pull = record_function(rules.force_and_potential, pull_type, state_type, given_type)
    force_of = record_function(lambda entries: entries[:d], rate_type, pull_type)
    potential_of = record_function(lambda entries: entries[d:], step_type, pull_type)
    potential = record_function(rules.potential, step_type, state_type, given_type)
    kick = record_function(rules.kick, state_type, state_type, step_type, rate_type)
    drift = record_function(rules.drift, state_type, state_type, step_type, given_type)
    quick = record_function(rules.quick, look_type, state_type, step_type, tally_type, given_type)
    sharpened = record_function(rules.sharpened, look_type, state_type, tally_type, look_type, given_type)
    counted = record_function(lambda tally, look: tallied(tally, look[0]), tally_type, tally_type, look_type)
    near = record_test(lambda look: uncertain(*look), look_type)
    left = record_test(lambda tally: tally[LATEST].absolute().any_not_within(tally[LIMIT]), tally_type)
    tally_at, given_at = 4 * d * width, (4 * d + TALLY) * width

    @strict
    def advance(count, stages, kick_first, drifts, kicks, rows):  # type: ignore[no-untyped-def]
        state, given = load_state(rows, 0), load_given(rows, given_at)
        tally = load_tally(rows, tally_at)
        shift = 1 if kick_first else 0
        rate, height = force(state, given), load_step(kicks, 0)  # any number: V is known after the last stage
        done = 0
        while done < count:
            if kick_first:
                state = kick(state, load_step(kicks, 0), rate)
            for i in range(stages):
                state = drift(state, load_step(drifts, i * width), given)
                if i + 1 < stages:
                    rate = force(state, given)
                else:
                    both = pull(state, given)
                    rate, height = force_of(both), potential_of(both)
                state = kick(state, load_step(kicks, (i + shift) * width), rate)
            if not kick_first:
                state = drift(state, load_step(drifts, stages * width), given)
                height = potential(state, given)
            done += 1
            look = quick(state, height, tally, given)
            if near(look):
                look = sharpened(state, tally, look, given)
            tally = counted(tally, look)
            if left(tally):
                break
        store_state(rows, 0, state)
        store_tally(rows, tally_at, tally)
        return done

    return advance


def begin(rules: Rules, width: int) -> Callable[..., Any]:
    """``begin(rows)``, jitted: each lane's tally anew, with the energy of its state as H0."""
    given_type = Record(parameter_rows(rules.physics.parameters), width)
    state_type, tally_type = Record(4 * rules.physics.dimension, width), Record(TALLY, width)
    load_state, load_given = record_loader(state_type), record_loader(given_type)
    store_tally = record_storer(tally_type)
    fresh = record_function(rules.begin, tally_type, state_type, given_type)
    tally_at = 4 * rules.physics.dimension * width
    given_at = tally_at + TALLY * width

    @strict
    def begin(rows):  # type: ignore[no-untyped-def]
        store_tally(rows, tally_at, fresh(load_state(rows, 0), load_given(rows, given_at)))

    return begin
