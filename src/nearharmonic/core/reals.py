"""The language of compiled loops: Python functions that are read and written as LLVM instructions.

A *real* is a number, or one in each lane; a *point* is one real for each coordinate. *Stages* are points of the stages
of an implicit method, side by side. The syntax tree of a loop is walked for a number of coordinates and of lanes. A
formula of a system is a call of a function that is linked later.

Functions of loops use a part of Python: arithmetic, comparisons, tuples, arrays of numbers, ``if``, ``while``, ``for``
over ``range``, and calls, which are inlined. What is known while the instructions are written, such as an option of a
form, is decided then. A name that is assigned more than once is a variable of one kind.
"""

from __future__ import annotations

import ast
import builtins
import linecache
import operator
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache, partial
from inspect import signature as parameters_of
from math import isnan
from types import CodeType, FunctionType
from typing import Any

from llvmlite import ir

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import Argument, Signature, running_at, running_rows
from nearharmonic.core.values import (
    DOUBLE,
    INDEX,
    PREFIX,
    TRUTH,
    Kinds,
    address,
    argument_types,
    folded,
    in_every_lane,
    intrinsic,
    loaded,
    numbers_of,
    packed,
    result_type,
    zero,
)
from nearharmonic.errors import CompiledCodeError

#: Kinds of values, as in :mod:`nearharmonic.core.values`; beside them are N, an array of integers, and no value.
REAL, POINT, PARAMETERS, STAGES, VOID = "RPCSV"
#: Numbers that are converted to the kind on their right beside one, with their types.
_RANKS = "BID"
_TYPES = {"B": TRUTH, "I": INDEX, "D": DOUBLE}
_SCALARS = {"int64": "I", "float64": "D", "bool": "B"}


class Number:
    """A value of the function that is being written, as one number of LLVM for each coordinate."""

    __slots__ = ("kind", "values")

    def __init__(self, kind: str, *values: ir.Value) -> None:
        self.kind, self.values = kind, values

    @property
    def value(self) -> ir.Value:
        """A single number."""
        return self.values[0]

    @property
    def has_coordinates(self) -> bool:
        return self.kind in (REAL, POINT, PARAMETERS, STAGES)


class Variable(Number):
    """The places on the stack of the numbers of a value."""

    __slots__ = ()


class Instruction:
    """A function of loops that writes instructions: ``write(writer, ...)`` returns its result."""

    def __init__(self, write: Callable[..., Any]) -> None:
        self.write = write


# --- Operations on reals and points, and functions that are linked later.
#
# An operation is one instruction per coordinate, rounded once, for any number of lanes. Beside a point, a real or a
# double is the same in each coordinate.


def _elementwise(emit: Callable[..., ir.Value], first: int = 0) -> Any:
    """An operation whose result is of stages if an operand from ``first`` on is, or a point, or a real."""

    def write(writer: Writer, *given: Any) -> Number:
        numbers = [writer.number(x) for x in given]
        kind = next(kind for kind in (STAGES, POINT, REAL) if any(x.kind == kind for x in numbers[first:]))
        columns = [writer.coordinates(x, kind) for x in numbers]
        return Number(kind, *(emit(writer.builder, *column) for column in zip(*columns, strict=True)))

    return Instruction(write)


def _where(relation: str) -> Callable[..., ir.Value]:
    return lambda b, x, y, yes, no: b.select(b.fcmp_ordered(relation, x, y), yes, no)


def _larger(builder: ir.IRBuilder, x: ir.Value, y: ir.Value) -> ir.Value:
    return _where(">")(builder, x, y, x, y)


#: ``where_greater(x, y, yes, no)`` is ``yes`` in the lanes where x > y, else ``no``; ``where_zero(x, yes, no)`` asks
#: for x = 0, and ``larger(x, y)`` is x where x > y, else y: a NaN in x is dropped.
absolute, larger = _elementwise(intrinsic("fabs")), _elementwise(_larger)
where_greater = _elementwise(_where(">"), 2)
where_zero = _elementwise(lambda b, x, yes, no: _where("==")(b, x, zero(x.type), yes, no), 1)


def _everywhere(emit: Callable[..., ir.Value]) -> Any:
    """A comparison of a real that is True if it is in every lane."""

    def write(writer: Writer, *given: Any) -> Number:
        found = emit(writer.builder, *(writer.coordinates(writer.number(x), REAL)[0] for x in given))
        if writer.kinds.lanes > 1:
            bits = writer.builder.bitcast(found, ir.IntType(writer.kinds.lanes))
            found = writer.builder.icmp_unsigned("==", bits, ir.Constant(bits.type, (1 << writer.kinds.lanes) - 1))
        return Number("B", found)

    return Instruction(write)


#: True if x <= bound, x > bound, or x = 0, in every lane; False for a NaN.
all_within = _everywhere(lambda b, x, y: b.not_(b.fcmp_unordered(">", x, y)))
all_greater = _everywhere(lambda b, x, y: b.fcmp_ordered(">", x, y))
all_zero = _everywhere(lambda b, x: b.fcmp_ordered("==", x, zero(x.type)))


def _largest_modulus(writer: Writer, point: Number) -> Number:
    found = zero(point.value.type)
    for x in point.values:
        found = _larger(writer.builder, intrinsic("fabs")(writer.builder, x), found)
    return Number(REAL, folded(writer.builder, found, writer.kinds, _larger) if point.kind == STAGES else found)


#: The largest |x| of the coordinates, in each lane.
largest_modulus: Any = Instruction(_largest_modulus)


def _loader(kind: str) -> Any:
    def write(writer: Writer, array: Number, row: Any) -> Number:
        apart = writer.kinds.stages if kind == STAGES else 1
        types, builder, at = writer.kinds.of(kind).elements, writer.builder, writer.as_kind(row, "I").value
        places = (builder.add(at, INDEX(i * apart)) for i in range(len(types)))
        pairs = zip(places, types, strict=True)
        return Number(kind, *(loaded(builder, array.value, at, writer.kinds, x) for at, x in pairs))

    return Instruction(write)


#: ``load_...(array, row)`` returns the numbers in the rows from ``row`` on.
load_real, load_point, load_parameters, load_stages = map(_loader, (REAL, POINT, PARAMETERS, STAGES))


def _store(writer: Writer, array: Number, row: Any, value: Any) -> None:
    number, builder, at = writer.number(value), writer.builder, writer.as_kind(row, "I").value
    apart = writer.kinds.stages if number.kind == STAGES else 1
    for i, x in enumerate(number.values):
        place = address(builder, array.value, builder.add(at, INDEX(i * apart)), writer.kinds, x.type)
        builder.store(x, place).align = 8


def _store_rest(writer: Writer, array: Number, row: Any, value: Number) -> None:
    count = writer.kinds.dimension % writer.kinds.block
    rest = (writer.builder.extract_element(value.value, ir.IntType(32)(i)) for i in range(count))
    _store(writer, array, row, Number(POINT, *rest))


#: ``store(array, row, value)`` stores a value in the rows from ``row`` on, ``store_rest`` only the coordinates of the
#: value behind the last full block.
store: Any = Instruction(_store)
store_rest: Any = Instruction(_store_rest)


def _shifted(writer: Writer, array: Number, by: Any) -> Number:
    return Number(array.kind, writer.builder.gep(array.value, [writer.as_kind(by, "I").value]))


#: ``shifted(array, by)`` is an array from a later number on.
shifted: Any = Instruction(_shifted)


def _scratch(writer: Writer) -> Number:
    kinds = writer.kinds
    rows = running_at(kinds.dimension, kinds.parameters // 2) + running_rows(kinds.dimension)
    with writer.builder.goto_entry_block():
        array = writer.builder.alloca(ir.ArrayType(DOUBLE, rows))
        return Number("A", writer.builder.gep(array, [INDEX(0), INDEX(0)]))


#: ``scratch()`` is an array on the stack, for the rows of a kernel with one lane.
scratch: Any = Instruction(_scratch)


def linked(name: str, result: Any) -> Any:
    """Return a function that is linked later: a formula, or a function of the shape of a system.

    The result is of a kind, or a tuple of kinds.
    """

    def write(writer: Writer, *given: Any) -> Any:
        builder, of, module, symbol = writer.builder, writer.kinds.of, writer.builder.module, PREFIX + name
        numbers = map(writer.number, given)
        values = [packed(builder, x.values, of(x.kind)) if x.has_coordinates else x.value for x in numbers]
        kinds = list(map(of, result))
        same = len(set(result)) == 1
        several = ir.ArrayType(kinds[0], len(kinds)) if same else ir.LiteralStructType(kinds)
        kind = ir.FunctionType(several if isinstance(result, tuple) else kinds[0], [x.type for x in values])
        found = builder.call(module.globals.get(symbol) or ir.Function(module, kind, symbol), values)
        if isinstance(result, tuple):
            return tuple(writer.unpacked(builder.extract_value(found, i), one) for i, one in enumerate(result))
        return None if result == VOID else writer.unpacked(found, result)

    return Instruction(write)


def linked_number(name: str) -> Any:
    """Return a function without arguments that is linked later and returns an integer."""
    return linked(name, "I")


def at_address(signature: Signature) -> Any:
    """Return ``call(address, ...)``, which calls a C function; the lengths of an array follow the array."""
    pointer = ir.FunctionType(result_type(signature), argument_types(signature)).as_pointer()

    def write(writer: Writer, place: Number, *given: Any) -> Any:
        numbers, builder = [writer.number(x) for x in given], writer.builder
        passed = [builder.zext(x.value, ir.IntType(8)) if x.kind == "B" else x.value for x in numbers]
        found = builder.call(builder.inttoptr(place.value, pointer), passed)
        return Number(_SCALARS[signature.result], found) if signature.result else None

    return Instruction(write)


def _zero_like(writer: Writer, value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_zero_like(writer, x) for x in value)
    return Number(value.kind, *(zero(x.type) for x in value.values))


#: 0, or a tuple of zeros, of the kind of a value.
zero_like: Any = Instruction(_zero_like)


def _fma(writer: Writer, *given: Any) -> Any:
    numbers = [writer.number(x) for x in given]
    if any(x.has_coordinates for x in numbers):
        return _elementwise(intrinsic("fma")).write(writer, *numbers)
    return Number("D", intrinsic("fma")(writer.builder, *(x.value for x in numbers)))


def _modulus(writer: Writer, x: Number) -> Number:
    return Number("D", intrinsic("fabs")(writer.builder, x.value))


def _extreme(relation: str) -> Callable[..., Number]:
    """The smaller or the larger of two integers."""

    def write(writer: Writer, *given: Any) -> Number:
        x, y = (writer.number(one).value for one in given)
        return Number("I", writer.builder.select(writer.builder.icmp_signed(relation, y, x), y, x))

    return write


def _is_nan(writer: Writer, x: Number) -> Number:
    return Number("B", writer.builder.fcmp_unordered("uno", x.value, x.value))


#: Functions of Python with instructions of their own.
_KNOWN: dict[Any, Callable[..., Any]] = {
    arithmetic.fma: _fma, abs: _modulus, min: _extreme("<"), max: _extreme(">"), isnan: _is_nan,
    float: lambda writer, x: writer.as_kind(x, "D"),
    int: lambda writer, x: Number("I", writer.builder.fptosi(x.value, INDEX)),
}  # fmt: skip
_BINARY: dict[type[ast.operator], tuple[Callable[..., Any], str, str]] = {
    ast.Add: (operator.add, "add", "fadd"), ast.Sub: (operator.sub, "sub", "fsub"),
    ast.Mult: (operator.mul, "mul", "fmul"), ast.Div: (operator.truediv, "", "fdiv"),
    # Of integers that are not negative.
    ast.FloorDiv: (operator.floordiv, "sdiv", ""), ast.Mod: (operator.mod, "srem", ""),
}  # fmt: skip
_RELATIONS: dict[type[ast.cmpop], tuple[Callable[..., Any], str]] = {
    ast.Lt: (operator.lt, "<"), ast.LtE: (operator.le, "<="), ast.Gt: (operator.gt, ">"), ast.GtE: (operator.ge, ">="),
    ast.Eq: (operator.eq, "=="), ast.NotEq: (operator.ne, "!="),
}  # fmt: skip


# --- The source of functions.


@cache
def _functions(file: str) -> dict[tuple[int, tuple[str, ...]], Any]:
    """Functions of a file by their first line and their arguments."""
    found: dict[tuple[int, tuple[str, ...]], Any] = {}
    for node in ast.walk(ast.parse("".join(linecache.getlines(file)))):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            found[node.lineno, tuple(argument.arg for argument in node.args.args)] = node
    return found


@cache
def _source(code: CodeType) -> tuple[list[ast.stmt], frozenset[str]]:
    """The statements of a function, and the names that are assigned more than once."""
    node = _functions(code.co_filename).get((code.co_firstlineno, code.co_varnames[: code.co_argcount]))
    if node is None:
        raise CompiledCodeError(
            f"no source of {code.co_qualname} in {code.co_filename}, which a kernel is written from"
        )
    body = [ast.Return(node.body)] if isinstance(node, ast.Lambda) else node.body
    assigned = Counter(argument.arg for argument in node.args.args)
    for inner in (inner for statement in body for inner in ast.walk(statement)):
        if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store):
            assigned[inner.id] += 1
        elif isinstance(inner, ast.AugAssign) and isinstance(inner.target, ast.Name):
            assigned[inner.target.id] += 1
    return body, frozenset(name for name, count in assigned.items() if count > 1 and name != "_")


# --- Writing.


class Writer(ast.NodeVisitor):
    """Writer of the instructions of one call of a function and of the functions that it calls.

    ``builder`` is at the place where they go. A value is a number, a tuple of values, or what Python knows already.
    """

    def __init__(self, builder: ir.IRBuilder, kinds: Kinds) -> None:
        self.builder, self.kinds = builder, kinds
        self.names: dict[str, Any] = {}
        self.loops: list[tuple[ir.Block, ir.Block]] = []  # where ``continue`` and ``break`` go
        self.conditional = 0  # depth of statements that are executed or not
        self.exit: ir.Block | None = None  # where ``return`` in such a statement goes
        self.is_over, self.result = False, None

    def inlined(self, function: Any, given: Sequence[Any]) -> Any:
        """Write a function for values of its arguments, and return its result."""
        code = function.__code__
        body, self.assigned = _source(code)
        self.outer = function.__globals__
        self.cells = dict(zip(code.co_freevars, function.__closure__ or (), strict=True))
        for name, value in zip(code.co_varnames[: code.co_argcount], given, strict=True):
            self._assign_name(name, value)
        self._statements(body)
        if self.exit is None:
            return self.result
        if not self.builder.block.is_terminated:
            self.builder.branch(self.exit)
        self.builder.position_at_end(self.exit)
        return self._loaded(self.result)

    def generic_visit(self, node: ast.AST) -> Any:
        raise TypeError(f"{ast.unparse(node)!r}: the language of loops has no {type(node).__name__}")

    # Values.

    def number(self, value: Any) -> Number:
        """A value as a number, which it may be in Python."""
        if isinstance(value, Number):
            return value
        return self.as_kind(value, "B" if isinstance(value, bool) else "I" if isinstance(value, int) else "D")

    def as_kind(self, value: Any, kind: str) -> Number:
        """A number, which may be one of Python, as a truth value, an integer or a double."""
        if not isinstance(value, Number):
            return Number(kind, ir.Constant(_TYPES[kind], float(value) if kind == "D" else int(value)))
        if value.kind == kind:
            return value
        if not (kind in _RANKS and value.kind in _RANKS and _RANKS.index(value.kind) < _RANKS.index(kind)):
            raise TypeError(f"a number of kind {value.kind} is none of kind {kind}")
        convert = "zext" if kind == "I" else "uitofp" if value.kind == "B" else "sitofp"
        return Number(kind, getattr(self.builder, convert)(value.value, _TYPES[kind]))

    def coordinates(self, number: Number, kind: str) -> list[ir.Value]:
        """The coordinates of a number; a single one is repeated for each coordinate of a value of ``kind``."""
        kinds = self.kinds.of(kind).elements
        found = [
            x if x.type == kinds[0] else in_every_lane(self.builder, x, kinds[0])
            for x in (number if number.has_coordinates else self.as_kind(number, "D")).values
        ]
        return found * len(kinds) if len(found) == 1 else found

    def unpacked(self, value: ir.Value, kind: str) -> Number:
        """The result of a function that is linked."""
        return Number(kind, *numbers_of(self.builder, value)) if kind in "RPCS" else Number(kind, value)

    def truth(self, number: Number) -> ir.Value:
        return number.value if number.kind == "B" else self._compared(ast.NotEq(), number, 0).value

    def visit_Constant(self, node: ast.Constant) -> Any:
        return node.value

    def visit_Tuple(self, node: ast.Tuple) -> Any:
        return tuple(self._values(node.elts))

    def _values(self, nodes: Sequence[ast.expr]) -> list[Any]:
        found: list[Any] = []
        for node in nodes:
            found += self.visit(node.value) if isinstance(node, ast.Starred) else [self.visit(node)]
        return found

    def visit_Name(self, node: ast.Name) -> Any:
        if node.id in self.names:
            return self._loaded(self.names[node.id])
        if node.id in self.cells:
            return self.cells[node.id].cell_contents
        return self.outer[node.id] if node.id in self.outer else getattr(builtins, node.id)

    def visit_Subscript(self, node: ast.Subscript) -> Any:
        whole = self.visit(node.value)
        if isinstance(whole, tuple):
            return whole[self.visit(node.slice)]
        return Number("I" if whole.kind == "N" else "D", self.builder.load(self._place(whole, node.slice)))

    def _place(self, array: Number, index: ast.expr) -> ir.Value:
        return self.builder.gep(array.value, [self.as_kind(self.visit(index), "I").value])

    def visit_Call(self, node: ast.Call) -> Any:
        function, given = self.visit(node.func), self._values(node.args)
        if isinstance(function, Instruction):
            return function.write(self, *given)
        if function in _KNOWN and any(isinstance(x, Number) for x in given):
            return _KNOWN[function](self, *given)
        if isinstance(function, FunctionType):
            return Writer(self.builder, self.kinds).inlined(function, given)
        return function(*given)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        x = self.visit(node.operand)
        if isinstance(node.op, ast.Not):
            return Number("B", self.builder.not_(self.truth(x))) if isinstance(x, Number) else not x
        if not isinstance(x, Number):
            return -x
        if x.has_coordinates:
            return _elementwise(lambda b, y: b.fneg(y)).write(self, x)
        return Number(x.kind, (self.builder.fneg if x.kind == "D" else self.builder.neg)(x.value))

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        if type(node.op) not in _BINARY:
            self.generic_visit(node.op)
        return self._combined(node.op, self.visit(node.left), self.visit(node.right))

    def _combined(self, symbol: ast.operator, *operands: Any) -> Any:
        of_python, of_integers, of_doubles = _BINARY[type(symbol)]
        if not any(isinstance(x, Number) for x in operands):
            return of_python(*operands)
        numbers = [self.number(x) for x in operands]
        if any(x.has_coordinates for x in numbers):
            return _elementwise(lambda b, x, y: getattr(b, of_doubles)(x, y)).write(self, *numbers)
        kind = "D" if not of_integers or any(x.kind == "D" for x in numbers) else "I"
        write = getattr(self.builder, of_doubles if kind == "D" else of_integers)
        return Number(kind, write(*(self.as_kind(x, kind).value for x in numbers)))

    def visit_Compare(self, node: ast.Compare) -> Any:
        ((symbol,), (right,)) = node.ops, node.comparators
        return self._compared(symbol, self.visit(node.left), self.visit(right))

    def _compared(self, symbol: ast.cmpop, *operands: Any) -> Any:
        of_python, relation = _RELATIONS[type(symbol)]
        if not any(isinstance(x, Number) for x in operands):
            return of_python(*operands)
        numbers = [self.number(x) for x in operands]
        kind = "D" if any(x.kind == "D" for x in numbers) else "I"
        x, y = (self.as_kind(one, kind).value for one in numbers)
        if kind == "I":
            return Number("B", self.builder.icmp_signed(relation, x, y))
        compare = self.builder.fcmp_unordered if relation == "!=" else self.builder.fcmp_ordered
        return Number("B", compare(relation, x, y))

    def visit_BoolOp(self, node: ast.BoolOp) -> Any:
        first, *others = node.values
        rest = partial(self.visit_BoolOp, ast.BoolOp(node.op, others)) if others[1:] else partial(self.visit, others[0])
        both = isinstance(node.op, ast.And)
        return self._chosen(self.visit(first), *((rest, lambda: False) if both else (lambda: True, rest)))

    def visit_IfExp(self, node: ast.IfExp) -> Any:
        return self._chosen(self.visit(node.test), partial(self.visit, node.body), partial(self.visit, node.orelse))

    def _chosen(self, test: Any, yes: Callable[[], Any], no: Callable[[], Any]) -> Any:
        """The one of two values that a test asks for; the other one is not computed."""
        if not isinstance(test, Number):
            return yes() if test else no()
        then, other = self._branches(test)
        behind, variable = self.builder.append_basic_block("behind"), None
        for block, compute in ((then, yes), (other, no)):
            self.builder.position_at_end(block)
            value = compute()
            variable = variable or self._variable(value)
            self._store(variable, value)
            self.builder.branch(behind)
        self.builder.position_at_end(behind)
        return self._loaded(variable)

    def _branches(self, test: Number) -> tuple[ir.Block, ir.Block]:
        """Branch by a test to one of two new blocks."""
        yes, no = (self.builder.append_basic_block(name) for name in ("yes", "no"))
        self.builder.cbranch(self.truth(test), yes, no)
        return yes, no

    # Variables.

    def _variable(self, value: Any) -> Any:
        """New variables for the numbers of a value."""
        if value is None or isinstance(value, tuple):
            return value and tuple(map(self._variable, value))
        number = self.number(value)
        with self.builder.goto_entry_block():
            return Variable(number.kind, *(self.builder.alloca(x.type) for x in number.values))

    def _loaded(self, variable: Any) -> Any:
        if isinstance(variable, tuple):
            return tuple(map(self._loaded, variable))
        if not isinstance(variable, Variable):
            return variable
        return Number(variable.kind, *map(self.builder.load, variable.values))

    def _store(self, variable: Any, value: Any) -> None:
        if isinstance(variable, tuple):
            for one, x in zip(variable, value, strict=True):
                self._store(one, x)
        elif variable is not None:
            for x, place in zip(self.as_kind(value, variable.kind).values, variable.values, strict=True):
                self.builder.store(x, place)

    def _assign_name(self, name: str, value: Any) -> None:
        if name not in self.assigned:
            self.names[name] = value
            return
        if name not in self.names:
            self.names[name] = self._variable(value)
        self._store(self.names[name], value)

    def _assign(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Tuple):
            for one, x in zip(target.elts, value, strict=True):
                self._assign(one, x)
        elif isinstance(target, ast.Subscript):
            array = self.visit(target.value)
            number = self.as_kind(value, "I" if array.kind == "N" else "D")
            self.builder.store(number.value, self._place(array, target.slice))
        else:
            assert isinstance(target, ast.Name)
            self._assign_name(target.id, value)

    # Statements.

    def _statements(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self.is_over or self.builder.block.is_terminated:
                return
            self.visit(statement)

    def _conditional(self, statements: Sequence[ast.stmt], at: ir.Block, behind: ir.Block) -> None:
        """Write statements that may be executed, from a block to another."""
        self.builder.position_at_end(at)
        self.conditional += 1
        self._statements(statements)
        self.conditional -= 1
        if not self.builder.block.is_terminated:
            self.builder.branch(behind)

    def visit_Expr(self, node: ast.Expr) -> None:
        self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        value = self.visit(node.value)
        for target in node.targets:
            self._assign(target, value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._assign(node.target, self._combined(node.op, self.visit(node.target), self.visit(node.value)))

    def visit_Return(self, node: ast.Return) -> None:
        value = None if node.value is None else self.visit(node.value)
        if self.exit is None and not self.conditional:
            self.is_over, self.result = True, value
            return
        if self.exit is None:
            self.exit, self.result = self.builder.append_basic_block("exit"), self._variable(value)
        self._store(self.result, value)
        self.builder.branch(self.exit)

    def visit_If(self, node: ast.If) -> None:
        test = self.visit(node.test)
        if not isinstance(test, Number):
            self._statements(node.body if test else node.orelse)
            return
        yes, no = self._branches(test)
        behind = self.builder.append_basic_block("behind")
        self._conditional(node.body, yes, behind)
        self._conditional(node.orelse, no, behind)
        self.builder.position_at_end(behind)

    def visit_Break(self, node: ast.Break) -> None:
        self.builder.branch(self.loops[-1][1])

    def visit_Continue(self, node: ast.Continue) -> None:
        self.builder.branch(self.loops[-1][0])

    def visit_While(self, node: ast.While) -> None:
        head = self.builder.append_basic_block("head")
        self.builder.branch(head)
        self.builder.position_at_end(head)
        test = self.visit(node.test)
        body, behind = self._branches(self.number(test))
        self._repeat(node.body, body, head, behind)

    def _repeat(self, statements: Sequence[ast.stmt], body: ir.Block, again: ir.Block, behind: ir.Block) -> None:
        self.loops.append((again, behind))
        self._conditional(statements, body, again)
        self.loops.pop()
        self.builder.position_at_end(behind)

    def visit_For(self, node: ast.For) -> None:
        assert isinstance(node.iter, ast.Call)
        given = self._values(node.iter.args)
        limits = [0, *given, 1] if len(given) == 1 else [*given, 1]
        start, end, step = (self.as_kind(x, "I").value for x in limits[:3])
        before, head, again = self.builder.block, *map(self.builder.append_basic_block, ("head", "again"))
        self.builder.branch(head)
        self.builder.position_at_end(head)
        i = self.builder.phi(INDEX)
        i.add_incoming(start, before)
        body, behind = self._branches(Number("B", self.builder.icmp_signed("<", i, end)))
        self.builder.position_at_end(again)
        i.add_incoming(self.builder.add(i, step, flags=("nsw",)), again)
        self.builder.branch(head)
        self.builder.position_at_end(body)
        self._assign(node.target, Number("I", i))
        self._repeat(node.body, body, again, behind)
        if isinstance(node.target, ast.Name) and node.target.id not in self.assigned:
            del self.names[node.target.id]  # it is one step further than Python's variable


def written(function: Callable[..., Any], signature: Signature, kinds_of_values: Kinds) -> ir.Module:
    """Return a module with a C function of this signature.

    The function takes those arguments of the signature that it names: numbers, addresses of arrays, and lengths of
    arrays.
    """
    module = ir.Module(function.__name__, ir.Context())
    names = [name for argument in signature.arguments for name in (argument.name, *argument.lengths)]
    kinds, result = argument_types(signature), result_type(signature)
    entry = ir.FunctionType(result, [INDEX.as_pointer()] if signature.packed else kinds)
    outer = ir.Function(module, entry, function.__name__)
    builder = ir.IRBuilder(outer.append_basic_block())
    given: dict[str, ir.Value] = dict(zip(names, outer.args, strict=False))
    if signature.packed:
        slots = (builder.gep(outer.args[0], [INDEX(i)]) for i in range(len(names)))  # of 8 bytes each
        pointers = (builder.bitcast(slot, kind.as_pointer()) for slot, kind in zip(slots, kinds, strict=True))
        given = dict(zip(names, map(builder.load, pointers), strict=True))
    letters = {argument.name: _letter(argument) for argument in signature.arguments}
    for name, letter in letters.items():
        if letter == "B":
            given[name] = builder.trunc(given[name], TRUTH)
    taken = [Number(letters.get(name, "I"), given[name]) for name in parameters_of(function).parameters]
    writer = Writer(builder, kinds_of_values)
    found = writer.inlined(function, taken)
    if signature.result:
        builder.ret(writer.as_kind(found, _SCALARS[signature.result]).value)
    else:
        builder.ret_void()
    return module


def _letter(argument: Argument) -> str:
    letter = _SCALARS[argument.scalar]
    return {"D": "A", "I": "N"}[letter] if argument.dimensions else letter
