"""Order conditions against nilpotent matrices, real mechanical systems, closed forms and other people's methods."""

from __future__ import annotations

import random
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import product
from math import factorial, sqrt

import numpy as np
import pytest
from mpmath import mp, mpf, nstr

from nearharmonic import lie_basis
from nearharmonic.algebra import logarithm, product_of_exponentials, words
from nearharmonic.errors import SettingError, UnknownNameError
from nearharmonic.integrators import integrators
from nearharmonic.order import (
    ErrorTerm,
    error_norm,
    generalised_order_of,
    harmonic_orders_of,
    leading_errors,
    nystrom_order_of,
    operators_of,
    order_of,
    tolerance,
)
from nearharmonic.tableau import Tableau, palindrome

DEGREE = 5


def method(name, first, outer, inner, digits, order=2):
    kick, drift = (outer, inner) if first == "kick" else (inner, outer)
    return Tableau(
        name=name, label=name, order=order, first=first, kick=kick, drift=drift, digits=digits, source="these tests"
    )


LEAPFROGS = {first: method("leapfrog", first, ("0.5", "0.5"), ("1",), 50) for first in ("kick", "drift")}


def composed(base, order, digits=60):
    """Yoshida's triple jump: the composition of three steps of ``base`` that has the order ``order`` + 2."""
    with mp.workdps(digits + 20):
        root = mpf(2) ** (mpf(1) / (order + 1))
        weights = [1 / (2 - root), -root / (2 - root), 1 / (2 - root)]
        outer, inner = ([mpf(c) for c in row] for row in (base.outer, base.inner))
        steps = [[w * c for c in outer] for w in weights]
        joined = steps[0]
        for step in steps[1:]:
            joined = [*joined[:-1], joined[-1] + step[0], *step[1:]]
        inners = [w * c for w in weights for c in inner]
        rows = [
            tuple(nstr((a + b) / 2, digits + 10) for a, b in zip(r, r[::-1], strict=True)) for r in (joined, inners)
        ]
    return method(f"triple jump of {base.name}", base.first, *rows, digits)


#: Blanes & Moan (2002), J. Comput. Appl. Math. 142, 313, method SRKN 11 b: order 6 for quadratic kinetic energy.
SRKN11 = method(
    "srkn11b",
    "kick",
    palindrome(
        "0.0414649985182624",
        "0.198128671918067",
        "-0.0400061921041533",
        "0.0752539843015807",
        "-0.0115113874206879",
        "0.2366699247869311",
    ),
    palindrome(
        "0.123229775946271",
        "0.290553797799558",
        "-0.127049212625417",
        "-0.246331761062075",
        "0.357208872795928",
        centre="0.20477705429147",
    ),
    digits=15,
)


# --- series and logarithm: words are products of nilpotent matrices --------------------------------------------------


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


def evaluated(polynomial):
    return sum((number * of_word(word) for word, number in polynomial.items()), start=0 * ONE)


def random_operators(seed):
    chance = random.Random(seed)
    return [(chance.choice("AB"), Fraction(chance.randint(-9, 9), chance.randint(1, 7))) for _ in range(7)]


@pytest.mark.parametrize("seed", range(5))
def test_a_product_of_exponentials_and_its_logarithm_are_those_of_matrices(seed):
    operators = random_operators(seed)
    expected = ONE
    for letter, c in operators:
        expected = expected @ exponential(c * MATRICES[letter])
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


# --- the basis and the quotient --------------------------------------------------------------------------------------


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


def test_the_conditions_are_as_many_as_the_lie_algebras_have_dimensions():
    general = [len(lie_basis.conditions(n, quadratic=False)) for n in range(1, 9)]
    assert general == free_dimensions({1: 2}, 8) == [2, 1, 2, 3, 6, 9, 18, 30]
    nystrom = [len(lie_basis.conditions(n, quadratic=True)) for n in range(1, 9)]
    assert nystrom == mechanical_dimensions(8) == [2, 1, 2, 2, 4, 5, 10, 14]


@pytest.mark.parametrize("degree", range(1, 7))
def test_coordinates_in_the_lyndon_basis_put_an_element_together_again(degree):
    chance = random.Random(degree)
    element = {}
    for _ in range(4):
        nested = {chance.choice("AB"): 1}
        for _ in range(degree - 1):
            nested = lie_basis.bracket({chance.choice("AB"): chance.randint(-3, 3) or 1}, nested)
        for word, number in nested.items():
            element[word] = element.get(word, 0) + number
    known = [Fraction(element.get(word, 0)) for word in lie_basis.lyndon_words(degree)]
    rebuilt = {}
    for row, word in zip(lie_basis._to_basis(degree), lie_basis.lyndon_words(degree), strict=True):
        coordinate = sum(a * b for a, b in zip(row, known, strict=True))
        for other, number in lie_basis.bracketing(word).items():
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


@pytest.mark.parametrize("degree", range(1, 9))
def test_in_a_mechanical_system_just_the_ideal_vanishes(degree):
    # The Lyndon basis as Poisson brackets of 2 T = p.p in two dimensions and a random V, of a degree that survives as
    # many derivatives as there are brackets: their rank is the dimension.
    chance = random.Random(5)
    T = {(0, 0, 2, 0): 1, (0, 0, 0, 2): 1}
    highest = max(2, degree)
    V = {(*e, 0, 0): chance.randint(1, 5) for e in product(range(highest + 1), repeat=2) if 1 < sum(e) <= highest}
    functions = {"A": T, "B": V}
    for length in range(2, degree + 1):
        for word in lie_basis.lyndon_words(length):
            split = next(k for k in range(1, length) if word[k:] in functions)
            functions[word] = poisson_bracket(functions[word[:split]], functions[word[split:]])
    basis = [functions[word] for word in lie_basis.lyndon_words(degree)]
    assert rank(basis) == mechanical_dimensions(degree)[-1]
    to_basis = lie_basis._to_basis(degree)
    for polynomial in lie_basis._ideal(degree):
        known = [polynomial.get(word, 0) for word in lie_basis.lyndon_words(degree)]
        total = {}
        for row, f in zip(to_basis, basis, strict=True):
            coordinate = sum(a * b for a, b in zip(row, known, strict=True))
            for powers, c in f.items() if coordinate else ():
                total[powers] = total.get(powers, 0) + coordinate * c
        assert not any(total.values())


# --- orders that are known -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first", ["kick", "drift"])
def test_leapfrog_has_order_two_and_its_textbook_error(first):
    # log = A + B - [A, [A, B]]/24 - [B, [A, B]]/12 or with the roles exchanged: sqrt(1/24^2 + 1/12^2) = sqrt(5)/24.
    leapfrog = LEAPFROGS[first]
    assert order_of(leapfrog) == nystrom_order_of(leapfrog) == 2
    assert leading_errors(leapfrog).general == ErrorTerm(3, pytest.approx(sqrt(5) / 24, rel=1e-14))
    assert generalised_order_of(leapfrog) == (2,)
    assert harmonic_orders_of(leapfrog) == (2, 2, 2, 2)


def test_each_triple_jump_adds_two_orders_up_to_eight():
    tableau = LEAPFROGS["drift"]
    for order in (2, 4, 6):
        tableau = composed(tableau, order)
        assert order_of(tableau) == nystrom_order_of(tableau) == order + 2
        assert harmonic_orders_of(tableau).energy == order + 2
    assert order_of(tableau, highest=6) == 6
    assert error_norm(tableau, 9) > 1e-3
    with pytest.raises(SettingError, match="highest = 7 is not allowed: the order of triple jump"):
        leading_errors(tableau, highest=7)


def test_a_nystrom_method_has_its_order_for_quadratic_kinetic_energy_and_in_its_own_role_alone():
    assert (order_of(SRKN11), nystrom_order_of(SRKN11)) == (4, 6)
    assert nystrom_order_of(SRKN11, first="drift") == 4


@pytest.mark.parametrize("name", list(integrators))
def test_the_first_generalised_order_is_that_of_a_quadrature(name):
    # To first order in epsilon the kicks are the weights, the drifts before them the nodes, of a quadrature on [0, 1].
    tableau = integrators[name]
    letters, nodes, weights = operators_of(tableau), [], []
    position = Fraction(0)
    for letter, c in letters:
        if letter == "A":
            position += c
        else:
            nodes.append(position)
            weights.append(c)
    exact = 0
    while abs(sum(w * x**exact for w, x in zip(weights, nodes, strict=True)) - Fraction(1, exact + 1)) < 1e-25:
        exact += 1
    assert generalised_order_of(tableau)[0] == exact


def test_what_blanes_and_others_call_the_small_part_is_the_kick():
    assert generalised_order_of("aba864") == (8, 6, 4)
    assert generalised_order_of("aba864", first="kick") == (4,)


# --- norms -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ruth", "yoshida_s7o6a", "abas5o6h", "babps9o7h"])
@pytest.mark.parametrize("degree", [5, 7])
def test_the_nystrom_norm_is_the_distance_to_what_vanishes(name, degree):
    # Double precision suffices: least squares of well-scaled columns.
    found = logarithm(product_of_exponentials(operators_of(integrators[name]), degree), lie_basis.lyndon_words(degree))
    matrix = np.array([[float(x) for x in row] for row in lie_basis._to_basis(degree)])
    error = matrix @ [float(found[word]) for word in lie_basis.lyndon_words(degree)]
    ideal = matrix @ np.array(
        [[x.get(word, 0) for x in lie_basis._ideal(degree)] for word in lie_basis.lyndon_words(degree)], dtype=float
    )
    solution = np.linalg.lstsq(ideal, error, rcond=None)[0]
    # What double precision leaves where the error vanishes, as below the order.
    assert error_norm(name, degree) == pytest.approx(np.linalg.norm(error), rel=1e-9, abs=1e-12)
    expected = np.linalg.norm(error - ideal @ solution)
    assert error_norm(name, degree, quadratic=True) == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("name", ["ruth", "abas5o6h", "babs7o7h"])
def test_the_harmonic_error_is_the_limit_of_the_step_minus_the_rotation(name):
    degree, norm = leading_errors(name).harmonic
    tableau = integrators[name]
    with mp.workdps(60):
        tau = mpf(10) ** -5
        step = mp.eye(2)
        for letter, c in operators_of(tableau):
            x = mpf(c.numerator) / c.denominator * tau
            step = mp.matrix([[1, x], [0, 1]] if letter == "A" else [[1, 0], [-x, 1]]) * step
        rotation = mp.matrix([[mp.cos(tau), mp.sin(tau)], [-mp.sin(tau), mp.cos(tau)]])
        # The next term is smaller by the order of tau.
        assert mp.mnorm(step - rotation, "f") / tau**degree == pytest.approx(norm, rel=1e-3)


# --- digits ----------------------------------------------------------------------------------------------------------


def rounded(tableau, digits):
    """The tableau with all but its innermost coefficients rounded, these closing the sums, as a table prints it."""
    rows = []
    with localcontext(prec=200):
        for row in (tableau.kick, tableau.drift):
            middle = (len(row) - 1) // 2
            half = [Decimal(c).quantize(Decimal(1).scaleb(-digits)) for c in row[:middle]]
            inner = (1 - 2 * sum(half)) / (2 - len(row) % 2)
            rows.append(tuple(map(str, [*half, *[inner] * (2 - len(row) % 2), *reversed(half)])))
    kick, drift = rows
    return method(tableau.name, tableau.first, *((kick, drift) if tableau.first == "kick" else (drift, kick)), digits)


@pytest.mark.parametrize("digits", [16, 30, 70])
@pytest.mark.parametrize(("name", "order"), [("yoshida_s7o6a", 6), ("babps9o7h", 4), ("ruth", 4)])
def test_an_order_is_recognised_from_as_few_digits_as_are_guaranteed_and_no_fewer(name, order, digits):
    tableau = rounded(integrators[name], digits)
    assert order_of(tableau) == order
    # Digits claimed beyond those that are right: found out once the bound no longer covers the difference.
    forged = method(name, tableau.first, tableau.outer, tableau.inner, digits + 12)
    assert order_of(forged) == 2


@pytest.mark.parametrize("name", ["yoshida_s7o6a", "babps9o7h", "aba864"])
@pytest.mark.parametrize("degree", [3, 5, 7])
def test_the_tolerance_bounds_what_wrong_last_digits_do(name, degree):
    chance, tableau = random.Random(7), integrators[name]
    wrong = []
    for letter, c in operators_of(tableau):
        wrong.append((letter, c + Fraction(chance.choice((-1, 1)), 10**tableau.digits)))
    every = [word for word in words(degree) if len(word) == degree]
    right, off = (
        logarithm(product_of_exponentials(operators, degree), every) for operators in (operators_of(tableau), wrong)
    )
    change = sum(abs(right[word] - off[word]) for word in every)
    assert 0 < change <= tolerance(tableau, degree)


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [0, -2, 2.0, True, "4"])
def test_a_degree_or_a_highest_order_that_is_no_positive_integer_is_refused(number):
    with pytest.raises(SettingError, match=r"highest = .* is not allowed: an integer >= 1"):
        order_of("ruth", highest=number)
    with pytest.raises(SettingError, match=r"degree = .* is not allowed: an integer >= 1"):
        error_norm("ruth", number)


@pytest.mark.parametrize("function", [order_of, nystrom_order_of, generalised_order_of, leading_errors])
def test_an_unknown_integrator_is_refused(function):
    with pytest.raises(UnknownNameError, match="unknown integrator 'rut'"):
        function("rut")
