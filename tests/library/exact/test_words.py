"""Steps on words, their logarithm and the derivatives of both, against series that are multiplied out."""

import random
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf

from nearharmonic.exact.lie import logarithm_weights
from nearharmonic.exact.words import logarithm, logarithm_slopes, word_slopes, word_sums, words
from support.oracles.word_series import plus, series, times

LENGTH = 6
#: Steps that are no palindromes, in which an operator may follow itself.
steps = st.lists(
    st.tuples(st.sampled_from("ABC"), st.integers(-1500, 1500).map(lambda n: Fraction(n, 1000))), min_size=1, max_size=6
)


def exact(step):
    found = series(step, LENGTH)
    return {word: found.get(word, Fraction(0)) for word in words(LENGTH)}


def in_mpmath(step):
    return [(name, mpf(c.numerator) / c.denominator) for name, c in step]


def difference(number, fraction):
    return abs(number - mpf(fraction.numerator) / fraction.denominator)


@settings(max_examples=30)
@given(steps)
def test_sums_of_fractions_are_the_exact_ones(step):
    assert word_sums(step, words(LENGTH)) == exact(step)
    assert word_sums(step, ["ABBAB"])["ABBAB"] == exact(step)["ABBAB"]


@settings(max_examples=30)
@given(steps)
def test_sums_in_sixty_digits_are_the_exact_ones(step):
    found = word_sums(in_mpmath(step), words(LENGTH))
    for word, value in exact(step).items():
        # Sums of at most 6^6 products, none above 1.5^6.
        assert difference(found[word], value) < mpf(10) ** -50, word


@pytest.mark.slow
@settings(max_examples=30)
@given(steps)
def test_sums_of_arrays_are_those_of_each_column(step):
    two = [step, [(name, -c / 2) for name, c in step]]
    factors = [(name, np.array([float(a), float(b)])) for (name, a), (_, b) in zip(*two, strict=True)]
    found = word_sums(factors, words(LENGTH))
    for column, one in enumerate(two):
        for word, value in exact(one).items():
            at = np.broadcast_to(found[word], 2)[column]
            assert float(value) == pytest.approx(at, rel=1e-12, abs=1e-10), word


@pytest.mark.slow
@settings(max_examples=30)
@given(steps)
def test_slopes_in_sixty_digits_are_the_exact_derivatives(step):
    sums, slopes = word_slopes(in_mpmath(step), words(LENGTH))
    h = Fraction(1, 10**40)
    values = exact(step)
    for i, (name, c) in enumerate(step):
        up, down = (exact([*step[:i], (name, c + sign * h), *step[i + 1 :]]) for sign in (1, -1))
        for word in words(LENGTH):
            # Without rounding a central difference is off by h^2 alone.
            assert difference(slopes[word][i], (up[word] - down[word]) / (2 * h)) < mpf(10) ** -48, word
            assert difference(sums[word], values[word]) < mpf(10) ** -50


@pytest.mark.slow
def test_slopes_of_arrays_are_those_of_each_column():
    random = np.random.default_rng(3)
    names, numbers = "ABCABBACBA", random.normal(size=(10, 4))
    needed = words(LENGTH)
    _, found = word_slopes(list(zip(names, numbers, strict=True)), needed)
    for column in range(4):
        _, one = word_slopes([(name, mpf(c)) for name, c in zip(names, numbers[:, column], strict=True)], needed)
        for word in needed:
            wanted = np.array(one[word], dtype=float)
            # 10^5 products of sizes up to 100: rounding of 1e-16 each.
            assert np.abs(found[word][:, column] - wanted).max() < 1e-9, word


def test_slopes_on_few_words_are_those_on_all():
    numbers = np.random.default_rng(4).normal(size=7)
    step = list(zip("ABCABBA", numbers, strict=True))
    _, few = word_slopes(step, ["AAABB", "AB"])
    _, everything = word_slopes(step, words(5))
    assert set(few) == {"AAABB", "AB"}
    for word, slope in few.items():
        assert slope == pytest.approx(everything[word], rel=1e-13, abs=1e-13)


def test_only_the_words_asked_for_and_their_beginnings_are_computed():
    assert set(word_sums([("A", 0.5), ("B", 1.0)], ["AAB", "BA"])) == {"", "A", "AA", "AAB", "B", "BA"}


# --- logarithms -------------------------------------------------------------------------------------------------------

DEGREE = 5


def exact_logarithm(step):
    """The series log(1 + X) = X - X^2/2 + ..., where X begins with words of one letter."""
    X = series(step, DEGREE) | {"": Fraction(0)}
    power, total = {"": Fraction(1)}, {}
    for n in range(1, DEGREE + 1):
        power = times(power, X, DEGREE)
        total = plus(total, {word: c * Fraction((-1) ** (n + 1), n) for word, c in power.items()})
    return {word: total.get(word, Fraction(0)) for word in words(DEGREE)[1:]}


@settings(max_examples=5)
@given(steps)
def test_a_logarithm_is_that_of_the_series(step):
    assert logarithm(step, words(DEGREE)[1:]) == exact_logarithm(step)


@settings(max_examples=5)
@given(steps)
def test_weights_of_shuffles_make_the_logarithm_of_the_series(step):
    sums = exact(step)
    for word, value in exact_logarithm(step).items():
        if word:
            assert sum(weight * sums[other] for other, weight in logarithm_weights(word).items()) == value, word


def random_step(seed):
    chance = random.Random(seed)
    return [(chance.choice("ABC"), Fraction(chance.randint(-9, 9), chance.randint(1, 7))) for _ in range(7)]


def test_a_logarithm_on_few_words_is_that_on_all():
    operators, wanted = random_step(9), [word for word in words(6, 2) if word]
    assert [word for word in words(6) if word and word.count("B") <= 2] == wanted
    found = logarithm(operators, words(6)[1:])
    assert logarithm(operators, wanted) == {word: found[word] for word in wanted}


def test_logarithms_of_arrays_are_the_exact_ones_of_each_column():
    columns = [random_step(seed) for seed in (3, 3)]
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
