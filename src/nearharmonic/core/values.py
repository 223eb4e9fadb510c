"""Values that emit machine code: doubles, bit patterns and truth values, as scalars or one per SIMD lane.

An operation on :class:`LLVMValue`, :class:`LLVMBits` or :class:`LLVMMask` is one instruction of the function that is
being built. A Python number beside one of them is the same in every lane.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, ClassVar, TypeVar

from llvmlite import ir
from numpy.typing import NDArray

from nearharmonic.core.layout import BLOCK, Signature

# --- Types of reals and points, for given numbers of coordinates and lanes, and the functions that loops call.
#
# A letter stands for a type: R is a real, P a point, S the points of the stages of an implicit method, D a double that
# is the same in every lane, C the parameters, I an integer, A an array of doubles, B a truth value, V none.
#
# A coordinate of S is one vector of ``stages * lanes`` doubles: all lanes of the first stage, of the second, and so on.

PREFIX = "nearharmonic."
DOUBLE, INDEX, TRUTH = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
#: LLVM types of the numbers of a :class:`nearharmonic.core.layout.Signature`.
SCALARS: dict[str, ir.Type] = {"int64": INDEX, "float64": DOUBLE, "bool": ir.IntType(8)}


def argument_types(signature: Signature) -> list[ir.Type]:
    """Types of the arguments of a C function; an array is the address of its first number, followed by its lengths."""
    found: list[ir.Type] = []
    for argument in signature.arguments:
        kind = SCALARS[argument.scalar]
        found += [kind.as_pointer(), *[INDEX] * argument.dimensions] if argument.dimensions else [kind]
    return found


def result_type(signature: Signature) -> ir.Type:
    return SCALARS[signature.result] if signature.result else ir.VoidType()


def intrinsic(name: str) -> Callable[..., ir.Value]:
    """Return a writer of a call of an intrinsic function of LLVM."""

    def emit(builder: ir.IRBuilder, *values: ir.Value) -> ir.Value:
        kind, module = values[0].type, builder.module
        symbol = f"llvm.{name}.v{kind.count}f64" if isinstance(kind, ir.VectorType) else f"llvm.{name}.f64"
        known = module.globals.get(symbol) or ir.Function(module, ir.FunctionType(kind, [kind] * len(values)), symbol)
        return builder.call(known, values)

    return emit


def zero(kind: ir.Type) -> ir.Constant:
    return ir.Constant(kind, [0.0] * kind.count if isinstance(kind, ir.VectorType) else 0.0)


@dataclass(frozen=True)
class Kinds:
    """Types of LLVM by their letters."""

    dimension: int
    parameters: int
    lanes: int
    block: int = 0  # coordinates of a point that are neighbours in memory; 0: all coordinates, one by one
    stages: int = 1  # of an implicit method

    @property
    def real(self) -> ir.Type:
        return DOUBLE if self.lanes == 1 else ir.VectorType(DOUBLE, self.lanes)

    def of(self, letter: str) -> ir.Type:
        """Type for a letter."""
        if letter == "S":  # of one coordinate where states are in memory
            count = 1 if self.block else self.dimension
            return ir.LiteralStructType([ir.VectorType(DOUBLE, self.stages * self.lanes)] * count)
        if letter == "P" and self.block:
            return ir.LiteralStructType([ir.VectorType(DOUBLE, self.block)])
        points = {"P": self.dimension, "C": self.parameters, "R": 1}
        if letter in points:
            return ir.LiteralStructType([self.real] * points[letter])
        return {"D": DOUBLE, "I": INDEX, "A": DOUBLE.as_pointer(), "B": TRUTH, "V": ir.VoidType()}[letter]


def declare(
    module: ir.Module, symbol: str, kinds: Sequence[ir.Type], result: ir.Type, *, inlined: bool = True
) -> ir.Function:
    """Return a new function that is always inlined, or never."""
    function = ir.Function(module, ir.FunctionType(result, kinds), symbol)
    function.attributes.add("alwaysinline" if inlined else "noinline")
    function.attributes.add("nounwind")
    return function


def numbers_of(builder: ir.IRBuilder, value: ir.Value) -> list[ir.Value]:
    return [builder.extract_value(value, i) for i in range(len(value.type.elements))]


def in_every_lane(builder: ir.IRBuilder, x: ir.Value, vector: ir.Type) -> ir.Value:
    """A double in every lane, or a number of each lane in every stage."""
    if isinstance(x.type, ir.VectorType):
        return shuffled(builder, x, [i % x.type.count for i in range(vector.count)])
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), x, ir.IntType(32)(0))
    return shuffled(builder, first, [0] * vector.count)


def shuffled(builder: ir.IRBuilder, x: ir.Value, places: Sequence[int]) -> ir.Value:
    mask = ir.Constant(ir.VectorType(ir.IntType(32), len(places)), list(places))
    return builder.shuffle_vector(x, ir.Constant(x.type, ir.Undefined), mask)


def stage(builder: ir.IRBuilder, x: ir.Value, j: int, kinds: Kinds) -> ir.Value:
    """The number in each lane of stage ``j``."""
    if kinds.lanes == 1:
        return builder.extract_element(x, ir.IntType(32)(j))
    return shuffled(builder, x, range(j * kinds.lanes, (j + 1) * kinds.lanes))


def folded(builder: ir.IRBuilder, x: ir.Value, kinds: Kinds, combine: Callable[..., ir.Value]) -> ir.Value:
    """The numbers of all stages combined, in each lane: halves with halves, or one stage after the other."""
    if kinds.stages % 2 == 0 and kinds.stages > 2:
        middle = kinds.stages // 2 * kinds.lanes
        halves = (shuffled(builder, x, range(at, at + middle)) for at in (0, middle))
        return folded(builder, combine(builder, *halves), replace(kinds, stages=kinds.stages // 2), combine)
    found = stage(builder, x, 0, kinds)
    for j in range(1, kinds.stages):
        found = combine(builder, found, stage(builder, x, j, kinds))
    return found


def packed(builder: ir.IRBuilder, numbers: Any, kind: ir.Type) -> ir.Value:
    """Pack a number, or nested sequences of numbers, into a value of this type."""
    if isinstance(numbers, ir.Value):
        return numbers
    value = ir.Constant(kind, ir.Undefined)
    members = [kind.element] * kind.count if isinstance(kind, ir.ArrayType) else kind.elements
    for i, (number, member) in enumerate(zip(numbers, members, strict=True)):
        value = builder.insert_value(value, packed(builder, number, member), i)
    return value


def address(builder: ir.IRBuilder, array: ir.Value, row: ir.Value, kinds: Kinds, element: ir.Type) -> ir.Value:
    return builder.bitcast(builder.gep(array, [builder.mul(row, INDEX(kinds.lanes))]), element.as_pointer())


def loaded(builder: ir.IRBuilder, array: ir.Value, row: ir.Value, kinds: Kinds, element: ir.Type) -> ir.Value:
    """A number of this type that begins at a row."""
    found = builder.load(address(builder, array, row, kinds, element))
    found.align = 8
    return found


def write_numbers(module: ir.Module, numbers: Mapping[str, int]) -> None:
    """Define functions that return integers."""
    for name, number in numbers.items():
        function = declare(module, f"{PREFIX}{name}", [], INDEX)
        ir.IRBuilder(function.append_basic_block()).ret(INDEX(int(number)))


Kind = TypeVar("Kind", bound="_Emitted")
#: A method of a value and another, or a Python number.
Binary = Callable[[Kind, Any], Kind]
Comparison = Callable[["LLVMValue", "LLVMValue | float"], "LLVMMask"]


def _broadcast(kind: ir.Type, number: float | int) -> ir.Constant:
    return ir.Constant(kind, [number] * kind.count if isinstance(kind, ir.VectorType) else number)


def _with_lanes_of(kind: ir.Type, element: ir.Type) -> ir.Type:
    return ir.VectorType(element, kind.count) if isinstance(kind, ir.VectorType) else element


class _Emitted:
    """A value of the function that is being built."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder, self.value = builder, value

    def _operand(self, other: Any) -> ir.Value:
        return other.value if isinstance(other, type(self)) else _broadcast(self.value.type, other)

    def _made(self: Kind, name: str, *operands: ir.Value) -> Kind:
        """The result of an instruction, of the type of this value."""
        return type(self)(self.builder, getattr(self.builder, name)(*operands))


def _instruction(name: str) -> Binary[Kind]:
    def method(self: Kind, other: Any) -> Kind:
        return self._made(name, self.value, self._operand(other))

    return method


def _reversed(name: str) -> Binary[Kind]:
    """A method that makes an instruction of a Python number and a value."""

    def method(self: Kind, other: Any) -> Kind:
        return self._made(name, self._operand(other), self.value)

    return method


def _comparison(relation: str) -> Comparison:
    def method(self: LLVMValue, other: LLVMValue | float) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.fcmp_ordered(relation, self.value, self._operand(other)))

    return method


class LLVMMask(_Emitted):
    """A truth value, or one per lane."""

    __slots__ = ()
    __and__: Binary[LLVMMask] = _instruction("and_")
    __or__: Binary[LLVMMask] = _instruction("or_")

    def __invert__(self) -> LLVMMask:
        return self._made("not_", self.value)

    def choose(self, yes: LLVMValue | float, no: LLVMValue | float) -> LLVMValue:
        """``yes`` in the lanes where this is true, ``no`` in the others."""
        kind = _with_lanes_of(self.value.type, DOUBLE)
        choices = [x.value if isinstance(x, LLVMValue) else _broadcast(kind, x) for x in (yes, no)]
        return LLVMValue(self.builder, self.builder.select(self.value, *choices))

    def anywhere(self) -> LLVMMask:
        if not isinstance(self.value.type, ir.VectorType):
            return self
        mask = self.builder.bitcast(self.value, ir.IntType(self.value.type.count))
        return LLVMMask(self.builder, self.builder.icmp_unsigned("!=", mask, ir.Constant(mask.type, 0)))


class LLVMBits(_Emitted):
    """The 64 bits of a double as an integer, or one per lane; sums wrap around."""

    __slots__ = ()
    __add__: Binary[LLVMBits] = _instruction("add")
    __sub__: Binary[LLVMBits] = _instruction("sub")
    __rsub__: Binary[LLVMBits] = _reversed("sub")
    __mul__: Binary[LLVMBits] = _instruction("mul")
    __and__: Binary[LLVMBits] = _instruction("and_")
    __or__: Binary[LLVMBits] = _instruction("or_")
    __xor__: Binary[LLVMBits] = _instruction("xor")
    __lshift__: Binary[LLVMBits] = _instruction("shl")
    __rshift__: Binary[LLVMBits] = _instruction("lshr")  # the high bits become 0

    def at_most(self, other: int) -> LLVMBits:
        """The smaller of this signed number and ``other``."""
        smaller = self.builder.icmp_signed("<", self.value, self._operand(other))
        return LLVMBits(self.builder, self.builder.select(smaller, self.value, self._operand(other)))

    def nonzero(self) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.icmp_unsigned("!=", self.value, self._operand(0)))

    def number(self) -> LLVMValue:
        kind = _with_lanes_of(self.value.type, DOUBLE)
        return LLVMValue(self.builder, self.builder.bitcast(self.value, kind))


class LLVMValue(_Emitted):
    """One LLVM value of type ``double`` or ``<n x double>``; a carrier for :mod:`nearharmonic.core.arithmetic`."""

    __slots__ = ()
    __add__: Binary[LLVMValue] = _instruction("fadd")
    __radd__: Binary[LLVMValue] = _reversed("fadd")
    __sub__: Binary[LLVMValue] = _instruction("fsub")
    __rsub__: Binary[LLVMValue] = _reversed("fsub")
    __mul__: Binary[LLVMValue] = _instruction("fmul")
    __rmul__: Binary[LLVMValue] = _instruction("fmul")
    __truediv__: Binary[LLVMValue] = _instruction("fdiv")
    __rtruediv__: Binary[LLVMValue] = _reversed("fdiv")

    def __neg__(self) -> LLVMValue:
        return self._made("fneg", self.value)

    @property
    def width(self) -> int:
        kind = self.value.type
        return int(kind.count) if isinstance(kind, ir.VectorType) else 1

    def constant(self, number: float) -> LLVMValue:
        return LLVMValue(self.builder, _broadcast(self.value.type, number))

    def _intrinsic(self, name: str, *others: LLVMValue | float) -> LLVMValue:
        operands = [self._operand(x) for x in others]
        return LLVMValue(self.builder, intrinsic(name)(self.builder, self.value, *operands))

    def fma(self, factor: LLVMValue | float, addend: LLVMValue | float) -> LLVMValue:
        return self._intrinsic("fma", factor, addend)

    def sqrt(self) -> LLVMValue:
        return self._intrinsic("sqrt")

    def absolute(self) -> LLVMValue:
        return self._intrinsic("fabs")

    def with_sign_of(self, other: LLVMValue) -> LLVMValue:
        """|self| with the sign bit of ``other``."""
        return self._intrinsic("copysign", other)

    def bits(self) -> LLVMBits:
        return LLVMBits(self.builder, self.builder.bitcast(self.value, _with_lanes_of(self.value.type, INDEX)))

    #: A comparison is false for a NaN.
    less: ClassVar[Comparison] = _comparison("<")
    greater: ClassVar[Comparison] = _comparison(">")
    at_least: ClassVar[Comparison] = _comparison(">=")
    equals: ClassVar[Comparison] = _comparison("==")

    def undefined(self) -> LLVMMask:
        return LLVMMask(self.builder, self.builder.fcmp_unordered("uno", self.value, self.value))

    def lanes(self) -> list[LLVMValue]:
        if self.width == 1:
            return [self]
        index = ir.IntType(32)
        return [
            LLVMValue(self.builder, self.builder.extract_element(self.value, ir.Constant(index, i)))
            for i in range(self.width)
        ]

    def from_lanes(self, scalars: Sequence[LLVMValue]) -> LLVMValue:
        """A value of the type of this one, with the given lanes."""
        if self.width == 1:
            return scalars[0]
        value = ir.Constant(self.value.type, ir.Undefined)
        for i, scalar in enumerate(scalars):
            value = self.builder.insert_element(value, scalar.value, ir.Constant(ir.IntType(32), i))
        return LLVMValue(self.builder, value)

    def times_sign(self, other: LLVMValue) -> LLVMValue:
        """Return -self where other < 0, else self."""
        return other.less(0.0).choose(-self, self)

    def larger(self, other: LLVMValue) -> LLVMValue:
        """self where self > other, else other: a NaN in self is lost, so finiteness needs a separate test."""
        return self.greater(other).choose(self, other)


# --- Numbers in memory: variables, tables, and loops of the function that is being built.

#: A 64-bit integer.
Index = LLVMBits
#: Type of an entry of a table of places.
PLACE = ir.IntType(32)


class Variable:
    """A variable of a function that is written."""

    def __init__(self, builder: ir.IRBuilder, initial: LLVMValue) -> None:
        self._builder = builder
        with builder.goto_entry_block():
            self._room = builder.alloca(initial.value.type)
        self.value = initial

    @property
    def value(self) -> LLVMValue:
        return LLVMValue(self._builder, self._builder.load(self._room))

    @value.setter
    def value(self, new: LLVMValue) -> None:
        self._builder.store(new.value, self._room)


class LoopWriter:
    """Writes loops over blocks, tables and accesses to memory at the end of a function."""

    def __init__(self, builder: ir.IRBuilder) -> None:
        self.builder = builder

    def index(self, number: int) -> Index:
        return Index(self.builder, INDEX(number))

    @contextmanager
    def repeated(self, count: int | Index, begin: int | Index = 0, step: int = 1) -> Iterator[Index]:
        """Write the body of a loop over ``begin``, ``begin`` + ``step``, ... below ``count``."""
        builder = self.builder
        end, start = (self.index(x).value if isinstance(x, int) else x.value for x in (count, begin))
        before, head = builder.block, builder.append_basic_block("repeated")
        body, behind = builder.append_basic_block("body"), builder.append_basic_block("behind")
        builder.branch(head)
        builder.position_at_end(head)
        i = builder.phi(INDEX)
        i.add_incoming(start, before)
        builder.cbranch(builder.icmp_signed("<", i, end), body, behind)
        builder.position_at_end(body)
        yield Index(builder, i)
        i.add_incoming(builder.add(i, INDEX(step)), builder.block)
        builder.branch(head)
        builder.position_at_end(behind)

    def zero(self, width: int) -> LLVMValue:
        kind = DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)
        return LLVMValue(self.builder, ir.Constant(kind, 0.0 if width == 1 else [0.0] * width))

    def place(self, address: ir.Value, offset: Index | int) -> ir.Value:
        """The address ``offset`` doubles behind another."""
        return self.builder.gep(address, [self.index(offset).value if isinstance(offset, int) else offset.value])

    def load(self, address: ir.Value, width: int) -> LLVMValue:
        """``width`` neighbouring doubles."""
        kind = DOUBLE if width == 1 else ir.VectorType(DOUBLE, width)
        value = self.builder.load(self.builder.bitcast(address, kind.as_pointer()))
        value.align = 8
        return LLVMValue(self.builder, value)

    def store(self, value: LLVMValue, address: ir.Value) -> None:
        """Neighbouring doubles."""
        place = self.builder.bitcast(address, value.value.type.as_pointer())
        self.builder.store(value.value, place).align = 8

    def broadcast(self, value: LLVMValue, width: int) -> LLVMValue:
        """A double in every lane."""
        if width == value.width:
            return value
        return self.zero(width).from_lanes([value] * width)

    def gather(self, address: ir.Value, places: Sequence[Index]) -> LLVMValue:
        """The doubles at ``places``, one per lane."""
        scalars = [self.load(self.place(address, place), 1) for place in places]
        return self.zero(len(scalars)).from_lanes(scalars)

    def blocks(self, count: int) -> Iterator[tuple[Index, int, int]]:
        """Blocks of ``count`` results; the caller writes their code in a loop over this generator.

        Yields the index of the first result of a block, its length, and the number of its results that the previous
        block has too: the last block ends with the last result.
        """
        if count < BLOCK:
            with self.repeated(count) as i:
                yield i, 1, 0
            return
        with self.repeated(count // BLOCK) as i:
            yield i * BLOCK, BLOCK, 0
        if count % BLOCK:
            yield self.index(count - BLOCK), BLOCK, BLOCK - count % BLOCK

    def last_lanes(self, skipped: int) -> LLVMMask:
        """The mask of the lanes of a block after the first ``skipped``."""
        lanes = [int(i >= skipped) for i in range(BLOCK)]
        return LLVMMask(self.builder, ir.Constant(ir.VectorType(ir.IntType(1), BLOCK), lanes))

    def table(self, numbers: NDArray[Any]) -> ir.Value:
        """The address of constant numbers: 32-bit integers or doubles."""
        element = DOUBLE if numbers.dtype.kind == "f" else PLACE
        contents = bytearray(numbers.astype("<f8" if element is DOUBLE else "<i4").tobytes())
        module = self.builder.module
        kind = ir.ArrayType(ir.IntType(8), len(contents))
        table = ir.GlobalVariable(module, kind, f"table.{len(module.globals)}")
        table.linkage, table.global_constant, table.align = "internal", True, 64
        table.initializer = ir.Constant(kind, contents)
        return self.builder.bitcast(table, element.as_pointer())

    def looked_up(self, table: ir.Value, first: Index, width: int) -> list[Index]:
        """``width`` neighbouring entries of a table of places."""
        address = self.builder.gep(table, [first.value])
        if width == 1:
            return [Index(self.builder, self.builder.sext(self.builder.load(address), INDEX))]
        kind = ir.VectorType(PLACE, width)
        entries = self.builder.load(self.builder.bitcast(address, kind.as_pointer()))
        entries.align = 4
        lanes = (self.builder.extract_element(entries, ir.Constant(PLACE, i)) for i in range(width))
        return [Index(self.builder, self.builder.sext(lane, INDEX)) for lane in lanes]


def write_function(
    module: ir.Module, name: str, given: Sequence[ir.Type], result: ir.Type, body: Callable[..., Any], *,
    inlined: bool = True,
) -> None:  # fmt: skip
    """Write a function that loops call by its name.

    ``body(builder, ...)`` takes the arguments, a real or a point as the list of its numbers, and returns the numbers of
    the result in its nesting.
    """
    function = declare(module, f"{PREFIX}{name}", given, result, inlined=inlined)
    builder = ir.IRBuilder(function.append_basic_block())
    arguments = [
        [LLVMValue(builder, number) for number in numbers_of(builder, x)]
        if isinstance(x.type, ir.BaseStructType)
        else x
        for x in function.args
    ]
    found = body(builder, *arguments)
    if isinstance(result, ir.VoidType):
        builder.ret_void()
    else:
        builder.ret(packed(builder, _values_of(found), result))


def _values_of(numbers: Any) -> Any:
    return numbers.value if isinstance(numbers, LLVMValue) else [_values_of(number) for number in numbers]
