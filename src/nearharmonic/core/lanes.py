"""Numba types for SIMD lanes: a record of doubles, each of them one per lane, held in registers.

A :class:`Record` of ``count`` entries and ``width`` lanes is the LLVM array ``[count x <width x double>]`` (width 1:
``[count x double]``). It has no operators: intrinsics made by :func:`record_function` unpack it into
:class:`~nearharmonic.core.tracing.LLVMValue` values, run plain Python on them, and pack the result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, register_model

from nearharmonic.core.tracing import LLVMValue


class Record(types.Type):
    """``count`` doubles in each of ``width`` lanes."""

    def __init__(self, count: int, width: int) -> None:
        self.count, self.width = count, width
        super().__init__(name=f"Record({count}, {width})")

    @property
    def entry(self) -> ir.Type:
        """LLVM type of one entry."""
        return ir.DoubleType() if self.width == 1 else ir.VectorType(ir.DoubleType(), self.width)


@register_model(Record)
class _RecordModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Record) -> None:
        super().__init__(dmm, fe_type, ir.ArrayType(fe_type.entry, fe_type.count))


def _unpack(builder: ir.IRBuilder, kind: Record, value: ir.Value) -> list[LLVMValue]:
    return [LLVMValue(builder, builder.extract_value(value, i)) for i in range(kind.count)]


def _pack(builder: ir.IRBuilder, kind: Record, entries: Sequence[LLVMValue]) -> ir.Value:
    value = ir.Constant(ir.ArrayType(kind.entry, kind.count), ir.Undefined)
    for i, entry in enumerate(entries):
        value = builder.insert_value(value, entry.value, i)
    return value


def _pointer(context: Any, builder: ir.IRBuilder, array: types.Array, value: ir.Value, offset: ir.Value) -> ir.Value:
    data = context.make_array(array)(context, builder, value).data
    return builder.gep(data, [offset])


def _load(builder: ir.IRBuilder, kind: Record, data: ir.Value) -> list[LLVMValue]:
    entries = []
    for i in range(kind.count):
        place = builder.gep(data, [ir.Constant(ir.IntType(64), i * kind.width)])
        value = builder.load(builder.bitcast(place, kind.entry.as_pointer()))
        value.align = 8
        entries.append(LLVMValue(builder, value))
    return entries


def record_loader(kind: Record) -> Callable[..., Any]:
    """An intrinsic (array, offset) -> record: ``count * width`` doubles of a contiguous float64 array."""

    @intrinsic
    def load(typingctx, array, offset):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
            data = _pointer(context, builder, signature.args[0], args[0], args[1])
            return _pack(builder, kind, _load(builder, kind, data))

        return kind(array, types.intp), codegen

    return load  # type: ignore[no-any-return]


def record_storer(kind: Record) -> Callable[..., Any]:
    """An intrinsic (array, offset, record) -> None, the inverse of :func:`record_loader`."""

    @intrinsic
    def store(typingctx, array, offset, record):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
            data = _pointer(context, builder, signature.args[0], args[0], args[1])
            for i, entry in enumerate(_unpack(builder, kind, args[2])):
                place = builder.gep(data, [ir.Constant(ir.IntType(64), i * kind.width)])
                builder.store(entry.value, builder.bitcast(place, kind.entry.as_pointer())).align = 8
            return context.get_dummy_value()

        return types.void(array, types.intp, kind), codegen

    return store  # type: ignore[no-any-return]


def record_function(rule: Callable[..., Sequence[LLVMValue]], result: Record, *arguments: Record) -> Callable[..., Any]:
    """An intrinsic (records) -> record whose code ``rule`` writes: lists of entries in, a list of entries out."""
    return _function(lambda builder, entries: _pack(builder, result, rule(*entries)), result, arguments)


def record_test(rule: Callable[..., ir.Value], *arguments: Record) -> Callable[..., Any]:
    """An intrinsic (records) -> bool whose code ``rule`` writes."""
    return _function(lambda builder, entries: rule(*entries), types.boolean, arguments)


def _function(write: Callable[..., ir.Value], result: types.Type, arguments: Sequence[Record]) -> Callable[..., Any]:
    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return write(builder, [_unpack(builder, kind, value) for kind, value in zip(arguments, args, strict=True)])

    signature = result(*arguments)
    # Numba reads an intrinsic's arity from its text, so one text per arity.
    if len(arguments) == 1:

        @intrinsic
        def function(typingctx, a):  # type: ignore[no-untyped-def]
            return signature, codegen

    elif len(arguments) == 2:

        @intrinsic
        def function(typingctx, a, b):  # type: ignore[no-untyped-def]
            return signature, codegen

    elif len(arguments) == 3:

        @intrinsic
        def function(typingctx, a, b, c):  # type: ignore[no-untyped-def]
            return signature, codegen

    else:

        @intrinsic
        def function(typingctx, a, b, c, d):  # type: ignore[no-untyped-def]
            return signature, codegen

    return function  # type: ignore[no-any-return]
