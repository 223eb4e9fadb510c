"""The move of a system with an exactly solved oscillator: a kick by the rest of V, then a rotation.

A coordinate of frequency w rotates by an angle x in its phase plane. A rotation is three shears: with T = w tan(x/2)
and S = sin(x)/w, p -= T q, q += S p, p -= T q. The last shear of one move, the kick, and the first shear of the next
move are at the same position. Together they are one kick k f + b q with b = -(T + T'). The move is therefore a kick and
a drift again, with a force that has a linear part. Rounded coefficients give a slightly different map. It still
consists of shears and is symplectic, so the energy does not drift. The new position is (q + S p + S b q) + (S k) f, as
in :mod:`nearharmonic.core.step`. The rounding errors of S k and S b are added one move later.

Between moves the momentum lacks the shear that is part of the next kick. The first move of a run and the output state
at the end of a step have a separate shear.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core.arithmetic import fma
from nearharmonic.core.layout import TURNS
from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.reals import POINT, compiled, linked, load_real
from nearharmonic.core.step import compensated, double_double, update_of


@compiled
def rotated_compensated(state, row, f):  # type: ignore[no-untyped-def]
    """Kick and rotation with compensated sums."""
    q, q_low, p, p_low, late = state
    kick, b, S, product, linear_product, rest, linear_rest, _ = row
    ahead = fma(S, p, fma(linear_product, q, late)) + q_low
    behind = fma(linear_rest, q, rest * f)
    p, p_low = compensated(p, fma(b, q, p_low), kick, f)
    q, q_low = compensated(q, ahead, product, f)
    return q, q_low, p, p_low, behind


@compiled
def rotated_plain(state, row, f):  # type: ignore[no-untyped-def]
    """Kick and rotation with plain sums."""
    q, q_low, p, p_low, late = state
    kick, b, S, product, linear_product, _, _, _ = row
    ahead = fma(S, p, fma(linear_product, q, q))
    p = fma(kick, f, fma(b, q, p))
    return fma(product, f, ahead), q_low, p, p_low, late


@compiled
def rotated_double_double(state, row, f):  # type: ignore[no-untyped-def]
    """Kick and rotation in double-double."""
    q, q_low, p, p_low, late = state
    kick, b, S, _ = row
    p, p_low = double_double(p, p_low, kick, f)
    p, p_low = double_double(p, p_low, b, (q, q_low))
    q, q_low = double_double(q, q_low, S, (p, p_low))
    return q, q_low, p, p_low, late


def rotated(form: Form) -> Any:
    """Return the rotation of a form: one of the three functions above."""
    return rotated_double_double if form.extended else rotated_compensated if form.compensated else rotated_plain


def sheared(form: Form) -> Any:
    """Return ``sheared(state, row)``: the state after the shear p += ... q that follows the move of a row."""
    update, extended = update_of(form), form.extended

    @compiled
    def shear(state, row):  # type: ignore[no-untyped-def]
        q, q_low, p, p_low, late = state
        if extended:
            p, p_low = update(p, p_low, row[-1], (q, q_low))
        else:
            p, p_low = update(p, p_low, row[-1], q)
        return q, q_low, p, p_low, late

    return shear


def row_loader(*, extended: bool) -> Any:
    """Return ``load(moves, row)``: the kick (a real), and b, S, S k, S b, the two rests and the shear (points)."""
    columns = tuple(linked(f"turn{column}", POINT) for column in range(6 if extended else TURNS))
    if extended:
        b, b_low, S, S_low, shear, shear_low = columns

        @compiled
        def load(moves, row):  # type: ignore[no-untyped-def]
            return (
                (load_real(moves, row), load_real(moves, row + 1)), (b(moves, row), b_low(moves, row)),
                (S(moves, row), S_low(moves, row)), (shear(moves, row), shear_low(moves, row)),
            )  # fmt: skip

        return load
    linear, drift, product, linear_product, rest, linear_rest, sheared = columns

    @compiled
    def load_doubles(moves, row):  # type: ignore[no-untyped-def]
        return (
            load_real(moves, row), linear(moves, row), drift(moves, row), product(moves, row),
            linear_product(moves, row), rest(moves, row), linear_rest(moves, row), sheared(moves, row),
        )  # fmt: skip

    return load_doubles
