"""Linear stability of each method, exact: the trace of the oscillator's step matrix, and the gaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import coordinate, method_coordinates, variable
from nearharmonic.reproduction.experiments.stability.linear.tables import linear_stability_table
from nearharmonic.theory.linear_stability import largest_growth, stability_gaps
from nearharmonic.theory.oscillator import step_polynomials

if TYPE_CHECKING:
    import xarray as xr

#: The trace is drawn up to this step size per stage, past the end of stability of all ten methods, in so many points.
HIGHEST_TAU_PER_STAGE, POINTS = 2.4, 961


def measure(integrators: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` of the methods with the names ``integrators``, and its ``table``."""
    methods = [registry[name] for name in integrators]
    return {"cube": linear_stability_cube(methods), "table": linear_stability_table(methods)}


def linear_stability_cube(tableaus: Sequence[Tableau]) -> xr.Dataset:
    """Return half the trace over (integrator, tau_per_stage), and the gaps over (integrator, gap).

    Gaps are NaN past a method's last, which ends at infinity.
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
            "half_trace": variable(("integrator", "tau_per_stage"), trace, "half the trace of the step matrix"),
            **{k: variable(over, v, text) for (k, v), text in zip(numbers.items(), texts, strict=True)},
        },
        coords={
            **method_coordinates(tableaus),
            "stages": variable("integrator", [t.stages for t in tableaus], "stages"),
            **coordinate("tau_per_stage", grid, "step size per stage"),
            **coordinate("gap", np.arange(edges.shape[2]), "number of the gap"),
        },
    )
