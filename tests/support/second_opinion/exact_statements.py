"""Statements on coefficients and on terms of the oscillator, decided in exact fractions."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import product
from random import Random

from support.second_opinion import Opinion
from support.second_opinion.algebra import (
    VANISHED,
    harmonic_order,
    momentum_errors,
    position_errors,
    states,
    step,
    swapped,
)
from support.second_opinion.methods import METHODS, Method, closed

SELECTED = ("ABA864", "ABA1064", "Yosh s7o6 A", "ABAs5o6H", "BABs7o7H", "BAB's8o7H", "BAB's9o7H")


def only_solution_of_eq_14() -> Opinion:
    """Count the real solutions of Eq. 14 where both rows sum to 1; unknown are c = c_1 and d = d_2."""

    def residuals(c: Fraction, d: Fraction) -> tuple[Fraction, Fraction]:
        c2, d1 = 1 - 2 * c, Fraction(1, 2) - d
        second = 12 * c * d * (c + c2) / (2 * c + c2) - 1
        return second, 24 * c * d * (2 * c * d1 + 2 * c2 * d1 + c2 * d) - 1

    # Polynomials of degree 3 or less in c and in d that are equal at 4 x 4 points are equal. As Eq. 14 forbids c d = 0,
    # a solution has d = (1 - c) / 2, and the second residual is then a cubic's.
    points = [Fraction(n) for n in range(1, 5)]
    a, b, e, f = cubic = (6, -12, 6, -1)
    reduced = all(
        residuals(c, d)[1] - residuals(c, d)[0] == 12 * c * d * (1 - c - 2 * d) for c, d in product(points, repeat=2)
    ) and all(residuals(c, (1 - c) / 2)[0] == ((a * c + b) * c + e) * c + f for c in points)
    discriminant = 18 * a * b * e * f - 4 * b**3 * f + b * b * e * e - 4 * a * e**3 - 27 * a * a * f * f
    # Ruth's c = 1 / (2 - 2^(1/3)) is the real root of (2 - 1/c)^3 = 2, which is (2c - 1)^3 - 2c^3 = 0.
    ruth = (8 - 2, -12, 6, -1)
    only = reduced and discriminant < 0 and ruth == cubic
    return ("holds" if only else "fails"), ["1 real root"]


def general_criteria_of_eq_16() -> Opinion:
    """Try coefficients that solve Eq. 16 on the oscillator, which is a separable Hamiltonian."""
    outer = closed([Fraction(1, 3), Fraction(2, 3)], 5)
    inner = closed([Fraction(3, 4)], 4)
    example = Method("kick", outer, inner)
    symmetric = outer == outer[::-1] and inner == inner[::-1] and sum(outer) == sum(inner) == 1
    solves = step(example, 1, 0)[0][2:5:2] == [Fraction(-1, 2), Fraction(1, 24)]
    refuted = symmetric and solves and harmonic_order(position_errors(example)) < 4
    return ("fails" if refuted else "undecided"), []


def inner_limit_of_table_3() -> Opinion:
    """Compare the printed sum, to h - 1, and the sum of Eq. 16, to h, with products of shears of random fractions."""
    random = Random(1501)

    def sums(kicks: list[Fraction], drifts: list[Fraction]) -> list[tuple[Fraction, Fraction, Fraction]]:
        """Return the term of tau^4 after h = 2, 3, ... drifts, its printed sum, and the sum to h."""
        moves = [move for pair in zip(kicks, drifts, strict=True) for move in (("kick", pair[0]), ("drift", pair[1]))]
        positions = [position for position, _ in states(moves, 1, 0)[1::2]]

        def nested(h: int, limit: int) -> Fraction:
            return -sum((positions[m - 1][2] * kicks[m] * sum(drifts[m:limit]) for m in range(1, h)), Fraction(0))

        return [(positions[h - 1][4], nested(h, h - 1), nested(h, h)) for h in range(2, len(drifts) + 1)]

    rows = []
    for _ in range(5):
        coefficients = [Fraction(random.randint(1, 99), random.randint(1, 99)) for _ in range(10)]
        rows += sums(coefficients[:5], coefficients[5:])
    ruth = METHODS["Ruth"]
    off = max(abs(true - printed) for true, printed, _ in sums(list(ruth.outer[:3]), list(ruth.inner)))
    right = sum(true == printed for true, printed, _ in rows)
    values = [f"{right} of {len(rows)} sums equal", f"largest error for Ruth's method {float(off):.3g}"]
    if right == len(rows):
        return "holds", values
    return ("erratum" if all(true == to_h for true, _, to_h in rows) else "fails"), values


def bab_prime_leaves_q() -> Opinion:
    orders = {
        label: (harmonic_order(position_errors(METHODS[label])), harmonic_order(momentum_errors(METHODS[label])))
        for label in ("BAB's6o5H", "BAB's7o6H", "BAB's8o7H", "BAB's9o7H")
    }
    count = sum(q < p for q, p in orders.values())
    verdict = "holds" if count == len(orders) else "holds in part" if count else "fails"
    return verdict, [f"{label} q {q}, p {p}" for label, (q, p) in orders.items()]


def seventh_term_of_figure_2() -> Opinion:
    gone, left = (position_errors(METHODS[label])[7] for label in ("BAB's8o7H", "ABAs5o6H"))
    holds = gone < VANISHED <= left
    return ("holds" if holds else "fails"), [f"{float(left):.3g} for ABAs5o6H"]


def even_orders_of_figure_2() -> Opinion:
    """Compare the terms of both compositions; terms of odd order must differ."""
    pairs = {
        label: list(zip(position_errors(METHODS[label]), position_errors(swapped(METHODS[label])), strict=False))
        for label in SELECTED
    }
    even = [one == other for terms in pairs.values() for one, other in terms[2::2]]
    odd = [max(abs(one - other) for one, other in terms[3::2]) for terms in pairs.values()]
    holds = all(even) and min(odd) > VANISHED
    return ("holds" if holds else "fails"), [f"{sum(even)} of {len(even)} even terms"]


STATEMENTS: dict[str, Callable[[], Opinion]] = {
    "eq-14-only-solution": only_solution_of_eq_14, "eq-16-general": general_criteria_of_eq_16,
    "table-3-inner-limit": inner_limit_of_table_3, "bab-prime-leaves-q": bab_prime_leaves_q,
    "fig-2-kappa-7": seventh_term_of_figure_2, "fig-2-even-orders-meet": even_orders_of_figure_2,
}  # fmt: skip
