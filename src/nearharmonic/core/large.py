"""Formulas of many coordinates as loops: an energy and its gradient, and functions that call them."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from nearharmonic.core import arithmetic
from nearharmonic.core.emission import module_with, write_stages
from nearharmonic.core.layout import BLOCK, COUNTERS, TALLY, running_at, running_rows
from nearharmonic.core.number import Constant, applied
from nearharmonic.core.terms import COORDINATES, LoopedEnergy, Places, Totals, Work
from nearharmonic.core.tracing import Conditioned, Double, DoubleDouble, Physics, Rules, rounding_of
from nearharmonic.core.values import DOUBLE, INDEX, Index, Kinds, LLVMValue, LoopWriter, Variable, write_function


class ConditionedDouble(Conditioned):
    """A double with its condition, which are two planes in memory."""

    __slots__ = ()
    parts = 2

    @classmethod
    def read(cls, value: LLVMValue, size: LLVMValue) -> ConditionedDouble:
        """The number of these carriers."""
        number = cls(Double(value))
        number.size = Double(size)
        return number

    @classmethod
    def of(cls, number: Constant, like: LLVMValue) -> ConditionedDouble:
        return cls(Double.of(number, like))

    @classmethod
    def of_state(cls, high: LLVMValue, low: LLVMValue) -> ConditionedDouble:
        return cls(Double(high))

    @property
    def carriers(self) -> list[LLVMValue]:
        return [self.value.carrier, self.size.carrier]


#: Types of the numbers of loops.
Kind = type[Double] | type[DoubleDouble] | type[ConditionedDouble]


class Planes(NamedTuple):
    """Numbers in memory: the address of the first double, and the distance from one plane to the next in doubles."""

    address: ir.Value
    stride: int


def is_consecutive(places: NDArray[np.int64]) -> bool:
    """Return True if ``places`` ascend by 1."""
    return len(places) > 1 and bool((np.diff(places) == 1).all())


# --- Machine code of an energy and its gradient as loops, for numbers of one kind.

#: Computes a block of numbers from the index of its first number and its number of lanes; loads one from an address.
Computed = Callable[[Index, int], Any]
Loader = Callable[[ir.Value, Index, int], LLVMValue]

#: Number of terms up to which a sum has no loop.
FEW_TERMS = 8
#: Number of terms from which on a sum has one partial sum for each lane of a block.
MANY_TERMS = 32


class Emission:
    """Writes the loops of an energy at the end of a function.

    ``kind`` is the type of the numbers, ``state`` the planes of the coordinates and of their carries, ``kept`` memory
    for intermediate results; high and low halves of the parameters are interleaved, as scalars.
    """

    def __init__(
        self, writer: LoopWriter, energy: LoopedEnergy, kind: Kind, state: Planes, kept: Planes,
        parameters: Sequence[LLVMValue],
    ) -> None:  # fmt: skip
        self.writer, self.energy, self.kind = writer, energy, kind
        self._read: Callable[..., Any] = kind.read if kind is ConditionedDouble else kind
        self.state, self.kept = state, kept
        self.parameters = list(zip(parameters[::2], parameters[1::2], strict=False))[: energy.parameters]

    def value(self, with_derivatives: bool = False) -> Any:
        """Compute the energy, and store the derivatives of the terms of its sum if they are wanted."""
        last = len(self.energy.levels)
        for level in range(1, last):
            self._sums(level)
        return self._total([self._loop(last, i, with_derivatives) for i in range(len(self.energy.work[-1]))])

    def gradient(self) -> Any:
        """Store the gradient at the offset 0, and compute the energy."""
        value = self.value(True)
        for level in range(len(self.energy.levels) - 1, 0, -1):
            self._gradient_of(level)
            for i in range(len(self.energy.work[level - 1])):
                self._loop(level, i, True)
        self._gradient_of(COORDINATES)
        return value

    def _sums(self, level: int) -> None:
        for i in range(len(self.energy.work[level - 1])):
            self._loop(level, i, False)
        for totals in self.energy.values_of(level):
            self._totals(totals, self.energy.offsets["value", level, 0])

    def _gradient_of(self, array: int) -> None:
        for totals in self.energy.gradient_of(array):
            self._totals(totals, self.energy.offsets["gradient", array, 0])

    def _total(self, numbers: Sequence[Any]) -> Any:
        if not numbers:  # free particles: V has no terms
            return self._number(Constant(0), 1)
        total, *rest = numbers
        for number in rest:
            total = total + number
        return total

    def _loop(self, level: int, number: int, with_derivatives: bool) -> Any:
        """Write one loop, which stores its results; in the last level, return the sum of its values."""
        work, offsets = self.energy.work[level - 1][number], self.energy.offsets
        last, count = level == len(self.energy.levels), work.loop.count
        program = work.both if with_derivatives else work.value
        read = self._operands(work, level)
        zero = self.writer.zero(BLOCK if count >= BLOCK else 1)
        totals = [Variable(self.writer.builder, zero) for _ in range(self.kind.parts)]
        for first, width, again in self.writer.blocks(count):
            arguments = read(first, width, with_derivatives)
            results = [self._number(x, width) for x in program.run(arguments, lambda c: c, _function)]
            if with_derivatives:
                for k, derivative in enumerate(results[:-1]):
                    self._keep(derivative, offsets[f"derivative {k}", level, number], first)
            if last:
                self._accumulate(totals, results[-1], again)
            elif not with_derivatives:
                self._keep(results[-1], offsets["term", level, number], first)
        return self._joined(totals) if last else None

    def _number(self, value: Any, width: int) -> Any:
        return self.kind.of(value, self.writer.zero(width)) if isinstance(value, Constant) else value

    def _operands(self, work: Work, level: int) -> Callable[[Index, int, bool], list[Any]]:
        """Return a function that reads the arguments of a block; tables are written once, before the loop."""
        loop = work.loop
        operands = [self._reader(operand.array, operand.places) for operand in loop.operands]
        data = [self._data(column) for column in loop.data]
        adjoint = None if work.scaled is None else self._reader(level, loop.sums, gradient=True)

        def read(first: Index, width: int, with_derivatives: bool) -> list[Any]:
            found = [one(first, width) for one in (*operands, *data)]
            given = ([self.writer.broadcast(x, width) for x in pair] for pair in self.parameters)
            found += [self.kind.of_state(*pair) for pair in given]
            return [*found, adjoint(first, width)] if adjoint is not None and with_derivatives else found

        return read

    def _reader(self, array: int, places: Places, gradient: bool = False) -> Computed:
        """Return a function of the index of a repetition that reads its number from an array."""
        load = self._loader(places)
        if array == COORDINATES:
            addresses = [self.state.address, self.writer.place(self.state.address, self.state.stride)]
            return lambda first, width: self.kind.of_state(*(load(address, first, width) for address in addresses))
        kept = self._planes(self.energy.offsets["gradient" if gradient else "value", array, 0])
        return lambda first, width: self._read(*[load(address, first, width) for address in kept])

    def _planes(self, offset: int) -> list[ir.Value]:
        return [self.writer.place(self.kept.address, offset + k * self.kept.stride) for k in range(self.kind.parts)]

    def _loader(self, places: Places) -> Loader:
        """Return a function that loads the doubles at ``places`` behind an address."""
        writer = self.writer
        if (places == places[0]).all():
            return lambda address, _, width: writer.broadcast(
                writer.load(writer.place(address, int(places[0])), 1), width
            )
        if is_consecutive(places):
            return lambda address, first, width: writer.load(
                writer.place(writer.place(address, int(places[0])), first), width
            )
        table = writer.table(places)
        return lambda address, first, width: writer.gather(address, writer.looked_up(table, first, width))

    def _data(self, column: Sequence[Any]) -> Computed:
        """Return a function that reads constants."""
        pairs = np.array([arithmetic.rounded_pair(c.numerator, c.denominator) for c in column])
        addresses = [self.writer.table(np.ascontiguousarray(plane)) for plane in pairs.T]
        writer = self.writer
        return lambda first, width: self.kind.of_state(
            *(writer.load(writer.place(address, first), width) for address in addresses)
        )

    def _keep(self, number: Any, offset: int, first: Index) -> None:
        for value, address in zip(number.carriers, self._planes(offset), strict=True):
            self.writer.store(value, self.writer.place(address, first))

    def _accumulate(self, totals: Sequence[Variable], number: Any, again: int) -> None:
        """Add a block to running sums, without those first results that the previous block has added."""
        if again:
            new = self.writer.last_lanes(again)
            number = self._read(*[new.choose(plane, 0.0) for plane in number.carriers])
        before = [room.value for room in totals]
        total = self._read(*before) + number
        for value, room in zip(total.carriers, totals, strict=True):
            room.value = value

    def _joined(self, totals: Sequence[Variable]) -> Any:
        """The sum over the lanes of a running sum."""
        planes = [room.value.lanes() for room in totals]
        return _pairwise([self._read(*lane) for lane in zip(*planes, strict=True)])

    def _totals(self, totals: Totals, offset: int) -> None:
        """Write the sums of stored results."""
        count, terms = totals.sources.shape
        if terms == 0:
            self._put(totals.targets, offset, lambda _, width: self._number(Constant(0), width))
        elif count < BLOCK and terms >= MANY_TERMS:
            for target, sources in zip(totals.targets, totals.sources, strict=True):
                total = self._along(sources)
                self._keep(total, offset + int(target), self.writer.index(0))
        elif terms <= FEW_TERMS:
            loaders = [self._loader(column) for column in totals.sources.T]
            self._put(totals.targets, offset, lambda *at: self._total([self._loaded(load, *at) for load in loaders]))
        else:
            self._put(totals.targets, offset, self._across(totals.sources))

    def _put(self, targets: Places, offset: int, computed: Computed) -> None:
        """Write to the targets the numbers that ``computed`` returns for each block."""
        table = None if is_consecutive(targets) or len(targets) == 1 else self.writer.table(targets)
        addresses = self._planes(offset if table is not None else offset + int(targets[0]))
        for first, width, _ in self.writer.blocks(len(targets)):
            planes = computed(first, width).carriers
            places = self.writer.looked_up(table, first, width) if table is not None else []
            for value, address in zip(planes, addresses, strict=True):
                if table is None:
                    self.writer.store(value, self.writer.place(address, first))
                for lane, place in zip(value.lanes(), places, strict=False):
                    self.writer.store(lane, self.writer.place(address, place))

    def _loaded(self, load: Loader, first: Index, width: int) -> Any:
        return self._read(*[load(address, first, width) for address in self._planes(0)])

    def _across(self, sources: Places) -> Computed:
        """Sums of many terms, one sum in each lane of a block."""
        count, terms = sources.shape
        table = self.writer.table(np.ascontiguousarray(sources.T))

        def computed(first: Index, width: int) -> Any:
            def term(i: Index) -> Any:
                at = i * count + first
                places = self.writer.looked_up(table, at, width)
                return self._read(*[self.writer.gather(address, places) for address in self._planes(0)])

            totals = [Variable(self.writer.builder, x) for x in term(self.writer.index(0)).carriers]
            with self.writer.repeated(terms - 1) as i:
                self._accumulate(totals, term(i + 1), 0)
            return self._read(*[room.value for room in totals])

        return computed

    def _along(self, sources: Places) -> Any:
        """One sum of many terms, with a partial sum in each lane of a block."""
        load, terms = self._loader(sources), len(sources)
        totals = [Variable(self.writer.builder, self.writer.zero(BLOCK)) for _ in range(self.kind.parts)]
        for first, width, again in self.writer.blocks(terms):
            self._accumulate(totals, self._loaded(load, first, width), again)
        return self._joined(totals)


def _pairwise(numbers: Sequence[Any]) -> Any:
    """The pairwise sum of numbers, whose count is a power of two."""
    while len(numbers) > 1:
        half = len(numbers) // 2
        numbers = [a + b for a, b in zip(numbers[:half], numbers[half:], strict=True)]
    return numbers[0]


def _function(name: str, x: Any, *others: Any) -> Any:
    if name == "root":
        return x.sqrt()
    return x.sign() if name == "sign" else applied(name, x, *others)


# --- Formulas of many coordinates as functions of LLVM that read the rows of a kernel and store gradients behind them.
#
# :mod:`nearharmonic.core.step` calls them. The rows end with memory for intermediate results of the loops, see
# :func:`room`.


def room(physics: Physics, *, extended: bool) -> int:
    """Return the number of doubles behind the running state that the loops of a kernel store results in."""
    assert physics.loops is not None
    V, T = physics.loops
    scratch = physics.dimension * (physics.stage_count + 2) + BLOCK if physics.stages else 0
    return BLOCK + _planes(V, T, extended) * (V.room + T.room) + scratch


def _planes(V: LoopedEnergy, T: LoopedEnergy, extended: bool) -> int:
    """Planes of the stored numbers: two if energies of several levels are computed in double-double."""
    return 2 if extended or max(len(V.levels), len(T.levels)) > 1 else 1


def module_of(rules: Rules, kinds: Kinds, needed: Container[str]) -> ir.Module:
    """Return a module with the functions of a system of many coordinates that loops of its form call.

    They read the running state or the output state. They are long, and therefore not inlined.
    """
    physics, d, number = rules.physics, rules.physics.dimension, rules.kind
    assert physics.loops is not None
    V, T = physics.loops
    running = running_at(d, physics.parameters)
    end, planes = running + running_rows(d, physics.stage_count), _planes(V, T, rules.extended)
    force_at = -(-end // BLOCK) * BLOCK
    velocity_at = force_at + planes * V.room
    numbers = {
        "dimension": d, "columns": rules.columns, "tally": 4 * d, "parameters": 4 * d + TALLY, "running": running,
        "force_at": force_at, "force_plane": V.room, "velocity_at": velocity_at, "velocity_plane": T.room,
    }  # fmt: skip
    if physics.stages is not None:
        scratch = -(-(velocity_at + planes * T.room) // BLOCK) * BLOCK
        numbers |= {"counters": end - COUNTERS, "scratch": scratch, "stages": physics.stage_count}
    module, real, nothing = module_with(numbers), kinds.of("R"), ir.VoidType()

    def define(name: str, result: ir.Type, body: Callable[..., Any], *more: ir.Type) -> None:
        if name in needed:
            given = [DOUBLE.as_pointer(), *more]
            write_function(module, name, given, result, lambda b, *x: body(LoopWriter(b), *x), inlined=False)

    def emission(writer: LoopWriter, rows: ir.Value, energy: LoopedEnergy, kind: Kind, state: Any = 0) -> Emission:
        """The writer of an energy for the state in the rows from ``state`` on."""
        first = writer.place(writer.place(rows, state), 2 * d if energy is T else 0)
        at = writer.place(rows, force_at if energy is V else velocity_at)
        given = [writer.load(writer.place(rows, 4 * d + TALLY + i), 1) for i in range(2 * physics.parameters)]
        return Emission(writer, energy, kind, Planes(first, d), Planes(at, energy.room), given)

    def energies(writer: LoopWriter, rows: ir.Value) -> list[Any]:
        kinetic, potential = (emission(writer, rows, energy, DoubleDouble).value() for energy in (T, V))
        return [[x] for x in (*(kinetic + potential).pair, kinetic.high, kinetic.high.constant(0.0))]

    def rounding(writer: LoopWriter, rows: ir.Value) -> list[Any]:
        kinetic, potential = (emission(writer, rows, energy, ConditionedDouble).value() for energy in (T, V))
        return [[x] for x in rounding_of(kinetic, potential)]

    def gradient(writer: LoopWriter, rows: ir.Value) -> Any:
        return emission(writer, rows, V, number, running).gradient().carriers[:1]

    def velocities(writer: LoopWriter, rows: ir.Value, state: ir.Value) -> None:
        emission(writer, rows, T, number, Index(writer.builder, state)).gradient()

    def value(energy: LoopedEnergy) -> Callable[..., Any]:
        return lambda writer, rows: emission(writer, rows, energy, number).value().carriers[:1]

    define("force", nothing, gradient)
    define("force_and_potential", real, gradient)
    define("velocities", nothing, velocities, INDEX)
    define("potential", real, value(V))
    define("kinetic", real, value(T))
    define("energy", ir.ArrayType(real, 2), lambda writer, rows: energies(writer, rows)[:2])
    define("energies", ir.ArrayType(real, 4), energies)
    if rules.quick_energy:
        define("rounding", ir.ArrayType(real, 2), rounding)
    if physics.stages is not None:
        write_stages(module, rules, kinds, needed)
    return module
