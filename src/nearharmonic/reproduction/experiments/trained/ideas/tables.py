"""The table of ideas: which is ahead at each anharmonicity and step size, and what each of them reaches."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.trained.comparison.contestants import IDEAS

if TYPE_CHECKING:
    import xarray as xr

CAPTION = (
    "Random potentials of two coordinates: the idea whose best method has the least mean of log10 max |dH/H0| at equal "
    "cost, by how many decades it is ahead of the second with its 95 % interval over the potentials; the idea that is "
    "ahead with T and V, where oscillators are not solved exactly; and the gains of all over the best general method. "
    "Anharmonicity is the median variation of the Hessian."
)


def ideas_table(cube: xr.Dataset) -> Table:
    """Return a row for each step size and strength."""
    values = {name: entry.values for name, entry in cube.variables.items()}
    header = ["tau_per_stage", "anharmonicity", "ahead", "method", "log10_error", "lead", "lead_low", "lead_high"]
    header += ["ahead with T + V", "lead with T + V"]
    rows: list[list[Any]] = []
    for t, j in product(range(len(values["tau_per_stage"])), range(len(values["strength"]))):
        leader = str(values["leader"][t, j])
        i = IDEAS.index(leader)
        numbers = [values["mean_log_error"][i, t, j], values["lead"][t, j], *values["lead_interval"][t, j]]
        first = [float(values["tau_per_stage"][t]), float(values["anharmonicity"][j, 1]), leader]
        best = str(values["best_method"][i, t, j])
        split = [str(values["leader_split"][t, j]), float(values["lead_split"][t, j])]
        rows.append([*first, best, *map(float, numbers), *split, *map(float, values["gain"][:, t, j])])
    return Table(header=[*header, *IDEAS], rows=rows, caption=CAPTION)
