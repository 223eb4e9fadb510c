"""Kernel arguments in doubles, from exact numbers: coefficients times step sizes, initial states, parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np

from nearharmonic.core.arithmetic import two_products
from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, REST, modified_columns
from nearharmonic.engine.numbers.equations import equations
from nearharmonic.engine.numbers.rotations import pair_of, rotations
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.oscillator import frequencies_of


def start_row(q: Sequence[Fraction], p: Sequence[Fraction], *, plain: bool = False) -> Floats:
    """Return one start (4 d,) as the kernel takes it: q, the digits below q, p, the digits below p.

    The digits below are 0 if ``plain``.
    """
    pairs = [[pair_of(x) for x in row] for row in (q, p)]
    keep = 0.0 if plain else 1.0
    return np.array([part for row in pairs for part in ([h for h, _ in row], [low * keep for _, low in row])]).ravel()


def parameter_row(values: Sequence[Fraction]) -> Floats:
    """Return parameters (2 P,) as the kernel takes them: each rounded to a double, and the digits below it."""
    pairs = [pair_of(value) for value in values]
    return np.array(pairs, dtype=np.float64).reshape(-1)


def moves(step: Composition, taus: Sequence[Fraction], parts: int, *, rounded: bool = False) -> Floats:
    """Return the coefficients (len(taus), s + 2, columns) of a kernel's moves, multiplied by powers of tau exactly.

    Rows are those of :meth:`nearharmonic.integrators.composition.Composition.moves`. Columns: kick, drift and the
    product of the two, each rounded once, and by how much the product of the rounded two exceeds it; with two parts,
    kick and drift as pairs. Those of kicks of a modified potential are :data:`nearharmonic.core.layout.SQUARE`.

    Parameters
    ----------
    step : Composition
        Step of s stages.
    taus : sequence of Fraction
        Step sizes.
    parts : {1, 2}
        Doubles that make a number: 2 for double-doubles.
    rounded : bool
        True if coefficients times powers of tau are rounded to doubles before any are added; kicks of V alone have no
        other numbers with one part.
    """
    array = np.empty((len(taus), step.stages + 2, modified_columns(parts) if step.modified else COLUMNS))
    for i, tau in enumerate(taus):
        array[i] = _moves(step, tau.numerator, tau.denominator, parts, rounded and (parts == 2 or step.modified))
    return array


def pieces(tableau: Tableau, taus: Sequence[Fraction]) -> Floats:
    """Return the factors of moves, for step sizes that are multiples of tau: (len(taus), s + 3, 6).

    A row has pairs of kick, drift and their product. The rows are those of :func:`moves`, and behind them one that
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
    if tableau.implicit:
        frequencies = frequencies_of(system)[0] if numerics.exact_oscillator else ()
        return np.stack([equations(tableau.stages, tau, frequencies) for tau in taus])
    if numerics.exact_oscillator:
        frequencies, _ = frequencies_of(system)
        rounded = numerics.double_coefficients and numerics.parts == 2
        return np.stack([rotations(tableau, tau, frequencies, numerics.parts, rounded=rounded) for tau in taus])
    rounded = numerics.double_coefficients
    found = [moves(step, taus, numerics.parts, rounded=rounded) for step in tableau.compositions]
    return found[0] if len(found) == 1 else np.concatenate(found, axis=1)


@lru_cache(maxsize=1024)  # half a kilobyte each; most calls take step sizes that an earlier one took
def _moves(step: Composition, numerator: int, denominator: int, parts: int, rounded: bool) -> Floats:
    """The moves (s + 2, columns) of one step size."""
    if step.modified:
        return _modified(step, Fraction(numerator, denominator), parts, rounded)
    if parts == 2:
        found = step.moves(Fraction(numerator, denominator), rounded=rounded)
        return np.array([[half for c in row[:2] for half in pair_of(c)] for row in found])
    return _products(step, numerator, denominator)


def _products(step: Composition, numerator: int, denominator: int) -> Floats:
    array = np.empty((step.stages + 2, COLUMNS))
    n, d = numerator * numerator, denominator * denominator
    for row, ((k1, k2), (e1, e2), (p1, p2)) in zip(array, exact_products(step), strict=True):
        row[:2] = k1 * numerator / (k2 * denominator), e1 * numerator / (e2 * denominator)
        row[PRODUCT] = _quotient(p1 * n, p2 * d)
    with np.errstate(over="ignore", invalid="ignore"):
        high, low = two_products(array[:, KICK], array[:, DRIFT])
        array[:, REST] = (high - array[:, PRODUCT]) + low
    return array


def _modified(step: Composition, tau: Fraction, parts: int, rounded: bool) -> Floats:
    found = step.moves(tau, rounded=rounded)
    array = np.zeros((len(found), modified_columns(parts)))
    for i, (row, move) in enumerate(zip(array, found, strict=True)):
        row[:-1] = [part for c in move for part in pair_of(c)[:parts]]
        row[-1] = any(found[k][2] for k in moves_behind(i, len(found)))
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
