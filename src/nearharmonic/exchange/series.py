"""Truncated power series in A (drift) and B (kick) in double precision, many at once.

Exact series are in :mod:`nearharmonic.exact.words`. These are for what needs few digits: derivatives of order
conditions by the coefficients, and a search through thousands of changed rows. A series is a list over the length k of
words of arrays (member, 2^k). A word is the binary number of its letters, A = 0 and B = 1, the first letter being the
highest bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import numpy as np

Series = list[np.ndarray]


def logarithm(values: np.ndarray, letters: Sequence[str], degree: int) -> Series:
    """Return log(exp(c_1 X_1) exp(c_2 X_2) ...), of the words up to ``degree`` letters.

    Parameters
    ----------
    values : array (member, m)
        Coefficients c_i.
    letters : sequence of str
        Operators X_i, m letters A and B.
    degree : int
        Letters of the longest words.

    Returns
    -------
    list of arrays (member, 2^k)
        Coefficients of the words of k = 0, ..., ``degree`` letters.
    """
    total = _identity(len(values), degree)
    for i, letter in enumerate(letters):
        total = _product(total, _exponential(values[:, i], letter, degree))
    total[0] = np.zeros_like(total[0])
    power, result = total, [part.copy() for part in total]
    for k in range(2, degree + 1):
        power = _product(power, total)
        result = [a + (-1) ** (k - 1) / k * b for a, b in zip(result, power, strict=True)]
    return result


def derivatives_of_logarithm(values: np.ndarray, letters: Sequence[str], degree: int) -> np.ndarray:
    """Return the derivatives of the logarithm of one product of exponentials by its coefficients.

    Parameters
    ----------
    values : array (1, m)
        Coefficients.
    letters : sequence of str
        Operators, m letters A and B.
    degree : int
        Letters of the words.

    Returns
    -------
    array (m, 2^degree)
        Derivatives of the coefficients of the words of ``degree`` letters.
    """
    factors = [_exponential(values[:, i], letter, degree) for i, letter in enumerate(letters)]
    before, after = [_identity(1, degree)], [_identity(1, degree)]
    for factor in factors:
        before.append(_product(before[-1], factor))
    for factor in reversed(factors):
        after.append(_product(factor, after[-1]))
    after.reverse()
    changes = [_product(_followed_by(b, x), a) for b, x, a in zip(before[1:], letters, after[1:], strict=True)]
    change = [np.concatenate(parts) for parts in zip(*changes, strict=True)]
    X = before[-1]
    X[0] = np.zeros_like(X[0])
    power, d_power, result = X, change, change[degree]
    for k in range(2, degree + 1):
        d_power = [a + b for a, b in zip(_product(d_power, X), _product(power, change), strict=True)]
        power = _product(power, X)
        result = result + (-1) ** (k - 1) / k * d_power[degree]
    return result


def _identity(members: int, degree: int) -> Series:
    return [np.ones((members, 1)), *(np.zeros((members, 1 << k)) for k in range(1, degree + 1))]


def _exponential(c: np.ndarray, letter: str, degree: int) -> Series:
    series = _identity(len(c), degree)
    for k in range(1, degree + 1):
        series[k][:, 0 if letter == "A" else -1] = c**k / factorial(k)
    return series


def _followed_by(x: Series, letter: str) -> Series:
    """The product of ``x`` and one letter."""
    result = [np.zeros_like(part) for part in x]
    for k in range(1, len(x)):
        result[k][:, letter == "B" :: 2] = x[k - 1]
    return result


def _product(x: Series, y: Series) -> Series:
    members = max(len(x[0]), len(y[0]))
    result = []
    for n in range(len(x)):
        total = np.zeros((members, 1 << n))
        for k in range(n + 1):
            total += (x[k][:, :, None] * y[n - k][:, None, :]).reshape(-1, 1 << n)
        result.append(total)
    return result
