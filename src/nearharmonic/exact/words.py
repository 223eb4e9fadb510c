"""Exact truncated power series in two letters that do not commute: A for a drift, B for a kick.

An operator of a step may also be C = [B, [A, B]], which is not a letter. For quadratic T it is a kick of a modified
potential.

A series assigns a number to every word. In a product of exponentials exp(c A) and exp(c B), a word w of n letters has a
coefficient S(w) that is a sum of products of n values c. If ``unit`` is a common denominator of all c, n! unit^n S(w)
is an integer. A :class:`Series` holds these integers, so that no fraction is ever reduced.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import product
from math import comb, factorial, lcm

LETTERS = "AB"
#: [B, [A, B]] as coefficients of words.
SQUARE = {"BAB": 2, "ABB": -1, "BBA": -1}

#: An operator of a step: A, B or C, and its factor.
Operator = tuple[str, Fraction]


@dataclass(frozen=True)
class Series:
    """Coefficients of words of up to ``length`` letters, times n! unit^n for words of n letters.

    ``scaled`` holds every word up to that length with at most the given number of letters B.
    """

    scaled: dict[str, int]
    unit: int
    length: int

    def __getitem__(self, word: str) -> Fraction:
        """The coefficient of ``word``."""
        return Fraction(self.scaled[word], factorial(len(word)) * self.unit ** len(word))


def words(length: int, kicks: int | None = None) -> list[str]:
    """All words of at most ``length`` letters with at most ``kicks`` letters B (None: any number), shorter ones first.

    Every part of such a word is such a word, so that series truncated to them can be multiplied.
    """
    bound = length if kicks is None else kicks
    layers = [[""]]
    for _ in range(length):
        layers.append([w + x for w, x in product(layers[-1], LETTERS) if (w + x).count("B") <= bound])
    return [word for layer in layers for word in layer]


def product_of_exponentials(operators: Sequence[Operator], length: int, kicks: int | None = None) -> Series:
    """exp(c1 X1) exp(c2 X2) ... for ``operators`` (X, c) from left to right, on :func:`words` of ``length, kicks``.

    X is one of the two letters, or "C" for :data:`SQUARE`.
    """
    unit = lcm(*(c.denominator for _, c in operators))
    scaled = dict.fromkeys(words(length, kicks), 0)
    scaled[""] = 1
    for letter, c in operators:
        if letter == "C":
            _multiply_by_square(scaled, int(c * unit**3), length, kicks)
            continue
        factor = int(c * unit)
        powers = [factor**k for k in range(length + 1)]
        # In place: the coefficient of a word depends on shorter words, which are updated later.
        for n, k, pairs in _endings(length, kicks, letter):
            weight = comb(n, k) * powers[k]
            for word, beginning in pairs:
                scaled[word] += weight * scaled[beginning]
    return Series(scaled, unit, length)


def logarithm(series: Series, wanted: Iterable[str]) -> dict[str, Fraction]:
    """Coefficients of log(series) for the words ``wanted``, exact; the constant term of the series must be 1.

    log(1 + X) = X (1 - X (1/2 - X (1/3 - ...))), and since X begins with words of one letter, the k-th bracket from
    outside is needed only for words of up to length - k letters that are ends of wanted words.
    """
    X, targets = series.scaled, tuple(wanted)
    length = max(map(len, targets), default=0)
    common = lcm(*range(1, length + 1))
    ends = _ends(targets)
    bracket = {"": common // max(1, length)}
    for k in range(length - 1, 0, -1):
        bracket = {word: -_convolution(X, bracket, splits) for word, splits in ends if len(word) <= length - k}
        bracket[""] = common // k
    scale = [common * factorial(n) * series.unit**n for n in range(length + 1)]
    last = dict(ends)
    return {word: Fraction(_convolution(X, bracket, last[word]), scale[len(word)]) for word in targets}


def _multiply_by_square(scaled: dict[str, int], factor: int, length: int, kicks: int | None) -> None:
    """Multiply a series, in place, by the exponential of C times ``factor`` / unit^3; C has three letters."""
    powers = {"": 1}  # C^k / k!, with the factors of its words
    ends: list[tuple[str, Fraction]] = []
    for k in range(1, length // 3 + 1):
        powers = {word + end: a * b for word, a in powers.items() for end, b in SQUARE.items()}
        ends += [(word, Fraction(a * factor**k, factorial(k))) for word, a in powers.items()]
    for word in reversed(words(length, kicks)):
        n = len(word)
        for end, a in ends:
            if word.endswith(end):
                scaled[word] += int(a * factorial(n) / factorial(n - len(end))) * scaled[word[: n - len(end)]]


@cache
def _endings(length: int, kicks: int | None, letter: str) -> tuple[tuple[int, int, tuple[tuple[str, str], ...]], ...]:
    """(n, k, words of n letters that end with k times ``letter``, each with its beginning), n descending."""
    found: dict[tuple[int, int], list[tuple[str, str]]] = {}
    for word in words(length, kicks):
        for k in range(1, len(word) - len(word.rstrip(letter)) + 1):
            found.setdefault((len(word), k), []).append((word, word[:-k]))
    return tuple((n, k, tuple(pairs)) for (n, k), pairs in sorted(found.items(), reverse=True))


#: The splits of a word of n letters in two, the first part not empty: (n over its length, first part, second part).
_Splits = tuple[tuple[int, str, str], ...]


@lru_cache(maxsize=64)
def _ends(wanted: tuple[str, ...]) -> tuple[tuple[str, _Splits], ...]:
    """Every end of the words ``wanted``, each with its splits."""
    found = {word[k:] for word in wanted for k in range(len(word))}
    return tuple(
        (word, tuple((comb(len(word), k), word[:k], word[k:]) for k in range(1, len(word) + 1))) for word in found
    )


def _convolution(X: dict[str, int], Y: dict[str, int], splits: _Splits) -> int:
    """Scaled coefficient of the word with these splits in the product of X - 1 and Y."""
    return sum(ways * X[first] * Y[second] for ways, first, second in splits)
