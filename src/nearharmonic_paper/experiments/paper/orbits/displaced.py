"""Panel D of Figure 6 from starts outside the plane q_x = 0: there the paths finally diverge."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories
from nearharmonic.engine.numbers import start_array
from nearharmonic.engine.settings import Numerics, tau_grid
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic_paper.experiments.paper.orbits.substeps import PAPER_PANELS

#: Initial q_x.
DISPLACEMENTS = ("0", "1e-12", "1e-6", "1e-3", "1e-2")
SUMS = ("compensated", "plain")
#: Samples per decade of the iterations.
PER_DECADE = 24


def displaced(integrator: str, iterations: int) -> dict[str, Contents]:
    """Integrate panel D with each of :data:`DISPLACEMENTS` in place of q_x = 0, with both summations.

    The ``cube`` has over (displacement, summation) ``left_at`` and ``max_energy_error``, and over iterations evenly
    spaced in the logarithm ``block_max_energy_error`` and ``q_x``, NaN once the path has left its energy surface.
    """
    tableau, (_, panel) = integrators[integrator], PAPER_PANELS["D"]
    system = panel["system"]
    samples = {round(n) for n in tau_grid(1, iterations, PER_DECADE)} | {iterations}
    marks = np.array([0, *sorted(samples)])
    paths = [_integrated(tableau, panel, summation, marks) for summation in SUMS]

    def of_runs(key: str) -> Any:
        return np.stack([getattr(path, key) for path in paths], axis=1)

    over, unit, left_at = ("displacement", "summation"), system.units["q"], of_runs("left_at")
    variables = {
        **coordinate("displacement", np.array(DISPLACEMENTS, dtype=float), "initial q_x", unit),
        **coordinate("summation", SUMS, "summation of the steps"),
        **coordinate("iteration", marks[1:], "number of the iteration"),
        "left_at": variable(over, left_at, "iteration that left the energy surface, 0 if none did"),
        "max_energy_error": variable(
            over, of_runs("max_energy_error"), "maximum of |H - H0|/|H0| over every iteration, inf if one left"
        ),
        "block_max_energy_error": variable(
            (*over, "iteration"), of_runs("block_max")[..., 1:], "maximum of |H - H0|/|H0| since the previous sample"
        ),
        "q_x": variable((*over, "iteration"), of_runs("q")[..., 1:, 0], "q_x", unit),
    }
    attributes = {
        "system": system.name, "system_label": system.label, "integrator": tableau.name, "label": tableau.label,
        "tau": panel["tau"], "iterations": iterations, "surface_limit": system.surface_limit,
    }  # fmt: skip
    evaluations = sum(tableau.evaluations(n or iterations) for n in left_at.ravel().tolist())
    return {"cube": Contents(variables=variables, attributes=attributes, evaluations=evaluations)}


def _integrated(tableau: Tableau, panel: dict[str, Any], summation: str, marks: np.ndarray[Any, Any]) -> Trajectories:
    """Return the runs with one summation, sampled at ``marks``; the last mark is the number of steps."""
    system, (q_y, p_y), runs = panel["system"], map(str, panel["start"]), len(DISPLACEMENTS)
    starts = [start_array(system, (q_x, q_y), ("0", p_y), plain=summation == "plain") for q_x in DISPLACEMENTS]
    steps = int(marks[-1])
    return integrate_batch(
        system, tableau, t_end=Fraction(panel["tau"]) * steps, steps=[steps] * runs, samples=2,
        numerics=Numerics(summation=summation), start=np.concatenate(starts), marks=np.tile(marks, (runs, 1)),
    )  # fmt: skip
