"""Kernel arguments in doubles, from exact numbers: coefficients times step sizes, initial states, parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from nearharmonic.core.arithmetic import rounded_pair, two_products
from nearharmonic.core.layout import (
    COLUMNS,
    DRIFT,
    ENERGY,
    KICK,
    LIMIT,
    PRODUCT,
    REST,
    TALLY,
    running_at,
    running_rows,
)
from nearharmonic.engine.batch.processed import processed_moves
from nearharmonic.engine.numbers.modified_moves import modified_moves
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.modified_tableau import ModifiedTableau
from nearharmonic.integrators.processed_tableau import ProcessedTableau
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.oscillator import frequencies_of


def start_row(q: Sequence[Fraction], p: Sequence[Fraction], *, plain: bool = False) -> Floats:
    """Return one start (4 d,) as the kernel takes it: q, the digits below q, p, the digits below p.

    Parameters
    ----------
    q, p : sequence of d Fraction
        Exact position and momentum.
    plain : bool
        Whether the digits below a double are dropped.
    """
    pairs = [[rounded_pair(*x.as_integer_ratio()) for x in row] for row in (q, p)]
    keep = 0.0 if plain else 1.0
    return np.array([part for row in pairs for part in ([h for h, _ in row], [low * keep for _, low in row])]).ravel()


def parameter_row(values: Sequence[Fraction]) -> Floats:
    """Return parameters (2 P,) as the kernel takes them: each rounded to a double, and the digits below it."""
    pairs = [rounded_pair(*value.as_integer_ratio()) for value in values]
    return np.array(pairs, dtype=np.float64).reshape(-1)


def lane_rows(start: Floats, parameters: Floats, width: int, room: int = 0) -> Floats:
    """Return the rows of a kernel (flat) whose lanes all hold one start, with H0 = 1 and no limit of the energy error.

    Parameters
    ----------
    start, parameters : arrays of float
        As :func:`start_row` and :func:`parameter_row` lay them out.
    width : int
        Number of lanes.
    room : int
        Doubles behind the rows that the kernel works in.
    """
    d, behind = start.size // 4, start.size + TALLY
    running = running_at(d, parameters.size // 2)
    rows = np.zeros((running + running_rows(d), width))
    rows[: start.size] = rows[running : running + start.size] = start[:, None]
    rows[start.size + ENERGY], rows[start.size + LIMIT] = 1.0, np.inf
    rows[behind : behind + parameters.size] = parameters[:, None]
    return np.append(rows, np.zeros(room))


def moves(tableau: Tableau, taus: Sequence[Fraction], parts: int, *, rounded: bool = False) -> Floats:
    """Return the coefficients (len(taus), s + 2, COLUMNS) of a kernel's moves, multiplied by tau exactly.

    Rows: the first move of a run, the first move of each later step, the others, and the move that closes a step.
    Columns: kick, drift and the product of the two, each rounded once, and by how much the product of the rounded two
    exceeds it. With two parts, kick and drift as pairs.

    Parameters
    ----------
    tableau : Tableau
        Method of s stages.
    taus : sequence of Fraction
        Step sizes.
    parts : {1, 2}
        Doubles that make a number: 2 for double-doubles.
    rounded : bool
        With two parts, the method whose coefficients times tau are rounded to doubles.
    """
    array = np.empty((len(taus), tableau.stages + 2, COLUMNS))
    for i, tau in enumerate(taus):
        array[i] = _products(tableau, tau.numerator, tau.denominator, parts, rounded and parts == 2)
    return array


def pieces(tableau: Tableau, taus: Sequence[Fraction]) -> Floats:
    """Return what moves are made of, for a step size that is a multiple of tau: (len(taus), s + 3, 6).

    A row has pairs of kick, drift and their product. The rows are those of :func:`moves`, and behind them one that
    begins with tau as a pair.
    """
    found = np.zeros((len(taus), tableau.stages + 3, 6))
    for rows, tau in zip(found, taus, strict=True):
        powers = tau, tau, tau * tau
        for row, numbers in zip(rows, exact_products(tableau), strict=False):
            exact = [Fraction(*number) * power for number, power in zip(numbers, powers, strict=True)]
            row[:] = [half for number in exact for half in rounded_pair(*number.as_integer_ratio())]
        rows[-1, :2] = rounded_pair(*tau.as_integer_ratio())
    return found


def moves_of(system: System, tableau: Tableau, taus: Sequence[Fraction], numerics: Numerics) -> Floats:
    """Return what a kernel of ``system`` takes of a method and its step sizes: moves, or pieces of them."""
    if system.regularisation is not None:
        return pieces(tableau, taus)
    if numerics.exact_oscillator:
        from nearharmonic.engine.numbers.rotations import rotations  # which needs what is above

        frequencies, _ = frequencies_of(system)
        rounded = numerics.double_coefficients and numerics.parts == 2
        return np.stack([rotations(tableau, tau, frequencies, numerics.parts, rounded=rounded) for tau in taus])
    if isinstance(tableau, ProcessedTableau):
        return processed_moves(tableau, taus, numerics.parts, rounded=numerics.double_coefficients)
    if isinstance(tableau, ModifiedTableau):
        return modified_moves(tableau, taus, numerics.parts, rounded=numerics.double_coefficients)
    return moves(tableau, taus, numerics.parts, rounded=numerics.double_coefficients)


def lanes_of(row: Floats, width: int) -> Floats:
    """Return the moves (s + 2, COLUMNS) of one step size for every lane, flat."""
    return np.repeat(row, width, axis=-1).reshape(-1)


def _rows(tableau: Tableau) -> tuple[list[Fraction], list[Fraction]]:
    """Kicks, with the sign of the force, and drifts."""
    outer, inner = tableau.rows_exact()
    drift, kick = (inner, outer) if tableau.first == "kick" else (outer, inner)
    return [-c for c in kick], list(drift)


def _moves(kicks: list[Fraction], drifts: list[Fraction], *, kick_first: bool) -> list[tuple[Fraction, Fraction]]:
    """Kick and drift of each move. A run that drifts first makes no first kick."""
    nothing = Fraction(0)
    if kick_first:
        opening, *between = zip(kicks, drifts, strict=False)
        return [opening, (kicks[-1] + kicks[0], drifts[0]), *between, (kicks[-1], nothing)]
    *between, closing = zip(kicks, drifts[1:], strict=True)
    return [(nothing, drifts[0]), (kicks[-1], drifts[-1] + drifts[0]), *between, closing]


@lru_cache(maxsize=1024)  # half a kilobyte each; most calls take step sizes that an earlier one took
def _products(tableau: Tableau, numerator: int, denominator: int, parts: int, rounded: bool) -> Floats:
    """The moves (s + 2, COLUMNS) of one step size."""
    if parts == 2:
        return _pairs(tableau, numerator, denominator, rounded)
    array = np.empty((tableau.stages + 2, COLUMNS))
    n, d = numerator * numerator, denominator * denominator
    for row, ((k1, k2), (e1, e2), (p1, p2)) in zip(array, exact_products(tableau), strict=True):
        row[:2] = k1 * numerator / (k2 * denominator), e1 * numerator / (e2 * denominator)
        row[PRODUCT] = _quotient(p1 * n, p2 * d)
    with np.errstate(over="ignore", invalid="ignore"):
        high, low = two_products(array[:, KICK], array[:, DRIFT])
        array[:, REST] = (high - array[:, PRODUCT]) + low
    return array


def _quotient(top: int, bottom: int) -> float:
    """The double nearest to a quotient of integers, infinite where it is too large for one."""
    try:
        return top / bottom
    except OverflowError:
        return math.inf if top > 0 else -math.inf


def _pairs(tableau: Tableau, numerator: int, denominator: int, rounded: bool) -> Floats:
    """As above, with kicks and drifts as pairs."""
    found = kicks_and_drifts(tableau, Fraction(numerator, denominator), rounded=rounded)
    return np.array([[part for c in pair for part in rounded_pair(*c.as_integer_ratio())] for pair in found])


def kicks_and_drifts(tableau: Tableau, tau: Fraction, *, rounded: bool) -> list[tuple[Fraction, Fraction]]:
    """Return kick and drift (s + 2) of each move, times tau exactly, or as products that are rounded to doubles first.

    A kick has the sign of the force.
    """
    kicks, drifts = ([c * tau for c in row] for row in _rows(tableau))
    if rounded:
        kicks, drifts = ([Fraction(float(c)) for c in row] for row in (kicks, drifts))
    return _moves(kicks, drifts, kick_first=tableau.first == "kick")


@lru_cache(maxsize=256)
def exact_products(tableau: Tableau) -> list[tuple[tuple[int, int], ...]]:
    """Return kick, drift and their product (s + 2) of each move, for tau = 1, as quotients of integers."""
    kicks, drifts = _rows(tableau)
    pairs = _moves(kicks, drifts, kick_first=tableau.first == "kick")
    return [tuple(c.as_integer_ratio() for c in (k, e, k * e)) for k, e in pairs]
