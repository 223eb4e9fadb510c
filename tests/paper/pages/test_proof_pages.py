"""docs/explanation/order_conditions.md and elimination.md: their formulas and numbers, computed in other ways."""

from __future__ import annotations

import re
from collections import Counter
from fractions import Fraction
from math import comb, factorial, prod

import pytest
from mpmath import cbrt, cos, expm, logm, matrix, mp, mpf, norm, sin

import nearharmonic as nh
from nearharmonic.exact.lie import conditions
from nearharmonic.integrators import plain_integrators
from nearharmonic.numerics.search import RandomStarts
from nearharmonic.theory.order import nystrom_order_of
from nearharmonic_paper.experiments.derivation.conditions import Equations
from nearharmonic_paper.experiments.derivation.elimination import eliminate, reduced_system
from nearharmonic_paper.experiments.derivation.isolated import DIGITS, solve
from support.results.formulas import evaluated, formulas, right_sides
from support.results.stated_numbers import ROOT, flat, numbers, states

ORDERS = "docs/explanation/order_conditions.md"
ELIMINATION = "docs/explanation/elimination.md"
POWER = "10⁻[⁰¹²³⁴⁵⁶⁷⁸⁹]+"


def table_row(page, title):
    (cells,) = re.findall(rf"^\| {re.escape(title)} \|(.*)\|$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    return [int(cell) for cell in cells.split("|")]


def free_lie_dimensions(generators, highest):
    """Dimensions by degree of the free Lie algebra with so many generators of each degree."""
    words = [1]
    for n in range(1, highest + 1):
        words.append(sum(generators[k] * words[n - k] for k in range(1, n + 1)))
    found, product = Counter(), [1] + [0] * highest
    for n in range(1, highest + 1):  # words are the symmetric algebra of the Lie algebra
        found[n] = words[n] - product[n]
        again = [0] * (highest + 1)
        for power in range(highest // n + 1):
            for low in range(highest + 1 - n * power):
                again[low + n * power] += comb(found[n] + power - 1, power) * product[low]
        product = again
    return found


def test_the_table_has_the_numbers_of_conditions():
    degrees = table_row(ORDERS, "degree")
    highest = degrees[-1]
    both = free_lie_dimensions(Counter({1: 2}), highest)
    # Potentials are a free commutative product of two potentials, T is one generator, and so is [T, X] for each X.
    potentials = Counter({1: 1})
    for n in range(2, highest + 1):
        pairs = [(d, n - 1 - d) for d in range(1, (n - 1) // 2 + 1)]
        potentials[n] = sum(potentials[d] * potentials[e] if d != e else comb(potentials[d] + 1, 2) for d, e in pairs)
    quadratic = free_lie_dimensions(Counter({1: 1}) + Counter({n + 1: k for n, k in potentials.items()}), highest)
    assert table_row(ORDERS, "conditions, any T") == [both[n] for n in degrees]
    assert table_row(ORDERS, "conditions, quadratic T") == [quadratic[n] + potentials[n] for n in degrees]
    odd = [sum(one[n] for n in (1, 3, 5)) for one in (both, quadratic + potentials)]
    assert numbers(flat(ORDERS), r"has to fulfil (\d+) conditions for any T, and (\d+) for quadratic T") == odd


def test_polynomial_potentials_have_as_many_conditions_as_stated():
    # tests/library/exact/test_lie.py counts independent Poisson brackets of polynomials.
    needed = {
        degree: [
            sum(len(conditions(n, quadratic=True, potential_degree=degree)) for n in range(1, order, 2))
            for order in (6, 8)
        ]
        for degree in (None, 4, 3)
    }
    text = flat(ORDERS)
    six = numbers(text, r"For order six a symmetric method has to fulfil (\d+) conditions for V of degree three")
    others = numbers(
        text, r"and (\d+) for any other V; for order eight (\d+), (\d+) for V of degree four, and (\d+) for"
    )
    assert (six[0], *others[1:]) == (needed[3][0], needed[3][1], needed[4][1], needed[None][1])
    assert others[0] == needed[4][0] == needed[None][0]


def test_three_registered_methods_gain_order_from_polynomial_potentials():
    gained = {"trained_cubic": [6, 4], "trained_cubic_precise": [8, 4], "trained_quartic_precise": [8, 8]}
    for name, method in {**plain_integrators, **nh.modified_integrators}.items():
        orders = [nh.order_of(method, potential_degree=degree) for degree in (3, 4)]
        assert orders == gained.get(name, [nystrom_order_of(method)] * 2), name
    text = " ".join((ROOT / ORDERS).read_text(encoding="utf-8").split())
    assert (
        "three gain an order from such a V: `trained_cubic` has order six and `trained_cubic_precise` order eight for "
        "degree three, and `trained_quartic_precise` order eight for degree four"
    ) in text


def bracket(x, y):
    return x * y - y * x


def test_the_logarithm_of_leapfrog_has_the_terms_of_page():
    (series,) = [one for one in formulas(ORDERS) if one.startswith(r"\log S") and "[A, [A, B]]" in one]
    found = re.findall(r"([+-]?) ?\\tfrac\{1\}\{(\d+)\}\\,\[", series)
    first, second = (Fraction(int(f"{sign}1"), int(number)) for sign, number in found)
    with mp.workdps(60):
        A, B = matrix([[0, 1, 2], [3, -1, 1], [1, 1, 0]]), matrix([[1, 0, -2], [1, 2, 0], [0, 1, -1]])
        tau = mpf("1e-6")
        step = expm(tau * B / 2) * expm(tau * A) * expm(tau * B / 2)
        terms = bracket(A, bracket(A, B)) * first.numerator / first.denominator
        terms += bracket(bracket(A, B), B) * second.numerator / second.denominator
        assert norm(logm(step) - tau * (A + B) - tau**3 * terms) < 1000 * tau**5


def test_three_kicks_and_a_drift_have_no_commutator():
    # A and B as operators on polynomials of one coordinate, for T = p²/2 and V = q⁴/4 + q³: exponents of q and p.
    def A(f):
        return {(i - 1, j + 1): i * c for (i, j), c in f.items() if i}

    def B(f):
        found = Counter()
        for (i, j), c in f.items():
            if j:
                found[i + 3, j - 1] -= j * c
                found[i + 2, j - 1] -= 3 * j * c
        return {place: c for place, c in found.items() if c}

    def commutator(x, y):
        def applied(f):
            found = Counter(x(y(f)))
            found.subtract(y(x(f)))
            return {place: c for place, c in found.items() if c}

        return applied

    assert "[B, [B, [A, B]]] = 0 ," in formulas(ORDERS)
    modified = commutator(B, commutator(A, B))
    for f in ({(1, 0): 1}, {(0, 1): 1}, {(2, 3): 5}):
        assert commutator(B, modified)(f) == {}
    assert modified({(0, 1): 1})
    assert commutator(A, commutator(A, B))({(0, 1): 1})


def test_the_bound_of_digits_is_that_of_the_page():
    tableau = nh.integrators["babps8o7h"]
    (bound,) = [one for one in formulas(ORDERS) if one.startswith("m\\, 10")]
    sizes = [abs(Fraction(c)) for c in (*tableau.kick, *tableau.drift)]
    assert states(ORDERS, [76.0], "BAB's8o7H", "decimals of")
    found = evaluated(bound.partition(r"\quad")[0], m=len(sizes), D=76, M=sum(sizes), n=5)
    assert 0.9 < float(found) / numbers(flat(ORDERS), rf"degree five is ({POWER})")[0] < 1.1


def test_nystrom_methods_have_the_stated_orders():
    assert states(ORDERS, [nh.order_of("srkn_a14"), nystrom_order_of("srkn_a14")], "`srkn_a14`", "of order")


def test_alternating_words_of_symmetric_steps_give_kappa():
    outer, inner = ([Fraction(c) for c in row] for row in nh.integrators["babs7o7h"].rows_exact())
    letters = [("B", outer[0])]
    for c, d in zip(inner, outer[1:], strict=True):
        letters += [("A", c), ("B", d)]
    for length in range(1, 10):
        word = ("AB" * length)[:length]
        # Sums of products over factors in order, one letter of the word each: A and B alternate, so no factor has two.
        sums = [Fraction(1)] + [Fraction(0)] * length
        for letter, c in letters:
            for place in range(length, 0, -1):
                if word[place - 1] == letter:
                    sums[place] += c * sums[place - 1]
        error = abs(sums[length] * factorial(length) - 1)
        assert float(abs(error - Fraction(str(nh.kappa("babs7o7h", 9)[length - 1])))) < 1e-60


def test_the_matrix_of_a_step_is_that_of_page():
    (whole,) = [one for one in formulas(ELIMINATION) if one.startswith("H = \\begin")]
    blocks = re.findall(r"\\begin\{pmatrix\}(.*?)\\end\{pmatrix\}", whole)
    given = {"A": 2, "B": 3, "C": 5, "D": 8}
    half, mirrored, same, product = (
        [[evaluated(cell, **given) for cell in row.split("&")] for row in block.split(r"\\")] for block in blocks
    )
    assert half == same == [[2, 3], [5, 8]]
    assert product == [[sum(mirrored[i][k] * half[k][j] for k in (0, 1)) for j in (0, 1)] for i in (0, 1)]


def polynomials(y, tau):
    """A, B, C, D of the example of three stages."""
    return [evaluated(right_sides(ELIMINATION, name)[-1], y=y, tau=tau) for name in "ABCD"]


def test_three_stages_leave_the_cubic_of_the_page():
    (cubic,) = [one.partition("=")[0] for one in formulas(ELIMINATION) if one.startswith("y^3")]
    for y, tau in ((Fraction(2, 3), Fraction(1, 5)), (Fraction(-7, 2), Fraction(3)), (Fraction(1, 9), Fraction(-2, 7))):
        A, B, C, D = polynomials(y, tau)
        assert evaluated(cubic, y=y) * tau**6 == A * D - B * C - 1
    with mp.workdps(80):
        A, B, C, D = polynomials(mpf(2) / 7, mpf("1e-8"))
        half = mpf("1e-8") / 2
        assert abs(A * D - cos(half) ** 2) < mpf("1e-47")
        assert abs(B * D - sin(half) * cos(half)) < mpf("1e-39")
        c1 = 1 / (2 - cbrt(2))
        d2 = (1 - c1) / 2
        (root,) = [one for one in right_sides(ELIMINATION, "y") if "c_1" in one]
        assert abs(evaluated(cubic, y=evaluated(root, c_1=c1, d_2=d2))) < mpf("1e-75")
    # One real root: the discriminant is negative.
    p, q = (evaluated(cubic, y=Fraction(1)) - evaluated(cubic, y=Fraction(-1))) / 2 - 1, evaluated(cubic, y=Fraction(0))
    assert -4 * p**3 - 27 * q**2 < 0


def test_numbers_of_complex_solutions_are_products_of_weights():
    text = (ROOT / ELIMINATION).read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d) \| (\d) \| (\d) \| ([\d, ]+) \| (\d+) \|$", text, re.MULTILINE)
    derivation = (ROOT / "docs/results/derivation.md").read_text(encoding="utf-8")
    elsewhere = dict(re.findall(r"^\| (\d) \| \d \| (\d+) \| \d+ \|$", derivation, re.MULTILINE))
    assert len(rows) == 4
    for stages, order, count, weights, solutions in rows:
        given = [int(weight) for weight in weights.split(",")]
        assert int(order) == int(stages) + 1
        assert prod(given) / factorial(int(count)) == int(solutions) == int(elsewhere.get(stages, solutions))
        system = reduced_system(Equations(int(stages), int(order)))
        assert (system.variables, list(system.weights)) == (int(count), given)
        if int(stages) < 7:
            found = eliminate(Equations(int(stages), int(order)))
            assert (len(found.eliminant) - 1, found.simple) == (int(solutions), True)


@pytest.mark.long
def test_boxes_of_proofs_are_as_wide_as_the_page_says():
    found = solve(Equations(3, 4), RandomStarts(20, 1, box=2.5, bound=20.0))
    assert [root.proved for root in found.roots] == [True]
    assert numbers(flat(ELIMINATION), rf"For (\d+) decimals the half width of the box is ({POWER})") == [
        DIGITS, float(found.roots[0].radius),
    ]  # fmt: skip
