"""Kicks of a modified potential: by k V - m |grad V|^2, whose gradient is that of V and of its square.

|grad V|^2 stands for the square a(V').V', with a the accelerations by forces V', which makes it the bracket
[B, [A, B]] of the drift A and the kick B. A row of coefficients is the kick, the drift behind it, m, and whether the
force behind both needs the gradient of the square, which costs more than the force. The pull k V' - m grad |V'|^2 is
rounded once a component, and both momentum and position take this one number, so that the map is symplectic to the
rounding of what is added.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import KICK, SQUARE
from nearharmonic.core.number import Number, call, constant

if TYPE_CHECKING:
    from nearharmonic.core.rules import Entries, Rules
    from nearharmonic.core.values import LLVMValue


def modified_columns(parts: int) -> int:
    """Doubles in a row of coefficients: three numbers of ``parts`` doubles, and whether a gradient follows."""
    return (SQUARE + 1) * parts + 1


def square(rules: Rules, state: Entries, parameters: Entries) -> Entries:
    """grad |grad V|^2 at the position."""
    d, physics = rules.physics.dimension, rules.physics
    assert physics.modified is not None
    found = call(physics, "V", physics.modified, rules.numbers(_pairs(state[: 2 * d], d)), *rules.constants(parameters))
    return rules.flat(tuple(x if isinstance(x, Number) else constant(x) for x in found), state[0])


def combined(rules: Rules, row: Entries, rates: Entries) -> tuple[Entries, Entries]:
    """The row of a plain move, and the rates that it takes, for a row of coefficients of a modified one.

    Parameters
    ----------
    rules : Rules
        Arithmetic.
    row : list
        Coefficients of the modified move.
    rates : list
        grad V, and behind it grad |grad V|^2.
    """
    d, parts = rules.physics.dimension, rules.parts
    gradient, square = rates[: parts * d], rates[parts * d :]
    kick, m, drift = rules.part(row, KICK), rules.part(row, SQUARE), row[parts : 2 * parts]
    one, zero = row[0].constant(1.0), row[0].constant(0.0)
    if not rules.extended:
        pulls = [arithmetic.fma(m[0], g, kick[0] * f) for f, g in zip(gradient, square, strict=True)]
        return [one, *drift, *drift, zero], pulls
    products = [
        arithmetic.dd_add(arithmetic.dd_mul(_pair(kick), f), arithmetic.dd_mul(_pair(m), g))
        for f, g in zip(_pairs(gradient, d), _pairs(square, d), strict=True)
    ]
    return [one, zero, *drift], [high for high, _ in products] + [low for _, low in products]


def gradient_follows(row: Entries) -> Entries:
    """Of a row, what is not 0 if the force behind its move needs the gradient of the square."""
    return row[-1:]


def _pair(entries: Entries) -> tuple[LLVMValue, LLVMValue]:
    return entries[0], entries[1]


def _pairs(entries: Entries, dimension: int) -> list[tuple[LLVMValue, LLVMValue]]:
    return list(zip(entries[:dimension], entries[dimension:], strict=True))
