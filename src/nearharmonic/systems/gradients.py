"""Formulas derived from the formulas of a system: checks, declared oscillators, Python text, squared forces."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, DivisionByZero, InvalidOperation, Overflow, localcontext
from fractions import Fraction
from functools import cache
from random import Random
from threading import RLock
from typing import Any

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.expression import Expression, Graph, Value, check_size, operations, value_of
from nearharmonic.core.expression import gradient as derived
from nearharmonic.core.number import FUNCTIONS, Constant, Number, call, in_mpfr, scalar, vector
from nearharmonic.core.program import Program, program, shortest_program
from nearharmonic.core.tracing import Conditioned
from nearharmonic.errors import SystemDefinitionError, bad_setting
from nearharmonic.systems.formulas import (
    DerivedGradient,
    Energy,
    Formulas,
    MassKineticEnergy,
    constants_beside,
    evaluate,
    quadratic_grad_T,
    quadratic_T,
)
from nearharmonic.systems.numba_potential import SMALL, check_numba_gradient, numba_potential
from nearharmonic.systems.quantities import Vector, written_frequencies
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

# --- Comparison of the formulas and declarations of a system in multiprecision, at its first use.
#
# Integrators use only gradients: a gradient that contradicts its potential gives orbits of another system without an
# error. The numbers are decimals of the standard library, because mpmath takes longer to load than a kernel.

#: Digits of the numbers. The allowed difference is relative to the terms of the given gradient; rounding errors are
#: relative to the terms of the derived one, which may be larger, and are negligible in so many digits.
DIGITS = 200
#: Distances of the points from the start. No point is the start itself, where gradients may vanish and formulas may
#: fail.
DISPLACEMENTS = tuple(Decimal(2) ** -k for k in (4, 10, 30, 60))
#: Largest difference, relative to the sum of the moduli of a component's terms. A literal of 16 digits, such as
#: 0.3333333333333333 for 1/3, changes a term by a relative 1e-16 at most.
TOLERANCE, ROUNDING = Decimal("1e-12"), Decimal(10) ** (10 - DIGITS)

_VALUES = Context(prec=DIGITS, Emax=MAX_EMAX, Emin=MIN_EMIN, traps=[DivisionByZero, InvalidOperation, Overflow])
_SIZES = Context(prec=9, Emax=MAX_EMAX, Emin=MIN_EMIN, traps=[DivisionByZero, InvalidOperation, Overflow])


class Multiprecision(Conditioned):
    """A number of :data:`DIGITS` digits, where that is the precision of the context, with its condition."""

    __slots__ = ()

    def __init__(self, value: Decimal, inherited: Decimal | int = 0) -> None:
        self.value, self.size = value, _SIZES.add(_SIZES.abs(value), inherited)

    @classmethod
    def of(cls, number: Constant) -> Multiprecision:
        """Return an exact number, rounded to :data:`DIGITS` digits."""
        return cls(_VALUES.divide(Decimal(number.numerator), Decimal(number.denominator)))

    sign = Number.sign

    def lifted(self, number: Constant) -> Multiprecision:
        return self.of(number)

    @staticmethod
    def _evaluated(function: str, values: Sequence[Decimal]) -> tuple[Decimal, Sequence[Decimal]]:
        import gmpy2

        with gmpy2.context(precision=int(3.33 * DIGITS) + 40):
            numbers = [gmpy2.mpfr(str(x)) for x in values]
            value, *slopes = _value_and_slopes(function).run(
                numbers, lambda c: gmpy2.mpfr(c.numerator) / c.denominator, in_mpfr
            )
            if not all(map(gmpy2.is_finite, (value, *slopes))):
                shown = ", ".join(f"{x:.6e}" for x in values)
                raise ArithmeticError(f"{function} has no finite value and slope at {shown}")
            return _VALUES.create_decimal(f"{value:.{DIGITS + 5}e}"), [Decimal(f"{slope:.9e}") for slope in slopes]


@cache
def _value_and_slopes(function: str) -> Program:
    graph = Graph()
    operands = graph.variables(len(FUNCTIONS[function]))
    value = value_of(operands[0].apply(function, *operands[1:]))
    return program(graph, [value, *derived(graph, value, [x.value for x in operands])])


#: The potentials that a system may declare.
POTENTIALS: Mapping[str, Callable[..., Any]] = {
    "harmonic": lambda q: q[0] * q[0] / 2,
    "gravity": lambda q, GM: -GM / sqrt(sum(x * x for x in q)),
}


@remembered
def check_gradients(system: System) -> None:
    """Compare given gradients with V and T, and V with a declared potential, at points near the start.

    Each comparison is made once. Derived gradients are not compared. A point at which a formula divides by zero or
    takes the root of a negative number is skipped. A contradiction, and formulas that fail or take too many operations
    to be compiled, raise SystemDefinitionError.
    """
    formulas, constants = system.formulas(), system.constants(Constant)
    q0, p0 = system.extended_start(Decimal)
    for energy, slope in zip(system.energies, (system.grad_V, system.grad_T), strict=True):
        try:
            energy.trace()
        except SystemDefinitionError as error:
            if isinstance(slope, DerivedGradient) or not isinstance(error.__cause__, ArithmeticError):
                raise
    numba = numba_potential(system)
    if numba is not None:
        check_numba_gradient(numba, *(tuple(map(float, numbers)) for numbers in (q0, constants)))
    given = numba is None and not isinstance(system.grad_V, DerivedGradient)
    known = isinstance(system.T, MassKineticEnergy) or (system.T, system.grad_T) == (quadratic_T, quadratic_grad_T)
    with localcontext(_VALUES):
        if given or any(getattr(system, name) for name in POTENTIALS):
            _compare(system, formulas, "V", q0, constants, compiled=given)
        if not (known or isinstance(system.grad_T, DerivedGradient)):
            _compare(system, formulas, "T", p0, constants, compiled=True)


def _compare(
    system: System, formulas: Formulas, name: str, start: Sequence[Decimal], constants: Any, *, compiled: bool
) -> None:
    """Compare the gradient of the energy V or T with the derived one; refuse one too long to be ``compiled``."""
    random = Random(1)  # the same points in every process
    largest = max(map(abs, start)) or Decimal(1)
    scales = [abs(x) or largest for x in start]  # a coordinate that starts at 0 has no other length scale
    if name == "V" and system.time_dependent:
        scales[-1] = abs(Decimal(system.t_end)) or Decimal(1)
    for displacement in DISPLACEMENTS:
        point = [_VALUES.fma(displacement * _random(random), w, x) for x, w in zip(start, scales, strict=True)]
        x = tuple(map(Multiprecision, point))
        try:
            if name == "V":
                _check_declared(system, formulas, x, constants)
            given = list(map(_lifted, vector(formulas, f"grad_{name}", x, *constants)))
            expected = list(map(_lifted, formulas.energies[name == "T"].gradient(x, *constants)))
        except (SystemDefinitionError, ArithmeticError) as error:
            if isinstance(error, ArithmeticError) or isinstance(error.__cause__, ArithmeticError):
                continue
            raise
        for i, (one, other) in enumerate(zip(given, expected, strict=True)):
            allowed = _SIZES.fma(one.size, TOLERANCE, _SIZES.multiply(other.size, ROUNDING))
            if abs(_VALUES.subtract(one.value, other.value)) > allowed:
                raise SystemDefinitionError(
                    f"{system.name}: grad_{name}[{i}] contradicts {name}: at {'q' if name == 'V' else 'p'} = "
                    f"({_shown(point)}) it is {float(one.value)}, and the derivative of {name} is {float(other.value)}"
                )
    if compiled and not formulas.are_loops:
        graph = Graph()
        components = vector(formulas, f"grad_{name}", graph.variables(formulas.dimension), *constants)
        count = operations(graph, [value_of(component) for component in components])
        call(formulas, f"grad_{name}", check_size, count)


def _lifted(x: Any) -> Multiprecision:
    return Multiprecision.of(x) if isinstance(x, Constant) else x


def _check_declared(system: System, formulas: Formulas, x: Sequence[Multiprecision], constants: Any) -> None:
    for name, potential in POTENTIALS.items():
        if getattr(system, name):
            value = _lifted(scalar(formulas, "V", x, *constants))
            expected = potential(x, *map(Multiprecision.of, constants))
            if abs(_VALUES.subtract(value.value, expected.value)) > _SIZES.multiply(TOLERANCE, expected.size):
                raise SystemDefinitionError(
                    f"{system.name}: {name} contradicts V: at q = ({_shown([y.value for y in x])}) it is "
                    f"{float(value.value)}, and the potential declared is {float(expected.value)}"
                )


def _shown(point: Sequence[Decimal]) -> str:
    shown = [repr(float(x)) if len(point) <= 4 else f"{float(x):.4g}" for x in point[:SMALL]]
    return ", ".join(shown) if len(point) <= SMALL else f"{', '.join(shown)}, ... {len(point)} in all"


def _random(random: Random) -> Decimal:
    """A factor in [1/2, 1) of random sign."""
    return Decimal(random.choice((-0.5, 0.5)) * (1 + random.random()))


# --- V as declared oscillators and the rest: [p.p + sum (w_i q_i)^2] / 2 + [V - sum (w_i q_i)^2 / 2].
#
# The rest has exact constants, so that the quadratic terms of V cancel as expressions, not as numbers.


@remembered
def frequencies_of(system: System) -> tuple[tuple[Fraction, ...], tuple[int, ...]]:
    """Return the distinct frequencies, and for each coordinate the index of its frequency."""
    check_oscillator(system)
    constants = dict(zip(system.parameters, system.constants(Fraction), strict=True))
    values = [constants[w] if isinstance(w, str) else w for w in written_frequencies(system)]
    distinct = tuple(dict.fromkeys(values))
    return distinct, tuple(distinct.index(value) for value in values)


def frequency_parameters(system: System) -> list[int]:
    """Return the indices of the parameters that are frequencies."""
    named = written_frequencies(system)
    return [i for i, name in enumerate(system.parameters) if name in named]


def check_oscillator(system: System, key: str = "split") -> None:
    """Raise an error about the setting ``key`` if the oscillators and T cannot be solved exactly together."""
    value = "exact_oscillator"
    if system.frequencies is None:
        example = ", ".join(["'1'"] * min(system.dimension, 3)) + (", ..." if system.dimension > 3 else "")
        comma = "," if system.dimension == 1 else ""
        needed = f"{system.name} declares no frequencies, such as frequencies=({example}{comma})"
    elif system.time_dependent:
        needed = f"it is for potentials that do not depend on time, and V of {system.name} does"
    elif system.regularisation is not None:
        needed = f"{system.name} is regularised, and is no oscillator in its own coordinates"
    elif not system.unit_masses:
        needed = f"it requires T = p.p / 2, which {system.name} does not have"
    elif not system.energies[0].traced:
        needed = f"it takes the oscillators out of the expression of V, and V of {system.name} is a function of numba"
    elif system.formulas().are_loops:
        needed = f"it is for systems of few terms, and the formulas of {system.name} are compiled as loops"
    else:
        return
    raise bad_setting(key, value, needed)


@remembered
def remainder_formulas(system: System) -> Formulas:
    """Return the formulas of ``system`` with the grad_V of V without its oscillators; V is the full potential."""
    check_oscillator(system)
    formulas, frequencies = system.formulas(), written_frequencies(system)

    def remainder(q: Vector, *parameters: Any) -> Any:
        given, rest, number = dict(zip(system.parameters, parameters, strict=True)), 0, constants_beside(q)
        for x, w in zip(q, frequencies, strict=True):
            if isinstance(w, str):
                rest = rest + given[w] * given[w] * x * x / 2
            elif w:
                rest = rest + number(Constant(w * w / 2)) * (x * x)
        return system.V(q, *parameters) - rest

    rest = Energy(system.name, "V", remainder, system.dimension, system.constants(Constant))
    return replace(
        formulas,
        grad_V=rest.gradient,
        grad_V_and_V=lambda q, *given: (*rest.gradient(q, *given), formulas.V(q, *given)),
    )


# --- Equations of motion as the text of a Python function, for libraries that compile or differentiate it.
class SourceTracer(Number):
    """A symbolic number that records each arithmetic operation as one line of Python source.

    ``name`` is a variable: the last of ``lines`` assigns its value, or it is an argument of the function.
    """

    __slots__ = ("lines", "name")

    def __init__(self, name: str, lines: list[str]) -> None:
        self.name, self.lines = name, lines

    def _line(self, expression: str) -> SourceTracer:
        name = f"v{len(self.lines)}"
        self.lines.append(f"{name} = {expression}")
        return type(self)(name, self.lines)

    def _add(self, other: SourceTracer | Constant) -> SourceTracer:
        # sum() begins with 0; no user would write a line for that addition.
        return self if isinstance(other, Constant) and not other else self._line(f"{self.name} + {_text(other)}")

    def __sub__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._line(f"{self.name} - {_text(operand)}")

    def __rsub__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._line(f"{_text(operand)} - {self.name}")

    def _multiply(self, other: SourceTracer | Constant) -> SourceTracer:
        return self._line(f"{self.name} * {_text(other)}")

    def _divide(self, other: SourceTracer | Constant) -> SourceTracer:
        return self._line(f"{self.name} / {_text(other)}")

    def __neg__(self) -> SourceTracer:
        return self._line(f"-{self.name}")

    def __abs__(self) -> SourceTracer:
        return self._line(f"abs({self.name})")

    def whole_power(self, exponent: int) -> SourceTracer:
        """Return the ``exponent``-th power in one line, which libraries differentiate as a power."""
        return self._line(f"{self.name} ** {exponent}")

    def sqrt(self) -> SourceTracer:
        return self._line(f"sqrt({self.name})")

    def lifted(self, number: Constant) -> SourceTracer:
        return type(self)(_text(number), self.lines)

    def apply(self, function: str, *others: SourceTracer | Constant) -> SourceTracer:
        return self._line(f"{function}({', '.join(map(_text, (self, *others)))})")


def _text(value: SourceTracer | Constant) -> str:
    return value.name if isinstance(value, SourceTracer) else repr(float(value))


def velocity_text(system: System) -> str:
    """Return the text of ``velocity(q0, .., p0, ..)`` -> (dq0/dt, .., dp0/dt, ..).

    Coordinates are as in ``system.formulas()``. For a regularised system they are (u, w), with derivatives by the
    fictitious time. The text calls ``abs``, ``sqrt`` and the functions of :mod:`nearharmonic.math` by their names.
    """
    lines: list[str] = []
    formulas, constants = system.formulas(), system.constants(Constant)
    d = formulas.dimension
    names = [f"{letter}{i}" for letter in "qp" for i in range(d)]
    entries = [SourceTracer(name, lines) for name in names]
    q, p = tuple(entries[:d]), tuple(entries[d:])
    velocity, force = vector(formulas, "grad_T", p, *constants), vector(formulas, "grad_V", q, *constants)
    results = [*map(_text, velocity), *(f"-{_text(component)}" for component in force)]
    body = "".join(f"    {line}\n" for line in lines)
    return f"def velocity({', '.join(names)}):\n{body}    return {', '.join(results)},\n"


def velocity(system: System, functions: Mapping[str, Callable[..., Any]] | None = None) -> Callable[..., Any]:
    """The function of :func:`velocity_text`; it calls ``functions``, by default from the module math."""
    import numpy as np

    space: dict[str, Any] = {name: getattr(math, name) for name in ("sqrt", *FUNCTIONS) if name != "cbrt"}
    space |= {"cbrt": np.cbrt, **(functions or {})}  # numba supports only numpy's cbrt
    exec(compile(velocity_text(system), f"<{system.name}>", "exec"), space)
    made: Callable[..., Any] = space["velocity"]
    return made


# --- The gradient of the square of a force, for kicks of a modified potential.
class SquareGradient:
    """grad |grad V|^2 as a function of the coordinates and the parameters.

    |grad V|^2 denotes the square a(f).f with inverse masses, where a(f) is the acceleration by the force f = grad V.
    Its gradient is derived in reverse mode, for a system with quadratic T.
    """

    def __init__(self, system: System) -> None:
        self.formulas, self.parameters = system.formulas(), len(system.parameters)
        self._programs: dict[tuple[Constant, ...] | None, Program] = {}
        self._lock = RLock()

    def __call__(self, q: Vector, *parameters: Any) -> Vector:
        """Return the gradient (d) at ``q`` (d), in any number type."""
        compiled_in = bool(parameters) and all(isinstance(k, Constant) for k in parameters)
        constants = parameters if compiled_in else None
        with self._lock:
            if constants not in self._programs:
                self._programs[constants] = self._program(constants)
        return evaluate(self._programs[constants], (*q, *(() if compiled_in else parameters)))

    def _program(self, constants: tuple[Constant, ...] | None) -> Program:
        graph, d = Graph(), self.formulas.dimension
        variables = graph.variables(d if constants is not None else d + self.parameters)
        q, given = variables[:d], variables[d:] if constants is None else constants
        force = vector(self.formulas, "grad_V", q, *given)
        pairs = zip(force, self.formulas.acceleration(force, *given), strict=True)
        square: Expression | Constant = sum((f * a for f, a in pairs), start=Constant(0))
        coordinates: tuple[Value, ...] = tuple(x.value for x in q)
        roots = derived(graph, value_of(square), coordinates)
        return shortest_program(graph, roots, value_of(scalar(self.formulas, "V", q, *given)))


#: The function of a system, made once.
square_gradient = cache(SquareGradient)
