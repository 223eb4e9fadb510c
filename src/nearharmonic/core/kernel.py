"""The one kernel: every tableau, every system, every precision, one trajectory or many in SIMD lanes.

:func:`build` turns a system's formulas into compiled code for one choice of ``precision``, ``summation`` and lane
``width``. The tableau is data (coefficient arrays), so one compilation serves all methods.

Layout of a lane's row block, ``width`` doubles a row: d positions, their d carries, d momenta, their d carries; then
the tally: largest and summed |H - H0| of the block, the sum's carry, the latest H - H0, H0 as a pair, and the largest
|H - H0| allowed. In extended precision the carries are the low halves of double-doubles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from hashlib import sha256
from typing import Any

from llvmlite import ir
from numba import types

from nearharmonic.core import arithmetic
from nearharmonic.core.cache import compiled, core_digest, named, strict
from nearharmonic.core.lanes import Record, record_function, record_loader, record_storer, record_test
from nearharmonic.core.scheduler import (
    ENERGY,
    ENERGY_LOW,
    LATEST,
    LIMIT,
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
    lane_scheduler,
)
from nearharmonic.core.tracing import Double, DoubleDouble, Emitted

Entries = list[Emitted]


@dataclass(frozen=True, kw_only=True)
class Physics:
    """A Hamiltonian as the kernel needs it: formulas, exact constants, number of coordinates."""

    V: Callable[..., Any]
    grad_V: Callable[..., Any]
    T: Callable[..., Any]
    grad_T: Callable[..., Any]
    parameters: tuple[Fraction, ...]
    dimension: int


def _pairs(entries: Entries, dimension: int) -> list[tuple[Emitted, Emitted]]:
    return list(zip(entries[:dimension], entries[dimension : 2 * dimension], strict=True))


@dataclass(frozen=True)
class _Rules:
    """How a state advances: what the physics sees of it, and how ``state += coefficient * rate`` is rounded."""

    physics: Physics
    extended: bool
    compensated: bool

    @property
    def parts(self) -> int:
        """Doubles per coefficient and per rate."""
        return 2 if self.extended else 1

    def numbers(self, pairs: list[tuple[Emitted, Emitted]]) -> tuple[Any, ...]:
        return tuple(DoubleDouble(*pair) if self.extended else Double(pair[0]) for pair in pairs)

    def flat(self, numbers: tuple[Any, ...]) -> Entries:
        if self.extended:
            return [n.high for n in numbers] + [n.low for n in numbers]
        return [n.carrier for n in numbers]

    def update(self, pairs: list[tuple[Emitted, Emitted]], coefficient: Entries, rates: Entries) -> Entries:
        if self.extended:
            step = (coefficient[0], coefficient[1])
            rate_pairs = _pairs(rates, len(pairs))
            new = [
                arithmetic.dd_add(y, arithmetic.dd_mul(step, rate)) for y, rate in zip(pairs, rate_pairs, strict=True)
            ]
        else:
            rule = arithmetic.compensated_update if self.compensated else arithmetic.plain_update
            new = [rule(y, coefficient[0], rate) for y, rate in zip(pairs, rates, strict=True)]
        return [high for high, _ in new] + [low for _, low in new]

    def force(self, state: Entries) -> Entries:
        """dV/dq at the position."""
        q = self.numbers(_pairs(state, self.physics.dimension))
        return self.flat(tuple(self.physics.grad_V(q, *self.physics.parameters)))

    def kick(self, state: Entries, coefficient: Entries, rates: Entries) -> Entries:
        """p += coefficient * rates; the coefficient carries the minus sign of dp/dt = -dV/dq."""
        half = 2 * self.physics.dimension
        return state[:half] + self.update(_pairs(state[half:], self.physics.dimension), coefficient, rates)

    def drift(self, state: Entries, coefficient: Entries) -> Entries:
        """q += coefficient * dT/dp."""
        half, d = 2 * self.physics.dimension, self.physics.dimension
        p = self.numbers(_pairs(state[half:], d))
        return self.update(_pairs(state, d), coefficient, self.flat(tuple(self.physics.grad_T(p)))) + state[half:]

    def energy(self, state: Entries) -> DoubleDouble:
        """H of state + carry in double-double, whatever the precision of the run."""
        half, d = 2 * self.physics.dimension, self.physics.dimension
        q = tuple(DoubleDouble(*pair) for pair in _pairs(state, d))
        p = tuple(DoubleDouble(*pair) for pair in _pairs(state[half:], d))
        H: DoubleDouble = self.physics.T(p) + self.physics.V(q, *self.physics.parameters)
        return H

    def measure(self, state: Entries, tally: Entries) -> Entries:
        """The tally with one more step in it."""
        H = self.energy(state)
        latest = (H.high - tally[ENERGY]) + (H.low - tally[ENERGY_LOW])
        size = latest.absolute()
        carried = tally[TOTAL_CARRY] + size
        total = tally[TOTAL] + carried
        carry = carried + (tally[TOTAL] - total)
        return [size.larger(tally[WORST]), total, carry, latest, *tally[ENERGY:]]

    def begin(self, state: Entries, tally: Entries) -> Entries:
        """A fresh tally whose H0 is the energy of ``state``; the limit, given relative, becomes absolute."""
        H = self.energy(state)
        zero = H.high.constant(0.0)
        return [zero, zero, zero, zero, H.high, H.low, tally[LIMIT] * H.high.absolute()]


@dataclass(frozen=True)
class Kernel:
    """Compiled code for one system, precision and width, with the layout its arrays must have.

    ``advance()`` compiles the inner kernel by itself, for benchmarks and ensembles that schedule their own lanes:
    ``advance()(count, stages, kick_first, drift, kick, rows) -> steps done``: ``drift`` and ``kick`` are float64
    (stages + 1, parts, width) with the step size multiplied in, ``rows`` float64 (4 d + 7, width), changed in place. It
    returns before ``count`` when a lane's energy error passes its limit.

    ``run(...)``: see :func:`nearharmonic.core.scheduler.lane_scheduler`.
    """

    width: int
    dimension: int
    parts: int
    advance: Callable[[], Callable[..., int]]
    run: Callable[..., None]


def build(physics: Physics, *, extended: bool, compensated: bool, width: int, every_step: bool = True) -> Kernel:
    """Compile the kernel, or load it from the cache.

    ``every_step`` measures the energy at every step; otherwise once at the end of each stretch of steps.
    """
    rules = _Rules(physics, extended, compensated)
    text = f"{core_digest()} {fingerprint(rules)} {extended} {compensated} {width} {every_step}"
    key = sha256(text.encode()).hexdigest()
    inner = named(_advance(rules, width, every_step), key)
    begin = named(_begin(rules, width), key)
    run = named(lane_scheduler(4 * physics.dimension, width, strict(inner), strict(begin)), key)
    vector, matrix, cube = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1]
    whole, wholes = types.int64, types.int64[::1]
    signature = types.void(
        wholes, types.int64[:, ::1], wholes, matrix, types.float64, whole, whole, types.boolean,
        cube, cube, cube, matrix, matrix, matrix, matrix, wholes, *[vector] * 4, *[wholes] * 3,
    )  # fmt: skip
    call = types.int64(whole, whole, types.boolean, vector, vector, vector)
    return Kernel(
        width=width,
        dimension=physics.dimension,
        parts=rules.parts,
        advance=lambda: compiled(inner, call, key),
        run=compiled(run, signature, key),
    )


def fingerprint(rules: _Rules) -> str:
    """Digest of the instructions that the formulas emit: the one thing about a system that compiled code depends on."""
    count = 4 * rules.physics.dimension
    double = ir.DoubleType()
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [double] * (count + TALLY + rules.parts)), "formulas")
    builder = ir.IRBuilder(function.append_basic_block())
    entries = [Emitted(builder, argument) for argument in function.args]
    state, tally, step = entries[:count], entries[count : count + TALLY], entries[count + TALLY :]
    results = [*rules.kick(state, step, rules.force(state)), *rules.drift(state, step), *rules.measure(state, tally)]
    text = f"{module}\n{[str(result.value) for result in results]}"
    return sha256(text.encode()).hexdigest()


def _advance(rules: _Rules, width: int, every_step: bool) -> Callable[..., Any]:
    d, parts = rules.physics.dimension, rules.parts
    state_type, tally_type = Record(4 * d, width), Record(TALLY, width)
    step_type, rate_type = Record(parts, width), Record(parts * d, width)
    load_state, store_state = record_loader(state_type), record_storer(state_type)
    load_tally, store_tally = record_loader(tally_type), record_storer(tally_type)
    load_step = record_loader(step_type)
    force = record_function(rules.force, rate_type, state_type)
    kick = record_function(rules.kick, state_type, state_type, step_type, rate_type)
    drift = record_function(rules.drift, state_type, state_type, step_type)
    measure = record_function(rules.measure, tally_type, state_type, tally_type)
    left = record_test(lambda tally: tally[LATEST].absolute().any_not_within(tally[LIMIT]), tally_type)
    stride, tally_at = parts * width, 4 * d * width

    def advance(count, stages, kick_first, drifts, kicks, rows):  # type: ignore[no-untyped-def]
        state = load_state(rows, 0)
        tally = load_tally(rows, tally_at)
        shift = 1 if kick_first else 0
        rate = force(state)
        done = 0
        while done < count:
            if kick_first:  # the force is that of the last kick: first same as last
                state = kick(state, load_step(kicks, 0), rate)
            for i in range(stages):
                state = drift(state, load_step(drifts, i * stride))
                rate = force(state)
                state = kick(state, load_step(kicks, (i + shift) * stride), rate)
            if not kick_first:
                state = drift(state, load_step(drifts, stages * stride))
            done += 1
            if every_step:
                tally = measure(state, tally)
                if left(tally):
                    break
        if not every_step:
            tally = measure(state, tally)
        store_state(rows, 0, state)
        store_tally(rows, tally_at, tally)
        return done

    return advance


def _begin(rules: _Rules, width: int) -> Callable[..., Any]:
    """Python text of ``begin(rows)``: each lane's tally anew, with the energy of its state as H0."""
    state_type, tally_type = Record(4 * rules.physics.dimension, width), Record(TALLY, width)
    load_state, load_tally = record_loader(state_type), record_loader(tally_type)
    store_tally = record_storer(tally_type)
    fresh = record_function(rules.begin, tally_type, state_type, tally_type)
    tally_at = 4 * rules.physics.dimension * width

    def begin(rows):  # type: ignore[no-untyped-def]
        store_tally(rows, tally_at, fresh(load_state(rows, 0), load_tally(rows, tally_at)))

    return begin
