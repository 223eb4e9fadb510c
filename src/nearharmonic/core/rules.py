"""What one step does to one state, written as plain Python on traced numbers: force, kick, drift, energy, tally."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

from llvmlite import ir

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import ENERGY, ENERGY_LOW, LIMIT, TALLY, TOTAL, TOTAL_CARRY, WORST
from nearharmonic.core.number import Constant, scalar, vector
from nearharmonic.core.tracing import Double, DoubleDouble, LLVMValue

Entries = list[LLVMValue]


@dataclass(frozen=True, kw_only=True)
class Physics:
    """A Hamiltonian as the kernel needs it: formulas, exact constants, number of coordinates; its name for errors."""

    name: str
    V: Callable[..., Any]
    grad_V: Callable[..., Any]
    T: Callable[..., Any]
    grad_T: Callable[..., Any]
    parameters: tuple[Constant, ...]
    dimension: int


def _pairs(entries: Entries, dimension: int) -> list[tuple[LLVMValue, LLVMValue]]:
    return list(zip(entries[:dimension], entries[dimension : 2 * dimension], strict=True))


@dataclass(frozen=True)
class Rules:
    """How a state advances: what the physics sees of it, and how ``state += coefficient * rate`` is rounded."""

    physics: Physics
    extended: bool
    compensated: bool

    @property
    def parts(self) -> int:
        """Doubles per coefficient and per rate."""
        return 2 if self.extended else 1

    def numbers(self, pairs: list[tuple[LLVMValue, LLVMValue]]) -> tuple[Any, ...]:
        return tuple(DoubleDouble(*pair) if self.extended else Double(pair[0]) for pair in pairs)

    def flat(self, components: tuple[Any, ...], like: LLVMValue) -> Entries:
        """The components of a gradient as carriers, one or two each; constants become carriers as ``like`` is."""
        kind = DoubleDouble if self.extended else Double
        numbers: list[Any] = [kind.of(x, like) if isinstance(x, Constant) else x for x in components]
        if self.extended:
            return [n.high for n in numbers] + [n.low for n in numbers]
        return [n.carrier for n in numbers]

    def update(self, pairs: list[tuple[LLVMValue, LLVMValue]], coefficient: Entries, rates: Entries) -> Entries:
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
        return self.flat(vector(self.physics, "grad_V", q, *self.physics.parameters), state[0])

    def kick(self, state: Entries, coefficient: Entries, rates: Entries) -> Entries:
        """p += coefficient * rates; the coefficient carries the minus sign of dp/dt = -dV/dq."""
        half = 2 * self.physics.dimension
        return state[:half] + self.update(_pairs(state[half:], self.physics.dimension), coefficient, rates)

    def drift(self, state: Entries, coefficient: Entries) -> Entries:
        """q += coefficient * dT/dp."""
        half, d = 2 * self.physics.dimension, self.physics.dimension
        p = self.numbers(_pairs(state[half:], d))
        velocity = self.flat(vector(self.physics, "grad_T", p), state[0])
        return self.update(_pairs(state, d), coefficient, velocity) + state[half:]

    def energy(self, state: Entries) -> DoubleDouble:
        """H of state + carry in double-double, whatever the precision of the run."""
        half, d = 2 * self.physics.dimension, self.physics.dimension
        q = tuple(DoubleDouble(*pair) for pair in _pairs(state, d))
        p = tuple(DoubleDouble(*pair) for pair in _pairs(state[half:], d))
        H = scalar(self.physics, "T", p) + scalar(self.physics, "V", q, *self.physics.parameters)
        return DoubleDouble.of(H, state[0]) if isinstance(H, Constant) else H

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


def fingerprint(rules: Rules) -> str:
    """Digest of the instructions that the formulas emit: the one thing about a system that compiled code depends on."""
    count = 4 * rules.physics.dimension
    double = ir.DoubleType()
    module = ir.Module()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [double] * (count + TALLY + rules.parts)), "formulas")
    builder = ir.IRBuilder(function.append_basic_block())
    entries = [LLVMValue(builder, argument) for argument in function.args]
    state, tally, step = entries[:count], entries[count : count + TALLY], entries[count + TALLY :]
    results = [*rules.kick(state, step, rules.force(state)), *rules.drift(state, step), *rules.measure(state, tally)]
    text = f"{module}\n{[str(result.value) for result in results]}"
    return sha256(text.encode()).hexdigest()
