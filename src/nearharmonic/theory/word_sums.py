"""Coefficients of a product of exponentials on words, in the arithmetic of whatever numbers it is given.

A step is a product of exponentials of A (a drift), B (a kick) and C = [B, [A, B]] (a kick of the square of grad V, for
quadratic T). Arrays of doubles give the sums of many steps at once, complex ones their derivatives, and mpmath numbers
any number of digits.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from math import factorial
from typing import Any

from nearharmonic.exact.words import SQUARE

#: An operator of a step, and the number it is multiplied with.
Factor = tuple[str, Any]
#: Of a word: the power of the number, what it is multiplied by over and divided by, and the word in front.
_Term = tuple[int, int, int, str]

_ELEMENTS: dict[str, dict[str, int]] = {"A": {"A": 1}, "B": {"B": 1}, "C": SQUARE}


def word_sums(factors: Sequence[Factor], needed: Iterable[str]) -> dict[str, Any]:
    """Return the coefficients of a product of exponentials on the words ``needed`` and on their beginnings.

    Parameters
    ----------
    factors : sequence of (str, number)
        The operators from left to right, each with what it is multiplied by: floats, arrays of one shape, or mpmath
        numbers.
    needed : iterable of str
        Words.
    """
    wanted = _closed(tuple(needed))
    found: dict[str, Any] = dict.fromkeys(wanted, 0.0)
    found[""] = 1.0
    for operator, c in factors:
        plan, highest = _plan(operator, wanted)
        powers = [1.0, c]
        while len(powers) <= highest:
            powers.append(powers[-1] * c)
        for word, terms in plan:
            found[word] = found[word] + sum(powers[k] * over / by * found[front] for k, over, by, front in terms)
    return found


@lru_cache(maxsize=64)
def _closed(needed: tuple[str, ...]) -> tuple[str, ...]:
    """Words and all of their beginnings, shorter ones first."""
    return tuple(sorted({word[:n] for word in needed for n in range(len(word) + 1)}, key=lambda w: (len(w), w)))


@lru_cache(maxsize=64)
def _plan(operator: str, wanted: tuple[str, ...]) -> tuple[list[tuple[str, list[_Term]]], int]:
    """What a factor adds to each word, longer words first, which draw on shorter ones; and its highest power."""
    element, longest = _ELEMENTS[operator], max(map(len, wanted))
    ends: list[tuple[str, int, int]] = []
    power, k = {"": 1}, 0
    while len(next(iter(power))) + len(next(iter(element))) <= longest:
        k += 1
        power = {word + end: a * b for word, a in power.items() for end, b in element.items()}
        ends += [(word, k, a) for word, a in power.items()]
    plan = []
    for word in reversed(wanted):
        terms = [(n, a, factorial(n), word[: len(word) - len(end)]) for end, n, a in ends if word.endswith(end)]
        if terms:
            plan.append((word, terms))
    return plan, max((k for _, terms in plan for k, *_ in terms), default=0)
