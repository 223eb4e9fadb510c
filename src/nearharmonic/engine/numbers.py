"""Numbers of callers and arguments of kernels: arrays, initial values, and coefficients of moves, each rounded once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.arithmetic import rounded_pair, two_products
from nearharmonic.core.layout import (
    COLUMNS,
    DRIFT,
    KICK,
    PRODUCT,
    REST,
    TURN,
    TURNS,
    collocation_columns,
    columns,
)
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting, unknown_name
from nearharmonic.integrators.collocation import gauss, integrals
from nearharmonic.integrators.tableau import Composition, Tableau
from nearharmonic.math import cos, sin
from nearharmonic.numerics.portable import Floats, product
from nearharmonic.numerics.written import exact_value, is_real
from nearharmonic.systems.gradients import frequencies_of, frequency_parameters
from nearharmonic.systems.quantities import is_list
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

# --- Coefficients of the moves of a kernel that solves an oscillator exactly, from exact numbers.

#: Bits of sines and cosines: twice the bits of a double-double.
BITS = 212


@lru_cache(maxsize=1024)
def rotations(
    tableau: Tableau, tau: Fraction, frequencies: tuple[Fraction, ...], parts: int, *, rounded: bool
) -> Floats:
    """Return the moves (s + 2, columns) of one step size, each a kick and a rotation behind it.

    Rows are as in :meth:`nearharmonic.integrators.tableau.Composition.moves`, and columns as in
    :mod:`nearharmonic.core.step`, for distinct frequencies and numbers of one or two ``parts``. Drifts that meet
    between steps turn by the sum of their angles. If ``rounded``, kicks and drifts times tau are rounded to doubles
    before anything follows from them.
    """
    found = tableau.moves(tau, rounded=rounded)
    kicks, drifts = [kick for kick, _, _ in found], [drift for _, drift, _ in found]
    array = np.zeros((len(found), columns(len(frequencies))))
    array[:, KICK : KICK + parts] = [pair_of(kick)[:parts] for kick in kicks]
    for place, frequency in enumerate(frequencies):
        shears, size = list(_shears(drifts, frequency)), 6 if parts == 2 else TURNS
        at = TURN * parts + size * place
        if parts == 2:
            array[:, at : at + size] = [[half for x in row for half in pair_of(x)] for row in shears]
        else:
            array[:, at : at + size] = _in_doubles(kicks, shears)
    return array


def rounded_rotations(kicks: Floats, drifts: Floats, frequencies: Floats) -> Floats:
    """Return moves (..., s + 2, columns) in doubles, for kicks and drifts (..., s + 2) times the step size.

    They equal the moves of :func:`rotations` up to the rounding errors of each number, for many methods and step
    sizes at once; ``frequencies`` (..., F) may differ too, and are not 0.
    """
    w, kick = frequencies[..., None, :], kicks[..., None]
    half = w * drifts[..., None] / 2
    sine, cosine = sin(half), cos(half)
    T = w * sine / cosine
    found = np.zeros((*T.shape[:-1], columns(T.shape[-1])))
    found[..., KICK] = kicks
    b, S, product, linear_product, _, _, shear = (found[..., TURN + i :: TURNS] for i in range(TURNS))
    S[:] = 2 * sine * cosine / w
    b[..., 1, :], b[..., 2:-1, :], b[..., -1, :] = T[..., -2, :], T[..., 1:-2, :], T[..., -2, :]
    b += T
    np.negative(b, out=b)
    np.multiply(kick, S, out=product)
    np.multiply(b, S, out=linear_product)
    shear[..., 0, :], shear[..., -1, :] = T[..., 1, :] - T[..., 0, :], -T[..., -1, :]
    return found


def _in_doubles(kicks: list[Fraction], shears: list[tuple[Fraction, Fraction, Fraction]]) -> Floats:
    """The coefficients (s + 2, TURNS) of a frequency, each rounded once, from b, S and the last shear of each move."""
    rows = [(b, S, k * S, b * S, last, k) for k, (b, S, last) in zip(kicks, shears, strict=True)]
    linear, drift, product, linear_product, shear, kick = np.array([[float(x) for x in row] for row in rows]).T
    with np.errstate(over="ignore", invalid="ignore"):
        rests = [(high - x) + low for x, (high, low) in (
            (product, two_products(kick, drift)), (linear_product, two_products(linear, drift)),
        )]  # fmt: skip
    return np.stack([linear, drift, product, linear_product, *rests, shear], axis=1)


def _shears(drifts: Sequence[Fraction], frequency: Fraction) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """Yield b of each move, S and the shear behind it, which are 0 but for a run's first move and a step's last."""
    turns = [_shear_and_drift(drift, frequency) for drift in drifts]
    shears, nothing = [T for T, _ in turns], Fraction(0)
    before = [nothing, shears[-2], *shears[1:-2], shears[-2]]
    behind = [shears[1] - shears[0], *[nothing] * (len(turns) - 2), -shears[-1]]
    for (T, S), earlier, last in zip(turns, before, behind, strict=True):
        yield -(earlier + T), S, last


def _shear_and_drift(drift: Fraction, frequency: Fraction) -> tuple[Fraction, Fraction]:
    """T = w tan(x/2) and S = sin(x)/w for a frequency w and the angle x that it turns by in a drift."""
    if not frequency * drift:
        return Fraction(0), drift
    from mpmath.libmp import from_rational, mpf_cos_sin, to_rational

    half = frequency * drift / 2
    angle = from_rational(half.numerator, half.denominator, 2 * BITS)
    c, s = (Fraction(*map(int, to_rational(x))) for x in mpf_cos_sin(angle, BITS))
    return frequency * s / c, 2 * s * c / frequency


def pair_of(x: Fraction) -> tuple[float, float]:
    """Return the double nearest to x, and the digits below it."""
    return rounded_pair(*x.as_integer_ratio())


# --- Numbers and arrays of numbers as callers give them: the one place in which they are read.
#
# Decimal strings, fractions and numbers of any precision are exact: a double and the digits below it. Floats mean their
# binary value. What is no number of the system's units is refused: truth values, complex numbers, differences of times,
# masked entries, and numbers that bring a unit of their own.

#: Description of a valid number in errors.
NUMBER = "a finite number in the system's units: a float, or an exact decimal string or fraction"


def exact(key: str, value: object) -> Fraction:
    """Return the exact value of a number, or of a string such as "0.1", "1e-3" or "1/3"; its modulus is a finite
    double.
    """
    try:
        number = exact_value(value)
        float(number)
    except (TypeError, ValueError, OverflowError):
        raise bad_setting(key, value, NUMBER) from None
    return number


def array_of(key: str, values: Any) -> NDArray[Any] | None:
    """Return ``values`` as a plain array if it is an array of integers or floats, else None.

    A masked entry, or numbers with a unit of their own, raise an error that begins with ``key``.
    """
    if hasattr(values, "magnitude") or hasattr(type(values), "unit") or hasattr(type(values), "units"):
        raise bad_setting(key, values, "numbers in the system's units, without a unit of their own")
    if not hasattr(values, "__array__"):
        return None
    if np.ma.is_masked(values):
        place = np.argwhere(np.ma.getmaskarray(values))[0].tolist()
        raise bad_setting(f"{key}{place or ''}", "masked", "numbers, none of them masked")
    array = np.asarray(values)
    return array if array.dtype.kind in "fiu" else None


def doubles_of(key: str, values: Any, allowed: str) -> Any:
    """Return an array of numbers as doubles, if these hold them exactly, or as lists; return no array unchanged.

    An array of neither numbers, text nor objects raises an error.
    """
    array = array_of(key, values)
    if array is not None:
        with np.errstate(all="ignore"):
            doubles = array.astype(float)
            exactly = np.abs(doubles) < 2.0**53 if array.dtype.kind in "iu" else doubles == array
        return doubles if array.dtype == float or exactly.all() else array.tolist()
    if not hasattr(values, "__array__"):
        return values
    if np.asarray(values).dtype.kind not in "OU":
        raise bad_setting(key, values, allowed)
    return np.asarray(values).tolist()


def list_of(key: str, values: Any, allowed: str, most: int) -> list[Any]:
    """Return the entries of a list, of another iterable of numbers, or of an array of one dimension, at most ``most``.

    Entries are not checked, except for masks and units; they keep their type. A single value, text, bytes, a mapping, a
    set or an array of other dimensions raise an error that begins with ``key``.
    """
    array_of(key, values)  # for its checks
    if hasattr(values, "__array__"):
        array = np.asarray(values)
        if array.ndim != 1:
            raise bad_setting(key, f"array of shape {array.shape}", f"{allowed}, of one dimension")
        values = array[: most + 1]
        values = values.tolist() if values.dtype == float else list(values)
    elif not is_list(values):
        raise bad_setting(key, values, allowed)
    found = list(islice(values, most + 1))  # an iterator may be endless
    if len(found) > most:
        raise bad_setting(key, f"more than {most} entries", f"{allowed}, at most {most}")
    return found


def rows_of(key: str, values: Any, width: int, allowed: str, *, several: bool = True) -> Floats:
    """Return pairs (R, width, 2) of the numbers of a row, or of ``several``: a double, and the digits below it.

    ``values`` have the shape (width,) or (R, width); a single number is a row of width 1. Another shape, no row, and an
    entry that is masked or no finite number raise an error about ``key`` with the text ``allowed``.
    """
    read = doubles_of(key, values, allowed)
    if isinstance(read, np.ndarray):
        array = np.atleast_1d(read)
        if array.ndim > 1 + several or array.shape[-1] != width or not len(array):
            raise bad_setting(key, f"array of shape {read.shape}", allowed)
        return _pairs_of(key, array.reshape(-1, width))
    if isinstance(read, str | Decimal) or is_real(read):
        read = [read]
    if not isinstance(read, Sequence) or not is_list(read) or not read:
        raise bad_setting(key, values, allowed)
    if several and is_list(read[0]):
        return np.concatenate([rows_of(f"{key}[{i}]", x, width, allowed, several=False) for i, x in enumerate(read)])
    if len(read) != width:
        raise bad_setting(key, values, allowed)
    if all(type(value) is float for value in read):
        return _pairs_of(key, np.array([read]))
    return np.array([[_pair(f"{key}[{i}]", value) for i, value in enumerate(read)]])


def column_of(key: str, values: Any) -> Floats:
    """Return pairs (R, 2) of one number, or of a list or an array of them; the array is not empty."""
    read = doubles_of(key, values, NUMBER)
    if isinstance(read, np.ndarray):
        if read.ndim > 1 or not read.size:
            raise bad_setting(key, f"array of shape {read.shape}", "a number, or one a member")
        return _pairs_of(key, read.reshape(-1, 1))[:, 0]
    if isinstance(read, Sequence) and is_list(read):
        return np.array([_pair(f"{key}[{i}]", x) for i, x in enumerate(read)]).reshape(-1, 2)
    return np.array([_pair(key, read)])


def _pair(key: str, value: object) -> tuple[float, float]:
    """A double and the digits below it."""
    if type(value) is float and value - value == 0:
        return value, 0.0
    return pair_of(exact(key, value))


def _pairs_of(key: str, array: Any) -> Floats:
    pairs = np.zeros((*array.shape, 2))
    pairs[..., 0] = array
    if not np.isfinite(pairs).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(pairs))[0][:-1])
        raise bad_setting(f"{key}{list(where)}", float(array[where]), NUMBER)
    return pairs


# --- Coefficients of a collocation method with oscillators inside its equations, for a step size.
@lru_cache(maxsize=1024)
def equations(stages: int, tau: Fraction, frequencies: tuple[Fraction, ...]) -> Floats:
    """Return the moves (3, columns) of a method of s stages, as :func:`collocation_columns` has them.

    Each of the three rows is the same, as a step is one move. Without frequencies it is the step size alone.
    """
    row = np.zeros(collocation_columns(stages, len(frequencies)))
    row[:2] = pair_of(tau)
    for k, frequency in enumerate(frequencies):
        row[collocation_columns(stages, k) : collocation_columns(stages, k + 1)] = _oscillator(stages, tau, frequency)
    return np.tile(row, (3, 1))


def _oscillator(stages: int, tau: Fraction, frequency: Fraction) -> Floats:
    """w^2 as a pair, G 1, G c and h^2 B by columns: one iteration of a step removes the rounding of G and B."""
    nodes, squares = _matrices(stages)
    h = float(tau)
    known = np.column_stack([np.ones(stages), nodes, squares * (h * h)])
    found = _solved(np.eye(stages) + squares * float((tau * frequency) ** 2), known)
    return np.concatenate([pair_of(frequency * frequency), *found.T])


@lru_cache
def _matrices(stages: int) -> tuple[Floats, Floats]:
    """The nodes, and the square of the matrix of the method."""
    nodes, _ = gauss(stages)
    matrix = np.array([[float(x) for x in row] for row in integrals(nodes)])
    return np.array([float(c) for c in nodes]), product(matrix, matrix)


def _solved(matrix: Floats, known: Floats) -> Floats:
    """Solve a linear system by elimination with pivots, in operations whose bits no library chooses."""
    rows = np.hstack([matrix, known])
    size = len(rows)
    for k in range(size):
        pivot = k + int(np.argmax(np.abs(rows[k:, k])))
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] /= rows[k, k]
        others = np.arange(size) != k
        rows[others] -= rows[others, k, None] * rows[k]
    return rows[:, size:]


# --- Kernel arguments in doubles, from exact numbers: coefficients times step sizes, initial states, parameters.
def start_row(q: Sequence[Fraction], p: Sequence[Fraction], *, plain: bool = False) -> Floats:
    """Return one start (4 d,) as the kernel takes it: q, the digits below q, p, the digits below p.

    The digits below are 0 if ``plain``.
    """
    rows = np.array([[pair_of(x) for x in row] for row in (q, p)]).transpose(0, 2, 1)
    rows[:, 1] *= 0.0 if plain else 1.0
    return rows.reshape(-1)


def parameter_row(values: Sequence[Fraction]) -> Floats:
    """Return parameters (2 P,) as the kernel takes them: each rounded to a double, and the digits below it."""
    return np.array([pair_of(value) for value in values], float).reshape(-1)


def moves(step: Composition, taus: Sequence[Fraction], parts: int, *, rounded: bool = False) -> Floats:
    """Return the coefficients (len(taus), s + 2, columns) of a kernel's moves, multiplied by powers of tau exactly.

    Rows are as in :meth:`nearharmonic.integrators.tableau.Composition.moves`. Columns: kick, drift and the
    product of the two, each rounded once, and by how much the product of the rounded two exceeds it; with two
    ``parts``, the doubles of a double-double, kick and drift as pairs. Columns for a modified potential are
    :data:`nearharmonic.core.layout.SQUARE`. If ``rounded``, coefficients times powers of tau are rounded to doubles
    before any are added; kicks of V alone have no other numbers with one part.
    """
    rounded = rounded and (parts == 2 or step.modified)
    return np.stack([_moves(step, tau.numerator, tau.denominator, parts, rounded) for tau in taus])


def pieces(tableau: Tableau, taus: Sequence[Fraction]) -> Floats:
    """Return the factors of moves, for step sizes that are multiples of tau: (len(taus), s + 3, 6).

    A row has pairs of kick, drift and their product. The rows are as in :func:`moves`, and behind them one that
    begins with tau as a pair.
    """
    found = np.zeros((len(taus), tableau.moves_per_step + 3, 6))
    for rows, tau in zip(found, taus, strict=True):
        powers = tau, tau, tau * tau
        for row, numbers in zip(rows, exact_products(tableau), strict=False):
            exact = [Fraction(*number) * power for number, power in zip(numbers, powers, strict=True)]
            row[:] = [half for number in exact for half in pair_of(number)]
        rows[-1, :2] = pair_of(tau)
    return found


def moves_of(system: System, tableau: Tableau, taus: Sequence[Fraction], numerics: Numerics) -> Floats:
    """Return the coefficients of a kernel of ``system`` for these step sizes: moves, or pieces of moves."""
    if system.regularisation is not None:
        return pieces(tableau, taus)
    parts, rounded = numerics.parts, numerics.double_coefficients
    frequencies = frequencies_of(system)[0] if numerics.exact_oscillator else ()
    if tableau.implicit:
        return np.stack([equations(tableau.stages, tau, frequencies) for tau in taus])
    if numerics.exact_oscillator:
        rounded = rounded and parts == 2
        return np.stack([rotations(tableau, tau, frequencies, parts, rounded=rounded) for tau in taus])
    return np.concatenate([moves(step, taus, parts, rounded=rounded) for step in tableau.compositions], axis=1)


@lru_cache(maxsize=1024)  # half a kilobyte each; most calls take step sizes that an earlier one took
def _moves(step: Composition, numerator: int, denominator: int, parts: int, rounded: bool) -> Floats:
    """The moves (s + 2, columns) of one step size."""
    if step.modified or parts == 2:
        found = step.moves(Fraction(numerator, denominator), rounded=rounded)
        rows = [[half for c in move[: 2 + step.modified] for half in pair_of(c)[:parts]] for move in found]
        if step.modified:
            flags = (any(found[k][2] for k in moves_behind(i, len(found))) for i in range(len(found)))
            rows = [[*row, flag] for row, flag in zip(rows, flags, strict=True)]
        return np.array(rows, float)
    array = np.empty((step.stages + 2, COLUMNS))
    n, d = numerator * numerator, denominator * denominator
    for row, ((k1, k2), (e1, e2), (p1, p2)) in zip(array, exact_products(step), strict=True):
        row[:2] = k1 * numerator / (k2 * denominator), e1 * numerator / (e2 * denominator)
        row[PRODUCT] = _quotient(p1 * n, p2 * d)
    with np.errstate(over="ignore", invalid="ignore"):
        high, low = two_products(array[:, KICK], array[:, DRIFT])
        array[:, REST] = (high - array[:, PRODUCT]) + low
    return array


def moves_behind(i: int, count: int) -> tuple[int, ...]:
    """Return the moves that may follow move ``i`` of ``count``.

    Behind the last inner one a step closes, or is merged with the next one.
    """
    closing = count - 1
    if i == closing:
        return ()
    following = 2 if i < 2 else i + 1
    return (1, closing) if following == closing else (following,)


def _quotient(top: int, bottom: int) -> float:
    """The double nearest to a quotient of integers, infinite where it is too large for one."""
    try:
        return top / bottom
    except OverflowError:
        return math.inf if top > 0 else -math.inf


@lru_cache(maxsize=256)
def exact_products(step: Composition) -> list[tuple[tuple[int, int], ...]]:
    """Return kick, drift and their product (s + 2) of each move, for tau = 1, as quotients of integers."""
    return [tuple(c.as_integer_ratio() for c in (k, e, k * e)) for k, e, _ in step.moves()]


# --- Initial values and parameters that a caller gives in place of a system's own, as the rows that a kernel takes.
@remembered
def standard_start(system: System, plain: bool) -> Floats:
    """Return the initial values (4 d,) of ``system`` as :func:`start_array` does; not to be changed."""
    row = start_row(*system.extended_start(Fraction), plain=plain)
    row.flags.writeable = False
    return row


@remembered
def standard_parameters(system: System) -> Floats:
    """Return the parameters (2 P,) of ``system`` as :func:`parameter_array` does; not to be changed."""
    row = parameter_row(system.constants(Fraction))
    row.flags.writeable = False
    return row


def start_array(system: System, q0: object, p0: object, *, plain: bool) -> Floats:
    """Return initial states (R, 4 d) as :func:`nearharmonic.engine.numbers.start_row` lays them out.

    ``q0`` and ``p0`` are d numbers or strings, or arrays (d,) or (R, d), a single number for one coordinate; the
    system's own for None. R is 1 unless one of them has R rows. ``plain`` drops the digits below a double.
    """
    d, own = system.dimension, standard_start(system, plain)
    allowed = f"{d} number{'s' if d > 1 else ''}, one per coordinate, or rows of {d}"
    for key, values in (("q0", q0), ("p0", p0)):
        if hasattr(values, "data_vars"):
            raise bad_setting(key, "a Dataset", f"{allowed}; a run is continued by start=")
    named = ((0, "q0", q0), (2, "p0", p0))
    given = [(k, rows_of(key, values, d, allowed)) for k, key, values in named if values is not None]
    members = max([1, *(len(pairs) for _, pairs in given)])
    rows = np.empty((members, 4, own.size // 4))
    rows[:] = own.reshape(4, -1)
    for k, pairs in given:
        if len(pairs) not in (1, members):
            raise bad_setting("p0", f"{len(given[1][1])} rows", f"as many as q0, {len(given[0][1])}, or one for all")
        rows[:, k, :d] = pairs[:, :, 0]
        rows[:, k + 1, :d] = 0.0 if plain else pairs[:, :, 1]
    return rows.reshape(members, -1)


def parameter_array(system: System, parameters: Mapping[str, Any]) -> Floats:
    """Return parameters (R, 2 P) as :func:`nearharmonic.engine.numbers.parameter_row` lays them out.

    Values by name are numbers, strings, or (R,) arrays of float; the system gives those that are not named. R is 1 if
    there is no array.
    """
    if not isinstance(parameters, Mapping):
        raise bad_setting("parameters", parameters, "a mapping of names to values")
    for name in parameters:
        if name not in system.parameters:
            raise unknown_name(f"parameter of {system.name}", name, system.parameters)
    columns = {name: column_of(f"parameters[{name!r}]", value) for name, value in parameters.items()}
    members = max([1, *map(len, columns.values())])
    rows = np.empty((members, len(system.parameters), 2))
    rows[:] = standard_parameters(system).reshape(-1, 2)
    for k, name in enumerate(system.parameters):
        column = columns.get(name)
        if column is None:
            continue
        if len(column) not in (1, members):
            raise bad_setting("parameters", f"{len(column)} values of {name!r}", f"as many as of the others, {members}")
        rows[:, k] = column
    return rows.reshape(members, -1)


def parameters_at_run_time(
    system: System, numerics: Numerics, parameters: Floats, *, own_frequencies: bool = True
) -> Floats:
    """Return the parameters that a kernel is given: ``parameters``, or none (1, 0) if they are compiled in.

    Those that are compiled in, or for which the coefficients of runs with the system's ``own_frequencies`` are
    computed, must be the system's own.
    """
    own, names = standard_parameters(system), list(system.parameters)
    for i in frequency_parameters(system) if numerics.exact_oscillator and own_frequencies else ():
        given = parameters[:, 2 * i : 2 * i + 2]
        if (given != own[2 * i : 2 * i + 2]).any():
            what = f"it is a frequency of {system.name}, whose oscillators are solved exactly: make a copy of the "
            raise bad_setting(f"parameters[{names[i]!r}]", float(given[0, 0]), f"{what}system with dataclasses.replace")
    if system.parameters_at_run_time:
        return parameters
    if (parameters == own).all():
        return np.empty((1, 0))
    what = f"a formula of {system.name} decides by its parameters, so that they are compiled in: make a copy of the "
    raise bad_setting("parameters", parameters[0, ::2].tolist(), f"{what}system with dataclasses.replace")
