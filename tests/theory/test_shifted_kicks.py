"""Two kicks around a short drift, as one kick of a modified potential."""

from __future__ import annotations

from fractions import Fraction

import pytest

import nearharmonic as nh
from nearharmonic.exact.lie import lyndon_words
from nearharmonic.exact.words import SQUARE, logarithm
from nearharmonic.theory.shifted_kicks import ShiftedKick, shifted_kicks


def test_coefficient_of_square_is_that_of_exact_logarithm():
    a, d, b = Fraction(-2, 5), Fraction(-1, 90), Fraction(7, 10)
    found = logarithm([("B", a), ("A", d), ("B", b)], lyndon_words(3))
    # On the word ABB, C = [B, [A, B]] has -1, and no other bracket of one A and two B is independent of it.
    square = found["ABB"] / SQUARE["ABB"]
    kick = ShiftedKick(0, float(a), float(d), float(b))
    assert kick.square == pytest.approx(float(square), rel=1e-14)
    assert kick.net == pytest.approx(0.3)


def test_pairs_are_found_where_signs_differ_and_drift_is_short():
    found = shifted_kicks(nh.integrators["babps8o7h"])
    assert [one.place for one in found] == [2, 5]
    assert all(one.before * one.behind < 0 for one in found)
    assert shifted_kicks(nh.integrators["ruth"]) == []
    # ABA104 drifts first: the drift behind kick i is drift i + 1.
    assert [round(one.drift, 5) for one in shifted_kicks(nh.integrators["aba104"])] == [-0.01453, -0.01453]
