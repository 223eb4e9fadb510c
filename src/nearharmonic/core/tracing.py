"""The formulas of a system as numbers that write machine code, once for each kernel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import collocation_columns, columns, modified_columns
from nearharmonic.core.number import FUNCTIONS, Constant, Number, call, constant, scalar, vector
from nearharmonic.core.values import LLVMValue

if TYPE_CHECKING:
    from nearharmonic.core.layout import StageTable
    from nearharmonic.core.numba_code import NumbaCode
    from nearharmonic.core.terms import LoopedEnergy


# --- Numbers that write machine code when the Python formulas of a system are called, once for each kernel.
#
# :class:`LLVMValue` is one LLVM value (a double, or a vector of doubles in SIMD lanes); each operation on it is one
# instruction. Formulas are called with numbers of :class:`Double` or :class:`DoubleDouble`. Because the formulas are
# *called*, not parsed, they may use loops over components, ``sum`` and their own functions. Operations on constants
# alone are exact. A formula cannot branch on a value.


def _power_of_two(number: Constant) -> bool:
    top, bottom = abs(number.numerator), number.denominator
    return top > 0 and top & (top - 1) == 0 and bottom & (bottom - 1) == 0


class Double(Number):
    """A double, or one per lane. A product that is added to a number is always fused: both are rounded once.

    This class makes the contraction, not the compiler, so that scalars, lanes and all processors agree bitwise.
    """

    __slots__ = ("_carrier", "_factors")
    #: Carriers of a number, which are in planes of their own in memory.
    parts = 1

    def __init__(self, carrier: Any, factors: tuple[Any, Any] | None = None) -> None:
        self._carrier, self._factors = carrier, factors

    @classmethod
    def of_state(cls, high: Any, low: Any) -> Double:
        """A coordinate and its carry, or the halves of a parameter, as one number."""
        return cls(high)

    @property
    def carriers(self) -> list[Any]:
        return [self.carrier]

    @classmethod
    def of(cls, number: Constant, like: Any) -> Double:
        """Return ``number``, rounded once, in the carrier of ``like``."""
        return cls(like.constant(float(number)))

    @property
    def carrier(self) -> Any:
        """The value; a pending product is multiplied out once."""
        if self._carrier is None:
            assert self._factors is not None
            self._carrier = self._factors[0] * self._factors[1]
        return self._carrier

    def _add(self, other: Double | Constant) -> Double:
        if isinstance(other, Constant):
            if other == 0:
                return self
            other = self.lifted(other)
        for product, addend in ((self, other), (other, self)):
            if product._factors is not None:
                return Double(arithmetic.fma(*product._factors, addend.carrier))
        return Double(self.carrier + other.carrier)

    def _multiply(self, other: Double | Constant) -> Double:
        if isinstance(other, Constant):
            if other == 1:
                return self
            other = self.lifted(other)
        return Double(None, (self.carrier, other.carrier))

    def __neg__(self) -> Double:
        if self._factors is not None:
            return Double(None, (-self._factors[0], self._factors[1]))
        return Double(-self.carrier)

    def _divide(self, other: Double | Constant) -> Double:
        if isinstance(other, Constant):
            if _power_of_two(other):
                return self._multiply(1 / other)
            other = self.lifted(other)
        return Double(self.carrier / other.carrier)

    def __abs__(self) -> Double:
        return Double(arithmetic.absolute(self.carrier))

    def sign(self) -> Double:
        return Double(arithmetic.times_sign(self.carrier.constant(1.0), self.carrier))

    def sqrt(self) -> Double:
        return Double(arithmetic.sqrt(self.carrier))

    def lifted(self, number: Constant) -> Double:
        return Double.of(number, self._factors[0] if self._carrier is None and self._factors else self._carrier)

    def apply(self, function: str, *others: Double | Constant) -> Double:
        from nearharmonic.core.functions import double  # slow to load, and most formulas need no functions

        operands = [self, *map(self._lift, others)]
        return Double(double.FUNCTIONS[function](*(x.carrier for x in operands)))


class DoubleDouble(Number):
    """An unevaluated sum high + low of about 32 digits; :mod:`nearharmonic.core.arithmetic` has the error bounds."""

    __slots__ = ("high", "low")
    parts = 2

    def __init__(self, high: Any, low: Any) -> None:
        self.high, self.low = high, low

    @classmethod
    def of_state(cls, high: Any, low: Any) -> DoubleDouble:
        return cls(high, low)

    @property
    def carriers(self) -> list[Any]:
        return [self.high, self.low]

    @classmethod
    def of(cls, number: Constant, like: Any) -> DoubleDouble:
        """Return ``number``, rounded once, in the carrier of ``like``."""
        high, low = arithmetic.rounded_pair(number.numerator, number.denominator)
        return cls(like.constant(high), like.constant(low))

    @property
    def pair(self) -> tuple[Any, Any]:
        return self.high, self.low

    def _add(self, other: DoubleDouble | Constant) -> DoubleDouble:
        if isinstance(other, Constant):
            if other == 0:
                return self
            pair = self.lifted(other).pair
            if Constant(float(other)) == other:
                return DoubleDouble(*arithmetic.dd_add_double(self.pair, pair[0]))
            return DoubleDouble(*arithmetic.dd_add(self.pair, pair))
        return DoubleDouble(*arithmetic.dd_add(self.pair, other.pair))

    def _multiply(self, other: DoubleDouble | Constant) -> DoubleDouble:
        if isinstance(other, Constant):
            if other == 1:
                return self
            scale = self.lifted(other)
            if _power_of_two(other):
                return DoubleDouble(self.high * scale.high, self.low * scale.high)
            other = scale
        return DoubleDouble(*arithmetic.dd_mul(self.pair, other.pair))

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def _divide(self, other: DoubleDouble | Constant) -> DoubleDouble:
        if isinstance(other, Constant):
            return self._multiply(1 / other)
        return DoubleDouble(*arithmetic.dd_div(self.pair, other.pair))

    def __abs__(self) -> DoubleDouble:
        return DoubleDouble(*arithmetic.dd_abs(self.pair))

    def sign(self) -> DoubleDouble:
        one = self.high.constant(1.0)
        return DoubleDouble(arithmetic.times_sign(one, self.high), one - one)

    def sqrt(self) -> DoubleDouble:
        return DoubleDouble(*arithmetic.dd_sqrt(self.pair))

    def lifted(self, number: Constant) -> DoubleDouble:
        return DoubleDouble.of(number, self.high)

    def apply(self, function: str, *others: DoubleDouble | Constant) -> DoubleDouble:
        from nearharmonic.core.functions import extended

        operands = [self, *map(self._lift, others)]
        return DoubleDouble(*extended.FUNCTIONS[function](*(x.pair for x in operands)))


# --- Hamiltonian of a kernel, as functions of numbers of any type.
#
# Numbers with a bound of their rounding error: kernels choose a precision by it, and gradients are compared within it.
#
# ``size`` x u bounds, to first order in u, the change of ``value`` when every operand and result of the formula changes
# by a relative u (running error analysis: Higham, Accuracy and Stability of Numerical Algorithms, 3.3).


@dataclass(frozen=True, kw_only=True)
class Hamiltonian:
    """A separable Hamiltonian of an autonomous system: formulas ``f(q, *parameters)`` or ``f(p, *parameters)``."""

    name: str  # of the system, for errors
    dimension: int  # number of coordinates d
    V: Callable[..., Any]
    grad_V: Callable[..., Any]  # a tuple of d components
    T: Callable[..., Any]
    grad_T: Callable[..., Any]
    grad_V_and_V: Callable[..., Any]  # the components of grad_V, followed by V; both share operations
    balanced_T: Callable[..., Any]  # T in an order of operations with short chains
    #: ``f(force, *parameters)``, dT/dp minus its value at p = 0, which does not depend on p if T is quadratic.
    acceleration: Callable[..., Any] | None = None


@dataclass(frozen=True, kw_only=True)
class Physics(Hamiltonian):
    """A Hamiltonian as the kernel needs it; ``acceleration`` is None unless T is quadratic."""

    parameters: int  # number of parameters of a run, which are in the rows behind its tally
    #: Parameters that are compiled in because a formula needs their values; ``parameters`` is then 0.
    constants: tuple[Constant, ...]
    #: ``f(q, p, *parameters)``, the kinetic and the potential energy that are measured instead of T and V.
    measured: Callable[..., Any] | None = None
    #: V and T as loops, for many coordinates; the formulas above are then not compiled.
    loops: tuple[LoopedEnergy, LoopedEnergy] | None = None
    unit_masses: bool = False  # T = p.p / 2
    #: For T and an oscillator that are solved exactly together: the index of the frequency of each coordinate among the
    #: distinct frequencies. ``grad_V`` is then the gradient of the rest of V, which kicks use.
    turning: tuple[int, ...] | None = None
    modified: Callable[..., Any] | None = None  # the gradient of the square of grad_V, for modified potentials
    numba: NumbaCode | None = None  # V and grad_V that are functions of numba, for one lane
    stages: StageTable | None = None  # a collocation method, whose stages are solved together
    timed: bool = False  # the last coordinate of ``loops`` is the time

    @property
    def stage_count(self) -> int:
        """Stages of a collocation method that are solved together; 0 for any other method."""
        return 0 if self.stages is None else self.stages.stages


class Conditioned(Number):
    """A number with the condition of the formula that computes it; ``value`` is a traced double, or of a subclass."""

    __slots__ = ("size", "value")

    def __init__(self, value: Any, inherited: Any = 0) -> None:
        self.value, self.size = value, abs(value) + inherited

    def _with(self, value: Any, size: Any) -> Self:
        result = type(self)(value)
        result.size = size
        return result

    def _add(self, other: Self | Constant) -> Self:
        other = self._lift(other)
        return type(self)(self.value + other.value, self.size + other.size)

    def _multiply(self, other: Self | Constant) -> Self:
        other = self._lift(other)
        inherited = self.size * abs(other.value) + other.size * abs(self.value)
        return type(self)(self.value * other.value, inherited)

    def _divide(self, other: Self | Constant) -> Self:
        other = self._lift(other)
        value = self.value / other.value
        return type(self)(value, (self.size + abs(value) * other.size) / abs(other.value))

    def __neg__(self) -> Self:
        return self._with(-self.value, self.size)

    def __abs__(self) -> Self:
        return self._with(abs(self.value), self.size)

    def sign(self) -> Self:
        return type(self)(self.value.sign())

    def sqrt(self) -> Self:
        value = self.value.sqrt()
        return type(self)(value, self.size / (value + value))

    def lifted(self, number: Constant) -> Self:
        return type(self)(self.value.lifted(number))

    def apply(self, function: str, *others: Self | Constant) -> Self:
        operands = [self, *map(self._lift, others)]
        value, slopes = self._evaluated(function, [x.value for x in operands])
        return type(self)(value, sum(abs(slope) * x.size for slope, x in zip(slopes, operands, strict=True)))

    @staticmethod
    def _evaluated(function: str, values: Sequence[Any]) -> tuple[Any, Sequence[Any]]:
        """The value of a function, and its partial derivatives."""
        value = values[0].apply(function, *values[1:])
        return value, [slope(value, *values) for slope in FUNCTIONS[function]]


# --- The formulas of a system in the arithmetic of a kernel, written as plain Python on traced numbers.

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
        frequencies = 0 if self.physics.turning is None else 1 + max(self.physics.turning)
        if self.physics.stages is not None:
            return collocation_columns(self.physics.stage_count, frequencies)
        return columns(frequencies)

    @property
    def kind(self) -> type[Double] | type[DoubleDouble]:
        return DoubleDouble if self.extended else Double

    @property
    def parts(self) -> int:
        """Doubles per coefficient and per rate."""
        return self.kind.parts

    def _numbers(self, entries: Entries, count: int) -> tuple[Any, ...]:
        """The first ``count`` entries of a list and their low halves, as numbers."""
        pairs = zip(entries[:count], entries[count : 2 * count], strict=True)
        return tuple(self.kind.of_state(*pair) for pair in pairs)

    def flat(self, components: tuple[Any, ...], like: LLVMValue) -> Entries:
        """The components of a vector as carriers, one or two each; a constant becomes a carrier like ``like``."""
        kind: Any = self.kind
        numbers = [(x if isinstance(x, kind) else kind.of(constant(x), like)).carriers for x in components]
        return [number[part] for part in range(self.parts) for number in numbers]

    def constants(self, parameters: Entries) -> tuple[Any, ...]:
        """The parameters in the precision of the state."""
        halves = [*parameters[::2], *parameters[1::2]]
        return self.physics.constants or self._numbers(halves, self.physics.parameters)

    def force(self, position: Entries, parameters: Entries) -> Entries:
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
        return self.flat(found, position[0])

    def velocity(self, momentum: Entries, parameters: Entries) -> tuple[Any, ...]:
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
        return self.flat(found[:-1], position[0]) + self.flat(found[-1:], position[0])

    def kinetic(self, momentum: Entries, parameters: Entries) -> Entries:
        p = self._numbers(momentum, self.physics.dimension)
        return self.flat((scalar(self.physics, "balanced_T", p, *self.constants(parameters)),), momentum[0])

    def energies(self, state: Entries, parameters: Entries) -> Entries:
        """H as a pair, T, and 0, of state + carry, in double-double for every precision of the run."""
        half, d = 2 * self.physics.dimension, self.physics.dimension
        constants: tuple[Any, ...] = self.physics.constants
        constants = constants or tuple(map(DoubleDouble, parameters[::2], parameters[1::2]))
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
