"""Table 4: its coefficients, which sets are unique, what they solve, and the digit that is wrong."""

from __future__ import annotations

import re
from collections.abc import Iterator

from nearharmonic.claims.claim import Decision, claim, counted, either
from nearharmonic.claims.results import Results, short
from nearharmonic.integrators import nielsen_2015
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.theory.order import harmonic_orders_of, order_of
from nearharmonic.theory.oscillator import kappa
from nearharmonic.theory.table_4 import independent

SETS = tuple(tableau.name for tableau in nielsen_2015.TABLEAUS)
FIVE_STAGES = ("abas5o6h", "abas5o6h_b", "abas5o6h_c")
UNIQUE = (*FIVE_STAGES, "babs6o7h")
#: Decimals that Table 4 prints.
DECIMALS = 76
OTHER: dict[First, First] = {"drift": "kick", "kick": "drift"}
DERIVED = ("tables/table4_derived.csv",)


def _sets(results: Results) -> Iterator[Tableau]:
    return (results.method(name) for name in SETS)


def _vanish(tableau: Tableau, highest: int) -> float:
    """The largest of kappa_1 ... kappa_highest."""
    return float(max(kappa(tableau, highest)))


#: A unit of the 76th decimal, times what errors of coefficients grow by: l! sums of up to 2^l products, l <= 7.
PRINTED_ZERO = 1e-70
ZERO = "below 1e-70: the printed 76 decimals, times the 7! by which kappa_7 multiplies their errors, and a margin"


@claim(
    id="table-4-solves",
    paper="Table 4 and Eq. 17",
    statement="kappa_1 to kappa_lambda_H vanish for each of the ten sets",
    threshold=f"{ZERO}; computed in exact arithmetic from the printed decimals",
)
def table_4_solves(results: Results) -> Decision:
    left = {t.label: _vanish(t, t.harmonic_order or 0) for t in _sets(results)}
    good = [one < PRINTED_ZERO for one in left.values()]
    worst = max(left, key=left.__getitem__)
    return counted(good, f"{sum(good)} of {len(good)} sets; largest term {short(left[worst], 2)}, of {worst}")


@claim(
    id="table-4-fourth-order",
    paper="Table 4",
    statement="The ten sets are of fourth order",
    threshold="order 4 and no more for any separable Hamiltonian, proved in the free Lie algebra",
)
def table_4_fourth_order(results: Results) -> Decision:
    orders = {t.label: order_of(t, highest=5) for t in _sets(results)}
    good = [order == 4 for order in orders.values()]
    return counted(good, f"{sum(good)} of {len(good)} sets")


@claim(
    id="table-4-stages",
    paper="Section 4.A and Abstract",
    statement="Splitting coefficients with five to nine stages are presented",
    threshold="the numbers of stages of the sets, exactly 5 to 9",
)
def table_4_stages(results: Results) -> Decision:
    found = sorted({t.stages for t in _sets(results)})
    return either(found == [5, 6, 7, 8, 9], ", ".join(map(str, found)))


@claim(
    id="table-4-names",
    paper="Section 4.A",
    statement="The sets are named [scheme]s[stages]o[harmonic order]H",
    threshold="stages and the proved harmonic order of the position, for each set",
)
def table_4_names(results: Results) -> Decision:
    good = []
    for t in _sets(results):
        scheme, stages, order = re.findall(r"^(ABA|BAB'?)s(\d)o(\d)H", t.label)[0]
        found = (t.stages, harmonic_orders_of(t).position, t.first)
        good.append(found == (int(stages), int(order), "drift" if scheme == "ABA" else "kick"))
    return counted(good, f"{sum(good)} of {len(good)} names")


@claim(
    id="table-4-77-digits",
    paper="Table 4",
    statement="The coefficients are given with 77 digits",
    threshold="76 decimals each, which are 77 digits with the 0 in front",
)
def table_4_77_digits(results: Results) -> Decision:
    values = [value for t in _sets(results) for _, _, value in independent(t)]
    good = [len(value.partition(".")[2]) == DECIMALS for value in values]
    return counted(good, f"{sum(good)} of {len(good)} coefficients have {DECIMALS} decimals")


@claim(
    id="table-4-derived",
    paper="Table 4",
    statement="Each printed coefficient is right to its last digit",
    threshold="against the coefficients derived from random starts, continued to 128 digits: all 76 printed decimals "
    "agree, with less than a unit of the last",
    needs=DERIVED,
    target="derive",
)
def table_4_derived(results: Results) -> Decision:
    agreeing = {
        f"{row['coefficient']} of {row['set']}": row["agreeing decimals"] for row in results.rows("table4_derived")
    }
    bad = [name for name, decimals in agreeing.items() if decimals != str(DECIMALS)]
    value = f"{len(agreeing) - len(bad)} of {len(agreeing)} coefficients"
    tail = f"; not {', '.join(bad)}" if bad else ""
    return counted([not bad, len(bad) < len(agreeing)], value + tail)


@claim(
    id="table-4-c3",
    paper="Table 4, BAB's8o7H",
    statement="c(3) of BAB's8o7H ends in 0216",
    threshold="against the derived coefficient: less than a unit of the 76th decimal",
    needs=DERIVED,
    target="derive",
)
def table_4_c3(results: Results) -> Decision:
    rows = [r for r in results.rows("table4_derived") if r["set"] == "BAB's8o7H" and r["coefficient"] == "c(3)"]
    ((printed, derived, decimals),) = [(row["printed"], row["derived"], row["agreeing decimals"]) for row in rows]
    value = (
        f"printed ...{printed[-8:]}, derived ...{derived[len(printed) - 8 : len(printed)]}: {decimals} decimals agree"
    )
    return either(decimals == str(DECIMALS), value)


@claim(
    id="four-unique-sets",
    paper="Section 3, last paragraph, and Table 4",
    statement="Four of the sets are unique: ABAs5o6H A, B, C and BABs6o7H",
    threshold="each is one of the isolated real solutions whose existence is proved, in all 76 decimals",
    needs=("derived/coefficients.toml",),
    target="derive",
)
def four_unique_sets(results: Results) -> Decision:
    found = {one["name"]: one["decimals"] for one in results.derived["agreements"]}
    good = [found.get(name) == DECIMALS for name in UNIQUE]
    return counted(good, f"{sum(good)} of {len(good)} sets")


@claim(
    id="five-stage-solutions",
    paper="Table 4, first and second heading",
    statement="A, B and C are the sets with five stages: more are said to exist with six only",
    threshold="three real solutions, by elimination and Sturm's theorem, which miss none",
    needs=("tables/derived_counts.csv",),
    target="derive",
)
def five_stage_solutions(results: Results) -> Decision:
    counts = {row["stages"]: row["real solutions by Sturm"] for row in results.rows("derived_counts")}
    value = f"{counts['5']} real solutions with five stages, {counts['6']} with six"
    return either(counts["5"] == "3", value)


@claim(
    id="unique-sets-solve-both",
    paper="Section 4.A",
    statement="Unique solutions satisfy both the ABA and BAB decompositions",
    threshold=f"kappa_1 to kappa_lambda_H of either composition {ZERO}",
)
def unique_sets_solve_both(results: Results) -> Decision:
    left = {}
    for t in map(results.method, UNIQUE):
        left[t.label] = max(_vanish(t.role(first), t.harmonic_order or 0) for first in ("drift", "kick"))
    good = [one < PRINTED_ZERO for one in left.values()]
    bad = ", ".join(f"{label} has a term of {short(one, 2)}" for label, one in left.items() if one >= PRINTED_ZERO)
    return counted(good, f"{sum(good)} of {len(good)} sets" + (f"; {bad}" if bad else ""))


@claim(
    id="bab-and-bab-prime",
    paper="Section 4.A",
    statement="The error of p remains unaddressed for BAB, that of q for BAB'",
    threshold="the proved harmonic order of the momentum is below that of the position for the BAB sets of Table 4, "
    "and above it for the BAB' sets",
)
def bab_and_bab_prime(results: Results) -> Decision:
    good, told = [], []
    for t in _sets(results):
        if t.first == "kick":
            found = harmonic_orders_of(t)
            prime = "'" in t.label
            good.append(found.momentum > found.position if prime else found.momentum < found.position)
            told.append(f"{t.label} q {found.position}, p {found.momentum}")
    return counted(good, f"{sum(good)} of {len(good)} sets: {'; '.join(told)}")


@claim(
    id="near-forward",
    paper="Section 1, last paragraph",
    statement="The presented coefficients generally have small absolute values",
    threshold="the largest of each set below the largest of Ruth's method and of Yosh s7o6 A",
)
def near_forward(results: Results) -> Decision:
    def largest(name: str) -> float:
        method = results.method(name)
        return max(abs(float(c)) for c in (*method.kick, *method.drift))

    bound = min(largest("ruth"), largest("yoshida_s7o6a"))
    sizes = {results.method(name).label: largest(name) for name in SETS}
    good = [size < bound for size in sizes.values()]
    value = f"{sum(good)} of {len(good)} sets below {short(bound)}"
    return counted(good, f"{value}; from {short(min(sizes.values()))} to {short(max(sizes.values()))}")
