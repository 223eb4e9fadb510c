"""Series in two letters and their logarithm against nilpotent matrices."""

from __future__ import annotations

import random
from fractions import Fraction
from math import factorial

import numpy as np
import pytest

from nearharmonic.exact.words import logarithm, product_of_exponentials, words

DEGREE = 5


def nilpotent(seed):
    """A strictly upper triangular matrix of small integers: products of more than DEGREE of them vanish."""
    chance = random.Random(seed)
    size = DEGREE + 1
    return np.array([[Fraction(chance.randint(-4, 4) if j > i else 0) for j in range(size)] for i in range(size)])


MATRICES = {"A": nilpotent(1), "B": nilpotent(2)}
ONE = np.array([[Fraction(i == j) for j in range(DEGREE + 1)] for i in range(DEGREE + 1)])


def of_word(word):
    result = ONE
    for letter in word:
        result = result @ MATRICES[letter]
    return result


def commutator(x, y):
    return x @ y - y @ x


def exponential(matrix):
    result, power = ONE, ONE
    for n in range(1, DEGREE + 1):
        power = power @ matrix
        result = result + power / factorial(n)
    return result


def matrix_logarithm(matrix):
    result, power = 0 * ONE, ONE
    for n in range(1, DEGREE + 1):
        power = power @ (matrix - ONE)
        result = result - power * Fraction((-1) ** n, n)
    return result


OPERATORS = MATRICES | {"C": commutator(MATRICES["B"], commutator(MATRICES["A"], MATRICES["B"]))}


def evaluated(polynomial):
    return sum((number * of_word(word) for word, number in polynomial.items()), start=0 * ONE)


def random_operators(seed):
    chance = random.Random(seed)
    return [(chance.choice("ABC"), Fraction(chance.randint(-9, 9), chance.randint(1, 7))) for _ in range(7)]


@pytest.mark.parametrize("seed", range(5))
def test_a_product_of_exponentials_and_its_logarithm_are_those_of_matrices(seed):
    operators = random_operators(seed)
    expected = ONE
    for letter, c in operators:
        expected = expected @ exponential(c * OPERATORS[letter])
    series = product_of_exponentials(operators, DEGREE)
    assert (evaluated({word: series[word] for word in words(DEGREE)}) == expected).all()
    found = logarithm(series, words(DEGREE)[1:])
    assert (evaluated(found) == matrix_logarithm(expected)).all()


def test_a_series_with_few_kicks_is_the_full_one_where_it_is_known():
    operators = random_operators(9)
    full, few = product_of_exponentials(operators, 6), product_of_exponentials(operators, 6, 2)
    assert set(few.scaled) == {word for word in full.scaled if word.count("B") <= 2}
    assert all(few[word] == full[word] for word in few.scaled)
    wanted = [word for word in few.scaled if word]
    assert logarithm(few, wanted) == logarithm(full, wanted)
