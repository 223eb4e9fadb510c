"""The formulas of a system in the arithmetic of a kernel, written as plain Python on traced numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from nearharmonic.core.formulas.condition import Conditioned
from nearharmonic.core.formulas.number import Constant, Number, call, constant, scalar, vector
from nearharmonic.core.formulas.physics import Physics
from nearharmonic.core.formulas.tracing import Double, DoubleDouble, LLVMValue
from nearharmonic.core.layout import collocation_columns, columns, modified_columns

Entries = list[LLVMValue]

#: Number of coordinates up to which the energy is measured in double-double at every step.
FEW_COORDINATES = 8
#: An energy error in double is used if it is at least this multiple of its rounding bound: it then has 4 digits.
CERTAINTY = 2.0**12


@dataclass(frozen=True)
class Rules:
    """A system with the arithmetic of its states and sums.

    A state is a list: positions, their carries, momenta, their carries. Parameters are pairs, with high and low halves
    interleaved. A vector is the list of the high halves of its components; in extended precision the low halves follow.
    """

    physics: Physics
    extended: bool
    compensated: bool

    @property
    def quick_energy(self) -> bool:
        """True if the energy is measured in double wherever its error is far above the rounding of doubles.

        For attracting pairs of bodies, an energy in double-double at every step would cost ten times a step of
        leapfrog.
        """
        few = self.physics.dimension <= FEW_COORDINATES
        return not (self.extended or few or self.physics.numba)  # no more precise value exists for a V in double

    @property
    def looks_ahead(self) -> bool:
        """True if the new position does not wait for the new momentum: see :mod:`nearharmonic.core.step`."""
        known = self.physics.acceleration is not None or self.physics.turning is not None
        return known and not self.extended

    @property
    def columns(self) -> int:
        """Doubles in a row of coefficients."""
        if self.physics.modified is not None:
            return modified_columns(self.parts)
        if self.physics.stages is not None:
            frequencies = 0 if self.physics.turning is None else 1 + max(self.physics.turning)
            return collocation_columns(self.physics.stages.stages, frequencies)
        return columns(0 if self.physics.turning is None else 1 + max(self.physics.turning))

    @property
    def parts(self) -> int:
        """Doubles per coefficient and per rate."""
        return 2 if self.extended else 1

    def _numbers(self, entries: Entries, count: int) -> tuple[Any, ...]:
        """The first ``count`` entries of a list and their low halves, as numbers."""
        pairs = zip(entries[:count], entries[count : 2 * count], strict=True)
        return tuple(DoubleDouble(*pair) if self.extended else Double(pair[0]) for pair in pairs)

    def flat(self, components: tuple[Any, ...], like: LLVMValue) -> Entries:
        """The components of a vector as carriers, one or two each; a constant becomes a carrier like ``like``."""
        kind = DoubleDouble if self.extended else Double
        numbers: list[Any] = [kind.of(x, like) if isinstance(x, Constant) else x for x in components]
        if self.extended:
            return [n.high for n in numbers] + [n.low for n in numbers]
        return [n.carrier for n in numbers]

    def constants(self, parameters: Entries) -> tuple[Any, ...]:
        """The parameters in the precision of the state."""
        halves = [*parameters[::2], *parameters[1::2]]
        return self.physics.constants or self._numbers(halves, self.physics.parameters)

    def exact_constants(self, parameters: Entries) -> tuple[Any, ...]:
        """The parameters in double-double."""
        pairs = zip(parameters[::2], parameters[1::2], strict=False)
        return self.physics.constants or tuple(DoubleDouble(*pair) for pair in pairs)

    def force(self, position: Entries, parameters: Entries) -> Entries:
        """dV/dq."""
        together = self.physics.dimension > FEW_COORDINATES and self.physics.numba is None
        if together:  # bitwise identical with and without a measurement of the energy
            return self.force_and_potential(position, parameters)[: self.parts * self.physics.dimension]
        q = self._numbers(position, self.physics.dimension)
        return self.flat(vector(self.physics, "grad_V", q, *self.constants(parameters)), position[0])

    def square(self, position: Entries, parameters: Entries) -> Entries:
        """grad |grad V|^2, for kicks of a modified potential.

        |grad V|^2 denotes the square a(V').V', where a(V') is the acceleration by the force V'. It is the bracket [B,
        [A, B]] of the drift A and the kick B.
        """
        assert self.physics.modified is not None
        q = self._numbers(position, self.physics.dimension)
        found = call(self.physics, "V", self.physics.modified, q, *self.constants(parameters))
        return self.flat(tuple(x if isinstance(x, Number) else constant(x) for x in found), position[0])

    def velocity(self, momentum: Entries, parameters: Entries) -> tuple[Any, ...]:
        """dT/dp."""
        p = self._numbers(momentum, self.physics.dimension)
        return vector(self.physics, "grad_T", p, *self.constants(parameters))

    def acceleration(self, force: Entries, parameters: Entries) -> Entries:
        """The acceleration by a force: dT/dp of the force minus dT/dp at p = 0."""
        assert self.physics.acceleration is not None
        return self.flat(self.physics.acceleration(tuple(map(Double, force)), *self.constants(parameters)), force[0])

    def force_and_potential(self, position: Entries, parameters: Entries) -> Entries:
        """dV/dq followed by V in double; operations that both formulas share are computed once."""
        q = self._numbers(position, self.physics.dimension)
        found = call(self.physics, "V", self.physics.grad_V_and_V, q, *self.constants(parameters))
        *gradient, V = (x if isinstance(x, Number) else constant(x) for x in found)
        return self.flat(tuple(gradient), position[0]) + self.flat((V,), position[0])

    def potential(self, position: Entries, parameters: Entries) -> Entries:
        """V in double."""
        return self.force_and_potential(position, parameters)[-1:]

    def kinetic(self, momentum: Entries, parameters: Entries) -> Entries:
        """T in double."""
        p = self._numbers(momentum, self.physics.dimension)
        return self.flat((scalar(self.physics, "balanced_T", p, *self.constants(parameters)),), momentum[0])

    def energies(self, state: Entries, parameters: Entries) -> Entries:
        """H as a pair, T, and 0, of state + carry, in double-double for every precision of the run."""
        half, d, constants = 2 * self.physics.dimension, self.physics.dimension, self.exact_constants(parameters)
        q, p = (tuple(map(DoubleDouble, x[:d], x[d : 2 * d])) for x in (state, state[half:]))
        if self.physics.measured is not None:
            T, V = call(self.physics, "V", self.physics.measured, q, p, *constants)
        else:
            T, V = scalar(self.physics, "T", p, *constants), scalar(self.physics, "V", q, *constants)
        H, kinetic = (DoubleDouble.of(x, state[0]) if isinstance(x, Constant) else x for x in (T + V, T))
        return [H.high, H.low, kinetic.high, H.high.constant(0.0)]

    def rounding(self, state: Entries, parameters: Entries) -> Entries:
        """The rounding error of H in double: absolute, and relative to |T| + |V|."""
        half, d, constants = 2 * self.physics.dimension, self.physics.dimension, self.constants(parameters)
        q, p = (tuple(map(Conditioned, self._numbers(x, d))) for x in (state, state[half:]))
        given = [x if isinstance(x, Constant) else Conditioned(x) for x in constants]
        zero = Conditioned(Double(state[0].constant(0.0)))
        return rounding_of(*(zero + scalar(self.physics, name, x, *given) for name, x in (("T", p), ("V", q))))


def rounding_of(T: Conditioned, V: Conditioned) -> Entries:
    """:data:`CERTAINTY` times the rounding error of T + V in double: absolute, and relative to |T| + |V|."""
    size = (T.size + V.size).carrier * (CERTAINTY * 2.0**-53)
    return [size, size / (abs(T.value) + abs(V.value)).carrier]
