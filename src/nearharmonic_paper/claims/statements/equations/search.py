"""The end of Section 3 and the conclusion: how solutions are found, how many there are, which are picked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from nearharmonic_paper.claims.claim import Decision, counted, either, result, tallied
from nearharmonic_paper.claims.judging import GENERALLY, SMALL
from nearharmonic_paper.claims.results import Results, require, short

DOCUMENT = ("derived/coefficients.toml",)
#: Largest kappa at which the paper's minimisation ends.
ASKED = 1e-128


def largest(*coefficients: str) -> float:
    return max(abs(float(c)) for c in coefficients)


@result(
    paper="Section 3, below Eq. 17",
    sentence="for λ_H > 5 every additional stage yields two increments of λ_max and a single increment of λ_H for "
    "which at least one real solution exists",
    statement="Every additional stage yields two increments of λ_max and one of the λ_H that a real solution has",
    threshold="with each number of stages s from five on λ_max = 2s, and a real solution with λ_H = s + 1 is found; "
    "the paper says that experiments suggest it, so no proof is asked that λ_H cannot be larger",
    needs=("tables/derived_orders.csv",),
)
def growth_of_lambda_h(results: Results) -> Decision:
    rows = [row for row in results.rows("derived_orders") if int(row["stages"]) >= 5]
    require(len(rows) > 1, "the table of reached orders has fewer than two numbers of stages from five on")
    found = [[int(row[name]) for name in ("stages", "lambda_max", "harmonic order reached")] for row in rows]
    reached = [(highest, order) == (2 * stages, stages + 1) for stages, highest, order in found]
    proved = [row["stages"] for row in rows if row["proved largest"] == "yes"]
    stages = f"s = {rows[0]['stages']} to {rows[-1]['stages']}"
    value = f"s + 1 reached for {sum(reached)} of {len(rows)}, {stages}; proved largest for s = {', '.join(proved)}"
    return either(all(reached), value)


@result(
    paper="Section 3, last paragraph",
    sentence="Solutions are provided in the following section with minimization criteria κ_max < 1e-128",
    statement="Solutions have κ_max < 10⁻¹²⁸",
    threshold="below 10⁻¹²⁸, the paper's number, for each derived set, the printed ones among them",
    bound=ASKED,
    needs=DOCUMENT,
)
def kappa_below_1e_128(results: Results, asked: float) -> Decision:
    found = [float(root["residual"]) for case in results.derived["isolated"] for root in case["roots"]]
    found += [float(one["continued"]["residual"]) for one in results.derived["printed"]]
    return tallied((residual < asked for residual in found), "solutions", f"; largest {short(max(found), 2)}")


@result(
    paper="Section 3, last paragraph",
    sentence="The minimization is performed using an adaptive simplex method minimizing only one objective κ_max",
    statement="An adaptive simplex in 2048 bits that minimises κ_max alone reaches 10⁻¹²⁸",
    threshold="κ_max below 10⁻¹²⁸, the paper's number, from at least one random start",
    bound=ASKED,
    needs=("tables/derived_routes.csv",),
)
def simplex_reaches(results: Results, asked: float) -> Decision:
    rows = [row for row in results.rows("derived_routes") if row["route"].startswith("adaptive simplex")]
    found = [float(row["largest kappa"]) for row in rows if row["start"].startswith("random")]
    require(found, "the config asks for no simplex")
    good, worst = [kappa < asked for kappa in found], max(found)
    told = f"{sum(good)} of {len(good)} promising random starts"
    return either(any(good), told if all(good) else f"{told}; the others stall at a κ_max of up to {short(worst, 2)}")


@result(
    paper="Section 3, last paragraph",
    sentence="picked among thousands of solutions based on the sum of the absolute values of the splitting "
    "coefficients and higher order SHO errors",
    statement="The sets that are not unique have a small sum of absolute values and small next terms in their families",
    threshold="no member found of the same family is better by each of the criteria: then some weighting of them leads "
    "to the choice",
    needs=("tables/derived_families.csv",),
)
def picked_by_sum_and_next_term(results: Results) -> Decision:
    rows = results.rows("derived_families")
    better = [int(row["members better in all"]) for row in rows]
    listed = _listed(rows, "members better in all")
    return tallied((count == 0 for count in better), "sets", f"; members that are better by each: {listed}")


@result(
    paper="Section 3, last paragraph",
    sentence="The non-unique solutions are picked among thousands of solutions",
    statement="The non-unique solutions are picked among thousands of solutions",
    threshold="for each of these sets at least one free parameter, and at least 2000 members of the family found",
    bound=2000.0,
    needs=("tables/derived_families.csv",),
)
def picked_among_thousands(results: Results, thousands: float) -> Decision:
    rows = results.rows("derived_families")
    good = (int(row["free parameters"]) >= 1 and int(row["members found"]) >= thousands for row in rows)
    parameters = ", ".join(sorted({row["free parameters"] for row in rows}))
    listed = _listed(rows, "members found")
    return tallied(good, "sets", f", of {parameters} parameters; members found: {listed}")


def _listed(rows: Sequence[Mapping[str, str]], column: str) -> str:
    return ", ".join(f"{row['set']} {int(row[column])}" for row in rows)


@result(
    paper="Section 6, Conclusion",
    sentence="harmonic order conditions higher than seven often introduce more negative splitting coefficients",
    statement="Harmonic order conditions higher than seven often introduce more negative coefficients",
    threshold="more than half of the real solutions of harmonic order eight with seven stages have more negative "
    f"coefficients than BABs7o7H, of harmonic order seven with seven stages; {GENERALLY.brief}",
    bound=GENERALLY.number,
    needs=DOCUMENT,
)
def above_seven_more_negative(results: Results, share: float) -> Decision:
    cases = [case for case in results.derived["isolated"] if case["equations"]["harmonic_order"] == 8]
    require(cases, "no solutions of harmonic order eight were looked for")
    method = results.method("babs7o7h")
    before = _negative([*method.kick, *method.drift])
    counts = [_negative([*root["outer"], *root["inner"]]) for root in cases[0]["roots"]]
    more = sum(count > before for count in counts)
    value = f"{more} of {len(counts)} solutions: {', '.join(map(str, sorted(counts)))} negative against {before}"
    return either(more > share * len(counts), value)


def _negative(coefficients: Sequence[str]) -> int:
    return sum(text.startswith("-") for text in coefficients)


@result(
    paper="Section 6, Conclusion",
    sentence="A larger number of stages presents more degrees of freedom resulting in more inappropriate solutions",
    statement="With more stages there are more free parameters, and more solutions with a substep that is not small",
    threshold="each number above that of one stage less: free parameters at harmonic order seven with six to nine "
    f"stages, isolated real solutions with a coefficient above 1 with five to seven; {SMALL.brief}",
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
    require(min(len(free), len(long)) > 1, "solutions of fewer than two numbers of stages were looked for")
    good = [numbers[b] > numbers[a] for numbers in (free, long) for a, b in pairwise(sorted(numbers))]
    told = (", ".join(f"{numbers[s]} with {s}" for s in sorted(numbers)) for numbers in (free, long))
    return counted(good, "free parameters {} stages; isolated solutions with a coefficient above 1: {}".format(*told))
