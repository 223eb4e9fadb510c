"""Kinetic energies p.M^-1 p / 2: for unit masses, for masses, and for a constant mass matrix with exact inverse."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from inspect import Parameter as Argument
from inspect import signature
from numbers import Rational
from sys import float_info
from typing import Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import SystemDefinitionError, shown
from nearharmonic.numerics.written import decimal, exact_number
from nearharmonic.systems.definition.quantities import is_list
from nearharmonic.systems.formulas.energy import constants_beside

Vector = tuple[Any, ...]

#: The inverse of the largest double, about 5.6e-309.
SMALLEST_MASS = 1 / Fraction(float_info.max)


def quadratic_T(p: Vector) -> Any:
    """T = p.p / 2, the kinetic energy per unit mass."""
    return sum(x * x for x in p) / 2


def quadratic_grad_T(p: Vector) -> Vector:
    """dT/dp = p for T = p.p / 2."""
    return p


class MassKineticEnergy:
    """T = p.M^-1 p / 2 for masses that are numbers or names of parameters, or for a constant matrix M.

    Parameters
    ----------
    masses : tuple
        d masses, each a number, a decimal string, a fraction or the name of a parameter, or a symmetric positive
        definite matrix (d, d) of numbers. A number alone is the mass of the only coordinate.
    dimension, parameters
        Number of coordinates d, and names of the parameters.

    Raises
    ------
    SystemDefinitionError
        The shape is wrong, an entry is not a number, a mass is not positive, or a matrix is not symmetric or not
        positive definite.
    """

    def __init__(self, masses: Any, dimension: int, parameters: Collection[str]) -> None:
        #: The arguments.
        self.given = (masses, tuple(parameters))
        if dimension == 1 and isinstance(masses, int | float):
            masses = (masses,)
        if not is_list(masses) or not hasattr(masses, "__len__"):
            raise SystemDefinitionError(f"masses = {masses!r} is no tuple of {dimension} masses")
        if len(masses) != dimension:
            raise SystemDefinitionError(f"masses has {len(masses)} entries, expected {dimension}, one per coordinate")
        self.inverse: tuple[tuple[Constant, ...], ...] | None = None
        self.masses: tuple[int | Constant, ...] = ()
        if all(map(is_list, masses)):
            self.inverse = _inverse(_matrix(masses))
        else:
            names = list(parameters)
            self.masses = tuple(_mass(i, mass, names) for i, mass in enumerate(masses))

    def velocity(self, p: Vector, *parameters: Any) -> Vector:
        """Return dT/dp = M^-1 p."""
        kind = constants_beside(p)
        if self.inverse is None:
            return tuple(
                x / parameters[m] if isinstance(m, int) else (x if m == 1 else x * kind(1 / m))
                for x, m in zip(p, self.masses, strict=True)
            )
        return tuple(sum(x * kind(c) for c, x in zip(row, p, strict=True) if c) for row in self.inverse)

    def __call__(self, p: Vector, *parameters: Any) -> Any:
        """Return T = p.M^-1 p / 2."""
        return sum(x * v for x, v in zip(p, self.velocity(p, *parameters), strict=True)) / 2


def of_masses(
    masses: Sequence[Any] | None, T: Callable[..., Any], dimension: int, parameters: tuple[str, ...], *, alone: bool
) -> Callable[..., Any]:
    """Return the kinetic energy of a system: that of ``masses``, or T if there are no masses.

    Parameters
    ----------
    masses, dimension, parameters
        As for :class:`MassKineticEnergy`; ``masses`` is None if they are not given.
    T : callable
        Kinetic energy of the system; in a copy it may come from the masses of the original.
    alone : bool
        True if no gradient of T is given.

    Raises
    ------
    SystemDefinitionError
        Masses are given together with T or its gradient, or they do not define a kinetic energy.
    """
    made = T if isinstance(T, MassKineticEnergy) else None
    if masses is None:
        return T if made is None else quadratic_T
    if (made is None and T is not quadratic_T) or not alone:
        raise SystemDefinitionError(
            "masses and T are both given, and each defines the kinetic energy: give one of them"
        )
    if made is not None and made.given == (masses, parameters):
        return made
    return MassKineticEnergy(masses, dimension, parameters)


def takes_parameters(T: Callable[..., Any]) -> bool:
    """Return True if T is a function of the momenta and the parameters, by its signature."""
    if isinstance(T, MassKineticEnergy):
        return True
    try:
        arguments = signature(T).parameters.values()
    except (TypeError, ValueError):  # functions written in C have no signature
        return False
    needed = [x for x in arguments if x.default is Argument.empty]
    positional = sum(x.kind in (Argument.POSITIONAL_ONLY, Argument.POSITIONAL_OR_KEYWORD) for x in needed)
    return positional > 1 or any(x.kind is Argument.VAR_POSITIONAL for x in needed)


def _number(key: str, value: Any) -> Fraction:
    """An entry of ``masses`` as a fraction.

    Raises
    ------
    SystemDefinitionError
        It is not a number, or not a finite double.
    """
    try:
        number = exact_number(value if isinstance(value, Rational) else decimal(value))
        float(number)
    except (ValueError, TypeError, OverflowError):
        what = "a decimal string or a fraction, such as '0.5', '1/3'"
        message = f"{key} = {shown(value)} is not allowed: it must be {what}, and finite as a double"
        raise SystemDefinitionError(message) from None
    return number


def _mass(i: int, mass: Any, names: list[str]) -> int | Constant:
    """A mass, or the index of its parameter."""
    if mass in names:
        return names.index(mass)
    try:
        number = _number(f"masses[{i}]", mass)
    except SystemDefinitionError as error:
        known = f": {', '.join(names)}" if names else ", of which there is none"
        raise SystemDefinitionError(f"{error}; or the name of a parameter{known}") from None
    if number <= 0:
        raise SystemDefinitionError(f"masses[{i}] = {mass!r} is not allowed: a mass must be positive")
    if number < SMALLEST_MASS:
        raise SystemDefinitionError(f"masses[{i}] = {mass!r} is not allowed: no double holds its inverse")
    return Constant(number)


def _matrix(rows: Sequence[Sequence[Any]]) -> list[list[Fraction]]:
    d = len(rows)
    for i, row in enumerate(rows):
        if len(row) != d:
            raise SystemDefinitionError(f"masses[{i}] has {len(row)} entries, expected {d}: the matrix must be square")
    M = [[_number(f"masses[{i}][{j}]", entry) for j, entry in enumerate(row)] for i, row in enumerate(rows)]
    for i in range(d):
        for j in range(i):
            if M[i][j] != M[j][i]:
                raise SystemDefinitionError(
                    f"masses[{i}][{j}] = {rows[i][j]!r} differs from masses[{j}][{i}] = {rows[j][i]!r}: the matrix "
                    "must be symmetric"
                )
    return M


def _inverse(M: list[list[Fraction]]) -> tuple[tuple[Constant, ...], ...]:
    """The inverse of a symmetric positive definite matrix, by elimination in the order of the coordinates.

    A symmetric matrix is positive definite if and only if all pivots are positive.
    """
    d = len(M)
    rows = [[*row, *(Fraction(i == j) for j in range(d))] for i, row in enumerate(M)]
    for k in range(d):
        pivot = rows[k][k]
        if pivot <= 0:
            what = "singular" if pivot == 0 else "not positive definite"
            raise SystemDefinitionError(f"masses is {what}: the pivot of row {k} is {pivot}")
        rows[k] = [x / pivot for x in rows[k]]
        for i in range(d):
            factor = rows[i][k]
            if i != k and factor:
                rows[i] = [x - factor * y if y else x for x, y in zip(rows[i], rows[k], strict=True)]
    return tuple(tuple(map(Constant, row[d:])) for row in rows)
