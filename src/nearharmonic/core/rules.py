"""What one step does to one state, written as plain Python on traced numbers: force, move, energy, tally.

A kick by k and the drift by e behind it are one *move*, from the force at the position to the next position. If T is
quadratic, dT/dp = v(p), with a(f) the acceleration by a force f, the new position is (q + e v(p)) + (e k) a(f): the sum
in brackets is ready before the force is, so that one operation follows the force, and the momentum is updated beside
the next force. The chain of operations that bounds the time of one trajectory is shorter by that. The product e k is
rounded once from exact numbers, and differs from the product of e and k as rounded. By that the map would not be
symplectic, and the energy would drift; so what it leaves out (``REST``) is added, one move late, where the carry is.

Double-double operations follow one another so closely that the chain does not bound them: there, and where T is not
quadratic, the momentum comes first and its velocity behind it.

A step is as many moves as forces. Between steps the last move of one and the first of the next are merged: the state
that *runs* is that of the last force. The state at the end of a step, which is seen and measured, is a move away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import (
    CONDITION,
    DRIFT,
    ENERGY,
    ENERGY_LOW,
    NEAR,
    PRODUCT,
    REST,
    TOTAL,
    TOTAL_CARRY,
    WORST,
    columns,
)
from nearharmonic.core.modified_kick import modified_columns
from nearharmonic.core.number import Constant, Number, call, constant, scalar, vector
from nearharmonic.core.physics import Physics
from nearharmonic.core.tracing import Double, DoubleDouble, LLVMValue

if TYPE_CHECKING:
    from nearharmonic.core.condition import Conditioned

Entries = list[LLVMValue]

#: Coordinates up to which the energy is measured in double-double at every step.
FEW_COORDINATES = 8
#: An energy error in double is used where it is at least so many times the bound of its rounding: to 4 digits.
CERTAINTY = 2.0**12


def _pairs(entries: Entries, dimension: int) -> list[tuple[LLVMValue, LLVMValue]]:
    return list(zip(entries[:dimension], entries[dimension : 2 * dimension], strict=True))


@dataclass(frozen=True)
class Rules:
    """How a state advances: what the physics sees of it, and how ``state += coefficient * rate`` is rounded."""

    physics: Physics
    extended: bool
    compensated: bool

    @property
    def quick_energy(self) -> bool:
        """Whether the energy is measured in double where its error is far above the rounding of doubles.

        In double-double at every step it would cost ten times a step of leapfrog where pairs of bodies attract.
        """
        few = self.physics.dimension <= FEW_COORDINATES
        return not (self.extended or few or self.physics.numba)  # a V in double has nothing to be measured against

    @property
    def looks_ahead(self) -> bool:
        """Whether the new position is computed beside the new momentum."""
        known = self.physics.acceleration is not None or self.physics.turning is not None
        return known and not self.extended

    @property
    def columns(self) -> int:
        """Doubles in a row of coefficients."""
        if self.physics.modified is not None:
            return modified_columns(self.parts)
        return columns(0 if self.physics.turning is None else 1 + max(self.physics.turning))

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
        """state += coefficient * rates."""
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

    def constants(self, parameters: Entries) -> tuple[Any, ...]:
        """The parameters as the formulas of the state see them; they come as pairs, high and low in turns."""
        pairs = zip(parameters[::2], parameters[1::2], strict=False)
        return self.physics.constants or self.numbers(list(pairs))

    def exact_constants(self, parameters: Entries) -> tuple[Any, ...]:
        """The parameters in double-double."""
        pairs = zip(parameters[::2], parameters[1::2], strict=False)
        return self.physics.constants or tuple(DoubleDouble(*pair) for pair in pairs)

    def force(self, state: Entries, parameters: Entries) -> Entries:
        """dV/dq at the position."""
        if (
            self.physics.dimension > FEW_COORDINATES and not self.physics.numba
        ):  # the same bits whether or not the energy is measured beside it
            return self.force_and_potential(state, parameters)[: self.parts * self.physics.dimension]
        q = self.numbers(_pairs(state, self.physics.dimension))
        return self.flat(vector(self.physics, "grad_V", q, *self.constants(parameters)), state[0])

    def part(self, row: Entries, column: int) -> Entries:
        """A coefficient of a row, as one double or two."""
        return row[column * self.parts : (column + 1) * self.parts]

    def looked_ahead(
        self, position: Entries, late: Entries, row: Entries, velocity: Entries, acceleration: Entries,
        momentum: Entries,
    ) -> Entries:  # fmt: skip
        """The state that runs with the position (q + e v) + (e k) a and the new ``momentum``."""
        e, product, pairs = row[DRIFT], row[PRODUCT], _pairs(position, len(position) // 2)
        if not self.compensated:
            ahead = self.update(pairs, [e], velocity)
            return self.update(_pairs(ahead, len(pairs)), [product], acceleration) + momentum + late
        new = [
            arithmetic.compensated_update((q, arithmetic.fma(e, v, rest) + carry), product, a)
            for (q, carry), rest, v, a in zip(pairs, late, velocity, acceleration, strict=True)
        ]
        return [q for q, _ in new] + [carry for _, carry in new] + momentum + [row[REST] * a for a in acceleration]

    def seen(self, running: Entries) -> Entries:
        """A state with what it is late by in its carry."""
        d = len(running) // 5
        if not (self.compensated and self.looks_ahead):
            return running[: 4 * d]
        carries = [carry + rest for carry, rest in zip(running[d : 2 * d], running[4 * d :], strict=True)]
        return running[:d] + carries + running[2 * d : 4 * d]

    def velocity(self, momentum: Entries, parameters: Entries) -> tuple[Any, ...]:
        p = self.numbers(_pairs(momentum, self.physics.dimension))
        return vector(self.physics, "grad_T", p, *self.constants(parameters))

    def energies(self, state: Entries, parameters: Entries) -> tuple[Any, Any]:
        """T and V of state + carry in double-double, whatever the precision of the run; constants as they are."""
        half, d, constants = 2 * self.physics.dimension, self.physics.dimension, self.exact_constants(parameters)
        q = tuple(DoubleDouble(*pair) for pair in _pairs(state, d))
        p = tuple(DoubleDouble(*pair) for pair in _pairs(state[half:], d))
        if self.physics.measured is not None:
            return call(self.physics, "V", self.physics.measured, q, p, *constants)  # type: ignore[no-any-return]
        return scalar(self.physics, "T", p, *constants), scalar(self.physics, "V", q, *constants)

    def energy(self, state: Entries, parameters: Entries) -> DoubleDouble:
        """H of state + carry in double-double."""
        T, V = self.energies(state, parameters)
        return _double_double(T + V, state[0])

    def latest(self, state: Entries, tally: Entries, parameters: Entries) -> LLVMValue:
        """H - H0, each in double-double."""
        return self.difference(*self.energy(state, parameters).pair, tally)

    def difference(self, high: LLVMValue, low: LLVMValue, tally: Entries) -> LLVMValue:
        """H - H0 for H in double-double."""
        return (high - tally[ENERGY]) + (low - tally[ENERGY_LOW])

    def measure(self, state: Entries, tally: Entries, parameters: Entries) -> Entries:
        """The tally with one more step in it."""
        return tallied(tally, self.latest(state, tally, parameters))

    def force_and_potential(self, state: Entries, parameters: Entries) -> Entries:
        """dV/dq at the position, and V in double behind it: what both formulas have in common is computed once."""
        q = self.numbers(_pairs(state, self.physics.dimension))
        found = call(self.physics, "V", self.physics.grad_V_and_V, q, *self.constants(parameters))
        *gradient, V = (x if isinstance(x, Number) else constant(x) for x in found)
        return self.flat(tuple(gradient), state[0]) + self.flat((V,), state[0])

    def potential(self, state: Entries, parameters: Entries) -> Entries:
        """V at the position in double."""
        return self.force_and_potential(state, parameters)[-1:]

    def quick(self, state: Entries, potential: Entries, tally: Entries, parameters: Entries) -> Entries:
        """H - H0 in double, and the least of its modulus that can be told from rounding."""
        half, d = 2 * self.physics.dimension, self.physics.dimension
        p = self.numbers(_pairs(state[half:], d))
        T = _carrier(scalar(self.physics, "balanced_T", p, *self.constants(parameters)), state[0])
        return self.quick_difference(T, potential[0], tally)

    def quick_T(self, momentum: Entries, parameters: Entries) -> LLVMValue:
        """T in double."""
        p = self.numbers(_pairs(momentum, self.physics.dimension))
        return _carrier(scalar(self.physics, "balanced_T", p, *self.constants(parameters)), momentum[0])

    def first_energy(self, state: Entries, parameters: Entries) -> Entries:
        """H as a pair, T, and 0."""
        T, V = self.energies(state, parameters)
        H, kinetic = _double_double(T + V, state[0]), _double_double(T, state[0])
        return [H.high, H.low, kinetic.high, H.high.constant(0.0)]

    def quick_difference(self, T: LLVMValue, V: LLVMValue, tally: Entries) -> Entries:
        """H - H0 for T and V in double, and the least of its modulus that can be told from rounding."""
        latest = self.difference(*arithmetic.two_sum(T, V), tally)
        return [latest, tally[NEAR] + tally[CONDITION] * (T.absolute() + V.absolute())]

    def sharpened(self, state: Entries, tally: Entries, quick: Entries, parameters: Entries) -> Entries:
        """``quick`` with H - H0 in double-double in the lanes where it is near the rounding of doubles.

        That is seldom, and long: a function of its own, which takes no registers from the loop.
        """
        from nearharmonic.core.functions.emit import called

        latest, bound = quick
        size = len(state)
        high, low = called("energy", lambda *x: self.energy([*x[:size]], [*x[size:]]).pair, *state, *parameters)
        exact = self.difference(high, low, tally)
        return [latest.absolute().greater(bound).choose(latest, exact), bound]

    def rounding(self, state: Entries, parameters: Entries) -> Entries:
        """:data:`NEAR` and :data:`CONDITION` of a tally: the rounding of H, absolute and relative to |T| + |V|."""
        from nearharmonic.core.condition import Conditioned

        half, d, constants = 2 * self.physics.dimension, self.physics.dimension, self.constants(parameters)
        q, p = (tuple(map(Conditioned, self.numbers(_pairs(entries, d)))) for entries in (state, state[half:]))
        given = [x if isinstance(x, Constant) else Conditioned(x) for x in constants]
        zero = Conditioned(Double(state[0].constant(0.0)))
        return self.rounding_of(*(zero + scalar(self.physics, name, x, *given) for name, x in (("T", p), ("V", q))))

    def rounding_of(self, T: Conditioned, V: Conditioned) -> Entries:
        """The same of T and V."""
        size = (T.size + V.size).carrier * (CERTAINTY * 2.0**-53)
        return [size, size / (abs(T.value) + abs(V.value)).carrier]

    def begin(self, state: Entries, parameters: Entries) -> Entries:
        """A fresh tally whose H0 is the energy of ``state``, with |T| at the place of the limit."""
        T, V = self.energies(state, parameters)
        rounding = self.rounding(state, parameters) if self.quick_energy else [state[0].constant(0.0)] * 2
        return fresh_tally(_double_double(T + V, state[0]), _double_double(T, state[0]), rounding)


def _double_double(number: Any, like: LLVMValue) -> DoubleDouble:
    return DoubleDouble.of(number, like) if isinstance(number, Constant) else number


def _carrier(number: Any, like: LLVMValue) -> LLVMValue:
    carrier: LLVMValue = (Double.of(number, like) if isinstance(number, Constant) else number).carrier
    return carrier


def fresh_tally(H: DoubleDouble, T: DoubleDouble, rounding: Entries) -> Entries:
    """The tally of a run that begins, with |T| at the place of the limit."""
    zero = H.high.constant(0.0)
    return [zero, zero, zero, zero, H.high, H.low, T.high.absolute(), *rounding]


def uncertain(latest: LLVMValue, bound: LLVMValue) -> Any:
    """One bit: whether in any lane an energy error in double is too near its rounding."""
    return (~latest.absolute().greater(bound)).anywhere()


def tallied(tally: Entries, latest: LLVMValue) -> Entries:
    """The tally with one more energy in it, by its difference from H0."""
    size = latest.absolute()
    carried = tally[TOTAL_CARRY] + size
    total = tally[TOTAL] + carried
    carry = carried + (tally[TOTAL] - total)
    return [size.larger(tally[WORST]), total, carry, latest, *tally[ENERGY:]]
