"""The cube and the table of linear stability: trace and gaps of each method, exact, and what else is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from mpmath import isinf, nstr

from nearharmonic.decomposition import step_polynomials
from nearharmonic.linear_stability import KNOWN_LIMITS, largest_growth, stability_gaps, touching_points
from nearharmonic.tableau import Tableau

if TYPE_CHECKING:
    import xarray as xr

Rows = tuple[tuple[str, ...], list[tuple[Any, ...]]]

#: The trace is drawn up to this step size per stage, past the end of stability of all ten methods, in so many points.
HIGHEST_TAU_PER_STAGE, POINTS = 2.4, 961
#: Decimals of the edges in the table, for step sizes below 10.
DECIMALS = 12


def linear_stability_cube(tableaus: Sequence[Tableau]) -> xr.Dataset:
    """Half the trace over (integrator, tau_per_stage), and the gaps over (integrator, gap), NaN past a method's last.

    A last gap ends at infinity.
    """
    import xarray as xr

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
    texts = ("gap opens", "gap closes", "largest Lyapunov exponent per step", "largest Lyapunov exponent per time")
    numbers = dict(zip(("start", "end", "growth_per_step", "growth_per_time"), (*edges, *growth), strict=True))
    return xr.Dataset(
        {
            "half_trace": (("integrator", "tau_per_stage"), trace, _notes("half the trace of the step matrix")),
            **{k: (over, v, _notes(text)) for (k, v), text in zip(numbers.items(), texts, strict=True)},
        },
        coords={
            **_methods(tableaus),
            "stages": ("integrator", [t.stages for t in tableaus], _notes("stages")),
            "tau_per_stage": ("tau_per_stage", grid, _notes("step size per stage")),
        },
    )


def linear_stability_table(tableaus: Sequence[Tableau]) -> Rows:
    """One row for each interval of stability, and the gap that ends it; edges as decimal strings."""
    header = (
        "integrator", "stages", "stable from", "stable to", "stable to, per stage", "known limit", "unstable to",
        "largest growth per step", "at step size", "largest growth per time", "trace touches 2 at",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for tableau in tableaus:
        touching, known, before = touching_points(tableau), KNOWN_LIMITS.get(tableau.name, ""), 0
        for gap in stability_gaps(tableau):
            growth, (start, end) = largest_growth(tableau, gap), gap
            touched = " ".join(_decimals(x) for x in touching if before < x < start)
            sizes = _decimals(before), _decimals(start), _decimals(start / tableau.stages), known, _decimals(end)
            rates = float(growth.per_step), float(growth.at), float(growth.per_time)
            rows.append((tableau.name, tableau.stages, *sizes, *rates, touched))
            known, before = "", end
    return header, rows


def _methods(tableaus: Sequence[Tableau]) -> dict[str, Any]:
    return {
        "integrator": ("integrator", [t.name for t in tableaus], _notes("integrator")),
        "label": ("integrator", [t.label for t in tableaus], _notes("name in the paper")),
    }


def _notes(text: str) -> dict[str, str]:
    return {"units": "1", "long_name": text}


def _decimals(x: Any) -> str:
    return "inf" if isinf(x) else nstr(x, DECIMALS + 1, strip_zeros=False) if x else "0"
