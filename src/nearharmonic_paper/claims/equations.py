"""Statements of Section 3: equations and their misprints, and the search, number and choice of solutions.

An equation that is true for all coefficients or for none is decided in exact arithmetic on random coefficients, which
are independent of all methods: a step on the oscillator is multiplied out shear by shear. A wrong identity between
polynomials fails almost everywhere. Misprints are decided as printed.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import sqrt
from typing import Any, NamedTuple

from mpmath import mp, mpf

from nearharmonic.exact.polynomials import real_root_count, sturm_chain
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.theory.order import order_of
from nearharmonic.theory.oscillator import kappa, step_polynomials
from nearharmonic_paper.claims.claim import (
    Decision,
    Results,
    counted,
    either,
    mathematics,
    misprint,
    once,
    only,
    require,
    result,
    short,
    tallied,
)
from nearharmonic_paper.claims.judging import GENERALLY, NOT_SUITABLE, SIGNIFICANTLY, SMALL

# --- Decomposition of a step and its consequences, Equations 6 and 14, Table 2. ---------------------------------------

#: Table 2 as the paper prints it, by h and the power of tau.
TABLE_2 = (
    ("q_a",),
    ("Q[0,0]", "c_1 p_a / m", "D_1 Qbar[0,0]"),
    ("Q[1,0] Cbar_2 - C_2 Q[0,0]", "Q[1,1] Cbar_2", "Q[1,2] Cbar_2 + D_2 Qbar[1,0]", "D_2 Qbar[1,1]", "D_2 Qbar[1,2]"),
    (
        "Q[2,0] Cbar_3 - C_3 Q[1,0]",
        "Q[2,1] Cbar_3 - C_3 Q[1,1]",
        "Q[2,2] Cbar_3 - C_3 Q[1,2] + D_3 Qbar[2,0]",
        "Q[2,3] Cbar_3 + D_3 Qbar[2,1]",
        "Q[2,4] Cbar_3 + D_3 Qbar[2,2]",
        "D_3 Qbar[2,3]",
        "D_3 Qbar[2,4]",
    ),
)

#: A number in a table is a double, rounded once; sums of a few doubles may be wrong by a few units in the last place.
DOUBLE = 1e-14


@result(
    paper="Section 3, below Eq. 6",
    sentence="Eq. 6 yields significantly larger truncation errors than Eq. 5 and is therefore not suitable for "
    "practical implementation",
    statement="Eq. 6 yields significantly larger errors than Eq. 5 and is not suitable for practical implementation",
    threshold="the largest energy error of Eq. 6 is at least ten times the largest energy error of Eq. 5. Both are "
    "used for 1000 steps of BABs7o7H on the oscillator at τ/s = 0.003, in doubles without compensation. Truncation "
    f"errors are below rounding errors there. {NOT_SUITABLE.words}. {SIGNIFICANTLY.brief}. The paper calls rounding "
    "errors truncation errors",
    bound=NOT_SUITABLE.number,
)
def eq_6_rounding(results: Results, factor: float) -> Decision:
    shears, eliminated = (_largest_error(results, step) for step in (_by_eq_5, _by_eq_6))
    value = f"largest energy error {short(eliminated)} by Eq. 6, {short(shears)} by Eq. 5"
    return either(eliminated >= factor * shears, value)


State = tuple[float, float]


@once
def _largest_error(results: Results, step: Callable[[Tableau, float, State], State]) -> float:
    """Return the largest |H - H0|/H0 of 1000 steps of BABs7o7H from (q, p) = (1, -1)."""
    method = results.method("babs7o7h").role("kick")
    state, largest, tau = (1.0, -1.0), 0.0, 0.003 * method.stages
    for _ in range(1000):
        state = step(method, tau, state)
        largest = max(largest, abs((state[0] * state[0] + state[1] * state[1]) / 2 - 1))
    return largest


def _by_eq_5(method: Tableau, tau: float, state: State) -> State:
    (*kicks, last), drifts = method.rows_double()
    q, p = state
    for d, c in zip(kicks, drifts, strict=True):
        p -= tau * d * q
        q += tau * c * p
    return q, p - tau * last * q


def _by_eq_6(method: Tableau, tau: float, state: State) -> State:
    kicks, drifts = method.rows_double()
    before, p = state
    q = before + tau * drifts[0] * p - tau * tau * drifts[0] * kicks[0] * before
    for d, c, c_before in zip(kicks[1:], drifts[1:], drifts, strict=False):
        C = c / c_before
        before, q = q, q * (1 + C) - C * before - tau * tau * c * d * q
    return q, (q - before) / (tau * drifts[-1]) - tau * kicks[-1] * q


@mathematics(
    paper="Table 2",
    sentence="consider the three stage decomposition expressed by the entries Q_(h,λ) in Table 2",
    statement="The entries of Table 2 are correct up to τ⁶",
    threshold="each of the 16 entries equals the entry from the recursion of Eq. 6. With Ruth's coefficients the last "
    "row equals the product of Ruth's kicks and drifts to 10⁻¹⁴. The tables contain doubles, rounded to 10⁻¹⁶, of sums "
    "with terms up to 3",
    bound=DOUBLE,
    needs=("tables/table2_recursion.csv", "tables/table2_values.csv"),
)
def table_2(results: Results, rounded: float) -> Decision:
    same: list[bool] = []
    for printed, row in zip(TABLE_2, results.rows("table2_recursion"), strict=False):
        same += [cell == row.get(f"tau^{power}") for power, cell in enumerate(printed)]
    last = results.rows("table2_values")[len(TABLE_2) - 1]
    K = step_polynomials(results.method("ruth").role("kick"))
    terms = [(K.K12 if power % 2 else K.K11)[power] for power in range(7)]
    right = [abs(float(last[f"tau^{power}"]) - float(term)) < rounded for power, term in enumerate(terms)]
    return counted([*same, *right], f"{sum(same)} of {len(same)} entries, {sum(right)} of {len(right)} numbers")


@mathematics(
    paper="Eq. 14",
    sentence="It is readily found that the only real solution satisfying Eq. 14 is the one originally found by [Ruth]",
    statement="The only real solution of Eq. 14, given that c and d sum to 1, is the one found by Ruth",
    threshold="if both sums are 1, Eq. 14 reduces to 6c³ - 12c² + 6c - 1 = 0 for c₁. It has one real root by Sturm's "
    "theorem. The root is Ruth's c₁ to its 76 decimals",
    bound=1e-70,
)
def eq_14_only_solution(results: Results, rounded: float) -> Decision:
    polynomial = [-1, 6, -12, 6]
    count = real_root_count(sturm_chain(polynomial))
    c1 = Fraction(results.method("ruth").inner[0])
    left = abs(sum((a * c1**k for k, a in enumerate(polynomial)), Fraction(0)))
    value = f"{count} real root; at Ruth's c₁ the polynomial is {short(float(left), 1)}"
    return either(count == 1 and left < Fraction(rounded), value)


@mathematics(
    paper="Section 3, below Eq. 16",
    sentence="splitting coefficients satisfying Eq. 10 to at least fourth order also satisfy Eq. 2 to at least fourth "
    "order",
    statement="Coefficients of fourth order on the oscillator are of fourth order for any separable H",
    threshold="every registered symmetric method whose position has harmonic order 4 or more has order 4 or more, "
    "proved in the free Lie algebra. For symmetric sets both orders require two independent conditions",
    needs=("tables/integrators.csv",),
)
def harmonic_four_is_four(results: Results) -> Decision:
    rows = [row for row in results.rows("integrators") if row["symmetric"] == "yes"]
    rows = [row for row in rows if int(row["harmonic order of position"]) >= 4]
    bad = [row["integrator"] for row in rows if int(row["order"]) < 4]
    return either(bool(rows) and not bad, f"{len(rows) - len(bad)} of {len(rows)} methods")


# --- Equations that are true for all coefficients or for none: C_n, Equations 13, 15, 16, Table 3, their errata. ------

#: Coefficients: fractions, or numbers of mpmath.
Row = Sequence[Any]
DRAWS = 5
DRAWN = f"in exact arithmetic, for {DRAWS} sets of random fractions"
#: Digits of closed forms with roots, and the bound on the rounding error of an equation with these digits.
DIGITS, ROUNDED = 90, 1e-80


class Drawn(NamedTuple):
    """Kicks and drifts of a step that starts with a kick, without the last kick, which does not move the position."""

    kicks: Row
    drifts: Row


def drawn(stages: int, *, symmetric: bool = False) -> list[Drawn]:
    """Draw coefficients of a step at random, none of them 0; with ``symmetric`` each row is a palindrome."""
    source = random.Random(stages)
    sets = []
    for _ in range(DRAWS):
        kicks, drifts = (
            [Fraction(source.choice((-1, 1)) * source.randint(1, 99), source.randint(1, 99)) for _ in range(stages)]
            for _ in range(2)
        )
        if symmetric:
            kicks = [kicks[min(i, stages - i)] for i in range(stages)]
            drifts = [drifts[min(i, stages - 1 - i)] for i in range(stages)]
        sets.append(Drawn(kicks, drifts))
    return sets


def position_terms(coefficients: Drawn) -> list[list[Any]]:
    """Return the position after h drifts by power of tau: even powers in units of q_a, odd powers in units of p_a."""
    size = 2 * len(coefficients.drifts)
    q, p = [Fraction(1)] + [Fraction(0)] * size, [Fraction(1)] + [Fraction(0)] * size
    rows = [q]
    for d, c in zip(coefficients.kicks, coefficients.drifts, strict=True):
        p = [p[0], *(b - d * a for b, a in zip(p[1:], q, strict=False))]
        q = [q[0], *(a + c * b for a, b in zip(q[1:], p, strict=False))]
        rows.append(q)
    return rows


def _ruth(results: Results) -> Drawn:
    method = results.method("ruth").role("kick")
    return Drawn([Fraction(d) for d in method.kick[:-1]], [Fraction(c) for c in method.drift])


@misprint(
    paper="Section 3, below Eq. 6",
    sentence="where C_n = c_(n+1)/c_n and D_n = -c_n d_n",
    statement="In the recursion of Eq. 6, C_n is c_(n+1)/c_n",
    threshold=f"the recursion gives the position of Eq. 5, {DRAWN}. c_(s+1) is c₁ of the next step, or 0 as in Table 1",
)
def c_n_below_eq_6(results: Results) -> Decision:
    readings = (lambda c: [*c[1:], c[0]], lambda c: [*c[1:], Fraction(0)], lambda c: c)
    first, second, mended = (
        [_off(one, [b / a for a, b in pairwise(read(one.drifts))]) for one in (*drawn(3), _ruth(results))]
        for read in readings
    )
    told = [short(float(off[-1])) for off in (first, second)]
    value = f"for Ruth's method a term of the position is wrong by {told[0]} with c₄ = c₁ and by {told[1]} with c₄ = 0"
    good = not any(first[:-1]) or not any(second[:-1])
    return either(good, f"{value}. C_n = c_n/c_(n-1) is {'wrong as well' if any(mended[:-1]) else 'correct'}")


def _off(coefficients: Drawn, ratios: Row) -> Any:
    """Return the largest error of a term of the position if Eq. 6 uses ``ratios`` as C_2, C_3, ..."""
    kicks, drifts = coefficients
    exact = position_terms(coefficients)[-1]
    none = [Fraction(0)] * (len(exact) - 1)
    before = [Fraction(1), *none]
    now = [Fraction(1), drifts[0], -drifts[0] * kicks[0], *none[2:]]
    for C, c, d in zip(ratios, drifts[1:], kicks[1:], strict=True):
        force = [Fraction(0), Fraction(0), *now]
        before, now = now, [(1 + C) * a - C * b - c * d * f for a, b, f in zip(now, before, force, strict=False)]
    return max(abs(a - b) for a, b in zip(now, exact, strict=True))


@mathematics(
    paper="Eq. 6",
    sentence="p_(s+1) = m (q_s - q_(s-1))/(τ c_s) - τ d_(s+1) ∂V/∂q(q_s)",
    statement="The last row of Eq. 6 gives the momentum after the step",
    threshold=f"the row equals the momentum of Eq. 5 on the oscillator with m = 2, k = 3 and τ = 1/3, {DRAWN}",
)
def eq_6_p_row(_: Results) -> Decision:
    m, k, tau, last = 2, 3, Fraction(1, 3), Fraction(2, 7)
    good = []
    for kicks, drifts in drawn(4):
        before = q = Fraction(5, 11)
        p = Fraction(-3, 13)
        for d, c in zip(kicks, drifts, strict=True):
            p -= tau * d * k * q
            before, q = q, q + tau * c * p / m
        good.append(p - tau * last * k * q == m * (q - before) / (tau * drifts[-1]) - tau * last * k * q)
    return either(all(good), f"equal for {DRAWS} sets with four stages")


def solutions(stages: int, good: Callable[[int], bool], words: str, results: Results) -> Decision:
    """Decide a statement about the number of real solutions with ``stages`` stages."""
    count = int(only(results.rows("derived_counts"), "stages", str(stages))["real solutions by Sturm"])
    return either(good(count), f"{count} real solutions{words}")


#: Maps coefficients and the terms of the position after each drift to pairs of a formula and its expected value.
Formulas = Callable[[Drawn, list[list[Any]]], Iterable[tuple[Any, Any]]]


def identity(things: str, stages: int, formulas: Formulas, _: Results, *, symmetric: bool = False) -> Decision:
    """Decide a statement about formulas for terms of the position, on random coefficients."""
    pairs = [pair for one in drawn(stages, symmetric=symmetric) for pair in formulas(one, position_terms(one))]
    return tallied((formula == exact for formula, exact in pairs), f"{things} equal")


def _eq_13(one: Drawn, rows: list[list[Any]]) -> Iterable[tuple[Any, Any]]:
    (d1, d2), (c1, c2) = one.kicks[:2], one.drifts[:2]
    formulas = (
        2 * c1 + c2,
        -(d1 + d2) * (2 * c1 + c2),
        -2 * c1 * d2 * (c1 + c2),
        c1 * d2 * (2 * c1 * d1 + 2 * c2 * d1 + c2 * d2),
    )
    return zip(formulas, rows[-1][1:5], strict=True)


eq_13 = mathematics(
    id="eq-13",
    paper="Eq. 13",
    sentence="the following identities must be true for symmetric fourth order splitting coefficients",
    statement="With three stages the formulas of Eq. 13 for ζ₁ to ζ₄ are correct",
    threshold="each formula equals its term of the position after a step. The terms are multiplied out kick by drift, "
    f"{DRAWN}, which are symmetric",
)(partial(identity, "terms", 3, _eq_13, symmetric=True))


def closed_form() -> tuple[Any, Any, Any, Any]:
    """Return c_1, c_2, d_1, d_2 of Eq. 15 in the precision of mpmath."""
    c1 = 1 / (2 - mp.cbrt(2))
    return c1, 1 - 2 * c1, c1 / 2, mpf(1) / 2 - c1 / 2


def eq_14(c1: Any, c2: Any, d1: Any, d2: Any) -> tuple[Any, Any, Any]:
    """Return the right-hand sides of Eq. 14; they are 1 for a solution."""
    return (
        2 * (d1 + d2) * (2 * c1 + c2),
        12 * c1 * d2 * (c1 + c2) / (2 * c1 + c2),
        24 * c1 * d2 * (2 * c1 * d1 + 2 * c2 * d1 + c2 * d2),
    )


@mathematics(
    paper="Eq. 15",
    sentence="the only real solution satisfying Eq. 14 is the one originally found by [Ruth]",
    statement="d₁ = 1/(2(2 - 2^(1/3))) = 1/2 - d₂ and c₁ = 1/(2 - 2^(1/3)) = (1 - c₂)/2 solve Eq. 14",
    threshold=f"both sides of the three equations agree to 10⁻⁸⁰ in arithmetic with {DIGITS} digits",
    bound=ROUNDED,
)
def eq_15(_: Results, rounded: float) -> Decision:
    with mp.workdps(DIGITS):
        c1, c2, d1, d2 = closed_form()
        off = [float(abs(side - 1)) for side in eq_14(c1, c2, d1, d2)]
    return counted([one < rounded for one in off], f"largest difference {short(max(off), 1)}")


def _tau2(one: Drawn, h: int) -> Any:
    """Return the sum in the tau^2 column of Table 3."""
    return -sum((c * sum(one.kicks[: i + 1]) for i, c in enumerate(one.drifts[:h])), Fraction(0))


def _tau4(one: Drawn, h: int, limit: int) -> Any:
    """Return the sum in the tau^4 column of Table 3 and in Eq. 16; its inner sum ends at ``limit``."""
    return -sum((_tau2(one, m) * one.kicks[m] * sum(one.drifts[m:limit]) for m in range(1, h)), Fraction(0))


SUMS = (
    "each sum equals its term of the position after h drifts. The terms are multiplied out kick by drift, "
    f"{DRAWN} and five stages"
)


table_3 = mathematics(
    id="table-3",
    paper="Table 3",
    sentence="τ² and τ⁴ separations can be expressed as in Table 3",
    statement="The sums in the τ² column are correct for every h",
    threshold=SUMS,
)(partial(identity, "sums", 5, lambda one, rows: [(_tau2(one, h), row[2]) for h, row in enumerate(rows)]))


@misprint(
    paper="Table 3",
    sentence="τ² and τ⁴ separations can be expressed as in Table 3",
    statement="The sums in the τ⁴ column, with an inner sum up to h - 1, are correct",
    threshold=SUMS,
)
def table_3_inner_limit(results: Results) -> Decision:
    good = [_tau4(one, h, h - 1) == row[4] for one in drawn(5) for h, row in enumerate(position_terms(one)) if h > 1]
    ruth = _ruth(results)
    off = max(abs(float(_tau4(ruth, h, h - 1) - row[4])) for h, row in enumerate(position_terms(ruth)))
    value = f"{sum(good)} of {len(good)} sums equal; largest error for Ruth's method {short(off)}"
    return either(all(good), f"{value}. Eq. 16, with an inner sum up to h, is correct")


eq_16 = mathematics(
    id="eq-16",
    paper="Eq. 16",
    sentence="the following identities must be true to satisfy the fourth conditions for the SHO",
    statement="The sums of Eq. 16 for ζ₂ and ζ₄, with an inner sum up to h, are correct",
    threshold=SUMS,
)(partial(identity, "sums", 5, lambda one, rows: [(_tau2(one, 5), rows[-1][2]), (_tau4(one, 5, 5), rows[-1][4])]))


@mathematics(
    paper="Section 3, below Eq. 17",
    sentence="a = -b = 1 and m = k = 1 corresponding to the initial conditions q_a = -p_a = 1",
    statement="q = a cos t + b sin t with a = -b = 1 starts at q = 1, p = -1",
    threshold="q and p = m dq/dt of Eq. 12 have exactly these values at t = 0",
)
def initial_values_below_eq_17(_: Results) -> Decision:
    a, b, m, k = 1, -1, 1, 1
    q, p = a, m * b * sqrt(k / m)  # cos 0 = 1, sin 0 = 0
    return either((q, p) == (1, -1), f"q_a = {q}, p_a = {p:.0f}")


@mathematics(
    paper="Section 3, below Eq. 16",
    sentence="It has previously been shown that Eq. 16 is in fact general second and fourth order criteria",
    statement="Symmetric coefficients that solve Eq. 16 are of fourth order for any separable H",
    threshold="no symmetric coefficients that sum to 1 solve Eq. 16 to 10⁻⁷⁰ and have a lower order, proved in the "
    "free Lie algebra. One example refutes the statement",
    bound=1e-70,
)
def eq_16_general(_: Results, rounded: float) -> Decision:
    with mp.workdps(DIGITS):
        d1 = 1 - mp.sqrt(mpf(11) / 48)
        outer, inner = (mp.nstr(one, DIGITS - 5) for one in (d1, mpf(1) / 2 - d1))
    method = Tableau(
        name="eq_16", label="Eq. 16", order=2, first="kick", source="Eq. 16 with c_1 = 2", digits=DIGITS - 10,
        kick=palindrome(outer, inner), drift=palindrome("2", centre="-3"),
    )  # fmt: skip
    second, third, fourth = (float(one) for one in kappa(method, 4)[1:])
    order = order_of(method, highest=5)
    value = (
        f"c = (2, -3, 2) and d₁ = 1 - √(11/48) give κ₂ = {short(second, 1)} and κ₄ = {short(fourth, 1)}, but "
        f"κ₃ = {short(third)} and order {order}. The condition ζ₃ = -1/3! is missing for order four"
    )
    return either(max(second, fourth) > rounded or order >= 4, value)


# --- Misprints whose context shows the correction, and the freedom of Eq. 14; others are beside their statements. -----


@misprint(
    paper="Eq. 2",
    sentence="exp(τ(A + B)) = Π_(i=0)^k exp(c_i τA) exp(d_i τB) + o(τ^(N+1))",
    statement="The product of Eq. 2 begins with i = 0",
    threshold="for Ruth's method the product has as many factors as pairs of coefficients (c₁, d₁) to (c_k, d_k)",
)
def eq_2_product(results: Results) -> Decision:
    k = len(results.method("ruth").outer)
    factors = len(range(k + 1))
    return either(factors == k, f"{factors} factors for {k} pairs of coefficients. The product should begin with i = 1")


@misprint(
    paper="Eq. 2",
    sentence="where o(τ^(N+1)) denotes an error on the N + 1 order term",
    statement="The error is o(τ^(N+1)) in the usual meaning of this symbol: it vanishes faster than τ^(N+1)",
    threshold="κ₅ of Ruth's method is below 10⁻³⁰: a method of order N = 4 has no error term in τ⁵ on the oscillator",
    bound=1e-30,
)
def eq_2_order_symbol(results: Results, vanished: float) -> Decision:
    left = float(kappa(results.method("ruth"), 5)[-1])
    return either(left < vanished, f"κ₅ = {short(left)}. The paper means O(τ^(N+1)), as its words say")


@misprint(
    paper="Section 3, below Eq. 11",
    sentence="is enforced by applying the condition Q̄_(h,λ) = ∂V/∂q(Q_(h,λ)) in Table 2",
    statement="Q̄ is the gradient of V, not divided by the mass",
    threshold="with this Q̄ the entry D₁Q̄ of Table 2 is the τ² term of the position after a kick and a drift, for m = 2 "
    f"and k = 3, {DRAWN}",
)
def q_bar_below_eq_11(_: Results) -> Decision:
    m, k = 2, 3
    exact = [Fraction(-k, m) * one.kicks[0] * one.drifts[0] for one in drawn(3)]
    printed = [-one.kicks[0] * one.drifts[0] * k for one in drawn(3)]
    right = "correct" if [entry / m for entry in printed] == exact else "wrong as well"
    value = f"the entry is wrong by the factor {printed[0] / exact[0]}. With the factor 1/m of Table 2 it is {right}"
    return either(printed == exact, value)


@misprint(
    paper="Eq. 13",
    sentence="h₁ = ζ₀ = q_a",
    statement="If h counts substeps as in Table 2, h₁ = q_a is the position after the first substep",
    threshold="the position after substep 1 is q_a, " + DRAWN,
)
def eq_13_h1(_: Results) -> Decision:
    rows = [position_terms(one)[1] for one in drawn(3)]
    value = f"substep 1 adds {sum(map(bool, rows[0][1:]))} terms to q_a. The paper means the constant a of Eq. 12"
    return either(not any(any(row[1:]) for row in rows), value)


@misprint(
    paper="Eq. 14",
    sentence="the only real solution satisfying Eq. 14 is the one originally found by [Ruth]",
    statement="Eq. 14 has one real solution without the condition Σ c_i = Σ d_i = 1",
    threshold="Ruth's coefficients with doubled c and halved d do not solve Eq. 14 to 10⁻⁸⁰ in arithmetic with "
    f"{DIGITS} digits",
    bound=ROUNDED,
)
def eq_14_needs_sums(_: Results, rounded: float) -> Decision:
    with mp.workdps(DIGITS):
        c1, c2, d1, d2 = closed_form()
        off = max(float(abs(side - 1)) for side in eq_14(2 * c1, 2 * c2, d1 / 2, d2 / 2))
    value = f"the scaled coefficients solve Eq. 14 with an error of {short(off, 1)}"
    scaled = "because c → λc and d → d/λ leave Eq. 14 unchanged. The paper means the condition on the sums as well"
    return either(off >= rounded, f"{value}, {scaled}" if off < rounded else value)


@misprint(
    paper="Section 4.A",
    sentence="Solution to Eq. 10 using ABA decomposition with coefficients c₀ = c_(s+1) = 0 in Eq. 3",
    statement="In Eq. 3 the drifts c₀ and c_(s+1) of a BAB' set are 0",
    threshold="the drifts of BAB's9o7H sum to 1 in all printed decimals if c_(s+1) is 0. Eq. 3 starts with drift c₁",
)
def bab_prime_from_zero(results: Results) -> Decision:
    method = results.method("babps9o7h")
    *kept, _ = map(Fraction, method.drift)
    left = sum(kept, Fraction(0))
    unit = len(kept) * Fraction(1, 10**method.digits)
    value = f"one of {len(method.drift)} drifts is lost, and the others sum to {short(float(left))}"
    return either(abs(left - 1) <= unit, f"{value}. The paper means c₁ = c_(s+2) = 0, with s drifts in between")


four_unique_or_more = misprint(
    id="four-unique-or-more",
    paper="Section 3, last paragraph, and Table 4, second heading",
    sentence="Four unique sets of splitting coefficients are presented in the following section",
    statement="BABs6o7H is unique, although Table 4 says that more solutions exist",
    threshold="Sturm's theorem gives one real solution with six stages and harmonic order seven",
    needs=("tables/derived_counts.csv",),
)(partial(solutions, 6, lambda count: count == 1, ". The paper means isolated solutions, and Table 4 is correct"))


# --- Search, number and choice of solutions. --------------------------------------------------------------------------

DOCUMENT = ("derived/coefficients.toml",)
in_last_paragraph = partial(result, paper="Section 3, last paragraph")
#: Largest kappa at which the paper's minimisation ends.
ASKED = 1e-128


def largest(*coefficients: str) -> float:
    return max(abs(float(c)) for c in coefficients)


@result(
    paper="Section 3, below Eq. 17",
    sentence="for λ_H > 5 every additional stage yields two increments of λ_max and a single increment of λ_H for "
    "which at least one real solution exists",
    statement="Every additional stage increases λ_max by two, and the λ_H of the real solutions by one",
    threshold="for each number of stages s from five on, λ_max = 2s and a real solution with λ_H = s + 1 is found. The "
    "paper refers to experiments, so no proof is required that λ_H cannot be larger",
    needs=("tables/derived_orders.csv",),
)
def growth_of_lambda_h(results: Results) -> Decision:
    rows = [row for row in results.rows("derived_orders") if int(row["stages"]) >= 5]
    require(len(rows) > 1, "the table of reached orders has fewer than two numbers of stages from five on")
    found = [[int(row[name]) for name in ("stages", "lambda_max", "harmonic order reached")] for row in rows]
    reached = [(highest, order) == (2 * stages, stages + 1) for stages, highest, order in found]
    proved = [row["stages"] for row in rows if row["proved largest"] == "yes"]
    stages = f"s = {rows[0]['stages']} to {rows[-1]['stages']}"
    value = f"λ_H = s + 1 is reached for {sum(reached)} of {len(rows)} numbers of stages, {stages}; "
    value += f"it is proved to be the largest for s = {', '.join(proved)}"
    return either(all(reached), value)


@in_last_paragraph(
    sentence="Solutions are provided in the following section with minimization criteria κ_max < 1e-128",
    statement="The solutions have κ_max < 10⁻¹²⁸",
    threshold="κ_max of each derived set, including the printed sets, is below 10⁻¹²⁸, the paper's number",
    bound=ASKED,
    needs=DOCUMENT,
)
def kappa_below_1e_128(results: Results, asked: float) -> Decision:
    found = [float(root["residual"]) for case in results.derived["isolated"] for root in case["roots"]]
    found += [float(one["continued"]["residual"]) for one in results.derived["printed"]]
    return tallied((residual < asked for residual in found), "solutions", f"; largest κ_max {short(max(found), 2)}")


@in_last_paragraph(
    sentence="The minimization is performed using an adaptive simplex method minimizing only one objective κ_max",
    statement="An adaptive simplex method in 2048 bits that minimises only κ_max reaches 10⁻¹²⁸",
    threshold="from at least one random start, κ_max falls below 10⁻¹²⁸, the paper's number",
    bound=ASKED,
    needs=("tables/derived_routes.csv",),
)
def simplex_reaches(results: Results, asked: float) -> Decision:
    rows = [row for row in results.rows("derived_routes") if row["route"].startswith("adaptive simplex")]
    found = [float(row["largest kappa"]) for row in rows if row["start"].startswith("random")]
    require(found, "the config requests no simplex method")
    good, worst = [kappa < asked for kappa in found], max(found)
    told = f"{sum(good)} of {len(good)} promising random starts"
    return either(any(good), told if all(good) else f"{told}; the others stall at κ_max of up to {short(worst, 2)}")


@in_last_paragraph(
    sentence="picked among thousands of solutions based on the sum of the absolute values of the splitting "
    "coefficients and higher order SHO errors",
    statement="Each set that is not unique has a small sum of absolute values and small next terms within its family",
    threshold="no known member of the family of a set is better than the set by every criterion. Then some weighting "
    "of the criteria leads to the choice",
    needs=("tables/derived_families.csv",),
)
def picked_by_sum_and_next_term(results: Results) -> Decision:
    rows = results.rows("derived_families")
    better = [int(row["members better in all"]) for row in rows]
    listed = _listed(rows, "members better in all")
    return tallied((count == 0 for count in better), "sets", f"; members that are better by every criterion: {listed}")


@in_last_paragraph(
    sentence="The non-unique solutions are picked among thousands of solutions",
    statement="The non-unique solutions are picked among thousands of solutions",
    threshold="each of these sets has at least one free parameter, and at least 2000 members of its family are found",
    bound=2000.0,
    needs=("tables/derived_families.csv",),
)
def picked_among_thousands(results: Results, thousands: float) -> Decision:
    rows = results.rows("derived_families")
    good = (int(row["free parameters"]) >= 1 and int(row["members found"]) >= thousands for row in rows)
    parameters = ", ".join(sorted({row["free parameters"] for row in rows}))
    listed = _listed(rows, "members found")
    return tallied(good, "sets", f", with {parameters} free parameters; members found: {listed}")


def _listed(rows: Sequence[Mapping[str, str]], column: str) -> str:
    return ", ".join(f"{row['set']} {int(row[column])}" for row in rows)


@result(
    paper="Section 6, Conclusion",
    sentence="harmonic order conditions higher than seven often introduce more negative splitting coefficients",
    statement="Harmonic order conditions higher than seven often introduce more negative coefficients",
    threshold="more than half of the real solutions with harmonic order eight and seven stages have more negative "
    f"coefficients than BABs7o7H, which has harmonic order seven and seven stages. {GENERALLY.words}",
    bound=GENERALLY.number,
    needs=DOCUMENT,
)
def above_seven_more_negative(results: Results, share: float) -> Decision:
    cases = [case for case in results.derived["isolated"] if case["equations"]["harmonic_order"] == 8]
    require(cases, "the results have no search for solutions with harmonic order eight")
    method = results.method("babs7o7h")
    before = _negative([*method.kick, *method.drift])
    counts = [_negative([*root["outer"], *root["inner"]]) for root in cases[0]["roots"]]
    more = sum(count > before for count in counts)
    value = f"{more} of {len(counts)} solutions; numbers of negative coefficients {', '.join(map(str, sorted(counts)))}"
    return either(more > share * len(counts), f"{value}; BABs7o7H has {before}")


def _negative(coefficients: Sequence[str]) -> int:
    return sum(text.startswith("-") for text in coefficients)


@result(
    paper="Section 6, Conclusion",
    sentence="A larger number of stages presents more degrees of freedom resulting in more inappropriate solutions",
    statement="More stages give more free parameters, and more solutions with a substep that is not small",
    threshold="two numbers increase with every additional stage. These are the free parameters at harmonic order seven "
    "for six to nine stages, and the isolated real solutions with a coefficient above 1 for five to seven stages. "
    f"{SMALL.words}",
    bound=SMALL.number,
    needs=(*DOCUMENT, "tables/derived_families.csv"),
)
def more_stages_more_inappropriate(results: Results, small: float) -> Decision:
    families = [row for row in results.rows("derived_families") if row["harmonic order"] == "7"]
    free = {6: 0} | {int(row["stages"]): int(row["free parameters"]) for row in families}
    cases = {case["equations"]["stages"]: case["roots"] for case in results.derived["isolated"]}
    long = {
        stages: sum(largest(*root["outer"], *root["inner"]) > small for root in roots)
        for stages, roots in cases.items()
    }
    require(min(len(free), len(long)) > 1, "the results have solutions for fewer than two numbers of stages")
    good = [numbers[b] > numbers[a] for numbers in (free, long) for a, b in pairwise(sorted(numbers))]
    told = (", ".join(f"{numbers[s]} with {s}" for s in sorted(numbers)) for numbers in (free, long))
    value = "free parameters {} stages; isolated solutions with a coefficient above 1: {} stages"
    return counted(good, value.format(*told))
