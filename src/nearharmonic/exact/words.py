"""Steps of splitting methods in any arithmetic, and coefficients of steps and of their logarithms on words.

A step of size tau is a tuple of pairs (letter, number c). A is a drift, q += c tau dT/dp, B a kick, p -= c tau dV/dq,
and C = [B, [A, B]], for quadratic T, a kick p += c tau^3 grad |grad V|^2 by the square of the force. Numbers may be
fractions, floats, arrays of floats, mpmath numbers or intervals: functions compute in the arithmetic of the numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache, reduce
from itertools import accumulate, product, zip_longest
from math import comb, factorial, lcm
from numbers import Rational
from operator import add, mul, truediv
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    """Return the step of alternate kicks and drifts: coefficients of B and A.

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


# --- Coefficients of steps and of their logarithms on words: power series in letters that do not commute.
#
# A step is a product of exponentials exp(c X) of A, B and C = [B, [A, B]]. As a series it has a coefficient S(w) for
# each word w of letters A and B. A factor adds to S(w) a sum over shorter words. The coefficients in the product of
# the first factor, of the first two, and so on are therefore a cumulative sum. Its arrays have a row for each factor.
# Numbers are rational, floats, arrays of floats (one column per step), or mpmath numbers.
#
# Rational numbers are computed as integers: for a word w of n letters and a common denominator ``unit``, n! unit^n
# S(w) is an integer, so that no fraction is ever reduced.

LETTERS = "AB"
#: [B, [A, B]] as coefficients of words.
SQUARE = {"BAB": 2, "ABB": -1, "BBA": -1}
_ELEMENTS: dict[str, dict[str, int]] = {"A": {"A": 1}, "B": {"B": 1}, "C": SQUARE}

#: Doubles, or other numbers as objects: a row for each factor.
Array = NDArray[Any]
#: Of a word: an operator, its power, the weight of the word in it, and the word in front.
_Term = tuple[str, int, int, str]
#: The splits of a word of n letters in two, the first part not empty: (n over its length, first part, second part).
_Splits = tuple[tuple[int, str, str], ...]


def words(length: int, kicks: int | None = None) -> list[str]:
    """All words of at most ``length`` letters with at most ``kicks`` letters B (None: any number), shorter ones first.

    Every part of such a word is such a word.
    """
    bound = length if kicks is None else kicks
    layers = [[""]]
    for _ in range(length):
        layers.append([w + x for w, x in product(layers[-1], LETTERS) if (w + x).count("B") <= bound])
    return [word for layer in layers for word in layer]


def word_sums(step: Sequence[Factor], needed: Iterable[str]) -> dict[str, Any]:
    """Return the coefficients of a step on the words ``needed`` and on their beginnings.

    The numbers of its F factors, from left to right, are rational, floats, arrays of one shape, or mpmath numbers.
    """
    if not is_exact(step):
        return {word: sums[-1] for word, sums in _sums(step, tuple(needed)).items()}
    integers, unit = scaled(step)
    found = _sums(integers, tuple(needed), integers=True)
    return {word: Fraction(sums[-1], factorial(len(word)) * unit ** len(word)) for word, sums in found.items()}


def word_slopes(step: Sequence[Factor], needed: Iterable[str]) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return what :func:`word_sums` does, and the derivatives (F, ...) on the words ``needed`` by each number.

    The derivative of exp(c X) is X exp(c X). On a word w it gives the sum over all w = u X v of the coefficient on u of
    the factors in front, times that on v of the others. Numbers are not rational, as derivatives would be doubles.
    """
    needed, places = tuple(needed), _places(step)
    before = _sums(step, needed)
    # A, B and C are the same read backwards: a product read backwards has the words read backwards. No first letter is
    # behind a factor.
    behind = _sums(step[::-1], tuple(word[:0:-1] for word in needed))
    front = {word: sums[:-1] for word, sums in before.items()}
    others = {word: sums[:0:-1] for word, sums in behind.items()}
    slopes = {}
    for word in needed:
        slopes[word] = np.zeros_like(front[""])
        for operator, rows in places.items():
            if cuts := _cuts(word, operator):
                parts = (_times(weight, front[u]) * others[v] for weight, u, v in cuts)
                slopes[word][rows] = reduce(add, parts)[rows]
    return {word: sums[-1] for word, sums in before.items()}, slopes


def logarithm(step: Sequence[Factor], wanted: Iterable[str]) -> dict[str, Any]:
    """Return the coefficients of the logarithm of a step on the words ``wanted``.

    log(1 + X) = X (1 - X (1/2 - X (1/3 - ...))), and since X begins with words of one letter, the k-th bracket from
    outside is needed only for words of up to length - k letters that are ends of wanted words. These have one letter or
    more, and the step is as for :func:`word_sums`.
    """
    found, scale = scaled_logarithm(step, wanted)
    divided = Fraction if is_exact(step) else truediv
    return {word: divided(number, scale[len(word)]) for word, number in found.items()}


def scaled_logarithm(step: Sequence[Factor], wanted: Iterable[str]) -> tuple[dict[str, Any], list[int]]:
    """Return the numbers of :func:`logarithm` times a scale, integers for a rational step, and scales by length."""
    targets, exact = tuple(wanted), is_exact(step)
    step, unit = scaled(step) if exact else (step, 1)
    sums = {word: rows[-1] for word, rows in _sums(step, _parts(targets), integers=exact).items()}
    common, brackets = _brackets(X := sums if exact else _times_factorials(sums), targets)
    splits = dict(_ends(targets))
    scale = [common * factorial(n) * unit**n for n in range(len(brackets) + 1)]
    return {word: _convolution(X, brackets[-1], splits[word]) for word in targets}, scale


def logarithm_slopes(step: Sequence[Factor], wanted: Iterable[str]) -> dict[str, Array]:
    """Return the derivatives (F, ...) of :func:`logarithm` by each number of a step, which is not rational."""
    targets = tuple(wanted)
    X, dX = map(_times_factorials, word_slopes(step, _parts(targets)))
    common, brackets = _brackets(X, targets)
    ends, none = _ends(targets), np.zeros_like(next(iter(dX.values())))
    slopes = {word: none for word, _ in ends}
    for n, bracket in enumerate(brackets, start=1):
        slopes[""] = none
        slopes = {
            word: _convolution(dX, bracket, splits) - _convolution(X, slopes, splits)
            for word, splits in ends
            if len(word) <= n
        }
    return {word: slopes[word] / (common * factorial(len(word))) for word in targets}


def _times_factorials(found: Mapping[str, Any]) -> dict[str, Any]:
    return {word: factorial(len(word)) * x for word, x in found.items()}


def _places(step: Sequence[Factor]) -> dict[str, list[int]]:
    """Return the places of each operator among the factors."""
    found = {name: [i for i, (other, _) in enumerate(step) if other == name] for name in _ELEMENTS}
    return {name: rows for name, rows in found.items() if rows}


def _sums(step: Sequence[Factor], needed: tuple[str, ...], *, integers: bool = False) -> dict[str, Array]:
    """Return, by needed word or beginning of one, coefficients in the products of the first 0, 1, ..., F factors.

    With ``integers`` for numbers they are those times n!, integers too.
    """
    places = _places(step)
    numbers = np.array([number for _, number in step], dtype=object if integers else None)
    plan, highest = _plan("".join(places), needed, integers)
    powers = {}  # the k-th power, over k! but for integers, 0 where another operator stands
    for operator, rows in places.items():
        one = np.zeros_like(numbers)
        one[rows] = numbers[rows]
        factors = (one if integers else one / k for k in range(2, highest + 1))
        powers[operator] = list(accumulate(factors, mul, initial=one))
    start = np.zeros_like(numbers, shape=(len(numbers) + 1, *numbers.shape[1:]))
    found = {"": start + 1}
    for word, terms in plan:
        found[word] = start.copy()
        if terms:
            added = reduce(add, (_times(a, powers[name][k - 1]) * found[front][:-1] for name, k, a, front in terms))
            added.cumsum(axis=0, out=found[word][1:])
    return found


def _times(weight: int, array: Array) -> Array:
    return array if weight == 1 else weight * array


@lru_cache(maxsize=64)
def _plan(operators: str, needed: tuple[str, ...], integers: bool) -> tuple[list[tuple[str, list[_Term]]], int]:
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

    plan = []
    for word in wanted:
        n, terms = len(word), [one for one in ends if word.endswith(one[1])]
        scales = [factorial(n) // (factorial(n - len(end)) * factorial(k)) if integers else 1 for _, end, k, _ in terms]
        pairs = zip(terms, scales, strict=True)
        plan.append((word, [(name, k, a * scale, word.removesuffix(end)) for (name, end, k, a), scale in pairs]))
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


@lru_cache(maxsize=64)
def _parts(wanted: tuple[str, ...]) -> tuple[str, ...]:
    """All parts of the words ``wanted``."""
    return tuple({word[i:j] for word in wanted for i in range(len(word)) for j in range(i + 1, len(word) + 1)})


@lru_cache(maxsize=64)
def _ends(wanted: tuple[str, ...]) -> tuple[tuple[str, _Splits], ...]:
    """Every end of the words ``wanted``, each with its splits."""
    found = {word[k:] for word in wanted for k in range(len(word))}
    return tuple(
        (word, tuple((comb(len(word), k), word[:k], word[k:]) for k in range(1, len(word) + 1))) for word in found
    )


def _brackets(X: Mapping[str, Any], targets: tuple[str, ...]) -> tuple[int, list[dict[str, Any]]]:
    """The brackets of the logarithm, the innermost first, times a common multiple of their constants, and that."""
    common = lcm(*range(1, (length := max(map(len, targets), default=0)) + 1))
    brackets: list[dict[str, Any]] = [{"": common // max(1, length)}]
    for k in range(length - 1, 0, -1):
        bracket = {w: -_convolution(X, brackets[-1], splits) for w, splits in _ends(targets) if len(w) <= length - k}
        brackets.append(bracket | {"": common // k})
    return common, brackets


def _convolution(X: Mapping[str, Any], Y: Mapping[str, Any], splits: _Splits) -> Any:
    """Scaled coefficient of the word with these splits in the product of X - 1 and Y."""
    return sum([ways * X[first] * Y[second] for ways, first, second in splits])
