"""Section 3: decomposition of a step and its consequences, Equations 6 and 14, Table 2."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from nearharmonic.exact.polynomials import real_root_count, sturm_chain
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory.oscillator import step_polynomials
from nearharmonic_paper.claims.claim import Decision, counted, either, mathematics, result
from nearharmonic_paper.claims.judging import NOT_SUITABLE, SIGNIFICANTLY
from nearharmonic_paper.claims.results import Results, once, short

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

#: A number of a table is a double, rounded once; sums of a few of them may be off by a few units of its last place.
DOUBLE = 1e-14
ROUNDING = "equal to 10⁻¹⁴: the tables hold doubles, rounded to 10⁻¹⁶, of sums with terms up to 3"


@result(
    paper="Section 3, below Eq. 6",
    sentence="Eq. 6 yields significantly larger truncation errors than Eq. 5 and is therefore not suitable for "
    "practical implementation",
    statement="Eq. 6 yields significantly larger errors than Eq. 5 and is not suitable for practical implementation",
    threshold="the largest energy error of Eq. 6 at least ten times that of Eq. 5: 1000 steps of BABs7o7H on the "
    "oscillator at τ/s = 0.003, where its truncation is below rounding, in doubles without compensation; "
    f"{NOT_SUITABLE.brief}; {SIGNIFICANTLY.brief}. The paper calls rounding truncation",
    bound=NOT_SUITABLE.number,
)
def eq_6_rounding(results: Results, factor: float) -> Decision:
    shears, eliminated = (_largest_error(results, step) for step in (_by_eq_5, _by_eq_6))
    value = f"{short(eliminated)} against {short(shears)} of Eq. 5"
    return either(eliminated >= factor * shears, value)


State = tuple[float, float]


@once
def _largest_error(results: Results, step: Callable[[Tableau, float, State], State]) -> float:
    """The largest |H - H0|/H0 of 1000 steps of BABs7o7H from (q, p) = (1, -1)."""
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
    statement="The entries of Table 2 are right, up to τ⁶",
    threshold="each of the 16 entries is that of the recursion of Eq. 6; with Ruth's coefficients the last row is the "
    f"product of his kicks and drifts, {ROUNDING}",
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
    threshold="with both sums 1, Eq. 14 leaves 6c³ - 12c² + 6c - 1 = 0 for c₁: one real root by Sturm's theorem, which "
    "is Ruth's c₁ within its 76 decimals",
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
    statement="Coefficients that solve the oscillator to fourth order are of fourth order for any separable H",
    threshold="every registered symmetric method whose position has harmonic order 4 or more has order 4 or more, "
    "proved in the free Lie algebra; for symmetric sets both ask for two independent conditions",
    needs=("tables/integrators.csv",),
)
def harmonic_four_is_four(results: Results) -> Decision:
    rows = [row for row in results.rows("integrators") if row["symmetric"] == "yes"]
    rows = [row for row in rows if int(row["harmonic order of position"]) >= 4]
    bad = [row["integrator"] for row in rows if int(row["order"]) < 4]
    return either(bool(rows) and not bad, f"{len(rows) - len(bad)} of {len(rows)} methods")
