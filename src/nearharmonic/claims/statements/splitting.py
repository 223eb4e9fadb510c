"""Sections 1 and 2: signs of coefficients, symmetric compositions, stages."""

from __future__ import annotations

from fractions import Fraction

from nearharmonic.claims.claim import Decision, claim, counted, either
from nearharmonic.claims.curves import Curves
from nearharmonic.claims.results import Results, Undecided, short

PAPER_CUBES = ("cubes/sho.h5", "cubes/henon_heiles.h5", "cubes/kepler.h5")


@claim(
    id="negative-coefficients",
    paper="Section 1",
    statement="Splitting methods of orders higher than two always involve negative coefficients",
    threshold="one negative coefficient at least in each registered method whose order is above 2; a theorem "
    "(Sheng 1989, Suzuki 1991), so that none may lack it",
)
def negative_coefficients(results: Results) -> Decision:
    high = [method for method in results.methods.values() if method.order > 2]
    without = [m.name for m in high if not any(float(c) < 0 for c in (*m.kick, *m.drift))]
    return either(not without, f"{len(high) - len(without)} of {len(high)} registered methods of order above 2")


@claim(
    id="sums-are-one",
    paper="Section 2, above Eq. 2",
    statement="The coefficients of each operator sum to 1",
    threshold="exactly, within a unit of the last decimal that the source guarantees for each coefficient, for every "
    "registered method",
)
def sums_are_one(results: Results) -> Decision:
    off = {
        method.name: max(abs(sum(map(Fraction, row), Fraction(-1))) / len(row) for row in (method.kick, method.drift))
        for method in results.methods.values()
    }
    good = [off[method.name] <= Fraction(1, 10**method.digits) for method in results.methods.values()]
    value = (
        f"{sum(good)} of {len(good)} methods; worst off by {short(float(max(off.values())), 1)} for each coefficient"
    )
    return counted(good, value)


@claim(
    id="even-orders",
    paper="Section 3, below Table 3",
    statement="Symmetric coefficients omit odd order error terms",
    threshold="every registered method is symmetric, so that its order, its order for quadratic T and its harmonic "
    "order of the energy, proved in exact arithmetic, must be even",
    needs=("tables/integrators.csv",),
)
def even_orders(results: Results) -> Decision:
    rows = results.rows("integrators")
    columns = ("order", "Nystrom order", "harmonic order of energy")
    odd = [row["integrator"] for row in rows if any(int(row[column]) % 2 for column in columns)]
    return counted([not odd, len(odd) < len(rows)], f"{len(rows) - len(odd)} of {len(rows)} methods")


@claim(
    id="table-1",
    paper="Table 1",
    statement="ABA: d_i = d_(k-i), c_i = c_(k+1-i), d_k = 0; BAB: d_i = d_(k+1-i), c_i = c_(k-i), c_k = 0",
    threshold="equal in all printed decimals",
    needs=("tables/table1_structure.csv",),
)
def table_1(results: Results) -> Decision:
    rows = results.rows("table1_structure")
    good = [
        _mirrored(rows, "ABA d value", shorter=True),
        _mirrored(rows, "ABA c value", shorter=False),
        _mirrored(rows, "BAB d value", shorter=False),
        _mirrored(rows, "BAB c value", shorter=True),
    ]
    return counted(good, f"{sum(good)} of 4 rows of Ruth's method read the same in both directions")


def _mirrored(rows: list[dict[str, str]], column: str, *, shorter: bool) -> bool:
    values = [row[column] for row in rows]
    if shorter:
        *values, padding = values
        return padding == "0" and values == values[::-1]
    return values == values[::-1]


@claim(
    id="time-reversible",
    paper="Section 2, below Eq. 3",
    statement="Symmetric integrators are time reversible: z(0) -> z(tau) can be exactly reverted",
    threshold="n steps forward and n back return to the start within the bound of rounding, n times the rounding of a "
    "step times the growth of errors",
    needs=("tables/structure.csv",),
    target="stability",
)
def time_reversible(results: Results) -> Decision:
    return _within(results, "return error", "return bound")


def _within(results: Results, measured: str, bound: str) -> Decision:
    """Compare two columns of the table of structure, a row a run."""
    shares = [float(row[measured]) / float(row[bound]) for row in results.rows("structure")]
    good = [share <= 1 for share in shares]
    return counted(good, f"{sum(good)} of {len(good)} runs within it; worst {short(max(shares))} of it")


@claim(
    id="symplectic",
    paper="Section 1",
    statement="The integrators preserve the symplectic structure",
    threshold="J^T Omega J - Omega, J the tangent map of a run in double-double, within what a random walk of its "
    "roundings gives",
    needs=("tables/structure.csv",),
    target="stability",
)
def symplectic(results: Results) -> Decision:
    return _within(results, "symplectic defect", "symplectic walk")


@claim(
    id="first-same-as-last",
    paper="Section 2, above Table 1",
    statement="A symmetric method of k pairs of coefficients costs s = k - 1 derivative evaluations a step",
    threshold="force evaluations of each finished run are s steps, and one more where a kick comes first, exactly",
    needs=PAPER_CUBES,
)
def first_same_as_last(results: Results) -> Decision:
    wrong, total = _miscounted(results)
    if not total:
        message = "no run has finished"
        raise Undecided(message)
    return counted([not wrong, wrong < total], f"{total - wrong} of {total} finished runs")


def _miscounted(results: Results) -> tuple[int, int]:
    """Finished runs whose evaluations are not s steps, and all."""
    wrong = total = 0
    for system in ("sho", "henon_heiles", "kepler"):
        curves = Curves(results.cube(system))
        for name in curves.names:
            method = results.method(name)
            finished = curves.of(name, "status") == "ok"
            expected = curves.of(name, "steps") * method.stages + (method.first == "kick")
            wrong += int((finished & (curves.of(name, "evaluations") != expected)).sum())
            total += int(finished.sum())
    return wrong, total
