"""Coefficients of a logarithm as linear functions of the coefficients of a step.

A step S is a product of exponentials of Lie elements. Then the product of its coefficients on two words is the sum of
its coefficients on all shuffles of the words (Ree 1958, Ann. Math. 68, 210; Reutenauer 1993, Free Lie Algebras, Theorem
3.2). Each power of S - 1 in log S = (S - 1) - (S - 1)^2 / 2 + ... has products of coefficients, which become sums.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from fractions import Fraction
from functools import cache, reduce
from itertools import combinations, pairwise


@cache
def logarithm_weights(word: str) -> Mapping[str, Fraction]:
    """Return weights of words whose weighted sum of coefficients of a step is that of its logarithm on ``word``.

    The words are rearrangements of ``word``.
    """
    found: dict[str, Fraction] = {}
    for parts in range(1, len(word) + 1):
        for cuts in combinations(range(1, len(word)), parts - 1):
            ends = (0, *cuts, len(word))
            pieces = [word[a:b] for a, b in pairwise(ends)]
            for shuffle, count in reduce(_times, pieces[1:], Counter({pieces[0]: 1})).items():
                found[shuffle] = found.get(shuffle, Fraction(0)) - Fraction((-1) ** parts * count, parts)
    return {shuffle: weight for shuffle, weight in found.items() if weight}


def _times(left: Mapping[str, int], word: str) -> Counter[str]:
    """Return the shuffles of each word on the left, as often as it stands there, with one word."""
    found: Counter[str] = Counter()
    for other, count in left.items():
        for shuffle, times in _shuffles(other, word).items():
            found[shuffle] += count * times
    return found


@cache
def _shuffles(u: str, v: str) -> Mapping[str, int]:
    """Return the shuffles of two words and how often each occurs."""
    if not u or not v:
        return {u + v: 1}
    found: Counter[str] = Counter()
    for first, x, y in ((u[0], u[1:], v), (v[0], u, v[1:])):
        for rest, count in _shuffles(x, y).items():
            found[first + rest] += count
    return found
