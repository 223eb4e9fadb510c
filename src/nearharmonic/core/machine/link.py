"""Kernels: loops that numba compiled for a form, linked with the formulas of a system and optimised together.

The loops of a form are cached as LLVM text, so that a new system of a known form does not need numba.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import binding, ir

from nearharmonic.core.layout import Signature
from nearharmonic.core.machine.native import (
    join,
    kept,
    object_code,
    run_passes,
    source_key,
)
from nearharmonic.core.machine.values import INDEX, PLACEHOLDERS, PREFIX, Kinds, argument_types, define, result_type
from nearharmonic.errors import CompiledCodeError

#: Letters of the placeholder types in the LLVM text of loops.
_LETTERS = {f"ptr addrspace({space})": letter for letter, space in PLACEHOLDERS.items()}
#: A placeholder type with or without null, a phi instruction of one, and declarations of operations and of formulas.
_TYPE = re.compile(rf"({'|'.join(map(re.escape, _LETTERS))})( null)?")
_CHOICE = re.compile(rf"= phi ({'|'.join(map(re.escape, _LETTERS))}) .*")
_OPERATION = re.compile(rf"^declare (.+) @({re.escape(PREFIX)}\w+\.\w+)\(", re.MULTILINE)
_FORMULA = re.compile(rf"^declare .* @{re.escape(PREFIX)}(\w+)\(", re.MULTILINE)
_MADE: dict[str, tuple[str, bytes]] = {}


def kept_loops(name: str, choice: str, make: Callable[[], tuple[str, bytes]]) -> tuple[str, bytes]:
    """Return the loops of a name and of options from the cache, or call ``make`` and put its result there.

    If nothing can be kept on disk, each process makes them once.
    """
    key = f"loops-{source_key(name, choice)}"

    def once() -> tuple[str, bytes]:
        found = _MADE[key] = _MADE.get(key) or make()
        return found

    return kept(key, once, lambda *found: found)


def loops(function: Callable[..., Any], signature: Signature) -> tuple[str, bytes]:
    """Return the name and the LLVM text of a function compiled by numba.

    The function takes those arguments of the signature that it names: numbers, addresses of arrays, and lengths of
    arrays. The code is not optimised, because the size of a number is not known yet.
    """
    from numba.core import config, registry
    from numba.core.compiler_lock import global_compiler_lock

    from nearharmonic.core.machine.reals import SCALARS, compiled, types

    kinds, taken = [], [*inspect.signature(function).parameters]
    by_name = {argument.name: argument for argument in signature.arguments}
    for name in taken:
        argument = by_name.get(name)
        scalar = SCALARS[argument.scalar] if argument else types.int64
        kinds.append(types.CPointer(scalar) if argument and argument.dimensions else scalar)
    # At its first use, numba fixes the optimisation level of all other code of the process.
    registry.cpu_target.target_context.refresh()
    with global_compiler_lock:
        config.reload_config()  # or the compiler reloads it after a change of the environment
        if config.DISABLE_JIT:
            raise CompiledCodeError("NUMBA_DISABLE_JIT is set, so that kernels cannot be compiled: unset it")
        level, config.OPT = config.OPT, config._OptLevel(0)
        try:
            jitted = compiled(function)
            jitted.compile(tuple(kinds))
        finally:
            config.OPT = level
    (made,) = jitted.overloads.values()
    entry = _entry(made.fndesc.llvm_func_name, function.__name__, signature, taken)
    module = join(binding.parse_assembly(made.library.get_llvm_str()), str(entry))
    _make_one(module, function.__name__)
    run_passes(module, "sroa", "simplify_cfg", "aggressive_dce", "simplify_cfg")  # once, not each time loops are linked
    return function.__name__, str(module).encode()


def _make_one(module: Any, name: str) -> None:
    """Inline the functions that ``name`` calls, except those that are only declared or marked noinline."""
    for function in module.functions:
        if not function.is_declaration and function.name != name:
            function.linkage = "internal"
            if not any(b"noinline" in attribute for attribute in function.attributes):
                function.add_function_attribute("alwaysinline")
    run_passes(module, "always_inliner", "global_dead_code_eliminate")


def needed(loops: bytes) -> frozenset[str]:
    """Names of the functions that loops call and do not define, without operations."""
    return frozenset(_FORMULA.findall(loops.decode()))


def linked(name: str, loops: bytes, written: ir.Module, kinds: Kinds, given: str = "") -> tuple[str, bytes]:
    """Name and object code of loops linked with the module ``written`` of a system, for a number of lanes.

    ``given`` is the LLVM text of functions that the formulas call; LLVM may inline them.
    """
    zero = "zeroinitializer"
    text = _CHOICE.sub(lambda found: found[0].replace("[ null,", f"[ {zero},"), loops.decode())
    text = _TYPE.sub(lambda found: f"{kinds.of(_LETTERS[found[1]])} {zero if found[2] else ''}", text)
    for result, symbol in _OPERATION.findall(loops.decode()):
        define(written, symbol, kinds, _LETTERS.get(result) or {"i1": "B", "void": "V"}[result])
    module = join(binding.parse_assembly(text), str(written))
    _make_one(module, name)
    if given:
        names = [function.name for function in binding.parse_assembly(given).functions if not function.is_declaration]
        join(module, given)
        for own in names:
            module.get_function(own).linkage = "internal"
    return name, object_code(module)


def alone(name: str, loops: bytes) -> tuple[str, bytes]:
    """Name and object code of loops that call no other function."""
    return linked(name, loops, ir.Module(), Kinds(1, 1, 1))


def _entry(name: str, entry: str, signature: Signature, taken: Sequence[str]) -> ir.Module:
    """A module with a C function that calls numba's function, which returns a status, and its result by an address."""
    module = ir.Module()
    names = [name for argument in signature.arguments for name in (argument.name, *argument.lengths)]
    kinds, result = argument_types(signature), result_type(signature)
    outer = ir.Function(module, ir.FunctionType(result, [INDEX.as_pointer()] if signature.packed else kinds), entry)
    builder = ir.IRBuilder(outer.append_basic_block())
    given = dict(zip(names, outer.args, strict=False))
    if signature.packed:
        given = {n: _slot(builder, outer.args[0], i, k) for i, (n, k) in enumerate(zip(names, kinds, strict=True))}
    address = ir.IntType(8).as_pointer()
    returned = builder.alloca(result if signature.result else address)
    arguments = [returned, builder.alloca(address), *(given[name] for name in taken)]
    callee = ir.Function(module, ir.FunctionType(ir.IntType(32), [value.type for value in arguments]), name)
    builder.call(callee, arguments)
    if signature.result:
        builder.ret(builder.load(returned))
    else:
        builder.ret_void()
    return module


def _slot(builder: ir.IRBuilder, block: ir.Value, number: int, kind: ir.Type) -> ir.Value:
    """An argument in a block of arguments of 8 bytes each."""
    return builder.load(builder.bitcast(builder.gep(block, [INDEX(number)]), kind.as_pointer()))
