"""Statements of Sections 1 and 2: methods of every order, signs of coefficients, symmetric compositions, stages."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from itertools import zip_longest
from math import isnan
from typing import Any

from mpmath import mp, mpf

from nearharmonic.integrators import BENCHMARKED, chin_1997, omelyan_2002, rowlands_1991
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.systems import System, henon_heiles, kepler, sho
from nearharmonic.theory.order import order_of
from nearharmonic_paper.claims.claim import Decision, Results, background, counted, either, mathematics, short, tallied
from nearharmonic_paper.claims.judging import APPROXIMATELY

#: Methods with modified kicks that were published before the paper.
FORCE_GRADIENT = tuple(
    one for module in (rowlands_1991, chin_1997, omelyan_2002) for one in module.TABLEAUS if one.modified
)
in_section_1 = partial(background, paper="Section 1")
#: Tested even orders: the free Lie algebra grows by a factor of four from one even order to the next.
EVEN_ORDERS = (2, 4, 6, 8)


@in_section_1(
    sentence="SIs of arbitrarily high even order exist and can be constructed using Lie algebra",
    statement="Composing a method three times with itself raises its order by two, and this can be repeated",
    threshold="the leapfrog has order 2. Its compositions with the weights 1/(2 - 2^(1/n)) for n = 3, 5 and 7 have the "
    "orders 4, 6 and 8. The orders are proved in the free Lie algebra",
)
def every_even_order(_: Results) -> Decision:
    found = {order: order_of(tripled(order), highest=order + 1) for order in EVEN_ORDERS}
    value = f"proved orders {', '.join(map(str, found.values()))}"
    return counted([proved == order for order, proved in found.items()], value)


def tripled(order: int) -> Tableau:
    """Compose the leapfrog three times with itself until the result has this order (Yoshida 1990, Eq. 4.14)."""
    with mp.workdps(60):
        weights = [mpf(1)]
        for n in range(3, order, 2):
            outer = 1 / (2 - mp.root(2, n))
            weights = [w * x for w in (outer, 1 - 2 * outer, outer) for x in weights]
        return leapfrogs(weights, name=f"tripled_o{order}", label=f"leapfrog, order {order}", order=order, digits=45)


def leapfrogs(weights: Sequence[Any], digits: int, **about: Any) -> Tableau:
    """Compose leapfrog steps, which begin with a drift, with symmetric weights in the precision of mpmath."""
    halves = [(a + b) / 2 for a, b in zip([mpf(0), *weights], [*weights, mpf(0)], strict=True)]
    kicks, drifts = ([mp.nstr(c, digits + 5) for c in row] for row in (weights, halves))
    middle = len(kicks) // 2
    kick, drift = palindrome(*kicks[:middle], centre=kicks[middle]), palindrome(*drifts[: middle + 1])
    source = "Yoshida (1990), doi:10.1016/0375-9601(90)90092-3"
    return Tableau(kick=kick, drift=drift, first="drift", digits=digits, source=source, **about)


@in_section_1(
    sentence="The force-gradient compositions benefit from all-positive splitting coefficients",
    statement="Fourth order methods that evaluate the force gradient have only positive coefficients",
    threshold="neither fourth order method, by Rowlands (1991) and by Chin (1997), has a negative coefficient. A "
    "splitting of order four without the force gradient always has a negative coefficient",
)
def positive_force_gradient(_: Results) -> Decision:
    least = {m.label: min(float(c) for c in (*m.kick, *m.drift)) for m in FORCE_GRADIENT}
    fourth = [m.label for m in FORCE_GRADIENT if m.order == 4]
    forward = [one for one in fourth if least[one] >= 0]
    above = [m for m in FORCE_GRADIENT if m.order > 4]
    higher = [f"; {m.label} of order {m.order} has the coefficient {least[m.label]:.2f}" for m in above]
    listed = f"methods of order four: {', '.join(forward)}{''.join(higher)}"
    return tallied((one in forward for one in fourth), listed)


@in_section_1(
    sentence="Non-gradient splitting methods of orders higher than two always involve negative coefficients",
    statement="Splitting methods of orders higher than two always involve negative coefficients",
    threshold="each registered method of order above 2 has at least one negative coefficient. A theorem (Sheng 1989, "
    "Suzuki 1991) allows no exception",
)
def negative_coefficients(results: Results) -> Decision:
    high = [method for method in results.methods.values() if method.order > 2]
    without = [m.name for m in high if not any(float(c) < 0 for c in (*m.kick, *m.drift))]
    return either(not without, f"{len(high) - len(without)} of {len(high)} registered methods of order above 2")


@mathematics(
    paper="Section 2, above Eq. 2",
    sentence="A set of real numbers exist (c₁, c₂, ..., c_k) and (d₁, d₂, ..., d_k), referred to as splitting "
    "coefficients, that satisfy Σ c_i = Σ d_i = 1",
    statement="The coefficients c sum to 1, and the coefficients d sum to 1",
    threshold="for every registered method both sums are 1 in exact arithmetic. The tolerance per coefficient is one "
    "unit of the last decimal of the source",
)
def sums_are_one(results: Results) -> Decision:
    good, worst = [], Fraction(0)
    for method in results.methods.values():
        off = max(abs(sum(map(Fraction, row), Fraction(-1))) / len(row) for row in (method.kick, method.drift))
        good.append(off <= Fraction(1, 10**method.digits))
        worst = max(worst, off)
    return tallied(good, "methods", f"; largest error of a sum {short(float(worst), 1)} per coefficient")


@mathematics(
    paper="Section 3, below Table 3",
    sentence="Symmetric coefficients omit odd order error terms",
    statement="The order of a symmetric method is even",
    threshold="for every registered symmetric method the order, the order for quadratic T and the harmonic order of "
    "the energy are even, proved in exact arithmetic. The paper's conclusion on Eq. 16 is a separate statement",
    needs=("tables/integrators.csv",),
)
def even_orders(results: Results) -> Decision:
    rows = [row for row in results.rows("integrators") if row["symmetric"] == "yes"]
    columns = ("order", "Nystrom order", "harmonic order of energy")
    odd = [row["integrator"] for row in rows if any(int(row[column]) % 2 for column in columns)]
    return counted([not odd, len(odd) < len(rows)], f"{len(rows) - len(odd)} of {len(rows)} methods")


@mathematics(
    paper="Table 1",
    sentence="Table 1 summarizes the symmetric structures of the ABA- and BAB-composition",
    statement="ABA methods have d_i = d_(k-i), c_i = c_(k+1-i), d_k = 0; BAB methods have d_i = d_(k+1-i), "
    "c_i = c_(k-i), c_k = 0",
    threshold="the coefficients of Ruth's method satisfy these equations in all decimals",
    needs=("tables/table1_structure.csv",),
)
def table_1(results: Results) -> Decision:
    rows, good = results.rows("table1_structure"), []
    for name, padding in (("ABA d", ["0"]), ("ABA c", []), ("BAB d", []), ("BAB c", ["0"])):
        column = [row[f"{name} value"] for row in rows]
        good.append(column == [*column[: len(column) - len(padding)][::-1], *padding])
    return tallied(good, "rows of Ruth's method are symmetric")


def _within(measured: str, bound: str, word: str, results: Results, most: float) -> Decision:
    """Decide whether a column of the table of structure stays within the bounds in another column, for each run."""
    pairs = [(float(row[measured]), float(row[bound])) for row in results.rows("structure")]
    shares = [one / limit for one, limit in pairs if not isnan(one)]  # asymmetric methods have no return error
    beside = f"; largest {word} {short(max(shares), 2)} of the bound"
    return tallied((share <= most for share in shares), "runs", beside)


STRUCTURE = (
    mathematics(
        id="time-reversible",
        paper="Section 2, below Eq. 3",
        sentence="SIs are time reversible if the symplectic coefficients are symmetric",
        statement="Symmetric integrators are time reversible: z(0) → z(τ) can be exactly reversed",
        threshold="n steps forward and n steps back return to the start. The return error is at most n rounding errors "
        "of a step, times the growth of errors along the run",
        bound=1.0,
        needs=("tables/structure.csv",),
    )(partial(_within, "return error", "return bound", "return error")),
    in_section_1(
        id="symplectic",
        sentence="due to their structure-preserving properties",
        statement="The integrators preserve the symplectic structure",
        threshold="JᵀΩJ = Ω for the tangent map J of each run in double-double. The bound on the defect is a random "
        "walk of the rounding errors",
        bound=1.0,
        needs=("tables/structure.csv",),
    )(partial(_within, "symplectic defect", "symplectic walk", "defect")),
)


@mathematics(
    paper="Section 2, above Table 1",
    sentence="The number of stages is defined as s = k - 1 for symmetric coefficients due to the first same as last "
    "property",
    statement="A symmetric method with k pairs of coefficients costs s = k - 1 derivative evaluations per step",
    threshold="three steps of every registered symmetric method evaluate the gradient of V 3s times, and once more if "
    "a kick comes first. A stepper that reuses the last gradient counts the evaluations. k is the length of the longer "
    "row of coefficients",
)
def first_same_as_last(results: Results) -> Decision:
    good = []
    for method in results.methods.values():
        rows = [[Fraction(c) for c in row] for row in (method.kick, method.drift)]
        if all(row == row[::-1] for row in rows):
            k = max(map(len, rows))
            good.append(gradients(method, steps=3) == 3 * (k - 1) + (len(method.kick) == k))
    return tallied(good, "methods")


def gradients(method: Tableau, steps: int) -> int:
    """Count the evaluated gradients of V = q^2/2 in some steps; the last gradient is reused while q is unchanged."""
    pairs = list(zip_longest(map(float, method.kick), map(float, method.drift), fillvalue=0.0))
    count, kept, q, p = 0, None, 1.0, 0.0
    for _ in range(steps):
        for d, c in pairs:
            if method.first == "drift":
                q += 0.1 * c * p
            if d and kept != q:
                kept, count = q, count + 1
            p -= 0.1 * d * q
            if method.first == "kick":
                q += 0.1 * c * p
    return count


@background(
    paper="Section 2, above Table 1",
    sentence="The computational cost of SIs is approximately proportional to the number of derivative evaluations "
    "(stages)",
    statement="The number of operations per step and stage is approximately equal for all ten methods",
    threshold="the number of arithmetic operations of a step is divided by the number of stages. On each system the "
    f"largest quotient of the ten methods is at most 1.26 times the smallest quotient. {APPROXIMATELY.brief}",
    bound=APPROXIMATELY.number,
)
def cost_proportional_to_stages(results: Results, most: float) -> Decision:
    ratios = {}
    for name, system in (("oscillator", sho), ("Hénon-Heiles", henon_heiles), ("Sun-Mercury", kepler)):
        costs = [operations(results.method(one), system.SYSTEM) / results.method(one).stages for one in BENCHMARKED]
        ratios[name] = max(costs) / min(costs)
    told = ", ".join(f"{name} {short(ratio)}" for name, ratio in ratios.items())
    return counted([ratio <= most for ratio in ratios.values()], f"ratio of largest to smallest quotient: {told}")


class Counted:
    """A number that counts its operations in a counter, which several numbers may share."""

    def __init__(self, counter: list[int]) -> None:
        self.counter = counter

    def _one(self, *_: object) -> Counted:
        self.counter[0] += 1
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = sqrt = _one


def operations(method: Tableau, system: System) -> int:
    """Count the operations of a step: its gradients of V, and two for each coordinate of a kick or drift."""
    counter = [0]
    q = tuple(Counted(counter) for _ in range(system.dimension))
    assert system.grad_V is not None
    system.grad_V(q, *(Counted(counter) for _ in system.parameters))
    return method.stages * counter[0] + 2 * system.dimension * (len(method.kick) + len(method.drift))
