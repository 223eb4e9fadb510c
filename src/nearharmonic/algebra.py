"""Truncated power series in two letters that do not commute, exact: A for a drift, B for a kick.

A series assigns a number to every word. Those here are products of exponentials exp(c A) and exp(c B), for which a word
w of n letters has a coefficient S(w) that is a sum of products of n values c. With ``unit`` a common denominator of all
c, n! unit^n S(w) is an integer: a :class:`Series` holds these integers, so that no fraction is ever reduced.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import comb, factorial, lcm

LETTERS = "AB"

#: An operator of a step: its letter and the number it is multiplied with.
Operator = tuple[str, Fraction]


@dataclass(frozen=True)
class Series:
    """Coefficients of words of up to ``length`` letters, each times n! unit^n for a word of n letters.

    ``scaled`` holds every word up to that length whose number of letters B does not exceed the bound it was made with.
    """

    scaled: dict[str, int]
    unit: int
    length: int

    def __getitem__(self, word: str) -> Fraction:
        """The coefficient of ``word``."""
        return Fraction(self.scaled[word], factorial(len(word)) * self.unit ** len(word))


def words(length: int, kicks: int | None = None) -> list[str]:
    """All words of at most ``length`` letters with at most ``kicks`` letters B (None: any number), shorter ones first.

    Every part of such a word is one itself, so that series truncated to them can be multiplied.
    """
    bound = length if kicks is None else kicks
    layers = [[""]]
    for _ in range(length):
        layers.append([w + x for w, x in product(layers[-1], LETTERS) if (w + x).count("B") <= bound])
    return [word for layer in layers for word in layer]


def product_of_exponentials(operators: Sequence[Operator], length: int, kicks: int | None = None) -> Series:
    """exp(c1 X1) exp(c2 X2) ... for ``operators`` (X, c) from left to right, on :func:`words` of ``length, kicks``."""
    unit = lcm(*(c.denominator for _, c in operators))
    longest_first = words(length, kicks)[::-1]
    scaled = dict.fromkeys(longest_first, 0)
    scaled[""] = 1
    for letter, c in operators:
        powers = [int(c * unit) ** k for k in range(length + 1)]
        # In place: the words that a word draws on are shorter, and still those of the product so far.
        for word in longest_first:
            total, n = scaled[word], len(word)
            for k in range(1, n - len(word.rstrip(letter)) + 1):
                total += comb(n, k) * powers[k] * scaled[word[: n - k]]
            scaled[word] = total
    return Series(scaled, unit, length)


def logarithm(series: Series, wanted: Iterable[str]) -> dict[str, Fraction]:
    """Coefficients of log(series) for the words ``wanted``, exact; the series has to begin with 1.

    log(1 + X) = X (1 - X (1/2 - X (1/3 - ...))), and since X begins with words of one letter, the k-th bracket from
    outside is needed for words of up to length - k letters only.
    """
    X, length = series.scaled, series.length
    common = lcm(*range(1, length + 1))
    bracket = {"": common // length}
    for k in range(length - 1, 0, -1):
        inner = [word for word in X if len(word) <= length - k]
        bracket = {word: -_convolution(X, bracket, word) for word in inner}
        bracket[""] = common // k
    scale = [common * factorial(n) * series.unit**n for n in range(length + 1)]
    return {word: Fraction(_convolution(X, bracket, word), scale[len(word)]) for word in wanted}


def _convolution(X: dict[str, int], Y: dict[str, int], word: str) -> int:
    """Scaled coefficient of ``word`` in the product of X, without its term 1, and Y."""
    n = len(word)
    return sum(comb(n, k) * X[word[:k]] * Y[word[k:]] for k in range(1, n + 1))
