"""The definition of a step.

A step is a sequence of kicks p -= k dV/dq and drifts q += e dT/dp. A kick and the drift behind it are one *move*, from
the force at a position to the next position. If T is quadratic, dT/dp = v(p), with a(f) the acceleration by a force f,
the new position is (q + e v(p)) + (e k) a(f): the sum in brackets is ready before the force is, so that one operation
follows the force, and the chain of operations that bounds the time of one trajectory is shorter by that. The product
e k is rounded once, and differs from the product of e and k as rounded. By that the map would not be symplectic and the
energy would drift: what it leaves out, ``rest``, is added one move late. Double-double operations follow one another so
closely that the chain does not bound them: there, and where T is not quadratic, the momentum comes first.

A state is (q, q_low, p, p_low, late): positions and momenta, what lies below their last digits (carries of compensated
sums, low halves of double-doubles), and what the next move is late by. All are points
(:mod:`nearharmonic.core.machine.reals`). Coefficients of kicks carry the minus sign of dp/dt = -dV/dq.

The functions at the end return a ``move(state, row, force, parameters)`` for the formulas of a system: ``row`` has the
coefficients of the move, and ``force`` is that at the position of the state.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core.arithmetic import dd_add, dd_mul, fma
from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.reals import compiled

#: A compiled function.
Move = Any


@compiled
def compensated(y: Any, carry: Any, c: Any, rate: Any) -> Any:
    """y += c rate; what rounding leaves out goes into the carry (Kahan 1965, doi:10.1145/363707.363723)."""
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
    """Return how a form adds: one of the three functions above."""
    return double_double if form.extended else compensated if form.compensated else plain


def ahead_compensated(velocity: Any, acceleration: Any) -> Move:
    """The position one operation behind the force, with compensated sums."""

    @compiled
    def move(state, row, f, parameters):  # type: ignore[no-untyped-def]
        (q, q_low, p, p_low, late), (kick, drift, product, rest) = state, row
        v, a = velocity(p, parameters), acceleration(f, parameters)
        q, q_low = compensated(q, fma(drift, v, late) + q_low, product, a)
        p, p_low = compensated(p, p_low, kick, f)
        return q, q_low, p, p_low, rest * a

    return move


def ahead_plain(velocity: Any, acceleration: Any) -> Move:
    """The position one operation behind the force, with plain sums."""

    @compiled
    def move(state, row, f, parameters):  # type: ignore[no-untyped-def]
        (q, q_low, p, p_low, late), (kick, drift, product, _) = state, row
        ahead = fma(drift, velocity(p, parameters), q)
        return fma(product, acceleration(f, parameters), ahead), q_low, fma(kick, f, p), p_low, late

    return move


def momentum_first(velocity: Any, update: Any) -> Move:
    """Kick and drift one behind the other, by :func:`compensated`, :func:`plain` or :func:`double_double`."""

    @compiled
    def move(state, row, f, parameters):  # type: ignore[no-untyped-def]
        (q, q_low, p, p_low, late), (kick, drift) = state, row
        p, p_low = update(p, p_low, kick, f)
        q, q_low = update(q, q_low, drift, velocity(p, p_low, parameters))
        return q, q_low, p, p_low, late

    return move


def modified(move: Move, ahead: bool) -> Move:
    """A move with the pull k V' + m grad |V'|^2 for a force, rounded once a component.

    Momentum and position take this one number, so that the map is symplectic to the rounding of what is added.
    """

    @compiled
    def modified_move(state, row, forces, parameters):  # type: ignore[no-untyped-def]
        (kick, drift, m), (f, g) = row, forces
        pull = fma(m, g, kick * f)
        return move(state, (1.0, drift, drift, 0.0) if ahead else (1.0, drift), pull, parameters)

    return modified_move


def modified_double_double(move: Move) -> Move:
    """The same in double-double."""

    @compiled
    def modified_move(state, row, forces, parameters):  # type: ignore[no-untyped-def]
        (kick, drift, m), (f, g) = row, forces
        pull = dd_add(dd_mul(kick, f), dd_mul(m, g))
        return move(state, ((1.0, 0.0), drift), pull, parameters)

    return modified_move
