"""What a compiled function is written with: loops, branches, variables, whole numbers, and arrays in memory.

Text that uses these reads as the loop that it writes: ``for`` over :meth:`Writer.range`, ``with`` :meth:`Writer.when`,
entries of an :class:`Array` by their indices. Nothing of numba is loaded for it, which takes longer than most runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from llvmlite import binding, ir

from nearharmonic.core.layout import Argument, Scalar, Signature
from nearharmonic.core.native import target_machine
from nearharmonic.core.values import LLVMMask, LLVMValue

INDEX, DOUBLE = ir.IntType(64), ir.DoubleType()
_KINDS: dict[Scalar, ir.Type] = {"int64": INDEX, "float64": DOUBLE, "bool": ir.IntType(8)}


def machine_code(module: ir.Module, name: str) -> tuple[str, bytes]:
    """Name and object code of a function of ``module``, which is optimised without re-ordering any arithmetic.

    Loops are not made vectors of: what is computed side by side is written so.
    """
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    machine = target_machine()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = options.loop_vectorization = False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(parsed, builder)
    return name, machine.emit_object(parsed)


class Index:
    """A 64-bit signed whole number."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def _operand(self, other: Index | int) -> ir.Value:
        return other.value if isinstance(other, Index) else ir.Constant(INDEX, other)

    def __add__(self, other: Index | int) -> Index:
        return Index(self.builder, self.builder.add(self.value, self._operand(other)))

    __radd__ = __add__

    def __sub__(self, other: Index | int) -> Index:
        return Index(self.builder, self.builder.sub(self.value, self._operand(other)))

    def __mul__(self, other: Index | int) -> Index:
        return Index(self.builder, self.builder.mul(self.value, self._operand(other)))

    __rmul__ = __mul__

    def _compare(self, relation: str, other: Index | int) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.icmp_signed(relation, self.value, self._operand(other)))

    def __lt__(self, other: Index | int) -> LLVMMask:
        return self._compare("<", other)

    def __gt__(self, other: Index | int) -> LLVMMask:
        return self._compare(">", other)

    def __ge__(self, other: Index | int) -> LLVMMask:
        return self._compare(">=", other)

    def equals(self, other: Index | int) -> LLVMMask:
        return self._compare("==", other)

    def at_most(self, other: Index | int) -> Index:
        """The smaller of the two."""
        operand = self._operand(other)
        smaller = self.builder.icmp_signed("<", self.value, operand)
        return Index(self.builder, self.builder.select(smaller, self.value, operand))


class Variable:
    """A value of a function that changes: a number, or an address."""

    def __init__(self, builder: ir.IRBuilder, initial: Any) -> None:
        self._builder, self._kind = builder, type(initial)
        with builder.goto_entry_block():
            self._room = builder.alloca(initial.value.type)
        self.value = initial

    @property
    def value(self) -> Any:
        """What it is now."""
        return self._kind(self._builder, self._builder.load(self._room))

    @value.setter
    def value(self, new: Any) -> None:
        self._builder.store(new.value, self._room)


class Array:
    """A C-contiguous array of numbers: the address of the first, and the lengths."""

    def __init__(self, builder: ir.IRBuilder, address: ir.Value, shape: Sequence[Index]) -> None:
        self.builder, self.address, self.shape = builder, address, tuple(shape)

    def __getitem__(self, index: Index | int | tuple[Index | int, ...]) -> Any:
        """A number, or the array of the numbers with these leading indices."""
        place, rest = self._place(index if isinstance(index, tuple) else (index,))
        if rest:
            return Array(self.builder, place, rest)
        value = self.builder.load(place)
        return LLVMValue(self.builder, value) if value.type == DOUBLE else Index(self.builder, value)

    def __setitem__(self, index: Index | int | tuple[Index | int, ...], number: Any) -> None:
        place, _ = self._place(index if isinstance(index, tuple) else (index,))
        if not hasattr(number, "value"):
            number = LLVMValue(self.builder, ir.Constant(place.type.pointee, number))
        self.builder.store(number.value, place)

    def _place(self, indices: tuple[Index | int, ...]) -> tuple[ir.Value, tuple[Index, ...]]:
        offset = Index(self.builder, ir.Constant(INDEX, 0))
        for k, length in enumerate(self.shape):
            offset = offset * length if k else offset
            offset = offset + indices[k] if k < len(indices) else offset
        return self.builder.gep(self.address, [offset.value]), self.shape[len(indices) :]

    def lanes(self, first: Index | int, width: int) -> LLVMValue:
        """``width`` neighbouring doubles of a flat array, one a lane."""
        value = self.builder.load(self._lanes(first, DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)))
        value.align = 8
        return LLVMValue(self.builder, value)

    def store_lanes(self, first: Index | int, number: LLVMValue) -> None:
        """Replace neighbouring doubles of a flat array."""
        self.builder.store(number.value, self._lanes(first, number.value.type)).align = 8

    def _lanes(self, first: Index | int, kind: ir.Type) -> ir.Value:
        return self.builder.bitcast(self._place((first,))[0], kind.as_pointer())

    @property
    def size(self) -> Index:
        """How many numbers there are."""
        count = self.shape[0]
        for length in self.shape[1:]:
            count = count * length
        return count


class Writer:
    """Writes at the end of a function."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self.builder = builder

    def index(self, number: int) -> Index:
        """A constant."""
        return Index(self.builder, ir.Constant(INDEX, number))

    def variable(self, initial: Any) -> Variable:
        """A variable with its first value."""
        return Variable(self.builder, initial)

    @contextmanager
    def when(self, condition: LLVMMask, *, likely: bool | None = None) -> Iterator[None]:
        """Write what is done if ``condition`` is true."""
        with self.builder.if_then(condition.value, likely=likely):
            yield

    @contextmanager
    def repeated(self, count: Index | int) -> Iterator[Index]:
        """Write the body of a loop over 0, ..., ``count`` - 1."""
        builder = self.builder
        before, head = builder.block, builder.append_basic_block("repeated")
        body, behind = builder.append_basic_block("body"), builder.append_basic_block("behind")
        builder.branch(head)
        builder.position_at_end(head)
        i = builder.phi(INDEX)
        i.add_incoming(ir.Constant(INDEX, 0), before)
        number = Index(builder, i)
        builder.cbranch((number < count).value, body, behind)
        builder.position_at_end(body)
        yield number
        i.add_incoming((number + 1).value, builder.block)
        builder.branch(head)
        builder.position_at_end(behind)

    def range(self, start: Index | int, stop: Index | int | None = None) -> Iterator[Index]:
        """The same as a loop of one turn, whose body the caller writes."""
        first, last = (0, start) if stop is None else (start, stop)
        count = (self.index(last) if isinstance(last, int) else last) - first
        with self.repeated(count) as i:
            yield i + first

    @contextmanager
    def forever(self) -> Iterator[ir.Block]:
        """Write the body of a loop that ends by a branch to the block that this yields, in which writing goes on."""
        body, behind = self.builder.append_basic_block("body"), self.builder.append_basic_block("behind")
        self.builder.branch(body)
        self.builder.position_at_end(body)
        yield behind
        self.builder.branch(body)
        self.builder.position_at_end(behind)

    def leave(self, condition: LLVMMask, behind: ir.Block) -> None:
        """Leave a loop of :meth:`forever` if ``condition`` is true."""
        going_on = self.builder.append_basic_block("going_on")
        self.builder.cbranch(condition.value, behind, going_on)
        self.builder.position_at_end(going_on)

    def number(self, index: Index) -> LLVMValue:
        """A whole number as a double."""
        return LLVMValue(self.builder, self.builder.sitofp(index.value, DOUBLE))

    def whole(self, number: LLVMValue) -> Index:
        """The whole part of a double; at most 2^52, which also stands for what is no number."""
        most = 2.0**52
        bounded = number.less(most).choose(number, most)
        return Index(self.builder, self.builder.fptosi(bounded.value, INDEX))

    def either(self, condition: LLVMMask, yes: Any, no: Any) -> Any:
        """``yes`` if ``condition`` is true, else ``no``."""
        return type(yes)(self.builder, self.builder.select(condition.value, yes.value, no.value))

    def call(self, address: Index, signature: Signature, arguments: Sequence[Any]) -> Any:
        """Call the C function at ``address`` with whole numbers, truth values and arrays as its signature has them."""
        values: list[ir.Value] = []
        for argument, given in zip(signature.arguments, arguments, strict=True):
            lengths = [length.value for length in given.shape] if argument.dimensions else []
            if argument.scalar == "bool":
                values.append(self.builder.zext(given.value, _KINDS["bool"]))
            else:
                values += [given.address, *lengths] if argument.dimensions else [given.value]
        result = _KINDS[signature.result] if signature.result else ir.VoidType()
        kind = ir.FunctionType(result, [value.type for value in values])
        returned = self.builder.call(self.builder.inttoptr(address.value, kind.as_pointer()), values)
        return Index(self.builder, returned) if signature.result else None


def function(module: ir.Module, name: str, signature: Signature) -> tuple[Writer, dict[str, Any]]:
    """Return what writes a function of ``module``, and its arguments by name.

    An argument is an :class:`Index`, an :class:`LLVMValue`, an :class:`Array`, or an LLVMMask for a truth value.
    """
    result = _KINDS[signature.result] if signature.result else ir.VoidType()
    kinds: list[ir.Type] = []
    if signature.packed:
        kinds = [INDEX.as_pointer(), DOUBLE.as_pointer()]
    else:
        for argument in signature.arguments:
            kind = _KINDS[argument.scalar]
            kinds += [kind.as_pointer(), *[INDEX] * argument.dimensions] if argument.dimensions else [kind]
    made = ir.Function(module, ir.FunctionType(result, kinds), name)
    made.attributes.add("nounwind")
    writer = Writer(ir.IRBuilder(made.append_basic_block()))
    slots = _slots(writer.builder, made, signature)
    return writer, {argument.name: _argument(writer.builder, argument, slots) for argument in signature.arguments}


def _slots(builder: ir.IRBuilder, made: ir.Function, signature: Signature) -> Iterator[ir.Value]:
    """The arguments of a function, from its registers or from the block that a packed one is given."""
    if not signature.packed:
        yield from made.args
        return
    integers, doubles = made.args
    at = 0
    for argument in signature.arguments:
        kind = _KINDS[argument.scalar]
        for k in range(1 + argument.dimensions):
            block = doubles if kind == DOUBLE and not argument.dimensions else integers
            slot = builder.load(builder.gep(block, [ir.Constant(INDEX, at)]))
            at += 1
            if argument.dimensions and not k:
                slot = builder.inttoptr(slot, kind.as_pointer())
            yield slot


def _argument(builder: ir.IRBuilder, argument: Argument, slots: Iterator[ir.Value]) -> Any:
    value = next(slots)
    if argument.dimensions:
        return Array(builder, value, [Index(builder, next(slots)) for _ in range(argument.dimensions)])
    if argument.scalar == "float64":
        return LLVMValue(builder, value)
    if argument.scalar == "int64":
        return Index(builder, value)
    return LLVMMask(builder, builder.icmp_unsigned("!=", value, ir.Constant(value.type, 0)))
