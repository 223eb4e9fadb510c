"""A step of a splitting method: its flows in the order of their application, in any arithmetic.

A step of size tau is a tuple of pairs (letter, number c). A is a drift, q += c tau dT/dp, B a kick, p -= c tau dV/dq,
and C = [B, [A, B]], for quadratic T, a kick p += c tau^3 grad |grad V|^2 by the square of the force. Numbers may be
fractions, floats, arrays of floats, mpmath numbers or intervals: functions compute in the arithmetic of the numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import zip_longest
from math import factorial, lcm
from numbers import Rational
from typing import Any, Literal, NamedTuple

#: A flow of a step: its letter, and the number that multiplies it.
Factor = tuple[str, Any]
Step = tuple[Factor, ...]
#: Coefficients of tau^0, tau^1, ...
Powers = list[Any]

#: A linear combination of position and momentum.
POSITION, MOMENTUM = (1, 0), (0, 1)


class StepPolynomials(NamedTuple):
    """Entries of the step matrix, q_b = K11 q_a + K12 p_a and p_b = K21 q_a + K22 p_a, as polynomials in tau.

    All four are as long as the step has powers of tau, plus one. K11 and K22 are even, K12 and K21 odd, and K11 = K22
    if the step is symmetric.
    """

    K11: tuple[Any, ...]
    K12: tuple[Any, ...]
    K21: tuple[Any, ...]
    K22: tuple[Any, ...]

    @property
    def trace(self) -> tuple[Any, ...]:
        """K11 + K22: the oscillator is stable where it lies in [-2, 2]."""
        return tuple(a + b for a, b in zip(self.K11, self.K22, strict=True))

    @property
    def defect(self) -> tuple[Any, ...]:
        """K12 + K21, which vanishes if the step conserves a circle."""
        return tuple(a + b for a, b in zip(self.K12, self.K21, strict=True))

    @property
    def difference(self) -> tuple[Any, ...]:
        """K11 - K22, which vanishes if the step conserves a circle or is symmetric."""
        return tuple(a - b for a, b in zip(self.K11, self.K22, strict=True))


def composed(
    first: Literal["drift", "kick"], kicks: Iterable[Any], drifts: Iterable[Any], squares: Iterable[Any] = ()
) -> Step:
    """Return the step that applies kicks and drifts in turns: coefficients of B and A.

    ``squares`` are coefficients of C, each behind its kick; None for a kick without C.
    """
    kicked = [[("B", k)] if m is None else [("B", k), ("C", m)] for k, m in zip_longest(kicks, squares)]
    drifted = [[("A", c)] for c in drifts]
    rows: tuple[list[list[Factor]], ...] = (kicked, drifted) if first == "kick" else (drifted, kicked)
    turns = zip_longest(*rows, fillvalue=[])
    return tuple(factor for turn in turns for group in turn for factor in group)


def is_exact(step: Sequence[Factor]) -> bool:
    """Return True if all numbers are rational."""
    return all(isinstance(c, Rational) for _, c in step)


def scaled(step: Sequence[Factor]) -> tuple[Step, int]:
    """Return a rational step in units of 1/unit, which makes all numbers integers, and the unit.

    What the step does in tau^l then is an integer over unit^l, which spares the common divisors of fractions.
    """
    unit = lcm(*(c.denominator for _, c in step))
    return tuple((letter, int(c * unit ** (3 if letter == "C" else 1))) for letter, c in step), unit


def oscillator(step: Sequence[Factor]) -> StepPolynomials:
    """Return the step matrix of the harmonic oscillator H = (p^2 + q^2)/2."""
    powers = sum(3 if letter == "C" else 1 for letter, _ in step)
    if is_exact(step):
        integers, unit = scaled(step)
        q, p = ([Fraction(c, unit**n) for n, c in enumerate(x)] for x in states(integers, powers)[-1])
    else:
        q, p = states(step, powers)[-1]
    none = 0 * q[0]
    # From (1, -1), even powers of q and odd ones of p come from the first component, the others from the second.
    parity = [(n % 2 == 0, a, b) for n, (a, b) in enumerate(zip(q, p, strict=True))]
    return StepPolynomials(
        tuple(a if even else none for even, a, _ in parity),
        tuple(none if even else -a for even, a, _ in parity),
        tuple(none if even else b for even, _, b in parity),
        tuple(-b if even else none for even, _, b in parity),
    )


def oscillator_errors(step: Sequence[Factor]) -> StepPolynomials:
    """Return the matrix of a rational step less the exact rotation, two powers beyond its own, where it must fail."""
    K = oscillator(step)
    powers = range(len(K.K11) + 2)
    cos = [Fraction((1, 0, -1, 0)[n % 4], factorial(n)) for n in powers]
    sin = [Fraction((0, 1, 0, -1)[n % 4], factorial(n)) for n in powers]
    pairs = zip(K, (cos, sin, [-x for x in sin], cos), strict=True)
    return StepPolynomials(*(tuple(a - b for a, b in zip((*own, 0, 0), exact, strict=True)) for own, exact in pairs))


def states(step: Sequence[Factor], highest: int) -> list[tuple[Powers, Powers]]:
    """Return (q, p) by powers of tau up to ``highest``, before each flow and behind the last, from (1, -1)."""
    zero = step[0][1] * 0 if step else 0
    q, p = [zero + 1] + [zero] * highest, [zero - 1] + [zero] * highest
    found = [(q, p)]
    for letter, c in step:
        if letter == "A":
            q = [q[0], *(a + c * b for a, b in zip(q[1:], p, strict=False))]
        elif letter == "B":
            p = [p[0], *(b - c * a for b, a in zip(p[1:], q, strict=False))]
        else:
            p = [*p[:3], *(b + 2 * c * a for b, a in zip(p[3:], q, strict=False))]
        found.append((q, p))
    return found


def slopes(step: Sequence[Factor], highest: int, of: tuple[int, int]) -> list[Powers]:
    """Return the derivatives of the last of :func:`states`, by flow, whose number is varied, and by power of tau.

    The step has drifts and kicks only; ``of`` are weights of q and p, :data:`POSITION` or :data:`MOMENTUM`.
    """
    before, zero = states(step, highest), step[0][1] * 0
    # The combination is alpha q + beta p of any intermediate state: followed backwards.
    alpha, beta = ([zero + weight] + [zero] * highest for weight in of)
    found: list[Powers] = []
    for (letter, c), (q, p) in zip(reversed(step), reversed(before[:-1]), strict=True):
        weight, moved = (alpha, p) if letter == "A" else (beta, q)
        row = [sum((weight[i] * moved[n - 1 - i] for i in range(n)), zero) for n in range(highest + 1)]
        if letter == "A":
            found.append(row)
            beta = [beta[0], *(b + c * a for b, a in zip(beta[1:], alpha, strict=False))]
        else:
            found.append([-x for x in row])
            alpha = [alpha[0], *(a - c * b for a, b in zip(alpha[1:], beta, strict=False))]
    return found[::-1]
