"""Formulas of many coordinates as functions of LLVM that read the rows of a kernel and store gradients behind them.

:mod:`nearharmonic.core.large.state` calls them. The rows end with memory for intermediate results of the loops, see
:func:`room`.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from typing import Any

from llvmlite import ir

from nearharmonic.core.collocation import formulas as stages
from nearharmonic.core.formulas.physics import Physics
from nearharmonic.core.formulas.rules import Rules, rounding_of
from nearharmonic.core.large.emission import Emission
from nearharmonic.core.large.energy import LoopedEnergy
from nearharmonic.core.large.memory import ConditionedDoubles, DoubleDoubles, Doubles, Index, LoopWriter, Planes
from nearharmonic.core.large.tables import BLOCK
from nearharmonic.core.layout import COUNTERS, TALLY, running_at, running_rows
from nearharmonic.core.machine.operations import DOUBLE, INDEX, PREFIX, Kinds, declare, packed, write_numbers


def room(physics: Physics, extended: bool) -> int:
    """Return the number of doubles behind the running state that the loops of a kernel store results in."""
    assert physics.loops is not None
    V, T = physics.loops
    stages = 0 if physics.stages is None else physics.stages.stages
    scratch = physics.dimension * (stages + 2) + BLOCK if stages else 0
    return BLOCK + _planes(V, T, extended) * (V.room + T.room) + scratch


def _planes(V: LoopedEnergy, T: LoopedEnergy, extended: bool) -> int:
    """Planes of the stored numbers: two if energies of several levels are computed in double-double."""
    return 2 if extended or max(len(V.levels), len(T.levels)) > 1 else 1


def module_of(rules: Rules, kinds: Kinds, needed: Container[str]) -> ir.Module:
    """Return a module with the functions of a system of many coordinates that loops of its form call."""
    d = rules.physics.dimension
    written = _Functions(rules, kinds, needed)
    write_numbers(written.module, {
        "dimension": d, "columns": rules.columns, "tally": 4 * d, "parameters": 4 * d + TALLY,
        "running": written.running, "force_at": written.force_at, "force_plane": written.V.room,
        "velocity_at": written.velocity_at, "velocity_plane": written.T.room,
    })  # fmt: skip
    written.write()
    if rules.physics.stages is not None:
        write_numbers(written.module, {
            "counters": written.end - COUNTERS, "scratch": written.scratch, "stages": written.stages,
        })  # fmt: skip
        stages.write(written.module, rules, kinds, needed)
    return written.module


class _Functions:
    """The functions of one module."""

    def __init__(self, rules: Rules, kinds: Kinds, needed: Container[str]) -> None:
        physics, d = rules.physics, rules.physics.dimension
        assert physics.loops is not None
        self.rules, self.kinds, self.needed, (self.V, self.T) = rules, kinds, needed, physics.loops
        self.running = running_at(d, physics.parameters)
        self.stages = 0 if physics.stages is None else physics.stages.stages
        self.end = self.running + running_rows(d, self.stages)
        planes = _planes(self.V, self.T, rules.extended)
        self.force_at = -(-self.end // BLOCK) * BLOCK
        self.velocity_at = self.force_at + planes * self.V.room
        self.scratch = -(-(self.velocity_at + planes * self.T.room) // BLOCK) * BLOCK
        self.number: Doubles = DoubleDoubles() if rules.extended else Doubles()
        self.module = ir.Module("formulas")

    def write(self) -> None:
        """Write the formulas of the system, for the running state or for the output state."""
        real, nothing = self.kinds.of("R"), ir.VoidType()
        number, exact = self.number, DoubleDoubles()

        def energies(writer: LoopWriter, rows: ir.Value) -> list[Any]:
            T, V = (self._emission(writer, rows, energy, exact).value() for energy in (self.T, self.V))
            return [*(T + V).pair, T.high, T.high.constant(0.0)]

        def rounding(writer: LoopWriter, rows: ir.Value) -> list[Any]:
            conditioned = ConditionedDoubles()
            return rounding_of(
                *(self._emission(writer, rows, energy, conditioned).value() for energy in (self.T, self.V))
            )

        def gradient(writer: LoopWriter, rows: ir.Value) -> Any:
            return number.written(self._emission(writer, rows, self.V, number, self.running).gradient())[0]

        def velocities(writer: LoopWriter, rows: ir.Value, state: ir.Value) -> None:
            self._emission(writer, rows, self.T, number, Index(writer.builder, state)).gradient()

        def value(energy: LoopedEnergy) -> Callable[..., Any]:
            return lambda writer, rows: number.written(self._emission(writer, rows, energy, number).value())[0]

        self._define("force", nothing, gradient)
        self._define("force_and_potential", real, gradient)
        self._define("velocities", nothing, velocities, INDEX)
        self._define("potential", real, value(self.V))
        self._define("kinetic", real, value(self.T))
        self._define("energy", ir.ArrayType(real, 2), lambda writer, rows: energies(writer, rows)[:2])
        self._define("energies", ir.ArrayType(real, 4), energies)
        if self.rules.quick_energy:
            self._define("rounding", ir.ArrayType(real, 2), rounding)

    def _define(self, name: str, result: ir.Type, body: Callable[..., Any], *more: ir.Type) -> None:
        """Write a function of the rows; it is long, and therefore not inlined."""
        if name not in self.needed:
            return
        function = declare(self.module, f"{PREFIX}{name}", [DOUBLE.as_pointer(), *more], result)
        function.attributes.discard("alwaysinline")
        function.attributes.add("noinline")
        writer = LoopWriter(ir.IRBuilder(function.append_basic_block()))
        found = body(writer, *function.args)
        if isinstance(result, ir.VoidType):
            writer.builder.ret_void()
            return
        numbers = [x.value for x in found] if isinstance(found, list) else [found.value]
        reals = [[x] for x in numbers] if isinstance(result, ir.ArrayType) else numbers
        writer.builder.ret(packed(writer.builder, reals, result))

    def _emission(
        self, writer: LoopWriter, rows: ir.Value, energy: LoopedEnergy, kind: Doubles, state: Any = 0
    ) -> Emission:
        """Return the writer of an energy for the state in the rows from ``state`` on."""
        physics, d = self.rules.physics, self.rules.physics.dimension
        first = writer.place(writer.place(rows, state), 2 * d if energy is self.T else 0)
        at = self.force_at if energy is self.V else self.velocity_at
        given = [writer.load(writer.place(rows, 4 * d + TALLY + i), 1) for i in range(2 * physics.parameters)]
        return Emission(writer, energy, kind, Planes(first, d), Planes(writer.place(rows, at), energy.room), given)
