"""Exact linear stability of each method: the trace of the oscillator's step matrix, and the gaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.exact.polynomials import significant
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.store import coordinate, method_coordinates, variable
from nearharmonic.output.table import Table
from nearharmonic.theory.oscillator import largest_growth, stability_gaps, step_polynomials, touching_points

#: Largest step size per stage of the curve, above the last stable step size of all ten methods, and number of points.
HIGHEST_TAU_PER_STAGE, POINTS = 2.4, 961


def measure(integrators: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` of the methods with the names ``integrators``, and its ``table``."""
    methods = [registry[name] for name in integrators]
    return {"cube": linear_stability_cube(methods), "table": linear_stability_table(methods)}


def linear_stability_cube(tableaus: Sequence[Tableau]) -> xr.Dataset:
    """Return half the trace over (integrator, tau_per_stage), and the gaps over (integrator, gap).

    Gaps are NaN after the last gap of a method, which ends at infinity.
    """
    grid = np.linspace(0, HIGHEST_TAU_PER_STAGE, POINTS)
    gaps = [stability_gaps(tableau) for tableau in tableaus]
    edges = np.full((2, len(tableaus), max(map(len, gaps))), np.nan)
    growth = np.full((2, *edges.shape[1:]), np.nan)
    trace = np.empty((len(tableaus), POINTS))
    for i, tableau in enumerate(tableaus):
        K = step_polynomials(tableau)
        halved = [float(a + b) / 2 for a, b in zip(K.K11, K.K22, strict=True)]
        trace[i] = np.polynomial.polynomial.polyval(grid * tableau.stages, halved)
        for j, gap in enumerate(gaps[i]):
            edges[:, i, j] = [float(edge) for edge in gap]
            largest = largest_growth(tableau, gap)
            growth[:, i, j] = float(largest.per_step), float(largest.per_time)
    over = ("integrator", "gap")
    return xr.Dataset(
        {
            "half_trace": variable(("integrator", "tau_per_stage"), trace, "half the trace of the step matrix"),
            "start": variable(over, edges[0], "gap opens"),
            "end": variable(over, edges[1], "gap closes"),
            "growth_per_step": variable(over, growth[0], "largest Lyapunov exponent per step"),
            "growth_per_time": variable(over, growth[1], "largest Lyapunov exponent per time"),
        },
        coords={
            **method_coordinates(tableaus),
            "stages": variable("integrator", [t.stages for t in tableaus], "stages"),
            **coordinate("tau_per_stage", grid, "step size per stage"),
            **coordinate("gap", np.arange(edges.shape[2]), "number of the gap"),
        },
    )


CAPTION = "Intervals of step sizes in which the harmonic oscillator stays bounded, and the gap that ends each."
#: Significant digits of the edges.
DIGITS = 13

#: First edges from another program, in C doubles by bisection of the trace: 10 digits.
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
