"""From the states to a cube and a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nearharmonic_paper.experiments.added.reductions import reduction
from nearharmonic_paper.experiments.added.settings import AddedSettings

from nearharmonic.output.store import read
from nearharmonic.output.table import Table


def reduce(methods: Sequence[str], settings: AddedSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of energy errors and the ``table`` of the largest ones."""
    cube = reduction.of(read(run), over="tau")
    rows = [(str(one.integrator.item()), float(one.max())) for one in cube.energy_error]
    return {"cube": cube, "table": Table(header=("integrator", "error"), rows=rows, caption="Largest energy errors.")}
