"""Functions of the module that is being built: long code is emitted once for each number of lanes, and called."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from llvmlite import ir

from nearharmonic.core.machine.values import LLVMMask, LLVMValue

Body = Callable[..., Sequence[LLVMValue]]


def called(name: str, body: Body, *arguments: LLVMValue) -> list[LLVMValue]:
    """Return the results of ``body`` by a call of a function of the module, which is written at its first use.

    The name and the number of lanes must identify the body. All values have the type of the arguments.
    """
    builder, kind = arguments[0].builder, arguments[0].value.type
    symbol = f"nearharmonic.{name}.{arguments[0].width}"
    function = builder.module.globals.get(symbol) or _written(builder.module, symbol, body, kind, len(arguments))
    result = builder.call(function, [x.value for x in arguments])
    count = len(function.function_type.return_type.elements)
    return [LLVMValue(builder, builder.extract_value(result, i)) for i in range(count)]


def _written(module: ir.Module, symbol: str, body: Body, kind: ir.Type, count: int) -> ir.Function:
    # The type of a function is fixed when it is created, but the number of results is known after the body is written.
    draft = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), [kind] * count), symbol)
    results = len(_run(body, draft))
    returned = ir.LiteralStructType([kind] * results)
    function = ir.Function(module, ir.FunctionType(returned, [kind] * count), symbol)
    function.linkage = "internal"
    function.attributes.add("noinline")
    function.attributes.add("nounwind")
    values = _run(body, function)
    builder = values[0].builder
    packed = ir.Constant(returned, ir.Undefined)
    for i, value in enumerate(values):
        packed = builder.insert_value(packed, value.value, i)
    builder.ret(packed)
    return function


def _run(body: Body, function: ir.Function) -> Sequence[LLVMValue]:
    builder = ir.IRBuilder(function.append_basic_block())
    return body(*(LLVMValue(builder, argument) for argument in function.args))


def where_needed(
    needed: LLVMMask, usual: Sequence[LLVMValue], rare: Callable[[], Sequence[LLVMValue]]
) -> list[LLVMValue]:
    """``usual``, replaced by the values of ``rare`` in the lanes ``needed``; ``rare`` runs only if a lane needs it."""
    builder = needed.builder
    before = builder.block
    with builder.if_then(needed.anywhere().value, likely=False):
        chosen = [needed.choose(new, old) for new, old in zip(rare(), usual, strict=True)]
        inside = builder.block
    results = []
    for new, old in zip(chosen, usual, strict=True):
        phi = builder.phi(old.value.type)
        phi.add_incoming(old.value, before)
        phi.add_incoming(new.value, inside)
        results.append(LLVMValue(builder, phi))
    return results
