"""Statements on coefficients and on terms of a step on H = (p^2 + q^2)/2, decided in exact fractions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from itertools import product, takewhile
from math import factorial
from random import Random

from support.second_opinion import Opinion
from support.second_opinion.methods import METHODS, Method

Polynomial = list[Fraction]  # coefficients of 1, tau, tau^2, ...

#: A term vanishes below this: decimals of the print end at 10^-76, and no other term of the methods is below 10^-5.
VANISHED = Fraction(1, 10**60)


def plus(one: Polynomial, factor: Fraction, other: Polynomial) -> Polynomial:
    """Return one + factor tau other."""
    longer = max(len(one), len(other) + 1)
    padded = one + [Fraction(0)] * (longer - len(one))
    return [padded[0], *(padded[i] + factor * (other[i - 1] if i <= len(other) else 0) for i in range(1, longer))]


def states(moves: Iterable[tuple[str, Fraction]], q: int, p: int) -> list[tuple[Polynomial, Polynomial]]:
    """Return position and momentum after each of the moves, from numbers q and p."""
    state = [Fraction(q)], [Fraction(p)]
    found = []
    for kind, coefficient in moves:
        position, momentum = state
        if kind == "drift":
            state = plus(position, coefficient, momentum), momentum
        else:
            state = position, plus(momentum, -coefficient, position)
        found.append(state)
    return found


def step(method: Method, q: int, p: int) -> tuple[Polynomial, Polynomial]:
    """Return position and momentum after a step from numbers q and p."""
    return states(method.moves(), q, p)[-1]


def swapped(method: Method) -> Method:
    """Return the composition of the other kind with these rows."""
    return method._replace(first="kick" if method.first == "drift" else "drift")


def errors(terms: Polynomial, derivatives: tuple[int, int, int, int]) -> list[Fraction]:
    """Return |derivative - n! term| for n = 0, 1, ...: Eq. 17, with derivatives of period four."""
    return [abs(derivatives[n % 4] - factorial(n) * term) for n, term in enumerate(terms)]


def position_errors(method: Method) -> list[Fraction]:
    """Return kappa_0, kappa_1, ... of Eq. 17 from q = 1, p = -1, where q = cos t - sin t."""
    return errors(step(method, 1, -1)[0], (1, -1, -1, 1))


def momentum_errors(method: Method) -> list[Fraction]:
    """Return the terms of Eq. 17 for the momentum, which is -cos t - sin t."""
    return errors(step(method, 1, -1)[1], (-1, -1, 1, 1))


def harmonic_order(terms: list[Fraction]) -> int:
    """Return the order up to which all terms vanish."""
    return len(list(takewhile(lambda term: term < VANISHED, terms))) - 1


SELECTED = ("ABA864", "ABA1064", "Yosh s7o6 A", "ABAs5o6H", "BABs7o7H", "BAB's8o7H", "BAB's9o7H")


def only_solution_of_eq_14() -> Opinion:
    """Count the real solutions of Eq. 14 where both rows sum to 1; unknown are c = c_1 and d = d_2."""

    def residuals(c: Fraction, d: Fraction) -> tuple[Fraction, Fraction]:
        c2, d1 = 1 - 2 * c, Fraction(1, 2) - d
        second = 12 * c * d * (c + c2) / (2 * c + c2) - 1
        return second, 24 * c * d * (2 * c * d1 + 2 * c2 * d1 + c2 * d) - 1

    # Polynomials of degree 3 or less in c and in d that are equal at 4 x 4 points are equal. As Eq. 14 forbids c d = 0,
    # a solution has d = (1 - c) / 2, and the second residual is then that of a cubic.
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


def inner_limit_of_table_3() -> Opinion:
    """Compare the sum as printed, to h - 1, and that of Eq. 16, to h, with products of shears of random fractions."""
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
    values = [f"{right} of {len(rows)} sums equal", f"for Ruth's method off by up to {float(off):.3g}"]
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
    "eq-14-only-solution": only_solution_of_eq_14,
    "table-3-inner-limit": inner_limit_of_table_3,
    "bab-prime-leaves-q": bab_prime_leaves_q,
    "fig-2-kappa-7": seventh_term_of_figure_2,
    "fig-2-even-orders-meet": even_orders_of_figure_2,
}
