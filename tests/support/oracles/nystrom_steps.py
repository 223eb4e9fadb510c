"""Methods for quadratic kinetic energy, taken apart for tests: equations, unknowns, sums over words."""

from __future__ import annotations

from mpmath import eye, matrix

from nearharmonic.reproduction.experiments.sixth_order.conditions import NystromEquations


def equations_of(tableau):
    return NystromEquations(tableau.stages, tableau.first, tableau.harmonic_order)


def unknowns_of(tableau):
    return equations_of(tableau).halved(tableau.outer, tableau.inner)


def word_sum(word, operators):
    """S(word): with the letters as matrices that have ones above the diagonal where they stand in the word, the corner.

    A product of such matrices reaches the corner only along the whole word, letter by letter.
    """
    n, product = len(word), eye(len(word) + 1)
    for letter, c in operators:
        X = matrix(n + 1, n + 1)
        for i in range(n):
            X[i, i + 1] = int(word[i] == letter)
        exponential, power = eye(n + 1), eye(n + 1)
        for k in range(1, n + 1):
            power = power * X * c / k
            exponential += power
        product = product * exponential
    return product[0, n]
