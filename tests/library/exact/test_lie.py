"""The basis of the free Lie algebra and its quotient, against other counts and real mechanical systems."""

import random
from fractions import Fraction
from itertools import product

import pytest

from nearharmonic.exact import lie


def free_dimensions(generators, highest):
    """Dimensions by degree of the free Lie algebra with ``generators[n]`` generators of degree n, from its series.

    prod_n (1 - t^n)^(-f_n) = 1 / (1 - g(t)), solved for f_n from below.
    """
    target = [1]
    for n in range(1, highest + 1):
        target.append(sum(generators.get(k, 0) * target[n - k] for k in range(1, n + 1)))
    dimensions, product_so_far = [], [1] + [0] * highest
    for n in range(1, highest + 1):
        dimensions.append(target[n] - product_so_far[n])
        for _ in range(dimensions[-1]):
            for k in range(n, highest + 1):
                product_so_far[k] += product_so_far[k - n]
    return dimensions


def mechanical_dimensions(highest):
    """McLachlan & Murua (2019): an abelian algebra X of potentials, and one free over A and [A, X].

    X is the free commutative nonassociative algebra over V whose product of degrees m and n has degree m + n + 1.
    """
    X = {1: 1}
    for n in range(2, highest + 1):
        ordered = sum(X.get(k, 0) * X.get(n - 1 - k, 0) for k in range(1, n - 1))
        squares = X.get((n - 1) // 2, 0) if n % 2 else 0
        X[n] = (ordered + squares) // 2
    free = free_dimensions({1: 1} | {n + 1: count for n, count in X.items()}, highest)
    return [X[n] + free[n - 1] for n in range(1, highest + 1)]


def test_conditions_are_as_many_as_lie_algebras_have_dimensions():
    general = [len(lie.conditions(n, quadratic=False)) for n in range(1, 9)]
    assert general == free_dimensions({1: 2}, 8) == [2, 1, 2, 3, 6, 9, 18, 30]
    nystrom = [len(lie.conditions(n, quadratic=True)) for n in range(1, 9)]
    assert nystrom == mechanical_dimensions(8) == [2, 1, 2, 2, 4, 5, 10, 14]


@pytest.mark.parametrize("degree", range(1, 7))
def test_coordinates_in_the_lyndon_basis_put_an_element_together_again(degree):
    chance = random.Random(degree)
    element = {}
    for _ in range(4):
        nested = {chance.choice("AB"): 1}
        for _ in range(degree - 1):
            nested = lie.bracket({chance.choice("AB"): chance.randint(-3, 3) or 1}, nested)
        for word, number in nested.items():
            element[word] = element.get(word, 0) + number
    known = [Fraction(element.get(word, 0)) for word in lie.lyndon_words(degree)]
    rebuilt = {}
    for row, word in zip(lie._to_basis(degree), lie.lyndon_words(degree), strict=True):
        coordinate = sum(a * known[i] for i, a in row.items())
        for other, number in lie.bracketing(word).items():
            rebuilt[other] = rebuilt.get(other, 0) + coordinate * number
    assert {word: c for word, c in rebuilt.items() if c} == {word: c for word, c in element.items() if c}


def derivative(f, variable):
    result = {}
    for powers, c in f.items():
        if powers[variable]:
            lowered = tuple(n - (i == variable) for i, n in enumerate(powers))
            result[lowered] = c * powers[variable]
    return result


def poisson_bracket(f, g):
    """{f, g} of polynomials in (q1, q2, p1, p2), as exponents -> coefficient."""
    result = {}
    for i in (0, 1):
        for sign, a, b in ((1, i, i + 2), (-1, i + 2, i)):
            for (u, x), (v, y) in product(derivative(f, a).items(), derivative(g, b).items()):
                powers = tuple(m + n for m, n in zip(u, v, strict=True))
                result[powers] = result.get(powers, 0) + sign * x * y
    return {powers: c for powers, c in result.items() if c}


def rank(functions):
    """Rank of polynomials modulo a prime, which the rank itself is not below."""
    prime, echelon = 2**61 - 1, []
    for f in functions:
        row = {powers: c % prime for powers, c in f.items()}
        for pivot, other in echelon:
            factor = row.get(pivot, 0)
            for powers, c in other.items() if factor else ():
                row[powers] = (row.get(powers, 0) - factor * c) % prime
        pivot = next((powers for powers, c in row.items() if c), None)
        if pivot is not None:
            inverse = pow(row[pivot], -1, prime)
            echelon.append((pivot, {powers: c * inverse % prime for powers, c in row.items()}))
    return len(echelon)


def mechanical_basis(degree, highest, seed):
    """The Lyndon basis as Poisson brackets of 2 T = p.p in two dimensions and a random V of degree ``highest``."""
    chance = random.Random(seed)
    T = {(0, 0, 2, 0): 1, (0, 0, 0, 2): 1}
    V = {(*e, 0, 0): chance.randint(1, 5) for e in product(range(highest + 1), repeat=2) if 1 < sum(e) <= highest}
    functions = {"A": T, "B": V}
    for length in range(2, degree + 1):
        for word in lie.lyndon_words(length):
            split = next(k for k in range(1, length) if word[k:] in functions)
            functions[word] = poisson_bracket(functions[word[:split]], functions[word[split:]])
    return [functions[word] for word in lie.lyndon_words(degree)]


@pytest.mark.parametrize("degree", [*range(1, 8), pytest.param(8, marks=pytest.mark.slow)])
def test_in_a_mechanical_system_just_the_ideal_vanishes(degree):
    # V survives as many derivatives as there are brackets: the rank is the dimension.
    basis = mechanical_basis(degree, max(2, degree), 5)
    assert rank(basis) == mechanical_dimensions(degree)[-1]
    to_basis = lie._to_basis(degree)
    for polynomial in lie._ideal(degree):
        known = [polynomial.get(word, 0) for word in lie.lyndon_words(degree)]
        total = {}
        for row, f in zip(to_basis, basis, strict=True):
            coordinate = sum(a * known[i] for i, a in row.items())
            for powers, c in f.items() if coordinate else ():
                total[powers] = total.get(powers, 0) + coordinate * c
        assert not any(total.values())


@pytest.mark.slow
@pytest.mark.parametrize("potential_degree", [2, 3, 4])
@pytest.mark.parametrize("degree", range(1, 10))
def test_polynomial_potentials_have_the_conditions_of_their_brackets(degree, potential_degree):
    # Brackets of several random V together: a single V in two dimensions has more that vanish.
    several = [mechanical_basis(degree, potential_degree, seed) for seed in range(6)]
    joined = [{(k, *e): c for k, f in enumerate(one) for e, c in f.items()} for one in zip(*several, strict=True)]
    found = lie.conditions(degree, quadratic=True, potential_degree=potential_degree)
    assert len(found) == rank(joined)


def test_brackets_of_the_oscillator_alternate():
    assert [len(lie.conditions(n, quadratic=True, potential_degree=2)) for n in range(1, 11)] == [2, 1] * 5


@pytest.mark.parametrize("degree", range(1, 9))
def test_a_high_degree_has_the_conditions_of_every_potential(degree):
    found = lie.conditions(degree, quadratic=True, potential_degree=degree)
    assert len(found) == len(lie.conditions(degree, quadratic=True)) == mechanical_dimensions(degree)[-1]
