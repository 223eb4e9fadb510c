"""Comparison of the formulas and declarations of a system in multiprecision, at its first use.

Integrators use only gradients: a gradient that contradicts its potential gives orbits of another system without an
error. The numbers are decimals of the standard library, because mpmath takes longer to load than a kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, DivisionByZero, InvalidOperation, Overflow, localcontext
from random import Random
from typing import Any, NamedTuple

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.formulas.expression.graph import Graph, value_of
from nearharmonic.core.formulas.expression.size import check_size, operations
from nearharmonic.core.formulas.number import Constant, Number, call, scalar, vector
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.definition.extended import DerivedGradient
from nearharmonic.systems.definition.remembered import remembered
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.formulas import Formulas
from nearharmonic.systems.formulas.kinetic_energy import MassKineticEnergy, quadratic_grad_T, quadratic_T
from nearharmonic.systems.numba.gradients import SMALL, bisected, check_numba_gradient
from nearharmonic.systems.numba.potential import numba_potential

# Sizes below are relative to the coordinates. A point has a displacement r from the start, so that length scales of a
# formula (singularities, the width of a zero) are hardly shorter than r. A central difference over a step h then has a
# relative truncation error of (h/r)^2 / 6 < 1e-84 for the smallest r. Its rounding error is 1e-DIGITS of the terms of
# V, divided by h. If the terms of V are as large as its slope times the coordinate, this is 1e-140 of the slope; for
# larger terms the comparison allows a larger error. Both errors are negligible compared with TOLERANCE.
DIGITS = 200
STEP = Decimal("1e-60")
#: Distances of the points from the start. No point is the start itself, where gradients may vanish and formulas may
#: fail.
DISPLACEMENTS = tuple(Decimal(2) ** -k for k in (4, 10, 30, 60))
#: Largest difference, relative to the sum of the moduli of a gradient's terms. A literal of 16 digits, such as
#: 0.3333333333333333 for 1/3, changes a term by a relative 1e-16 at most.
TOLERANCE = Decimal("1e-12")

_VALUES = Context(prec=DIGITS, Emax=MAX_EMAX, Emin=MIN_EMIN, traps=[DivisionByZero, InvalidOperation, Overflow])
_SIZES = Context(prec=9, Emax=MAX_EMAX, Emin=MIN_EMIN, traps=[DivisionByZero, InvalidOperation, Overflow])


class Multiprecision(Number):
    """A number of :data:`DIGITS` digits with the condition of the formula that computes it.

    ``size`` x u bounds, to first order in u, the change of ``value`` when every operand and result of the formula
    changes by a relative u (running error analysis: Higham, Accuracy and Stability of Numerical Algorithms, 3.3).
    """

    __slots__ = ("size", "value")

    def __init__(self, value: Decimal, inherited: Decimal = Decimal(0)) -> None:
        self.value, self.size = value, _SIZES.add(_SIZES.abs(value), inherited)

    @classmethod
    def of(cls, number: Constant) -> Multiprecision:
        """Return an exact number, rounded to :data:`DIGITS` digits."""
        return cls(_VALUES.divide(Decimal(number.numerator), Decimal(number.denominator)))

    def _add(self, other: Multiprecision | Constant) -> Multiprecision:
        other = self._lift(other)
        return Multiprecision(_VALUES.add(self.value, other.value), _SIZES.add(self.size, other.size))

    def _multiply(self, other: Multiprecision | Constant) -> Multiprecision:
        other = self._lift(other)
        sizes = [_SIZES.multiply(a.size, _SIZES.abs(b.value)) for a, b in ((self, other), (other, self))]
        return Multiprecision(_VALUES.multiply(self.value, other.value), _SIZES.add(*sizes))

    def _divide(self, other: Multiprecision | Constant) -> Multiprecision:
        other = self._lift(other)
        value = _VALUES.divide(self.value, other.value)
        sizes = _SIZES.fma(_SIZES.abs(value), other.size, self.size)
        return Multiprecision(value, _SIZES.divide(sizes, _SIZES.abs(other.value)))

    def __neg__(self) -> Multiprecision:
        return self._with(_VALUES.minus(self.value))

    def __abs__(self) -> Multiprecision:
        return self._with(_VALUES.abs(self.value))

    def _with(self, value: Decimal) -> Multiprecision:
        result = Multiprecision(value)
        result.size = self.size
        return result

    def sqrt(self) -> Multiprecision:
        value = _VALUES.sqrt(self.value)
        return Multiprecision(value, _SIZES.divide(self.size, _SIZES.add(value, value)))

    def lifted(self, number: Constant) -> Multiprecision:
        return Multiprecision.of(number)

    def apply(self, function: str, *others: Multiprecision | Constant) -> Multiprecision:
        from nearharmonic.systems.formulas.multiprecision_functions import evaluated

        operands = [self, *map(self._lift, others)]
        value, slopes = evaluated(function, [x.value for x in operands], DIGITS)
        inherited = Decimal(0)
        for slope, x in zip(slopes, operands, strict=True):
            inherited = _SIZES.fma(_SIZES.abs(slope), x.size, inherited)
        return Multiprecision(value, inherited)


class _Slope(NamedTuple):
    """Slope of an energy along a direction: by its gradient, by a difference, and the allowed difference of both."""

    gradient: Decimal
    difference: Decimal
    allowed: Decimal

    @property
    def contradiction(self) -> bool:
        return abs(_VALUES.subtract(self.gradient, self.difference)) > self.allowed


class _Pair(NamedTuple):
    """An energy and its gradient, as formulas of a system with constant parameters."""

    system: System
    formulas: Formulas
    energy: str
    constants: tuple[Constant, ...]

    @property
    def gradient(self) -> str:
        return f"grad_{self.energy}"

    def gradient_at(self, point: Sequence[Decimal]) -> tuple[Multiprecision, ...]:
        components = vector(self.formulas, self.gradient, tuple(map(Multiprecision, point)), *self.constants)
        return tuple(Multiprecision.of(x) if isinstance(x, Constant) else x for x in components)

    def energy_at(self, point: Sequence[Decimal]) -> Multiprecision:
        value = scalar(self.formulas, self.energy, tuple(map(Multiprecision, point)), *self.constants)
        return Multiprecision.of(value) if isinstance(value, Constant) else value

    def check_size(self) -> None:
        """Refuse a gradient that will be compiled and takes too many operations."""
        if self.formulas.are_loops:
            return
        graph = Graph()
        x = graph.variables(self.formulas.dimension)
        components = vector(self.formulas, self.gradient, x, *self.constants)
        count = operations(graph, [value_of(component) for component in components])
        call(self.formulas, self.gradient, check_size, count)

    def slope(self, point: Sequence[Decimal], gradient: Sequence[Multiprecision], along: Sequence[Decimal]) -> _Slope:
        """Both slopes at ``point`` (d,) in the direction ``along`` (d,), whose size is that of the coordinates."""
        ahead, behind = (
            self.energy_at([_VALUES.fma(sign * STEP, w, x) for x, w in zip(point, along, strict=True)])
            for sign in (1, -1)
        )
        difference = _VALUES.divide(_VALUES.subtract(ahead.value, behind.value), 2 * STEP)
        slope = allowed = Decimal(0)
        for g, w in zip(gradient, along, strict=True):
            slope = _VALUES.fma(g.value, w, slope)
            allowed = _SIZES.fma(_SIZES.multiply(g.size, TOLERANCE), abs(w), allowed)
        rounding = _SIZES.multiply(ahead.size, Decimal(10) ** (10 - DIGITS) / STEP)
        return _Slope(slope, difference, _SIZES.add(allowed, rounding))


#: The potentials that a system may declare.
POTENTIALS: Mapping[str, Callable[..., Any]] = {
    "harmonic": lambda q: q[0] * q[0] / 2,
    "gravity": lambda q, GM: -GM / sqrt(sum(x * x for x in q)),
}


@remembered
def check_gradients(system: System) -> None:
    """Compare given gradients with V and T, and V with a declared potential, at points near the start.

    Each comparison is made once. Derived gradients are not compared.

    A point at which a formula divides by zero or takes the root of a negative number is skipped.

    Raises
    ------
    SystemDefinitionError
        A component differs from the derivative of its energy, V differs from the declared potential, a formula takes
        too many operations to be compiled, or a formula fails for another reason.
    """
    formulas, constants = system.formulas(), system.constants(Constant)
    q0, p0 = system.extended_start(Decimal)
    for energy, gradient in zip(system.energies, (system.grad_V, system.grad_T), strict=True):
        try:
            energy.trace()
        except SystemDefinitionError as error:
            if isinstance(gradient, DerivedGradient) or not isinstance(error.__cause__, ArithmeticError):
                raise
    numba = numba_potential(system)
    if numba is not None:
        check_numba_gradient(numba, *(tuple(map(float, numbers)) for numbers in (q0, constants)))
    given = numba is None and not isinstance(system.grad_V, DerivedGradient)
    with localcontext(_VALUES):
        potential = _Pair(system, formulas, "V", constants)
        if given or any(getattr(system, name) for name in POTENTIALS):
            _compare(potential, "q", q0)
        if given:
            potential.check_size()
        known = isinstance(system.T, MassKineticEnergy) or (system.T, system.grad_T) == (quadratic_T, quadratic_grad_T)
        if not (known or isinstance(system.grad_T, DerivedGradient)):
            kinetic = _Pair(system, formulas, "T", constants)
            _compare(kinetic, "p", p0)
            kinetic.check_size()


def _compare(pair: _Pair, letter: str, start: Sequence[Decimal]) -> None:
    random = Random(1)  # the same points in every process
    largest = max(map(abs, start)) or Decimal(1)
    scales = [abs(x) or largest for x in start]  # a coordinate that starts at 0 has no other length scale
    if pair.energy == "V" and pair.system.time_dependent:
        scales[-1] = abs(Decimal(pair.system.t_end)) or Decimal(1)
    for displacement in DISPLACEMENTS:
        point = [_VALUES.fma(displacement * _random(random), w, x) for x, w in zip(start, scales, strict=True)]
        try:
            if pair.energy == "V":
                _check_declared(pair, point)
            gradient = pair.gradient_at(point)
            found = _contradiction(pair, point, gradient, scales, random)
        except SystemDefinitionError as error:
            if isinstance(error.__cause__, ArithmeticError):
                continue
            raise
        if found is not None:
            i, derivative = found
            raise SystemDefinitionError(
                f"{pair.system.name}: {pair.gradient}[{i}] contradicts {pair.energy}: at {letter} = "
                f"({_shown(point)}) it is {float(gradient[i].value)}, "
                f"and the derivative of {pair.energy} is {float(derivative)}"
            )


def _check_declared(pair: _Pair, point: Sequence[Decimal]) -> None:
    for name, potential in POTENTIALS.items():
        if getattr(pair.system, name):
            value = pair.energy_at(point)
            expected = potential(tuple(map(Multiprecision, point)), *map(Multiprecision.of, pair.constants))
            if abs(_VALUES.subtract(value.value, expected.value)) > _SIZES.multiply(TOLERANCE, expected.size):
                raise SystemDefinitionError(
                    f"{pair.system.name}: {name} contradicts V: at q = ({_shown(point)}) it is {float(value.value)}, "
                    f"and the potential declared is {float(expected.value)}"
                )


def _contradiction(
    pair: _Pair, point: Sequence[Decimal], gradient: Sequence[Multiprecision], scales: Sequence[Decimal], random: Random
) -> tuple[int, Decimal] | None:
    """A component that contradicts its energy, with the correct derivative; None if there is none."""

    def slope(indices: range, weights: Sequence[Decimal]) -> _Slope:
        along = [w if i in indices else Decimal(0) for i, w in enumerate(weights)]
        return pair.slope(point, gradient, along)

    d = len(point)
    if d <= SMALL:
        candidates: Iterator[int] = iter(range(d))
    else:
        weights = [w * _random(random) for w in scales]
        candidates = bisected(lambda indices: slope(indices, weights).contradiction, range(d))
    for i in candidates:
        single = slope(range(i, i + 1), scales)
        if single.contradiction:
            return i, _VALUES.divide(single.difference, scales[i])
    return None


def _shown(point: Sequence[Decimal]) -> str:
    shown = [repr(float(x)) if len(point) <= 4 else f"{float(x):.4g}" for x in point[:SMALL]]
    return ", ".join(shown) if len(point) <= SMALL else f"{', '.join(shown)}, ... {len(point)} in all"


def _random(random: Random) -> Decimal:
    """A factor in [1/2, 1) of random sign."""
    return Decimal(random.choice((-0.5, 0.5)) * (1 + random.random()))
