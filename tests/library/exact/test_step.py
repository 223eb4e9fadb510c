"""Steps from their rows, and what they do to the harmonic oscillator, against products of matrices."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import cos, diff, mp, mpf, sin

from nearharmonic.exact.words import MOMENTUM, POSITION, composed, oscillator, oscillator_errors, slopes, states

numbers = st.integers(-1500, 1500).map(lambda n: Fraction(n, 1000))
steps = st.lists(st.tuples(st.sampled_from("ABC"), numbers), min_size=1, max_size=6)


def matrix(step, tau):
    """The product of the matrices of the flows: V = q^2/2 has |V'|^2 = q^2, whose gradient is 2 q."""
    total = np.array([[1, 0], [0, 1]], dtype=object)
    for letter, c in step:
        entry = {"A": (0, 1, c * tau), "B": (1, 0, -c * tau), "C": (1, 0, 2 * c * tau**3)}[letter]
        flow = np.array([[1, 0], [0, 1]], dtype=object)
        flow[entry[:2]] = entry[2]
        total = flow @ total
    return total


def value(row, tau):
    return sum(c * tau**n for n, c in enumerate(row))


@settings(max_examples=50)
@given(steps, numbers)
def test_the_step_matrix_is_a_product_of_matrices(step, tau):
    K = oscillator(step)
    expected = matrix(step, tau).tolist()
    assert [[value(K.K11, tau), value(K.K12, tau)], [value(K.K21, tau), value(K.K22, tau)]] == expected
    assert value(K.trace, tau) == matrix(step, tau).trace()


@given(steps)
def test_entries_in_doubles_are_the_exact_ones(step):
    found = oscillator([(letter, float(c)) for letter, c in step])
    for row, exact in zip(found, oscillator(step), strict=True):
        # Sums of at most 2^6 products below 3^6.
        assert row == pytest.approx([float(c) for c in exact], abs=1e-11)


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from("AB"), numbers), min_size=1, max_size=6))
def test_slopes_of_states_are_exact_differences(step):
    highest, h = 4, Fraction(1, 10**30)
    for of in (POSITION, MOMENTUM):
        found = slopes(step, highest, of)
        for i, (letter, c) in enumerate(step):
            ends = []
            for sign in (1, -1):
                q, p = states([*step[:i], (letter, c + sign * h), *step[i + 1 :]], highest)[-1]
                ends.append([of[0] * a + of[1] * b for a, b in zip(q, p, strict=True)])
            # What is linear in every number has central differences without an error.
            assert found[i] == [(a - b) / (2 * h) for a, b in zip(*ends, strict=True)]


def test_errors_are_measured_from_the_series_of_sine_and_cosine():
    step = composed("kick", [Fraction(1, 2)] * 2, [Fraction(1)])
    E, K = oscillator_errors(step), oscillator(step)
    for row, exact, entry in zip(E, (cos, sin, lambda x: -sin(x), cos), K, strict=True):
        assert len(row) == len(entry) + 2
        for n, error in enumerate(row):
            own = entry[n] if n < len(entry) else Fraction(0)
            term = diff(exact, 0, n) / mp.factorial(n)
            assert abs(mpf((own - error).numerator) / (own - error).denominator - term) < mpf(10) ** -12


@pytest.mark.parametrize(
    ("first", "kicks", "drifts", "squares", "expected"),
    [
        ("kick", "ab", "x", (), "Ba Ax Bb"), ("drift", "a", "xy", (), "Ax Ba Ay"),
        ("kick", "ab", "xy", (), "Ba Ax Bb Ay"), ("drift", "ab", "xy", (), "Ax Ba Ay Bb"),
        ("kick", "ab", "x", ("m", None), "Ba Cm Ax Bb"), ("drift", "ab", "xyz", (None, "n"), "Ax Ba Ay Bb Cn Az"),
    ],
)  # fmt: skip
def test_kicks_and_drifts_take_turns_and_squares_follow_kicks(first, kicks, drifts, squares, expected):
    assert composed(first, kicks, drifts, squares) == tuple((text[0], text[1]) for text in expected.split())
