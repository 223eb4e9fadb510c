"""The definition of a step, and the rotation of an oscillator that is solved exactly."""

from __future__ import annotations

from typing import Any

from nearharmonic.core.arithmetic import dd_add, dd_mul, fma
from nearharmonic.core.layout import TURNS, Form
from nearharmonic.core.machine.reals import POINT, compiled, linked, load_real

# --- The definition of a step.
#
# A step is a sequence of kicks p -= k dV/dq and drifts q += e dT/dp. A kick and the next drift are one *move*, from
# the force at a position to the next position. If T is quadratic, with dT/dp = v(p) and the acceleration a(f) by a
# force f, the new position is (q + e v(p)) + (e k) a(f). The sum in brackets is ready before the force, so that only
# one operation follows the force. This shortens the chain of operations that bounds the time of one trajectory. The
# product e k is rounded once, and differs from the product of the rounded e and k. This rounding would break
# symplecticity and make the energy drift, so the difference, ``rest``, is added one move later. The chain does not
# bound the time of double-double operations. For these, and for T that is not quadratic, the momentum is computed
# first.
#
# A state is (q, q_low, p, p_low, late): positions and momenta, their low parts (carries of compensated sums, low halves
# of double-doubles), and the rest that the next move adds. All are points (:mod:`nearharmonic.core.machine.reals`).
# Coefficients of kicks carry the minus sign of dp/dt = -dV/dq.
#
# The functions at the end of this module return a ``move(state, row, force, parameters)`` for the formulas of a system:
# ``row`` holds the coefficients of the move, and ``force`` is the force at the position of the state.

#: A compiled function.
Move = Any


@compiled
def compensated(y: Any, carry: Any, c: Any, rate: Any) -> Any:
    """y += c rate; the rounding error goes into the carry (Kahan 1965, doi:10.1145/363707.363723)."""
    increment = fma(c, rate, carry)
    total = y + increment
    return total, increment + (y - total)


@compiled
def plain(y: Any, carry: Any, c: Any, rate: Any) -> Any:
    """y += c rate; the carry stays 0."""
    return fma(c, rate, y), carry


@compiled
def double_double(y: Any, low: Any, c: Any, rate: Any) -> Any:
    """y += c rate, each a pair."""
    return dd_add((y, low), dd_mul(c, rate))


def update_of(form: Form) -> Any:
    """Return the addition of a form: one of the three functions above."""
    return double_double if form.extended else compensated if form.compensated else plain


def ahead_compensated(velocity: Any, acceleration: Any) -> Move:
    """A move whose position is ready one operation after the force, with compensated sums."""

    @compiled
    def move(state, row, f, parameters):  # type: ignore[no-untyped-def]
        (q, q_low, p, p_low, late), (kick, drift, product, rest) = state, row
        v, a = velocity(p, parameters), acceleration(f, parameters)
        q, q_low = compensated(q, fma(drift, v, late) + q_low, product, a)
        p, p_low = compensated(p, p_low, kick, f)
        return q, q_low, p, p_low, rest * a

    return move


def ahead_plain(velocity: Any, acceleration: Any) -> Move:
    """A move whose position is ready one operation after the force, with plain sums."""

    @compiled
    def move(state, row, f, parameters):  # type: ignore[no-untyped-def]
        (q, q_low, p, p_low, late), (kick, drift, product, _) = state, row
        ahead = fma(drift, velocity(p, parameters), q)
        return fma(product, acceleration(f, parameters), ahead), q_low, fma(kick, f, p), p_low, late

    return move


def momentum_first(velocity: Any, update: Any) -> Move:
    """A kick and then a drift, by :func:`compensated`, :func:`plain` or :func:`double_double`."""

    @compiled
    def move(state, row, f, parameters):  # type: ignore[no-untyped-def]
        (q, q_low, p, p_low, late), (kick, drift) = state, row
        p, p_low = update(p, p_low, kick, f)
        q, q_low = update(q, q_low, drift, velocity(p, p_low, parameters))
        return q, q_low, p, p_low, late

    return move


def move_of(form: Form, velocity: Any, acceleration: Any) -> Move:
    """Return the move of a form: one of the three above."""
    if not form.ahead:
        return momentum_first(velocity, update_of(form))
    return (ahead_compensated if form.compensated else ahead_plain)(velocity, acceleration)


def modified(form: Form, move: Move) -> Move:
    """A move with the force k V' + m grad |V'|^2 of a modified potential, in double rounded once per component.

    Momentum and position use the same rounded number, so that the map is symplectic up to the rounding of the sums.
    """
    extended, ahead = form.extended, form.ahead

    @compiled
    def modified_move(state, row, forces, parameters):  # type: ignore[no-untyped-def]
        (kick, drift, m), (f, g) = row, forces
        if extended:
            return move(state, ((1.0, 0.0), drift), dd_add(dd_mul(kick, f), dd_mul(m, g)), parameters)
        return move(state, (1.0, drift, drift, 0.0) if ahead else (1.0, drift), fma(m, g, kick * f), parameters)

    return modified_move


# --- The move of a system with an exactly solved oscillator: a kick by the rest of V, then a rotation.
#
# A coordinate of frequency w rotates by an angle x in its phase plane. A rotation is three shears: with T = w
# tan(x/2) and S = sin(x)/w, p -= T q, q += S p, p -= T q. The last shear of one move, the kick, and the first shear
# of the next move are at the same position. Together they are one kick k f + b q with b = -(T + T'). The move is
# therefore a kick and a drift again, with a force that has a linear part. Rounded coefficients give a slightly
# different map. It still consists of shears and is symplectic, so the energy does not drift. The new position is (q +
# S p + S b q) + (S k) f, as in :mod:`nearharmonic.core.step`. The rounding errors of S k and S b are added one move
# later.
#
# Between moves the momentum lacks the shear that is part of the next kick. The first move of a run and the output state
# at the end of a step have a separate shear.


@compiled
def rotated_compensated(state, row, f):  # type: ignore[no-untyped-def]
    q, q_low, p, p_low, late = state
    kick, b, S, product, linear_product, rest, linear_rest, _ = row
    ahead = fma(S, p, fma(linear_product, q, late)) + q_low
    behind = fma(linear_rest, q, rest * f)
    p, p_low = compensated(p, fma(b, q, p_low), kick, f)
    q, q_low = compensated(q, ahead, product, f)
    return q, q_low, p, p_low, behind


@compiled
def rotated_plain(state, row, f):  # type: ignore[no-untyped-def]
    q, q_low, p, p_low, late = state
    kick, b, S, product, linear_product, _, _, _ = row
    ahead = fma(S, p, fma(linear_product, q, q))
    p = fma(kick, f, fma(b, q, p))
    return fma(product, f, ahead), q_low, p, p_low, late


@compiled
def rotated_double_double(state, row, f):  # type: ignore[no-untyped-def]
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
