"""Misprints that their context puts right, in Equations 2 and 13, below 11 and of BAB', and what Eq. 14 leaves free.

Each is decided as printed, in exact arithmetic. Others stand beside the statements that they are about.
"""

from __future__ import annotations

from fractions import Fraction

from mpmath import mp

from nearharmonic.theory.oscillator import kappa
from nearharmonic_paper.claims.claim import Decision, either, misprint
from nearharmonic_paper.claims.results import Results, short
from nearharmonic_paper.claims.statements.equations.identities import (
    DIGITS,
    DRAWN,
    ROUNDED,
    closed_form,
    drawn,
    eq_14,
    position_terms,
    solutions,
)

#: The lower limit of the product of Eq. 2.
FIRST_FACTOR = 0
#: The mass for which the condition below Eq. 11 is tried.
MASS = 2


@misprint(
    paper="Eq. 2",
    sentence="exp(τ(A + B)) = Π_(i=0)^k exp(c_i τA) exp(d_i τB) + o(τ^(N+1))",
    statement="The product of Eq. 2 begins with i = 0",
    threshold="as many factors as pairs of coefficients (c₁, d₁) to (c_k, d_k), for Ruth's method",
)
def eq_2_product(results: Results) -> Decision:
    k = len(results.method("ruth").outer)
    factors = len(range(FIRST_FACTOR, k + 1))
    return either(factors == k, f"{factors} factors for {k} pairs of coefficients. The product begins with i = 1")


@misprint(
    paper="Eq. 2",
    sentence="where o(τ^(N+1)) denotes an error on the N + 1 order term",
    statement="The error is o(τ^(N+1)), in the usual meaning of this symbol: it vanishes faster than τ^(N+1)",
    threshold="κ₅ of Ruth's method, whose order is N = 4, below 10⁻³⁰: it has no term in τ⁵ on the oscillator",
    bound=1e-30,
)
def eq_2_order_symbol(results: Results, vanished: float) -> Decision:
    left = float(kappa(results.method("ruth"), 5)[-1])
    return either(left < vanished, f"κ₅ = {short(left)}. O(τ^(N+1)) is meant, as the words say")


@misprint(
    paper="Section 3, below Eq. 11",
    sentence="is enforced by applying the condition Q̄_(h,λ) = ∂V/∂q(Q_(h,λ)) in Table 2",
    statement="Q̄ is the gradient of V, not divided by the mass",
    threshold="with it the entry D₁Q̄ of Table 2 is the τ² term of the position after a kick and a drift, m = 2 and "
    f"k = 3, {DRAWN}",
)
def q_bar_below_eq_11(_: Results) -> Decision:
    m, k = MASS, 3
    exact = [Fraction(-k, m) * one.kicks[0] * one.drifts[0] for one in drawn(3)]
    printed = [-one.kicks[0] * one.drifts[0] * k for one in drawn(3)]
    right = "is right" if [entry / m for entry in printed] == exact else "is wrong as well"
    value = f"off by the factor {printed[0] / exact[0]}; with 1/m, as Table 2 has it, it {right}"
    return either(printed == exact, value)


@misprint(
    paper="Eq. 13",
    sentence="h₁ = ζ₀ = q_a",
    statement="h₁ is the term of the position without τ, where h is the number of a substep as in Table 2",
    threshold="the position after substep 1 is q_a, " + DRAWN,
)
def eq_13_h1(_: Results) -> Decision:
    rows = [position_terms(one)[1] for one in drawn(3)]
    value = f"substep 1 adds {sum(1 for term in rows[0][1:] if term)} terms to q_a. The constant a of Eq. 12 is meant"
    return either(not any(any(row[1:]) for row in rows), value)


@misprint(
    paper="Eq. 14",
    sentence="the only real solution satisfying Eq. 14 is the one originally found by [Ruth]",
    statement="Eq. 14 has one real solution, without Σ c_i = Σ d_i = 1 beside it",
    threshold=f"Ruth's coefficients with c doubled and d halved do not solve Eq. 14 to 10⁻⁸⁰, in {DIGITS} digits",
    bound=ROUNDED,
)
def eq_14_needs_sums(_: Results, rounded: float) -> Decision:
    with mp.workdps(DIGITS):
        c1, c2, d1, d2 = closed_form()
        off = max(float(abs(side - 1)) for side in eq_14(2 * c1, 2 * c2, d1 / 2, d2 / 2))
    solved = f"they solve it, off by {short(off, 1)}: c → λc and d → d/λ leave it unchanged. The sums are meant as well"
    return either(off >= rounded, solved if off < rounded else f"off by {short(off, 1)}")


@misprint(
    paper="Section 4.A",
    sentence="Solution to Eq. 10 using ABA decomposition with coefficients c₀ = c_(s+1) = 0 in Eq. 3",
    statement="The drifts of a BAB' set in Eq. 3 that are 0 are c₀ and c_(s+1)",
    threshold="the drifts of BAB's9o7H sum to 1 in all printed decimals if c_(s+1) is 0; Eq. 3 counts from "
    "c₁, the first drift",
)
def bab_prime_from_zero(results: Results) -> Decision:
    method = results.method("babps9o7h")
    *kept, _ = map(Fraction, method.drift)
    left = sum(kept, Fraction(0))
    unit = len(kept) * Fraction(1, 10**method.digits)
    value = f"one of {len(method.drift)} drifts is lost, which leaves a sum of {short(float(left))}"
    return either(abs(left - 1) <= unit, f"{value}. c₁ = c_(s+2) = 0 is meant, with s drifts between")


four_unique_or_more = misprint(
    id="four-unique-or-more",
    paper="Section 3, last paragraph, and Table 4, second heading",
    sentence="Four unique sets of splitting coefficients are presented in the following section",
    statement="BABs6o7H is unique, while Table 4 says beside it that more exist",
    threshold="one real solution with six stages and harmonic order seven, by Sturm's theorem",
    needs=("tables/derived_counts.csv",),
)(solutions(6, lambda count: count == 1, ": isolated is meant, and Table 4 is right"))
