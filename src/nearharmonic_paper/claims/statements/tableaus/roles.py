"""Roles of the rows of Table 4, and their effect on the errors."""

from __future__ import annotations

from nearharmonic_paper.claims.claim import Decision, counted, misprint, result
from nearharmonic_paper.claims.judging import DOT, GREATLY
from nearharmonic_paper.claims.results import Results, label, require, short
from nearharmonic_paper.claims.statements.tableaus.coefficients import FIVE_STAGES

TABLES = ("tables/derived_errors.csv", "tables/derived_solutions.csv")


#: The first d that Table 4 prints for each set with five stages.
PRINTED_D1 = {"abas5o6h": "0.15585935", "abas5o6h_b": "0.40201960", "abas5o6h_c": "0.18685656"}


@misprint(
    paper="Section 2, above Table 1, and Table 4",
    sentence="the c and d coefficients are consistently used in connection with the ∂T/∂p and ∂V/∂q term respectively",
    statement="In Table 4 c always multiplies ∂T/∂p and d always ∂V/∂q",
    threshold="d(1) is the first kick of each ABA set. By Table 1 an ABA method has one c more than d; the sets with "
    "five stages are printed with six d and five c",
)
def table_4_columns(results: Results) -> Decision:
    rows = {name: results.method(name).kick for name in PRINTED_D1}
    good = [rows[name][0].startswith(first) for name, first in PRINTED_D1.items()]
    return counted(good, f"in {sum(good)} of {len(good)} sets: as ABA they have {len(rows['abas5o6h'])} kicks, not six")


@result(
    paper="Section 5, Discussion",
    sentence="the integrator performance may change drastically if the roles of T and V are switched",
    statement="The performance may change drastically if the roles of T and V are switched",
    threshold="maximum error of ABAs5o6H on the Hénon-Heiles system at least ten times larger with T and V exchanged, "
    f"at each of three τ/s; {GREATLY.brief}",
    bound=GREATLY.number,
    needs=TABLES,
)
def roles_switched(results: Results, factor: float) -> Decision:
    ratios = _kick_over_drift(results, "abas5o6h")
    listed = ", ".join(f"{short(ratio)} at τ/s = {tau}" for tau, ratio in ratios.items())
    return counted([ratio >= factor for ratio in ratios.values()], listed)


@result(
    paper="Section 4.A",
    sentence="the performance of the presented solutions depends on the applied scheme",
    statement="The performance of unique solutions depends on the applied scheme",
    threshold="maximum errors of ABAs5o6H A, B and C on the Hénon-Heiles system a tenth of a decade apart or more as "
    "ABA and as BAB, at each of three τ/s: visible in a figure",
    bound=DOT,
    needs=TABLES,
)
def performance_depends_on_scheme(results: Results, dot: float) -> Decision:
    good, told = [], []
    for name in FIVE_STAGES:
        ratios = _kick_over_drift(results, name).values()
        good += [max(ratio, 1 / ratio) >= dot for ratio in ratios]
        told.append(f"{label(name)} {short(min(ratios), 2)} to {short(max(ratios), 2)}")
    return counted(good, f"error as BAB over that as ABA: {', '.join(told)}")


def _kick_over_drift(results: Results, name: str) -> dict[str, float]:
    """Maximum error of a set with five stages kick first over that drift first, by step size per stage."""
    start = f"{float(results.method(name).outer[0]):.8f}"
    found = [
        row["solution"]
        for row in results.rows("derived_solutions")
        if row["stages"] == "5" and row["half of the outer row"].startswith(start)
    ]
    require(found, f"the derived solutions lack {label(name)}")
    errors = {
        (row["first"], row["tau/s"]): float(row["max error, Henon-Heiles"])
        for row in results.rows("derived_errors")
        if row["solution"] == found[0]
    }
    return {tau: errors["kick", tau] / error for (first, tau), error in errors.items() if first == "drift"}
