"""Section 3: equations that hold for all coefficients or for none, C_n, Equations 13, 15 and 16, Table 3, their errata.

They are decided in exact arithmetic on coefficients drawn at random, which share nothing with any method: a step on the
oscillator is multiplied out shear by shear, and an identity between polynomials that fails, fails almost everywhere.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from math import sqrt
from typing import Any, NamedTuple

from mpmath import mp, mpf

from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.theory.order import order_of
from nearharmonic.theory.oscillator import kappa
from nearharmonic_paper.claims.claim import Decide, Decision, counted, either, mathematics, misprint, tallied
from nearharmonic_paper.claims.results import Results, only, short

#: Coefficients: fractions, or numbers of mpmath.
Row = Sequence[Any]
DRAWS = 5
DRAWN = f"exactly, for {DRAWS} sets of random fractions"
#: Digits of closed forms with roots, and what rounding leaves of an equation then.
DIGITS, ROUNDED = 90, 1e-80


class Drawn(NamedTuple):
    """Kicks and drifts of a step that starts with a kick, without the last kick, which does not move the position."""

    kicks: Row
    drifts: Row


def drawn(stages: int, *, symmetric: bool = False) -> list[Drawn]:
    """Draw coefficients of a step, none of them 0; symmetric ones read the same backwards."""
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
    """The position after h drifts, by power of tau: even ones in units of q_a and odd ones in units of p_a."""
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
    statement="C_n = c_(n+1)/c_n in the recursion of Eq. 6",
    threshold=f"the recursion gives the position of Eq. 5, {DRAWN}; with c_(s+1) = c₁ of the next step, or 0 as in "
    "Table 1",
)
def c_n_below_eq_6(results: Results) -> Decision:
    readings = (lambda c: [*c[1:], c[0]], lambda c: [*c[1:], Fraction(0)], lambda c: c)
    first, second, mended = (
        [_off(one, [b / a for a, b in pairwise(read(one.drifts))]) for one in (*drawn(3), _ruth(results))]
        for read in readings
    )
    good = [not any(off[:-1]) for off in (first, second)]
    told = [short(float(off[-1])) for off in (first, second)]
    value = f"for Ruth's method a term of the position is off by {told[0]} with c₄ = c₁ and by {told[1]} with c₄ = 0"
    return either(any(good), f"{value}; c_n/c_(n-1) is {'wrong as well' if any(mended[:-1]) else 'right'}")


def _off(coefficients: Drawn, ratios: Row) -> Any:
    """Return the largest error of a term of the position by Eq. 6 with these C_2, C_3, ..."""
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
    threshold=f"equal to the momentum of Eq. 5 on the oscillator with m = 2, k = 3 and τ = 1/3, {DRAWN}",
)
def eq_6_p_row(_: Results) -> Decision:
    return either(all(_momenta_agree(*one) for one in drawn(4)), f"equal for {DRAWS} sets of four stages")


def _momenta_agree(kicks: Row, drifts: Row) -> bool:
    m, k, tau, last = 2, 3, Fraction(1, 3), Fraction(2, 7)
    before = q = Fraction(5, 11)
    p = Fraction(-3, 13)
    for d, c in zip(kicks, drifts, strict=True):
        p -= tau * d * k * q
        before, q = q, q + tau * c * p / m
    return bool(p - tau * last * k * q == last_row(m, (before, q), tau * drifts[-1], tau * last * k))


def last_row(m: Any, q: tuple[Any, Any], drift: Any, kick: Any) -> Any:
    """Return the momentum by Eq. 6 from the last two positions."""
    return m * (q[1] - q[0]) / drift - kick * q[1]


def solutions(stages: int, good: Callable[[int], bool], words: str) -> Decide:
    """Judge of statements about the number of real solutions with some stages."""

    def decide(results: Results) -> Decision:
        row = only(results.rows("derived_counts"), "stages", str(stages))
        count = int(row["real solutions by Sturm"])
        return either(good(count), f"{count} real solutions{words}")

    return decide


#: Takes coefficients and the terms of the position after each drift to formulas with what they should be equal to.
Formulas = Callable[[Drawn, list[list[Any]]], Iterable[tuple[Any, Any]]]


def identity(things: str, stages: int, formulas: Formulas, *, symmetric: bool = False) -> Decide:
    """Judge of formulas for terms of the position, on coefficients drawn at random."""

    def decide(_: Results) -> Decision:
        pairs = [pair for one in drawn(stages, symmetric=symmetric) for pair in formulas(one, position_terms(one))]
        return tallied((formula == exact for formula, exact in pairs), f"{things} equal")

    return decide


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
    statement="The formulas of Eq. 13 for ζ₁ to ζ₄ of three stages are right",
    threshold=f"equal to the terms of the position after a step, multiplied out kick by drift, {DRAWN}, symmetric ones",
)(identity("terms", 3, _eq_13, symmetric=True))


def closed_form() -> tuple[Any, Any, Any, Any]:
    """c_1, c_2, d_1, d_2 of Eq. 15, in the precision of mpmath."""
    c1 = 1 / (2 - mp.cbrt(2))
    return c1, 1 - 2 * c1, c1 / 2, mpf(1) / 2 - c1 / 2


def eq_14(c1: Any, c2: Any, d1: Any, d2: Any) -> tuple[Any, Any, Any]:
    """The right-hand sides of Eq. 14, which are 1 for a solution."""
    return (
        2 * (d1 + d2) * (2 * c1 + c2),
        12 * c1 * d2 * (c1 + c2) / (2 * c1 + c2),
        24 * c1 * d2 * (2 * c1 * d1 + 2 * c2 * d1 + c2 * d2),
    )


@mathematics(
    paper="Eq. 15",
    sentence="the only real solution satisfying Eq. 14 is the one originally found by [Ruth]",
    statement="d₁ = 1/(2(2 - 2^(1/3))) = 1/2 - d₂ and c₁ = 1/(2 - 2^(1/3)) = (1 - c₂)/2 solve Eq. 14",
    threshold=f"both sides of the three equations equal to 10⁻⁸⁰, in {DIGITS} digits",
    bound=ROUNDED,
)
def eq_15(_: Results, rounded: float) -> Decision:
    with mp.workdps(DIGITS):
        c1, c2, d1, d2 = closed_form()
        off = [float(abs(side - 1)) for side in eq_14(c1, c2, d1, d2)]
    return counted([one < rounded for one in off], f"off by up to {short(max(off), 1)}")


def _tau2(one: Drawn, h: int) -> Any:
    """The sum of the tau^2 column of Table 3."""
    return -sum((c * sum(one.kicks[: i + 1]) for i, c in enumerate(one.drifts[:h])), Fraction(0))


def _tau4(one: Drawn, h: int, limit: int) -> Any:
    """The sum of the tau^4 column of Table 3 and of Eq. 16, with the inner one up to ``limit``."""
    return -sum((_tau2(one, m) * one.kicks[m] * sum(one.drifts[m:limit]) for m in range(1, h)), Fraction(0))


SUMS = f"equal to the terms of the position after h drifts, multiplied out kick by drift, {DRAWN}, with five stages"


table_3 = mathematics(
    id="table-3",
    paper="Table 3",
    sentence="τ² and τ⁴ separations can be expressed as in Table 3",
    statement="The sums of the τ² column are right for every h",
    threshold=SUMS,
)(identity("sums", 5, lambda one, rows: [(_tau2(one, h), row[2]) for h, row in enumerate(rows)]))


@misprint(
    paper="Table 3",
    sentence="τ² and τ⁴ separations can be expressed as in Table 3",
    statement="The sums of the τ⁴ column are right, with an inner sum that runs to h - 1",
    threshold=SUMS,
)
def table_3_inner_limit(results: Results) -> Decision:
    good = [_tau4(one, h, h - 1) == row[4] for one in drawn(5) for h, row in enumerate(position_terms(one)) if h > 1]
    ruth = _ruth(results)
    off = max(abs(float(_tau4(ruth, h, h - 1) - row[4])) for h, row in enumerate(position_terms(ruth)))
    value = f"{sum(good)} of {len(good)} sums equal; for Ruth's method off by up to {short(off)}"
    return either(all(good), f"{value}. Eq. 16, where the sum runs to h, is right")


eq_16 = mathematics(
    id="eq-16",
    paper="Eq. 16",
    sentence="the following identities must be true to satisfy the fourth conditions for the SHO",
    statement="The sums of Eq. 16 for ζ₂ and ζ₄ are right, with an inner sum that runs to h",
    threshold=SUMS,
)(identity("sums", 5, lambda one, rows: [(_tau2(one, 5), rows[-1][2]), (_tau4(one, 5, 5), rows[-1][4])]))


#: a, b, m and k below Eq. 17.
CONSTANTS = (1, -1, 1, 1)


@mathematics(
    paper="Section 3, below Eq. 17",
    sentence="a = -b = 1 and m = k = 1 corresponding to the initial conditions q_a = -p_a = 1",
    statement="q = a cos t + b sin t with a = -b = 1 begins with q = 1, p = -1",
    threshold="exactly, from q and p = m dq/dt of Eq. 12 at t = 0",
)
def initial_values_below_eq_17(_: Results) -> Decision:
    a, b, m, k = CONSTANTS
    q, p = a, m * b * sqrt(k / m)  # cos 0 = 1, sin 0 = 0
    return either((q, p) == (1, -1), f"q_a = {q}, p_a = {p:.0f}")


def counterexample() -> Tableau:
    """Three stages with c = (2, -3, 2) that solve Eq. 16: d_1 = 1 - sqrt(11/48), d_2 = 1/2 - d_1."""
    with mp.workdps(DIGITS):
        d1 = 1 - mp.sqrt(mpf(11) / 48)
        outer, inner = (mp.nstr(one, DIGITS - 5) for one in (d1, mpf(1) / 2 - d1))
    return Tableau(
        name="eq_16", label="Eq. 16", order=2, first="kick", source="Eq. 16 with c_1 = 2", digits=DIGITS - 10,
        kick=palindrome(outer, inner), drift=palindrome("2", centre="-3"),
    )  # fmt: skip


@mathematics(
    paper="Section 3, below Eq. 16",
    sentence="It has previously been shown that Eq. 16 is in fact general second and fourth order criteria",
    statement="Symmetric coefficients that solve Eq. 16 are of fourth order for any separable H",
    threshold="no symmetric coefficients that sum to 1 solve Eq. 16, to 10⁻⁷⁰, and are of lower order, proved in the "
    "free Lie algebra; one example refutes the statement",
    bound=1e-70,
)
def eq_16_general(_: Results, rounded: float) -> Decision:
    method = counterexample()
    second, third, fourth = (float(one) for one in kappa(method, 4)[1:])
    order = order_of(method, highest=5)
    value = (
        f"c = (2, -3, 2), d₁ = 1 - √(11/48): κ₂ {short(second, 1)}, κ₄ {short(fourth, 1)}, but κ₃ = {short(third)} and "
        f"order {order}; Eq. 16 needs ζ₃ = -1/3! beside it"
    )
    return either(max(second, fourth) > rounded or order >= 4, value)
