"""Steps on words, and their logarithm and its derivatives, against nilpotent matrices and differences."""

from __future__ import annotations

import random
from fractions import Fraction
from math import factorial

import numpy as np
import pytest

from nearharmonic.exact.words import logarithm, logarithm_slopes, word_sums, words

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
def test_product_of_exponentials_and_its_logarithm_are_those_of_matrices(seed):
    operators = random_operators(seed)
    expected = ONE
    for letter, c in operators:
        expected = expected @ exponential(c * OPERATORS[letter])
    assert (evaluated(word_sums(operators, words(DEGREE))) == expected).all()
    found = logarithm(operators, words(DEGREE)[1:])
    assert (evaluated(found) == matrix_logarithm(expected)).all()


def test_a_logarithm_on_few_words_is_that_on_all():
    operators, wanted = random_operators(9), [word for word in words(6, 2) if word]
    assert [word for word in words(6) if word and word.count("B") <= 2] == wanted
    found = logarithm(operators, words(6)[1:])
    assert logarithm(operators, wanted) == {word: found[word] for word in wanted}


def test_logarithms_of_arrays_are_the_exact_ones_of_each_column():
    columns = [random_operators(seed) for seed in (3, 3)]
    columns[1] = [(letter, -c / 3) for letter, c in columns[1]]
    step = [(x, np.array([float(a), float(b)])) for (x, a), (_, b) in zip(*columns, strict=True)]
    found = logarithm(step, words(4)[1:])
    for column, operators in enumerate(columns):
        for word, value in logarithm(operators, words(4)[1:]).items():
            # Sums of some thousand products of numbers up to 9.
            assert found[word][column] == pytest.approx(float(value), rel=1e-10, abs=1e-9), word


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_slopes_of_the_logarithm_are_those_of_differences(degree):
    # Central differences of step 1e-10 in rational numbers are off by 1e-20; double precision leaves 1e-14.
    letters, values = "ABABA", [0.3, -0.7, 1.1, 0.9, -0.2]
    wanted = [word for word in words(degree) if len(word) == degree]
    found = logarithm_slopes(list(zip(letters, values, strict=True)), wanted)
    step = Fraction(1, 10**10)
    for i in range(len(letters)):
        ends = []
        for sign in (1, -1):
            moved = [Fraction(v) + sign * step * (i == j) for j, v in enumerate(values)]
            ends.append(logarithm(list(zip(letters, moved, strict=True)), wanted))
        for word in wanted:
            assert found[word][i] == pytest.approx(float((ends[0][word] - ends[1][word]) / (2 * step)), abs=1e-12)
