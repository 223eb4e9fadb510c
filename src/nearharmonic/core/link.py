"""Kernels: loops that numba compiled for a shape, and the formulas of a system, linked and optimised as one.

What numba made of a shape is kept, in LLVM's language, so that a new system needs no numba where its shape is known.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from llvmlite import binding, ir

from nearharmonic.core import disk
from nearharmonic.core.layout import Signature
from nearharmonic.core.native import target_machine
from nearharmonic.core.operations import PREFIX, Kinds, define

#: Types of numbers, and operations on them, in the text of loops: declared, and to be defined.
_TYPE = re.compile(rf"%{re.escape(PREFIX)}([RPC])(?:\.\d+)*( = type .*)?")
_OPERATION = re.compile(rf"^declare (\S+) @({re.escape(PREFIX)}\w+\.\w+)\(", re.MULTILINE)
#: Of Signature's scalars: in LLVM's language.
_KINDS: dict[str, ir.Type] = {"int64": ir.IntType(64), "float64": ir.DoubleType(), "bool": ir.IntType(8)}


def kept(key: str, make: Callable[[], tuple[str, bytes]]) -> tuple[str, bytes]:
    """Return what the cache has under a key, or what ``make`` returns, which is put there."""
    place = disk.place_of(key)
    found = disk.read(place) if place else None
    if found is None:
        found = make()
        if place:
            disk.write(place, *found)
    return found


def loops(function: Callable[..., Any], signature: Signature) -> tuple[str, bytes]:
    """Return the name and the text, in LLVM's language, of a function compiled by numba; arrays are addresses.

    Nothing is optimised: the size of a number is not known yet.
    """
    from numba.core import config, registry

    from nearharmonic.core.reals import compiled, types

    scalars = {"int64": types.int64, "float64": types.float64, "bool": types.boolean}
    kinds = [
        types.CPointer(scalars[argument.scalar]) if argument.dimensions else scalars[argument.scalar]
        for argument in signature.arguments
    ]
    # At the first use, numba settles how it optimises all other code of the process.
    registry.cpu_target.target_context.refresh()
    config.reload_config()  # or the compiler would, and forget the next line, after a change of the environment
    level, config.OPT = config.OPT, config._OptLevel(0)
    try:
        jitted = compiled(function)
        jitted.compile(tuple(kinds))
    finally:
        config.OPT = level
    (made,) = jitted.overloads.values()
    name, module = made.fndesc.llvm_func_name, binding.parse_assembly(made.library.get_llvm_str())
    _make_one(module, name)
    return name, str(module).encode()


def _make_one(module: Any, name: str) -> None:
    """Make the functions that ``name`` calls part of it, but for those that are declared alone or kept apart."""
    for function in module.functions:
        if not function.is_declaration and function.name != name:
            function.linkage = "internal"
            if not any(b"noinline" in attribute for attribute in function.attributes):
                function.add_function_attribute("alwaysinline")
    passes = binding.create_new_module_pass_manager()
    passes.add_always_inliner_pass()
    passes.add_global_dead_code_eliminate_pass()
    builder = binding.create_pass_builder(target_machine(), binding.create_pipeline_tuning_options())
    passes.run(module, builder)


def linked(
    name: str, loops: bytes, written: ir.Module, kinds: Kinds, entry: str, signature: Signature, given: str = ""
) -> tuple[str, bytes]:
    """Name and object code of the C function ``entry``: loops with what is ``written`` of a system, for some lanes.

    ``given`` is the text of functions that the formulas call, which become part of them where LLVM finds that good.
    No arithmetic is re-ordered. Loops are not made vectors of: what is computed side by side is written so.
    """
    text = _TYPE.sub(lambda found: "" if found[2] else str(kinds.of(found[1])), loops.decode())
    for result, symbol in _OPERATION.findall(loops.decode()):
        define(written, symbol, kinds, _letter_of(result))
    _write_entry(written, name, entry, signature)
    module, rest = binding.parse_assembly(text), binding.parse_assembly(str(written))
    rest.triple, rest.data_layout = module.triple, module.data_layout
    module.link_in(rest)
    _make_one(module, entry)
    if given:
        _add(module, given)
    module.verify()
    machine = target_machine()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = options.loop_vectorization = False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return entry, machine.emit_object(module)


def _add(module: Any, given: str) -> None:
    more = binding.parse_assembly(given)
    names = [function.name for function in more.functions if not function.is_declaration]
    module.link_in(more)
    for name in names:
        module.get_function(name).linkage = "internal"


def _letter_of(result: str) -> str:
    found = re.match(rf"%{re.escape(PREFIX)}([RPC])", result)
    return found[1] if found else {"i1": "B", "void": "V"}[result]


def _write_entry(module: ir.Module, name: str, entry: str, signature: Signature) -> None:
    """A C function that calls numba's: this returns a status and, by an address, its result."""
    kinds: list[ir.Type] = []
    passed = []
    for argument in signature.arguments:
        kind = _KINDS[argument.scalar]
        passed.append(len(kinds))
        kinds += [kind.as_pointer(), *[ir.IntType(64)] * argument.dimensions] if argument.dimensions else [kind]
    result = _KINDS[signature.result] if signature.result else ir.IntType(8).as_pointer()
    inner = [result.as_pointer(), ir.IntType(8).as_pointer().as_pointer(), *(kinds[i] for i in passed)]
    callee = ir.Function(module, ir.FunctionType(ir.IntType(32), inner), name)
    outer = ir.Function(module, ir.FunctionType(result if signature.result else ir.VoidType(), kinds), entry)
    builder = ir.IRBuilder(outer.append_basic_block())
    returned, raised = builder.alloca(result), builder.alloca(ir.IntType(8).as_pointer())
    builder.call(callee, [returned, raised, *(outer.args[i] for i in passed)])
    if signature.result:
        builder.ret(builder.load(returned))
    else:
        builder.ret_void()
