"""The move of a system whose oscillator is solved exactly: a kick by the rest of V, and a rotation behind it.

A coordinate of frequency w turns by an angle x in its plane of phase space. A rotation is three shears: with
T = w tan(x/2) and S = sin(x)/w, p -= T q, q += S p, p -= T q. The last of one move and the first of the next are at the
same position, as the kick between them is: the three are one kick k f + b q with b = -(T + T'). So the move is a kick
and a drift again, with a force that has a linear part. Coefficients as rounded make another map, but one of shears, and
that is symplectic: the energy does not drift. The new position is (q + S p + S b q) + (S k) f, as
:mod:`nearharmonic.core.rules` looks ahead, and what S k and S b as rounded leave out is added one move late.

Between moves the momentum lacks the shear that the next kick makes. The first move of a run, and the state that is seen
at the end of a step, have a shear of their own.
"""

from __future__ import annotations

from functools import reduce
from operator import and_
from typing import TYPE_CHECKING

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import KICK, TURN, TURNS

if TYPE_CHECKING:
    from nearharmonic.core.rules import Entries, Rules
    from nearharmonic.core.tracing import LLVMValue

#: Coefficients of a frequency in a row: b and S; S k and S b, and by how much the products of these as rounded exceed
#: them; and the shear behind the first move of a run, or behind the last one of a step. In extended precision they are
#: b, S and the shear, as pairs.
LINEAR, DRIFT, PRODUCT, LINEAR_PRODUCT, REST, LINEAR_REST, SHEAR = range(7)


def rotated(rules: Rules, running: Entries, row: Entries, rates: Entries) -> Entries:
    """The state that runs after a kick and a rotation by a row of coefficients, from the ``rates`` at the position."""
    d = rules.physics.dimension
    q, p, late = running[: 2 * d], running[2 * d : 4 * d], running[4 * d :]
    kicked = _kicked(rules, q, p, row, rates)
    if rules.extended:
        return _updated(rules, q, row, kicked, DRIFT) + kicked + late
    columns = []
    for i in range(d):
        turn = _turn(rules, row, i)
        columns.append(_drifted(rules, turn, (q[i], q[d + i]), p[i], rates[i], late[i]))
    position, carry, rest = ([column[k] for column in columns] for k in range(3))
    return position + carry + kicked + rest


def sheared(rules: Rules, running: Entries, row: Entries) -> Entries:
    """The state with the shear p += ... q that a row has behind its move."""
    d = rules.physics.dimension
    q, p = running[: 2 * d], running[2 * d : 4 * d]
    return q + _updated(rules, p, row, q, 2 if rules.extended else SHEAR) + running[4 * d :]


def opened(rules: Rules, running: Entries, row: Entries) -> tuple[Entries, Entries]:
    """The state that runs and the row of its first move, which is done already where it has a shear behind it.

    Such a move has no kick by the force.
    """
    d = rules.physics.dimension
    nothing = [running[0].constant(0.0)] * (d * rules.parts)
    turned = sheared(rules, rotated(rules, running, row, nothing), row)
    shears = (_turn(rules, row, i)[4 if rules.extended else SHEAR] for i in range(d))
    as_it_is = reduce(and_, (shear.equals(0.0) for shear in shears))
    states = [as_it_is.choose(x, y) for x, y in zip(running, turned, strict=True)]
    return states, [as_it_is.choose(x, 0.0) for x in row]


def _turn(rules: Rules, row: Entries, i: int) -> Entries:
    """The coefficients of a coordinate."""
    assert rules.physics.turning is not None
    size = 6 if rules.extended else TURNS
    first = TURN * rules.parts + size * rules.physics.turning[i]
    return row[first : first + size]


def _updated(rules: Rules, pairs: Entries, row: Entries, rates: Entries, column: int) -> Entries:
    """Numbers += a coefficient of each coordinate * ``rates``."""
    d, parts = rules.physics.dimension, rules.parts
    new: list[Entries] = []
    for i in range(d):
        coefficient = _turn(rules, row, i)[column * parts : (column + 1) * parts]
        new.append(rules.update([(pairs[i], pairs[d + i])], coefficient, rates[i::d][:parts]))
    return [high for high, _ in new] + [low for _, low in new]


def _kicked(rules: Rules, q: Entries, p: Entries, row: Entries, rates: Entries) -> Entries:
    """The momentum after the kick k f + b q."""
    d, kick = rules.physics.dimension, rules.part(row, KICK)
    if rules.extended:
        return _updated(rules, rules.update(_pairs(p, d), kick, rates), row, q, LINEAR)
    new = []
    for i in range(d):
        b, x, carry = _turn(rules, row, i)[LINEAR], p[i], p[d + i]
        if rules.compensated:
            new.append(arithmetic.compensated_update((x, arithmetic.fma(b, q[i], carry)), kick[0], rates[i]))
        else:
            new.append(arithmetic.plain_update((arithmetic.fma(b, q[i], x), carry), kick[0], rates[i]))
    return [value for value, _ in new] + [carry for _, carry in new]


def _drifted(
    rules: Rules, turn: Entries, position: tuple[LLVMValue, LLVMValue], p: LLVMValue, f: LLVMValue, late: LLVMValue
) -> Entries:
    """Position, carry and what the next move adds, from the momentum before the kick and the force f."""
    q, carry = position
    if not rules.compensated:
        ahead = arithmetic.fma(turn[DRIFT], p, arithmetic.fma(turn[LINEAR_PRODUCT], q, q))
        return [arithmetic.fma(turn[PRODUCT], f, ahead), carry, late]
    ahead = arithmetic.fma(turn[DRIFT], p, arithmetic.fma(turn[LINEAR_PRODUCT], q, late)) + carry
    rest = arithmetic.fma(turn[LINEAR_REST], q, turn[REST] * f)
    return [*arithmetic.compensated_update((q, ahead), turn[PRODUCT], f), rest]


def _pairs(entries: Entries, count: int) -> list[tuple[LLVMValue, LLVMValue]]:
    return list(zip(entries[:count], entries[count : 2 * count], strict=True))
