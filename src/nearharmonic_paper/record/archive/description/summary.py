"""Title, abstract and keywords of an archive, for all of its descriptions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

#: A line of the history.
Run = Mapping[str, Any]
KEYWORDS = ("symplectic integrators", "Hamiltonian systems", "splitting methods", "energy error")


def title(result: str) -> str:
    """Return the title of the archive of a result."""
    return f"nearharmonic results: {result}"


def abstract(runs: Sequence[Run], left_out: int) -> str:
    """Return the abstract of an archive with these ``runs``, from which so many trajectory files are left out."""
    without = f" Trajectories are left out (files: {left_out})." if left_out else ""
    return (
        f"Energy errors, cubes, tables and figures of near-harmonic symplectic integrators, with the settings and the "
        f"history of the workflow that made them (runs: {len(runs)}).{without}"
    )
