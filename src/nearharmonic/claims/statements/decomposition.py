"""Section 3: the decomposition of the harmonic oscillator, Equations 6 and 13 to 16, Tables 2 and 3, their errata."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise

from nearharmonic.claims.claim import Decision, claim, counted, either
from nearharmonic.claims.results import Results, short
from nearharmonic.exact.polynomials import real_root_count, sturm_chain
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.theory.oscillator import step_polynomials
from nearharmonic.theory.recursion import kicks_and_drifts

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
ROUNDED = 1e-14
ROUNDING = "equal to 1e-14: the tables hold doubles, rounded to 1e-16, of sums with terms up to 3"


@claim(
    id="c-n-below-eq-6",
    paper="Section 3, below Eq. 6",
    statement="C_n = c_(n+1)/c_n in the recursion of Eq. 6",
    threshold="the position that the recursion gives for Ruth's method, against the product of its shears, exact but "
    "for the 76 decimals of the coefficients",
)
def c_n_as_printed(results: Results) -> Decision:
    method = results.method("ruth").role("kick")
    exact = _even_part(method)
    printed, mended = (_recursion(method, shifted=shifted)[0 : len(exact)] for shifted in (1, 0))
    off = max(abs(float(a - b)) for a, b in zip(printed, exact, strict=True))
    right = max(abs(float(a - b)) for a, b in zip(mended, exact, strict=True))
    value = f"C_n as printed is off by {short(off)} in a term of the position, c_n/c_(n-1) by {short(right)}"
    return either(off < 1e-60, value)


def _even_part(method: Tableau) -> list[Fraction]:
    return list(step_polynomials(method).K11[: 2 * method.stages + 1])


def _recursion(method: Tableau, *, shifted: int) -> list[Fraction]:
    """The new position from q_a = 1, p_a = 0 by Eq. 6, C_n read ``shifted`` places further along the drifts."""
    kicks, drifts = kicks_and_drifts(method)
    # After the last drift comes the first of the next iteration.
    ratios = [b / a for a, b in pairwise([*drifts, drifts[0]])]
    width = 2 * len(drifts) + 1
    before = [Fraction(1)] + [Fraction(0)] * (width - 1)
    now = [Fraction(1), Fraction(0), -drifts[0] * kicks[0], *[Fraction(0)] * (width - 3)]
    for h in range(1, len(drifts)):
        C, D = ratios[h - 1 + shifted], -drifts[h] * kicks[h]
        force = [Fraction(0), Fraction(0), *now]
        before, now = now, [(1 + C) * a - C * b + D * f for a, b, f in zip(now, before, force, strict=False)]
    return now


@claim(
    id="eq-6-rounding",
    paper="Section 3, below Eq. 6",
    statement="Eq. 6 yields significantly larger errors than Eq. 5 and is not suitable for practical implementation",
    threshold="the largest energy error of 1000 steps of BABs7o7H on the oscillator at τ/s = 0.003, where that of the "
    "method is below rounding, at least ten times that of Eq. 5; both in doubles without compensation",
)
def eq_6_rounding(results: Results) -> Decision:
    method = results.method("babs7o7h").role("kick")
    tau = 0.003 * method.stages
    shears, eliminated = _largest_error(method, tau, _by_eq_5), _largest_error(method, tau, _by_eq_6)
    value = f"{short(eliminated)} against {short(shears)} of Eq. 5"
    return either(eliminated >= 10 * shears, value)


State = tuple[float, float]


def _largest_error(method: Tableau, tau: float, step: Callable[[Tableau, float, State], State]) -> float:
    """The largest |H - H0|/H0 of 1000 steps from (q, p) = (1, -1)."""
    state, largest = (1.0, -1.0), 0.0
    for _ in range(1000):
        state = step(method, tau, state)
        largest = max(largest, abs((state[0] ** 2 + state[1] ** 2) / 2 - 1))
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


@claim(
    id="table-2",
    paper="Table 2",
    statement="The entries of the three stage BAB decomposition, up to tau^6",
    threshold="each of the 16 entries is the term that the project's recursion forms, and the last row with numbers is "
    f"the product of the shears of Ruth's method, {ROUNDING}",
    needs=("tables/table2_recursion.csv", "tables/table2_values.csv"),
)
def table_2(results: Results) -> Decision:
    ours = results.rows("table2_recursion")
    same = [
        cell == row.get(f"tau^{power}")
        for printed, row in zip(TABLE_2, ours, strict=False)
        for power, cell in enumerate(printed)
    ]
    last = results.rows("table2_values")[len(TABLE_2) - 1]
    K = step_polynomials(results.method("ruth").role("kick"))
    right = [
        abs(float(last[f"tau^{power}"]) - float((K.K12 if power % 2 else K.K11)[power])) < ROUNDED for power in range(7)
    ]
    return counted([*same, *right], f"{sum(same)} of {len(same)} entries, {sum(right)} of {len(right)} numbers")


@claim(
    id="eq-13",
    paper="Eq. 13",
    statement="zeta_1 to zeta_4 of three stages in terms of c and d",
    threshold=f"the formulas with Ruth's coefficients against the numbers of Table 2, {ROUNDING}",
    needs=("tables/table2_values.csv",),
)
def eq_13(results: Results) -> Decision:
    outer, inner = results.method("ruth").rows_double()
    (d1, d2), (c1, c2) = outer[:2], inner[:2]
    formulas = (
        2 * c1 + c2,
        -(d1 + d2) * (2 * c1 + c2),
        -2 * c1 * d2 * (c1 + c2),
        c1 * d2 * (2 * c1 * d1 + 2 * c2 * d1 + c2 * d2),
    )
    last = results.rows("table2_values")[3]
    off = [abs(formula - float(last[f"tau^{power}"])) for power, formula in enumerate(formulas, start=1)]
    return counted([one < ROUNDED for one in off], f"largest difference {short(max(off))}")


@claim(
    id="eq-14-only-solution",
    paper="Eq. 14",
    statement="The only real solution of Eq. 14 is the one found by Ruth",
    threshold="with both sums 1, Eq. 14 leaves 6 c^3 - 12 c^2 + 6 c - 1 = 0 for c_1; its real roots are counted by "
    "Sturm's theorem, and Ruth's c_1 must be one within its 76 decimals",
)
def eq_14(results: Results) -> Decision:
    polynomial = [-1, 6, -12, 6]
    count = real_root_count(sturm_chain(polynomial))
    c1 = Fraction(results.method("ruth").inner[0])
    left = abs(sum((a * c1**k for k, a in enumerate(polynomial)), Fraction(0)))
    value = f"{count} real root; at Ruth's c_1 the polynomial is {short(float(left), 1)}"
    return either(count == 1 and left < Fraction(1, 10**70), value)


@claim(
    id="eq-15",
    paper="Eq. 15",
    statement="d_1 = 1/(2 (2 - 2^(1/3))) = 1/2 - d_2, c_1 = 1/(2 - 2^(1/3)) = (1 - c_2)/2",
    threshold="every coefficient of Ruth's method within a unit of its last, 76th decimal",
)
def eq_15(results: Results) -> Decision:
    from mpmath import mp, mpf

    method = results.method("ruth")
    with mp.workdps(90):
        c1 = 1 / (2 - mp.cbrt(2))
        expected = [c1 / 2, (1 - c1) / 2, (1 - c1) / 2, c1 / 2, c1, 1 - 2 * c1, c1]
        off = [abs(mpf(c) - e) for c, e in zip((*method.outer, *method.inner), expected, strict=False)]
        good = len(off) == 7 and max(off) <= mpf(10) ** -76
        return either(good, f"largest difference {mp.nstr(max(off), 1)}")


@claim(
    id="table-3",
    paper="Table 3",
    statement="Closed sums of the tau^2 column, for every h",
    threshold=f"against the recursion of Table 2 for Ruth's method, {ROUNDING}",
    needs=("tables/table3_even_orders.csv",),
)
def table_3(results: Results) -> Decision:
    off = _differences(results, "tau^2", "tau^2 of Table 2")
    return counted([one < ROUNDED for one in off], f"largest difference in {len(off)} rows {short(max(off))}")


@claim(
    id="table-3-inner-limit",
    paper="Table 3",
    statement="The inner sum of the tau^4 column runs to h - 1",
    threshold=f"against the recursion of Table 2 for Ruth's method, {ROUNDING}",
    needs=("tables/table3_even_orders.csv",),
)
def table_3_inner_limit(results: Results) -> Decision:
    off = _differences(results, "tau^4 as printed", "tau^4 of Table 2")
    return either(max(off) < ROUNDED, f"off by up to {short(max(off))}; Eq. 16, where the sum runs to h, is right")


@claim(
    id="eq-16",
    paper="Eq. 16",
    statement="zeta_2 = -1/2! and zeta_4 = 1/4! as sums, the inner one to h",
    threshold=f"for Ruth's method, which is of fourth order, {ROUNDING}",
    needs=("tables/table3_even_orders.csv",),
)
def eq_16(results: Results) -> Decision:
    last = results.rows("table3_even_orders")[-1]
    off = [abs(float(last["tau^2"]) + 1 / 2), abs(float(last["tau^4"]) - 1 / 24)]
    return either(max(off) < ROUNDED, f"off by {short(off[0])} and {short(off[1])}")


def _differences(results: Results, one: str, other: str) -> Sequence[float]:
    return [abs(float(row[one]) - float(row[other])) for row in results.rows("table3_even_orders")]


@claim(
    id="harmonic-four-is-four",
    paper="Section 3, below Eq. 16",
    statement="Coefficients that solve the oscillator to fourth order are of fourth order for any separable H",
    threshold="every registered method whose harmonic order of the position is 4 or more has a proved order of 4 or "
    "more; one exception would refute it",
    needs=("tables/integrators.csv",),
)
def harmonic_four_is_four(results: Results) -> Decision:
    rows = [row for row in results.rows("integrators") if int(row["harmonic order of position"]) >= 4]
    bad = [row["integrator"] for row in rows if int(row["order"]) < 4]
    return either(bool(rows) and not bad, f"{len(rows) - len(bad)} of {len(rows)} methods")
