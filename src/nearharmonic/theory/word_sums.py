"""Coefficients of a product of exponentials on words, and their derivatives, for many steps or many digits.

A step is a product of exponentials of A (a drift), B (a kick) and C = [B, [A, B]] (a kick of the square of grad V, for
quadratic T). What a factor adds to the coefficient on a word depends on shorter words alone: the coefficients of the
first factor, of the first two and so on are a cumulative sum. Its arrays have a row for each factor: of doubles with a
column for each step, or of mpmath numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache, reduce
from itertools import accumulate
from operator import add, mul
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.exact.words import SQUARE

#: An operator of a step, and the number it is multiplied with.
Factor = tuple[str, Any]
#: Doubles, or mpmath numbers as objects: a row for each factor.
Array = NDArray[Any]
#: Of a word: an operator, its power, the weight of the word in it, and the word in front.
_Term = tuple[str, int, int, str]

_ELEMENTS: dict[str, dict[str, int]] = {"A": {"A": 1}, "B": {"B": 1}, "C": SQUARE}


def word_sums(factors: Sequence[Factor], needed: Iterable[str]) -> dict[str, Any]:
    """Return the coefficients of a product of exponentials on the words ``needed`` and on their beginnings.

    Parameters
    ----------
    factors : sequence of F (str, number)
        The operators from left to right, each with what it is multiplied by: floats, arrays of one shape, or mpmath
        numbers.
    needed : iterable of str
        Words.
    """
    return {word: sums[-1] for word, sums in _sums(factors, tuple(needed)).items()}


def word_slopes(factors: Sequence[Factor], needed: Iterable[str]) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return what :func:`word_sums` does, and the derivatives (F, ...) on the words ``needed`` by each number.

    The derivative of exp(c X) is X exp(c X). On a word w it gives the sum over all w = u X v of the coefficient on u of
    the factors in front, times that on v of the others.

    Parameters
    ----------
    factors, needed
        As for :func:`word_sums`.
    """
    needed, places = tuple(needed), _places(factors)
    before = _sums(factors, needed)
    # A, B and C are the same read backwards: a product read backwards has the words read backwards. No first letter is
    # behind a factor.
    behind = _sums(factors[::-1], tuple(word[:0:-1] for word in needed))
    front = {word: sums[:-1] for word, sums in before.items()}
    others = {word: sums[:0:-1] for word, sums in behind.items()}
    slopes = {}
    for word in needed:
        slopes[word] = np.zeros_like(front[""])
        for operator, rows in places.items():
            if cuts := _cuts(word, operator):
                slopes[word][rows] = _total(_times(weight, front[u]) * others[v] for weight, u, v in cuts)[rows]
    return {word: sums[-1] for word, sums in before.items()}, slopes


def _places(factors: Sequence[Factor]) -> dict[str, list[int]]:
    """Return the places of each operator among the factors."""
    found = {name: [i for i, (other, _) in enumerate(factors) if other == name] for name in _ELEMENTS}
    return {name: rows for name, rows in found.items() if rows}


def _sums(factors: Sequence[Factor], needed: tuple[str, ...]) -> dict[str, Array]:
    """Return, by needed word or beginning of one, coefficients in the products of the first 0, 1, ..., F factors."""
    numbers, places = np.array([number for _, number in factors]), _places(factors)
    plan, highest = _plan("".join(places), needed)
    powers = {}  # the k-th power over k!, 0 where another operator stands
    for operator, rows in places.items():
        one = np.zeros_like(numbers)
        one[rows] = numbers[rows]
        powers[operator] = list(accumulate((one / k for k in range(2, highest + 1)), mul, initial=one))
    start = np.zeros_like(numbers, shape=(len(numbers) + 1, *numbers.shape[1:]))
    found = {"": start + 1}
    for word, terms in plan:
        found[word] = start.copy()
        if terms:
            added = _total(_times(a, powers[name][k - 1]) * found[front][:-1] for name, k, a, front in terms)
            added.cumsum(axis=0, out=found[word][1:])
    return found


def _times(weight: int, array: Array) -> Array:
    return array if weight == 1 else weight * array


def _total(arrays: Iterable[Array]) -> Array:
    return reduce(add, arrays)


@lru_cache(maxsize=64)
def _plan(operators: str, needed: tuple[str, ...]) -> tuple[list[tuple[str, list[_Term]]], int]:
    """Return the terms that factors add to each needed word and its prefixes, shorter first, and the highest power."""
    wanted = sorted({word[:n] for word in needed for n in range(1, len(word) + 1)}, key=lambda word: (len(word), word))
    longest = max(map(len, wanted), default=0)
    ends: list[tuple[str, str, int, int]] = []
    for operator in operators:
        element, power, k = _ELEMENTS[operator], {"": 1}, 0
        while len(next(iter(power))) + len(next(iter(element))) <= longest:
            k += 1
            power = {word + end: a * b for word, a in power.items() for end, b in element.items()}
            ends += [(operator, word, k, a) for word, a in power.items()]
    plan = [
        (word, [(name, k, a, word.removesuffix(end)) for name, end, k, a in ends if word.endswith(end)])
        for word in wanted
    ]
    return plan, max((k for _, terms in plan for _, k, _, _ in terms), default=0)


@lru_cache(maxsize=512)
def _cuts(word: str, operator: str) -> list[tuple[int, str, str]]:
    """All ways to cut out an operator: its weight, the word in front, and that behind read backwards."""
    return [
        (weight, word[:i], word[i + len(middle) :][::-1])
        for middle, weight in _ELEMENTS[operator].items()
        for i in range(len(word) - len(middle) + 1)
        if word[i:].startswith(middle)
    ]
