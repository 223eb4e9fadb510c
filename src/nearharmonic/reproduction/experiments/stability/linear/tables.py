"""The table of linear stability: intervals of step sizes, exact, and what else is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nearharmonic.exact.decimals import significant
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.table import Table
from nearharmonic.theory.linear_stability import largest_growth, stability_gaps, touching_points

CAPTION = "Where the harmonic oscillator stays bounded: intervals of step sizes, and the gap that ends each."
#: Significant digits of the edges.
DIGITS = 13

#: First edges as another program found them, in C doubles by bisection of the trace: 10 digits.
KNOWN_LIMITS: Mapping[str, str] = {
    "ruth": "1.573401947",
    "s5odr4": "2.720974539",
    "aba104": "3.089617987",
    "aba864": "3.142177180",
    "aba1064": "3.146107336",
    "yoshida_s7o6a": "2.269057996",
    "abas5o6h": "3.069226671",
    "babs7o7h": "3.140769602",
    "babps8o7h": "3.139720728",
    "babps9o7h": "3.140827789",
}


def linear_stability_table(tableaus: Sequence[Tableau]) -> Table:
    """Return a row for each interval of stability of each method and the gap that ends it, edges as decimal strings."""
    header = (
        "integrator", "stages", "stable from", "stable to", "stable to, per stage", "known limit", "unstable to",
        "largest growth per step", "at step size", "largest growth per time", "trace touches 2 at",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for tableau in tableaus:
        touching, known, before = touching_points(tableau), KNOWN_LIMITS.get(tableau.name, ""), 0
        for gap in stability_gaps(tableau):
            growth, (start, end) = largest_growth(tableau, gap), gap
            touched = " ".join(significant(x, DIGITS) for x in touching if before < x < start)
            edges = [significant(x, DIGITS) for x in (before, start, start / tableau.stages, end)]
            sizes = *edges[:3], known, edges[3]
            rates = float(growth.per_step), float(growth.at), float(growth.per_time)
            rows.append((tableau.name, tableau.stages, *sizes, *rates, touched))
            known, before = "", end
    return Table(header=header, rows=rows, caption=CAPTION)
