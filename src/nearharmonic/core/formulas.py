"""The formulas of a system as functions of LLVM, linked to the loops that :mod:`nearharmonic.core.advance` compiles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from hashlib import sha256
from typing import Any

from llvmlite import ir

from nearharmonic.core.layout import TALLY, TURN, TURNS, parameter_rows, running_at
from nearharmonic.core.modified_kick import square
from nearharmonic.core.number import Constant
from nearharmonic.core.operations import DOUBLE, INDEX, PREFIX, Kinds, declare, packed, write_load
from nearharmonic.core.rules import Entries, Rules
from nearharmonic.core.tracing import Double, LLVMValue


@lru_cache(maxsize=64)
def fingerprint(rules: Rules) -> str:
    """Digest of the instructions that the formulas emit: the one thing about a system that compiled code depends on."""
    physics = rules.physics
    if physics.loops is not None:
        digests = " ".join(energy.digest for energy in physics.loops)
        return sha256(f"{digests} {physics.unit_masses}".encode()).hexdigest()
    given = "" if physics.numba is None else f" {physics.numba.digest}"
    return sha256(f"{module_of(rules, 1)} {moving(rules)} {physics.turning}{given}".encode()).hexdigest()


def moving(rules: Rules) -> tuple[bool, ...]:
    """Return of each coordinate whether it ever moves: its dT/dp is not the constant 0."""
    d, builder = rules.physics.dimension, ir.IRBuilder()
    double = ir.DoubleType()
    kinds = [double] * (2 * d + parameter_rows(rules.physics.parameters))
    function = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), kinds), "moving")
    builder = ir.IRBuilder(function.append_basic_block())
    values = [LLVMValue(builder, argument) for argument in function.args]
    velocity = rules.velocity(values[: 2 * d], values[2 * d :])
    return tuple(not (isinstance(v, Constant) and v == 0) for v in velocity)


def module_of(rules: Rules, lanes: int) -> ir.Module:
    """Return a module with what a system and a number of lanes bring to the loops of their form.

    Parameters
    ----------
    rules : Rules
        The system, and what its formulas are computed with.
    lanes : int
        Lanes of the kernel.
    """
    physics, d = rules.physics, rules.physics.dimension
    written = _Formulas(rules, kinds_of(rules, lanes))
    for name, number in {
        "dimension": d, "columns": rules.columns, "tally": 4 * d, "parameters": 4 * d + TALLY,
        "running": running_at(d, physics.parameters),
    }.items():  # fmt: skip
        written.number(name, number)
    written.write()
    if physics.turning is not None:
        for column in range(6 if rules.extended else TURNS):
            written.coefficient(column)
    return written.module


def kinds_of(rules: Rules, lanes: int) -> Kinds:
    """Types of the numbers of a kernel."""
    return Kinds(rules.physics.dimension, parameter_rows(rules.physics.parameters), lanes)


class _Formulas:
    """Functions of one module."""

    def __init__(self, rules: Rules, kinds: Kinds) -> None:
        # A context of its own: a module shows all types of its context, and that of numba has more in some processes.
        self.module, self.rules, self.kinds = ir.Module("formulas", ir.Context()), rules, kinds
        self.real, self.point = kinds.of("R"), kinds.of("P")

    def write(self) -> None:
        """The formulas of the system."""
        rules, d, real, point = self.rules, self.rules.physics.dimension, self.real, self.point
        rates = ir.ArrayType(point, 2) if rules.extended else point

        def halves(entries: Entries) -> Any:
            return [entries[:d], entries[d:]] if rules.extended else entries

        def velocity(p: Entries, low: Entries, c: Entries) -> Any:
            return halves(rules.flat(rules.velocity(p + low, c), p[0]))

        acceleration = rules.physics.acceleration
        self.define("force", rates, "PP", lambda q, low, c: halves(rules.force(q + low, c)))
        if rules.looks_ahead:
            self.define("velocity", rates, "P", lambda p, c: velocity(p, p, c))
        else:
            self.define("velocity", rates, "PP", velocity)
        if rules.looks_ahead and acceleration is not None:
            self.define("acceleration", point, "P", lambda f, c: rules.flat(
                tuple(acceleration(tuple(map(Double, f)), *rules.constants(c))), f[0]
            ))  # fmt: skip
        if rules.physics.modified is not None:
            self.define("square", rates, "PP", lambda q, low, c: halves(square(rules, q + low, c)))
        self.define("energy", ir.ArrayType(real, 2), "PPPP", lambda *x: _each(rules.energy(_joined(x), x[-1]).pair))
        self.define("energies", ir.ArrayType(real, 4), "PPPP", lambda *x: _each(rules.first_energy(_joined(x), x[-1])))
        if rules.quick_energy:
            found = ir.LiteralStructType([point, real])
            self.define(
                "force_and_potential", found, "PP", lambda q, low, c: _split(rules.force_and_potential(q + low, c))
            )
            self.define("potential", real, "PP", lambda q, low, c: rules.potential(q + low, c))
            self.define("balanced_T", real, "P", lambda p, c: [rules.quick_T(p + p, c)])
            self.define("rounding", ir.ArrayType(real, 2), "PPPP", lambda *x: _each(rules.rounding(_joined(x), x[-1])))
        if not all(moves := moving(rules)):
            self.define("moved", point, "PP", lambda new, old: [
                x if moves[i] else y for i, (x, y) in enumerate(zip(new, old, strict=True))
            ], given=False)  # fmt: skip

    def define(self, name: str, result: ir.Type, letters: str, body: Callable[..., Any], *, given: bool = True) -> None:
        """A function of points and, if they are ``given``, of the parameters."""
        kinds = [self.kinds.of(letter) for letter in (f"{letters}C" if given else letters)]
        function = declare(self.module, f"{PREFIX}{name}", kinds, result)
        if name == "energy" and self.rules.quick_energy:  # long and seldom: it takes no registers from the loop
            function.attributes.discard("alwaysinline")
            function.attributes.add("noinline")
        builder = ir.IRBuilder(function.append_basic_block())
        found = body(
            *(
                [LLVMValue(builder, builder.extract_value(x, i)) for i in range(len(x.type.elements))]
                for x in function.args
            )
        )
        builder.ret(packed(builder, _values(found), result))

    def number(self, name: str, number: int) -> None:
        """A function that returns a whole number."""
        function = declare(self.module, f"{PREFIX}{name}", [], INDEX)
        ir.IRBuilder(function.append_basic_block()).ret(INDEX(number))

    def coefficient(self, column: int) -> None:
        """A function that loads a coefficient of each coordinate where an oscillator is solved exactly."""
        turning = self.rules.physics.turning
        assert turning is not None
        size, first = (6, 2 * TURN) if self.rules.extended else (TURNS, TURN)
        function = declare(self.module, f"{PREFIX}turn{column}", [DOUBLE.as_pointer(), INDEX], self.point)
        builder = ir.IRBuilder(function.append_basic_block())
        rows = [first + size * place + column for place in turning]
        array, row = function.args
        write_load(builder, array, row, self.kinds, self.point, rows)


def _joined(numbers: Sequence[Entries]) -> Entries:
    """The rows of a state, without the parameters behind it."""
    return [entry for point in numbers[:-1] for entry in point]


def _each(numbers: Sequence[LLVMValue]) -> list[Entries]:
    return [[number] for number in numbers]


def _split(entries: Entries) -> list[Entries]:
    return [entries[:-1], entries[-1:]]


def _values(numbers: Any) -> Any:
    return numbers.value if isinstance(numbers, LLVMValue) else [_values(number) for number in numbers]
