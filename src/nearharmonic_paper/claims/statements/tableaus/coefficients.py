"""Table 4: its coefficients, which sets are unique, what they solve, and the digit that is wrong."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from decimal import Decimal, localcontext
from functools import cache

from nearharmonic.integrators import nielsen_2015
from nearharmonic.integrators.tableau import Tableau, palindrome
from nearharmonic.theory.order import harmonic_orders_of, order_of
from nearharmonic.theory.oscillator import independent, kappa
from nearharmonic_paper.claims.claim import Decision, counted, either, finding, misprint, result, tallied
from nearharmonic_paper.claims.results import Results, short
from nearharmonic_paper.claims.statements.equations.identities import solutions

SETS = tuple(tableau.name for tableau in nielsen_2015.TABLEAUS)
FIVE_STAGES = ("abas5o6h", "abas5o6h_b", "abas5o6h_c")
UNIQUE = (*FIVE_STAGES, "babs6o7h")
#: Decimals that Table 4 prints.
DECIMALS = 76
DERIVED = ("tables/table4_derived.csv",)


def sets(results: Results) -> Iterator[Tableau]:
    return (results.method(name) for name in SETS)


@cache
def _vanish(tableau: Tableau, highest: int) -> float:
    """The largest of kappa_1 ... kappa_highest."""
    return float(max(kappa(tableau, highest)))


#: A unit of the 76th decimal, times what errors of coefficients grow by: l! sums of up to 2^l products, l <= 7.
PRINTED_ZERO = 1e-70
BELOW_ZERO = "below 10⁻⁷⁰: 76 printed decimals leave 10⁻⁷⁶, κ₇ multiplies their errors by 7!, and the rest is a margin"


@result(
    paper="Table 4 and Eq. 17",
    sentence="Solution to Eq. 10 using BAB decomposition",
    statement="κ₁ to κ_(λ_H) vanish for each of the ten sets",
    threshold=f"each of them {BELOW_ZERO}",
    bound=PRINTED_ZERO,
)
def table_4_solves(results: Results, zero: float) -> Decision:
    left = {t.label: _vanish(t, t.harmonic_order or 0) for t in sets(results)}
    worst = max(left, key=left.__getitem__)
    beside = f"; largest term {short(left[worst], 2)}, of {worst}"
    return tallied((one < zero for one in left.values()), "sets", beside)


@result(
    paper="Abstract, of Table 4",
    sentence="Efficient fourth order symplectic integrators are proposed for numerical integration of separable "
    "Hamiltonian systems",
    statement="The ten sets are of fourth order",
    threshold="order 4 and no more for any separable Hamiltonian, proved in the free Lie algebra",
)
def table_4_fourth_order(results: Results) -> Decision:
    return tallied((order_of(t, highest=5) == 4 for t in sets(results)), "sets")


@result(
    paper="Section 4.A and Abstract",
    sentence="Splitting coefficients with five to nine stages are presented in Table 4",
    statement="Splitting coefficients with five to nine stages are presented",
    threshold="the ten sets have 5, 6, 7, 8 or 9 stages, and each of these numbers occurs",
)
def table_4_stages(results: Results) -> Decision:
    found = sorted({t.stages for t in sets(results)})
    return either(found == [5, 6, 7, 8, 9], ", ".join(map(str, found)))


@result(
    paper="Section 4.A",
    sentence="The naming convention of the obtained methods is [scheme]s[stages]o[order]H",
    statement="The sets are named [scheme]s[stages]o[harmonic order]H",
    threshold="each name states the composition, the stages and the proved harmonic order of the position",
)
def table_4_names(results: Results) -> Decision:
    good = []
    for t in sets(results):
        scheme, stages, order = re.findall(r"^(ABA|BAB'?)s(\d)o(\d)H", t.label)[0]
        found = (t.stages, harmonic_orders_of(t).position, t.first)
        good.append(found == (int(stages), int(order), "drift" if scheme == "ABA" else "kick"))
    return tallied(good, "names")


@result(
    paper="Table 4",
    sentence="Obtained splitting coefficients with 77 digits",
    statement="The coefficients are printed with 77 digits",
    threshold="76 decimals each; the paper counts the 0 before the point as the 77th digit",
)
def table_4_77_digits(results: Results) -> Decision:
    values = [value for t in sets(results) for _, _, value in independent(t)]
    good = (len(value.partition(".")[2]) == DECIMALS for value in values)
    return tallied(good, f"coefficients have {DECIMALS} decimals and the 0 in front")


def _wrong_digits(results: Results) -> tuple[list[str], int]:
    """The printed coefficients that are not those derived, and the number of all."""
    rows = results.rows("table4_derived")
    return [f"{r['coefficient']} of {r['set']}" for r in rows if r["agreeing decimals"] != str(DECIMALS)], len(rows)


C3 = "c(3) of BAB's8o7H"


@result(
    paper="Table 4",
    sentence="Obtained splitting coefficients with 77 digits",
    statement=f"Each printed coefficient but {C3} is right to its last digit",
    threshold="off by less than a unit of the 76th decimal: the 17 coefficients of unique sets from those derived from "
    "random starts, the others from the printed set continued to 128 digits by Newton's method",
    needs=DERIVED,
)
def table_4_derived(results: Results) -> Decision:
    wrong, count = _wrong_digits(results)
    bad = [name for name in wrong if name != C3]
    good = count - 1 - len(bad)
    return counted([not bad, good > 0], f"{good} of {count - 1}" + (f"; not {', '.join(bad)}" if bad else ""))


@misprint(
    paper="Table 4, BAB's8o7H",
    sentence="c(3) =-0.0149646736494517061945681450558142918831874360003431672632178480031079700216",
    statement=f"{C3} ends in 0216",
    threshold="off by less than a unit of the 76th decimal from the printed set continued to 128 digits by Newton's "
    "method, which changes no digit of the other coefficients. None of these, moved by up to 12 units of its last "
    "decimal, brings the largest of κ₁ to κ₇ below 1.4 × 10⁻⁷⁴",
    needs=DERIVED,
)
def table_4_c3(results: Results) -> Decision:
    rows = [r for r in results.rows("table4_derived") if f"{r['coefficient']} of {r['set']}" == C3]
    ((printed, derived, decimals),) = [(row["printed"], row["derived"], row["agreeing decimals"]) for row in rows]
    found = derived[: len(printed)]
    method = results.method("babps8o7h")
    left = [_vanish(one, 7) for one in (method, _with_inner(method, 2, found))]
    value = (
        f"printed ...{printed[-8:]}, continued ...{found[-8:]}{_first_change(printed, found)}; with the latter the "
        f"largest of κ₁ to κ₇ is {short(left[1], 2)} in place of {short(left[0], 2)}"
    )
    return either(decimals == str(DECIMALS), value)


def _first_change(printed: str, found: str) -> str:
    """The first decimal in which two decimal fractions differ, in words; nothing if none does."""
    places = [i for i, (a, b) in enumerate(zip(printed, found, strict=True)) if a != b]
    if not places:
        return ""
    i = places[0]
    return f": decimal {i - printed.index('.')} is {found[i]}, not {printed[i]}"


def _with_inner(method: Tableau, index: int, text: str) -> Tableau:
    """``method`` with another coefficient in its even inner row, the middle ones keeping the sum 1."""
    half = [*method.inner[: len(method.inner) // 2]]
    half[index] = text
    with localcontext(prec=100):
        half[-1] = str(Decimal("0.5") - sum(map(Decimal, half[:-1]), Decimal(0)))
    row = palindrome(*half)
    return replace(method, drift=row) if method.first == "kick" else replace(method, kick=row)


@result(
    paper="Section 3, last paragraph, and Table 4",
    sentence="Four unique sets of splitting coefficients are presented in the following section",
    statement="Four of the sets are unique: ABAs5o6H A, B, C and BABs6o7H. A unique set is an isolated solution, not a "
    "member of a family",
    threshold="each is one of the isolated real solutions, proved to exist, in all 76 decimals",
    needs=("derived/coefficients.toml",),
)
def four_unique_sets(results: Results) -> Decision:
    found = {one["name"]: one["decimals"] for one in results.derived["agreements"]}
    return tallied((found.get(name) == DECIMALS for name in UNIQUE), "sets")


COUNTS = (
    finding(
        id="five-stage-solutions",
        paper="Table 4, first and second heading",
        sentence="Unique ABAs5o6H, A, B and C",
        statement="With five stages and harmonic order six there are four real solutions; the paper presents three",
        threshold="four real solutions, counted by elimination and Sturm's theorem, which miss none",
        needs=("tables/derived_counts.csv",),
    )(solutions(5, lambda count: count == 4, " with five stages")),
    result(
        id="six-stage-solutions",
        paper="Table 4, second heading",
        sentence="Unique BABs6o7H (more exist)",
        statement="BABs6o7H is not the only isolated solution with six stages and harmonic order seven",
        threshold="more than one real solution, counted by elimination and Sturm's theorem",
        needs=("tables/derived_counts.csv",),
    )(solutions(6, lambda count: count > 1, " with six stages")),
)


@result(
    paper="Section 4.A",
    sentence="Unique solutions satisfy both the ABA and BAB decompositions",
    statement="Unique solutions satisfy both the ABA and BAB decompositions",
    threshold=f"κ₁ to κ_(λ_H) of both compositions, each {BELOW_ZERO}",
    bound=PRINTED_ZERO,
)
def unique_sets_solve_both(results: Results, zero: float) -> Decision:
    left = {}
    for t in map(results.method, UNIQUE):
        left[t.label] = max(_vanish(t.role(first), t.harmonic_order or 0) for first in ("drift", "kick"))
    bad = ", ".join(f"{label} has a term of {short(one, 2)}" for label, one in left.items() if one >= zero)
    return tallied((one < zero for one in left.values()), "sets", f"; {bad}" if bad else "")


def _sides(results: Results, *, prime: bool) -> Decision:
    """Decide whether each BAB or BAB' set has the momentum, the position if ``prime``, of lower order."""
    good, told = [], []
    for t in sets(results):
        if t.first == "kick" and ("'" in t.label) == prime:
            found = harmonic_orders_of(t)
            good.append(found.position < found.momentum if prime else found.momentum < found.position)
            told.append(f"{t.label} q {found.position}, p {found.momentum}")
    return tallied(good, f"sets: {'; '.join(told)}")


SIDES = (
    result(
        id="bab-leaves-p",
        paper="Section 4.A",
        sentence="the error of p_(s+1) remains unaddressed for the BAB solution",
        statement="The conditions of a BAB set leave the momentum a lower harmonic order than the position",
        threshold="the proved harmonic order of p below that of q, for the BAB sets of Table 4",
    )(lambda results: _sides(results, prime=False)),
    result(
        id="bab-prime-leaves-q",
        paper="Section 4.A",
        sentence="as opposed to BAB' solution where the error of q_(s+1) remains unaddressed",
        statement="The conditions of a BAB' set leave the position a lower harmonic order than the momentum",
        threshold="the proved harmonic order of q below that of p, for the BAB' sets of Table 4. BAB's7o6H tells "
        "nothing: terms of even order are equal for q and p",
    )(lambda results: _sides(results, prime=True)),
)
