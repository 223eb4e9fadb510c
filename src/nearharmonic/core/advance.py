"""The loops of the inner kernel: steps of one trajectory, or of one in each lane, and the energy behind each step.

:func:`advance` and :func:`begin` make the functions of :data:`nearharmonic.core.layout.ADVANCE` and ``BEGIN`` for a
:class:`~nearharmonic.core.form.Form`; what a system and its lanes bring is linked to them by name. Rows of arrays are
described in :mod:`nearharmonic.core.kernel`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from nearharmonic.core import rotation, step
from nearharmonic.core.arithmetic import two_sum
from nearharmonic.core.layout import (
    CONDITION,
    DRIFT,
    ENERGY,
    ENERGY_LOW,
    INNER,
    KICK,
    LATEST,
    LIMIT,
    MERGED,
    NEAR,
    PRODUCT,
    REST,
    SQUARE,
    TOTAL,
    TOTAL_CARRY,
    WORST,
)
from nearharmonic.core.loops import state as in_memory
from nearharmonic.core.reals import (
    POINT,
    REAL,
    absolute,
    all_greater,
    all_within,
    all_zero,
    compiled,
    larger,
    largest_modulus,
    linked,
    linked_number,
    load_parameters,
    load_point,
    load_real,
    store,
    types,
    where_greater,
    where_zero,
    zero_like,
)
from nearharmonic.core.shape import Form, Measured, Motion


class Formulas(NamedTuple):
    """The formulas of a system as compiled text calls them; numbers are points and reals, in double-double pairs."""

    force: Any
    square: Any
    velocity: Any
    acceleration: Any
    energy: Any
    energies: Any
    force_and_potential: Any
    potential: Any
    kinetic: Any
    rounding: Any


def formulas(form: Form) -> Formulas:
    """Return the formulas that are linked to the loops of a form."""
    pair, rates = types.UniTuple(REAL, 2), types.UniTuple(POINT, 2) if form.extended else POINT
    results = {
        "force": rates, "square": rates, "velocity": rates, "acceleration": rates, "energy": pair,
        "energies": types.UniTuple(REAL, 4), "force_and_potential": types.Tuple((POINT, REAL)), "potential": REAL,
        "kinetic": REAL, "rounding": pair,
    }  # fmt: skip
    return Formulas(**{name: linked(name, kind) for name, kind in results.items()})


#: Rows: of coordinates, coefficients of a move, the tally, the parameters, and the state that runs.
_dimension, _columns, _tally, _parameters, _running = (
    linked_number(name) for name in ("dimension", "columns", "tally", "parameters", "running")
)
#: ``_moved(new, old)``: the coordinates of the first that move, and those of the second that rest.
_moved = linked("moved", POINT)


@compiled
def _load_state(rows, at):  # type: ignore[no-untyped-def]
    d = _dimension()
    return load_point(rows, at), load_point(rows, at + d), load_point(rows, at + 2 * d), load_point(rows, at + 3 * d)


@compiled
def _store_state(rows, at, q, q_low, p, p_low):  # type: ignore[no-untyped-def]
    d = _dimension()
    store(rows, at, q)
    store(rows, at + d, q_low)
    store(rows, at + 2 * d, p)
    store(rows, at + 3 * d, p_low)


@compiled
def _pair(moves, at):  # type: ignore[no-untyped-def]
    return load_real(moves, at), load_real(moves, at + 1)


@compiled
def _load_tally(rows, at):  # type: ignore[no-untyped-def]
    """Errors so far, H0 as a pair, the rounding of H in double, and the limit."""
    errors = load_real(rows, at + WORST), load_real(rows, at + TOTAL), load_real(rows, at + TOTAL_CARRY)
    H0 = load_real(rows, at + ENERGY), load_real(rows, at + ENERGY_LOW)
    rounding = load_real(rows, at + NEAR), load_real(rows, at + CONDITION)
    return (*errors, load_real(rows, at + LATEST)), H0, rounding, load_real(rows, at + LIMIT)


@compiled
def _store_errors(rows, at, worst, total, carry, latest):  # type: ignore[no-untyped-def]
    store(rows, at + WORST, worst)
    store(rows, at + TOTAL, total)
    store(rows, at + TOTAL_CARRY, carry)
    store(rows, at + LATEST, latest)


def row_loader(form: Form) -> Any:
    """Return ``load(moves, row)``, the coefficients of a move as :mod:`nearharmonic.core.step` takes them."""
    if form.turning:
        return rotation.row_loader(extended=form.extended)
    if form.extended and form.modified:
        return compiled(lambda moves, at: (_pair(moves, at), _pair(moves, at + 2), _pair(moves, at + 2 * SQUARE)))
    if form.extended:
        return compiled(lambda moves, at: (_pair(moves, at), _pair(moves, at + 2)))
    if form.modified:
        return compiled(
            lambda moves, at: (load_real(moves, at), load_real(moves, at + DRIFT), load_real(moves, at + SQUARE))
        )
    if form.ahead:
        return compiled(
            lambda moves, at: (
                load_real(moves, at + KICK), load_real(moves, at + DRIFT), load_real(moves, at + PRODUCT),
                load_real(moves, at + REST),
            )
        )  # fmt: skip
    return compiled(lambda moves, at: (load_real(moves, at + KICK), load_real(moves, at + DRIFT)))


def _move(form: Form, given: Formulas) -> Any:
    """The move of a form: :mod:`nearharmonic.core.step`, or :mod:`nearharmonic.core.rotation`."""
    if form.turning:
        rotated = (
            rotation.rotated_double_double if form.extended
            else rotation.rotated_compensated if form.compensated
            else rotation.rotated_plain
        )  # fmt: skip
        return compiled(lambda state, row, f, parameters: rotated(state, row, f))
    update = step.double_double if form.extended else step.compensated if form.compensated else step.plain
    if not form.ahead:
        move = step.momentum_first(given.velocity, update)
    elif form.compensated:
        move = step.ahead_compensated(given.velocity, given.acceleration)
    else:
        move = step.ahead_plain(given.velocity, given.acceleration)
    if form.modified:
        move = step.modified_double_double(move) if form.extended else step.modified(move, form.ahead)
    if not form.resting:
        return move

    @compiled
    def move_some(state, row, f, parameters):  # type: ignore[no-untyped-def]
        q, q_low, p, p_low, late = move(state, row, f, parameters)
        return _moved(q, state[0]), _moved(q_low, state[1]), p, p_low, late

    return move_some


def _sheared(form: Form) -> Any:
    if form.extended:
        return rotation.sheared_double_double
    return rotation.sheared_compensated if form.compensated else rotation.sheared_plain


def _closed(form: Form, move: Any) -> Any:
    """``closed(state, row, f, parameters)``: the state at the end of a step, which is a move away."""
    sheared, turning = _sheared(form), form.turning
    late_by = form.compensated and form.ahead

    @compiled
    def closed(state, row, f, parameters):  # type: ignore[no-untyped-def]
        state = move(state, row, f, parameters)
        if turning:
            state = sheared(state, row)
        q, q_low, p, p_low, late = state
        if late_by:
            q_low = q_low + late
        return q, q_low, p, p_low

    return closed


def _without(form: Form) -> Any:
    """``without(coefficient, rates)``: 0 in the lanes where the coefficient is 0."""
    if form.extended:
        return compiled(lambda c, f: (where_zero(c, 0.0, f[0]), where_zero(c, 0.0, f[1])))
    return compiled(lambda c, f: where_zero(c, 0.0, f))


def _forces(form: Form, given: Formulas) -> tuple[Any, Any, Any]:
    """``first(state, moves, parameters)`` and ``behind(state, moves, row, parameters)``: the forces that moves take.

    The third function is ``behind`` that returns V as well.
    Where no kick comes first the force does not matter, and need not exist. Behind a force of a modified potential
    stands the gradient of its square, where a lane needs it.
    """
    without = _without(form)
    force, square, force_and_potential = given.force, given.square, given.force_and_potential
    m = SQUARE * form.parts
    if not form.modified:

        @compiled
        def first(state, moves, parameters):  # type: ignore[no-untyped-def]
            return without(load_real(moves, KICK), force(state[0], state[1], parameters))

        @compiled
        def behind(state, moves, row, parameters):  # type: ignore[no-untyped-def]
            return force(state[0], state[1], parameters)

        @compiled
        def last(state, moves, row, parameters):  # type: ignore[no-untyped-def]
            return force_and_potential(state[0], state[1], parameters)

        return first, behind, last

    @compiled
    def squared(state, f, needed, parameters):  # type: ignore[no-untyped-def]
        g = zero_like(f)
        if not all_zero(needed):
            g = without(needed, square(state[0], state[1], parameters))
        return g

    @compiled
    def first_pull(state, moves, parameters):  # type: ignore[no-untyped-def]
        f = force(state[0], state[1], parameters)
        g = squared(state, f, load_real(moves, m), parameters)
        return without(load_real(moves, KICK), f), without(load_real(moves, KICK), g)

    @compiled
    def pull(state, moves, row, parameters):  # type: ignore[no-untyped-def]
        f = force(state[0], state[1], parameters)
        return f, squared(state, f, load_real(moves, row + _columns() - 1), parameters)

    @compiled
    def last_pull(state, moves, row, parameters):  # type: ignore[no-untyped-def]
        f, V = force_and_potential(state[0], state[1], parameters)
        return (f, squared(state, f, load_real(moves, row + _columns() - 1), parameters)), V

    return first_pull, pull, last_pull


def _opened(form: Form, row_of: Any, move: Any) -> Any:
    """``opened(state, moves)``: the state behind a first move of its own, in the lanes that have one.

    Such a move has no kick by the force, and a shear behind it; it is done here, and nothing of it is left.
    """
    if not form.turning:
        return compiled(lambda state, moves, parameters: state)
    sheared, extended = _sheared(form), form.extended

    @compiled
    def opened(state, moves, parameters):  # type: ignore[no-untyped-def]
        row = row_of(moves, 0)
        shear = largest_modulus(row[-1][0] if extended else row[-1])
        nothing = zero_like((state[0], state[0]) if extended else state[0])
        turned = sheared(move(state, row, nothing, parameters), row)
        for column in range(_columns()):
            x = load_real(moves, column)
            store(moves, column, where_zero(shear, x, zero_like(x)))
        q, q_low, p, p_low, late = state
        return (
            where_zero(shear, q, turned[0]), where_zero(shear, q_low, turned[1]), where_zero(shear, p, turned[2]),
            where_zero(shear, p_low, turned[3]), where_zero(shear, late, turned[4]),
        )  # fmt: skip

    return opened


@compiled
def _tallied(worst, total, carry, latest):  # type: ignore[no-untyped-def]
    """The largest, and the sum, of energy errors with one more."""
    size = absolute(latest)
    carried = carry + size
    new = total + carried
    return larger(size, worst), new, carried + (total - new)


def _measure(form: Form, given: Measured) -> Any:
    """``measure(seen, height, kick_first, H0, rounding, parameters)``: H - H0, in double where that is certain.

    ``height`` is V at the position of the last force, which is that of the end if the step ends with a kick.
    """
    energy, potential, kinetic = given.energy, given.potential, given.kinetic

    @compiled
    def difference(high, low, H0):  # type: ignore[no-untyped-def]
        return (high - H0[0]) + (low - H0[1])

    @compiled
    def exact(seen, height, kick_first, H0, rounding, parameters):  # type: ignore[no-untyped-def]
        high, low = energy(seen, parameters)
        return difference(high, low, H0)

    @compiled
    def quick(seen, height, kick_first, H0, rounding, parameters):  # type: ignore[no-untyped-def]
        V = height if kick_first else potential(seen, parameters)
        T = kinetic(seen, parameters)
        high, low = two_sum(T, V)
        latest = difference(high, low, H0)
        bound = rounding[0] + rounding[1] * (absolute(T) + absolute(V))
        if not all_greater(absolute(latest), bound):
            latest = where_greater(absolute(latest), bound, latest, exact(seen, V, True, H0, rounding, parameters))
        return latest

    return quick if form.quick else exact


def motion(form: Form) -> Motion:
    """Return what :func:`advance` calls, for states that are points."""
    given = formulas(form)
    row_of, move = row_loader(form), _move(form, given)
    opened = _opened(form, row_of, move)
    first, behind, last = _forces(form, given)

    @compiled
    def load(rows, moves, parameters):  # type: ignore[no-untyped-def]
        running = _running()
        q, q_low, p, p_low = _load_state(rows, running)
        late = load_point(rows, running + 4 * _dimension())
        return opened((q, q_low, p, p_low, late), moves, parameters), _load_state(rows, 0)

    @compiled
    def save(rows, state, seen):  # type: ignore[no-untyped-def]
        q, q_low, p, p_low, late = state
        _store_state(rows, _running(), q, q_low, p, p_low)
        store(rows, _running() + 4 * _dimension(), late)
        q, q_low, p, p_low = seen
        _store_state(rows, 0, q, q_low, p, p_low)

    return Motion(load, first, move, behind, last, _closed(form, move), save)


def _measured(form: Form) -> Measured:
    """Return the energies of states that are points."""
    given = formulas(form)
    energy, energies, rounding = given.energy, given.energies, given.rounding
    potential, kinetic = given.potential, given.kinetic
    return Measured(
        compiled(lambda seen, parameters: energy(seen[0], seen[1], seen[2], seen[3], parameters)),
        compiled(lambda seen, parameters: energies(seen[0], seen[1], seen[2], seen[3], parameters)),
        compiled(lambda seen, parameters: rounding(seen[0], seen[1], seen[2], seen[3], parameters)),
        compiled(lambda seen, parameters: potential(seen[0], seen[1], parameters)),
        compiled(lambda seen, parameters: kinetic(seen[2], parameters)),
    )


def advance(form: Form) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.ADVANCE`, to be compiled."""
    load, first, move, behind, last, closed, save = in_memory.motion(form) if form.large else motion(form)
    row_of, measure = row_loader(form), _measure(form, in_memory.measured() if form.large else _measured(form))
    every, sampled, quick = form.energy == "every", form.energy == "samples", form.quick

    def advance(count, stages, kick_first, moves, rows):  # type: ignore[no-untyped-def]
        tally, columns, parameters = _tally(), _columns(), load_parameters(rows, _parameters())
        state, seen = load(rows, moves, parameters)
        (worst, total, carry, latest), H0, rounding, limit = _load_tally(rows, tally)
        f, height = first(state, moves, parameters), zero_like(limit)
        done, opening = 0, 0
        while True:
            row = opening
            for i in range(stages - 1 if quick else stages):
                state = move(state, row_of(moves, row), f, parameters)
                f = behind(state, moves, row, parameters)
                row = row + columns if i > 0 else INNER * columns
            if quick:
                state = move(state, row_of(moves, row), f, parameters)
                f, height = last(state, moves, row, parameters)
            done += 1
            if every:
                seen = closed(state, row_of(moves, (stages + 1) * columns), f, parameters)
                latest = measure(seen, height, kick_first, H0, rounding, parameters)
                worst, total, carry = _tallied(worst, total, carry, latest)
                if not all_within(absolute(latest), limit):
                    break
            if done >= count:
                break
            opening = MERGED * columns
        if not every:
            seen = closed(state, row_of(moves, (stages + 1) * columns), f, parameters)
        if sampled:
            latest = measure(seen, height, kick_first, H0, rounding, parameters)
            worst, total, carry = _tallied(worst, total, carry, latest)
        save(rows, state, seen)
        _store_errors(rows, tally, worst, total, carry, latest)
        for column in range(columns):
            store(moves, column, load_real(moves, MERGED * columns + column))
        return done

    return advance


def begin(*, large: bool, quick: bool) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.BEGIN`, to be compiled."""
    form = Form(large=large, quick=quick)
    energies, rounding = (in_memory.measured() if large else _measured(form))[1:3]

    def begin(rows):  # type: ignore[no-untyped-def]
        tally, parameters = _tally(), load_parameters(rows, _parameters())
        seen = rows if large else _load_state(rows, 0)
        H, H_low, T, zero = energies(seen, parameters)
        near, condition = rounding(seen, parameters) if quick else (zero, zero)
        for entry in range(LIMIT):
            store(rows, tally + entry, zero)
        store(rows, tally + ENERGY, H)
        store(rows, tally + ENERGY_LOW, H_low)
        store(rows, tally + LIMIT, absolute(T))
        store(rows, tally + NEAR, near)
        store(rows, tally + CONDITION, condition)

    return begin
