"""docs/explanation/harmonic_order.md: its formulas, evaluated as they stand there, and its numbers."""

from __future__ import annotations

import random
import re
from fractions import Fraction
from math import factorial

import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from support.results.formulas import evaluated, formulas, right_sides
from support.results.stated_numbers import ROOT, plain

PAGE = "docs/explanation/harmonic_order.md"
#: Derivatives of cos t - sin t at 0.
DERIVATIVES = (1, -1, -1, 1)
#: Methods of both compositions, one of them asymmetric, without drifts of 0.
METHODS = ("leapfrog", "ruth", "ruth_s3o3", "abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h", "aba864", "srkn_b6")


def rows_of(name, first=None):
    """Kicks, each before a drift, and drifts of a method as exact numbers; an ABA step has no kick before its first."""
    tableau = nh.integrators[name].role(first)
    kicks, drifts = ([Fraction(c) for c in row] for row in (tableau.kick, tableau.drift))
    return ([Fraction(0), *kicks] if tableau.first == "drift" else kicks), drifts


def random_row(length):
    source = random.Random(length)
    return [Fraction(source.randint(1, 30), source.choice((-7, 11, 13))) for _ in range(length)]


def decomposition(kicks, drifts):
    """Q[h][power] for q_a = p_a = 1, by the formulas of the page."""
    (C,), (D,), (recursion,) = (right_sides(PAGE, left) for left in ("C_h", "D_h", r"Q_{h,\lambda}"))
    rows = {"c": lambda i: drifts[i - 1], "d": lambda i: kicks[i - 1]}
    width = 2 * len(drifts) + 1
    starts = {(0, 0): "q_a", (1, 0): "q_a", (1, 1): "c_1 p_a", (1, 2): "D_1 q_a"}
    for (h, power), start in starts.items():
        assert any(f"Q_{{{h},{power}}} = {start}" in one or f"Q_{{{h},{power}}} = Q" in one for one in formulas(PAGE))
    symbols = {"q_a": 1, "p_a": 1, "c_1": drifts[0], "D_1": evaluated(D, h=1, **rows)}
    Q = {place: Fraction(evaluated(start, **symbols)) for place, start in starts.items()}

    def known(h, power):
        return Q.get((h, power), Fraction(0))

    for h in range(2, len(drifts) + 1):
        ratio, product = (evaluated(one, h=h, **rows) for one in (C, D))
        for power in range(width):
            terms = {"C": lambda _, ratio=ratio: ratio, "D": lambda _, product=product: product}
            Q[h, power] = evaluated(recursion, h=h, **{"lambda": power}, Q=known, **terms)
    return [[known(h, power) for power in range(width)] for h in range(len(drifts) + 1)]


def zeta_of(kicks, drifts):
    """Contributions to the position for q_a = -p_a = 1: odd powers are in units of p_a."""
    return [term * (-1) ** power for power, term in enumerate(decomposition(kicks, drifts)[-1])]


def errors_of(name, highest, first=None):
    """e_1, ..., e_highest of the page."""
    zeta = zeta_of(*rows_of(name, first)) + [Fraction(0)] * highest
    return {n: zeta[n] - Fraction(DERIVATIVES[n % 4], factorial(n)) for n in range(1, highest + 1)}


#: The recursion divides by each drift but the last.
DIVISIBLE = [(name, first) for name in METHODS for first in ("kick", "drift") if all(rows_of(name, first)[1][:-1])]


def test_the_recursion_holds_for_most_methods():
    assert len(DIVISIBLE) > len(METHODS)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "first"), DIVISIBLE)
def test_the_decomposition_of_the_page_gives_kappa(name, first):
    with mp.workdps(120):
        mine = [
            mpf(abs(e).numerator) / abs(e).denominator * factorial(n) for n, e in errors_of(name, 12, first).items()
        ]
        assert all(
            abs(a - b) <= mpf(10) ** -70 * (1 + a) for a, b in zip(mine, nh.kappa(name, 12, first=first), strict=True)
        )


def test_eliminating_momentum_leaves_the_step_of_the_page():
    m, k, tau = Fraction(2), Fraction(3), Fraction(1, 5)
    kicks, drifts = random_row(4), random_row(5)[:4]
    p_next, momentum = right_sides(PAGE, "p_h")
    q_next, eliminated = right_sides(PAGE, "q_h")
    given = {"m": m, "k": k, "tau": tau, "c": lambda i: drifts[i - 1], "d": lambda i: kicks[i - 1]}
    q, p = [Fraction(3, 7)], [Fraction(-2, 11)]
    for h in range(1, 5):
        states = {"q": q.__getitem__, "p": p.__getitem__, "h": h}
        p.append(evaluated(p_next, **given, **states))
        q.append(evaluated(q_next, **given, **states))
        assert evaluated(momentum, **given, **states) == p[h]
        if h > 1:
            ratios = {
                name: lambda _, name=name: evaluated(right_sides(PAGE, f"{name}_h")[0], **given, h=h)  # noqa: B023
                for name in "CD"
            }
            assert evaluated(eliminated, **given, **states, **ratios) == q[h]
    assert q[1] == q[0] + tau * drifts[0] * p[1] / m
    assert p[1] == p[0] - tau * kicks[0] * k * q[0]


def test_contributions_of_three_stages_are_those_of_page():
    (c1, c2), (d1, d2) = random_row(2), random_row(3)[:2]
    last = decomposition([d1, d2, d2], [c1, c2, c1])[-1]
    given = {"c_1": c1, "c_2": c2, "d_1": d1, "d_2": d2, "q_a": 1, "p_a": 1}
    for power in (2, 3, 4):
        assert evaluated(right_sides(PAGE, rf"\zeta_{power}")[0], **given) == last[power]


def test_the_root_of_the_cubic_fulfils_two_conditions():
    (cubic,) = [one for one in formulas(PAGE) if one.startswith("6c_1^3")]
    (root,) = right_sides(PAGE, "c_1")
    with mp.workdps(60):
        c1 = 1 / (2 - mp.cbrt(2))
        assert root == "1/(2 - 2^{1/3})"
        assert abs(evaluated(cubic.partition("=")[0], c_1=c1)) < mpf(10) ** -55
        numbers = {"c_1": c1, "c_2": 1 - 2 * c1, "d_1": c1 / 2, "d_2": (1 - c1) / 2, "q_a": mpf(1), "p_a": mpf(1)}
        for power, exact in ((2, -2), (3, -6), (4, 24)):
            assert abs(evaluated(right_sides(PAGE, rf"\zeta_{power}")[0], **numbers) * exact - 1) < mpf(10) ** -55
    # Positive slope at both stationary values of one sign: one real root.
    assert all(6 * c**3 - 12 * c**2 + 6 * c - 1 < 0 for c in (Fraction(1, 3), Fraction(1)))


def test_closed_sums_are_terms_of_the_decomposition():
    kicks, drifts = random_row(6), random_row(7)[:6]
    Q = decomposition(kicks, drifts)
    rows = {"c": lambda i: drifts[i - 1], "d": lambda i: kicks[i - 1], "Q": lambda h, power: Q[h][power], "s": 6}
    for power in (2, 4):
        assert evaluated(right_sides(PAGE, rf"\zeta_{power}")[1], **rows) == Q[-1][power]


def test_the_leapfrog_has_the_contributions_of_the_page():
    kicks, drifts = rows_of("leapfrog")
    (step,) = right_sides(PAGE, "q_1")
    q_a, p_a, tau = Fraction(2, 3), Fraction(5, 7), Fraction(1, 9)
    p = p_a - tau * kicks[0] * q_a
    assert evaluated(step, q_a=q_a, p_a=p_a, tau=tau) == q_a + tau * drifts[0] * p
    assert r"\zeta = (1, -1, -\tfrac12)" in formulas(PAGE)
    assert zeta_of(kicks, drifts) == [1, -1, Fraction(-1, 2)]
    assert zeta_of(*rows_of("leapfrog", "drift"))[3] == evaluated(right_sides(PAGE, r"\zeta_3")[-1])


def leading(name):
    """(harmonic order, power and coefficient of the leading energy error) by the formula of the page."""
    e = errors_of(name, 12)
    order = next(n for n in e if abs(e[n]) > Fraction(1, 10**60)) - 1
    (both,) = [one for one in formulas(PAGE) if one.startswith(r"2\,|e_")]
    even, odd = re.findall(r"(2\\,\|.*?\|)\\;\\tau", both)
    found = evaluated(odd if order % 2 else even, e=e.__getitem__, **{"lambda": order})
    return order, order - order % 2, found


def largest_error(name, tau):
    """Largest energy error of any step from (1, 0), from the matrix of shears."""
    tableau = nh.integrators[name]
    rows = [[mpf(c) for c in row] for row in (tableau.outer, tableau.inner)]
    K = mp.eye(2)
    for i in range(2 * tableau.stages + 1):
        c = rows[i % 2][i // 2] * tau
        kick = (tableau.first == "kick") == (i % 2 == 0)
        K = mp.matrix([[1, 0], [-c, 1]] if kick else [[1, c], [0, 1]]) * K
    (error, K21) = (right_sides(PAGE, left)[0] for left in (r"\max \left|\frac{\Delta H}{H_0}\right|", "K_{21}"))
    entries = {"K_12": K[0, 1], "K_21": K[1, 0], "K_11": K[0, 0]}
    assert abs(evaluated(K21, **entries) - K[1, 0]) < mpf(10) ** -70
    state, seen = mp.matrix([1, 0]), []
    for _ in range(400):
        state = K * state
        seen.append(abs(state[0] ** 2 + state[1] ** 2 - 1))
    bound = evaluated(error, **entries)
    assert max(seen) <= bound * (1 + mpf(10) ** -20)
    assert max(seen) > 0.98 * bound
    return bound


@pytest.mark.slow
@pytest.mark.parametrize("name", ["leapfrog", "ruth", "abas5o6h", "babs7o7h", "babps8o7h", "babps9o7h"])
def test_the_leading_energy_error_is_that_of_many_steps(name):
    _, power, coefficient = leading(name)
    with mp.workdps(90):
        tau = mpf("0.1")
        coarse, fine = (largest_error(name, t) / t**power / coefficient - 1 for t in (tau, tau / 8))
    assert abs(coarse) < 0.05
    assert abs(fine) < abs(coarse) / 50 + mpf(10) ** -60  # the term of the leapfrog is all there is


@pytest.mark.slow
def test_the_table_of_energy_errors_has_these_numbers():
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (\d) \| ([\d.]+) \| (.+?) τ(.) \|$", text, re.MULTILINE)
    assert len(rows) == 5
    for name, order, kappa, error, power in rows:
        mine = leading(name)
        assert (int(order), "⁰¹²³⁴⁵⁶⁷⁸⁹".index(power)) == mine[:2]
        digits = len(kappa.replace(".", "").lstrip("0"))
        term = float(abs(errors_of(name, 12)[mine[0] + 1])) * factorial(mine[0] + 1)
        assert float(kappa) == float(f"{term:.{digits}g}")
        assert float(plain(error)) == float(f"{float(mine[2]):.2g}")
    assert evaluated(r"2 |{-\tfrac1{24}} + \tfrac16|") == leading("leapfrog")[2] == Fraction(1, 4)
