"""Kicks of a modified potential: by k V - m |grad V|^2, whose gradient is that of V and of its square.

|grad V|^2 stands for the square a(V').V', with a the accelerations by forces V', which makes it the bracket
[B, [A, B]] of the drift A and the kick B. A row of coefficients is the kick, the drift behind it, m, and whether the
force behind both needs the gradient of the square, which costs more than the force. The pull k V' - m grad |V'|^2 is
rounded once a component, and both momentum and position take this one number, so that the map is symplectic to the
rounding of what is added.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.core.layout import SQUARE
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


def _pairs(entries: Entries, dimension: int) -> list[tuple[LLVMValue, LLVMValue]]:
    return list(zip(entries[:dimension], entries[dimension:], strict=True))
