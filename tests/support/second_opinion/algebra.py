"""Terms of a step on the oscillator H = (p^2 + q^2)/2 in exact fractions."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import takewhile
from math import factorial

from support.second_opinion.methods import Method

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
