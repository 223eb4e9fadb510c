"""What the search for sixth-order methods found, as tables, and the winners measured beside the paper's methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from nearharmonic.integrate import sweep
from nearharmonic.search.nystrom_search import Candidate, Findings
from nearharmonic.systems import systems
from nearharmonic.tableau import Tableau

Table = tuple[tuple[str, ...], list[tuple[Any, ...]]]

#: Candidates that the ranking shows.
RANKED = 40
#: Where the winners are measured: step sizes per stage in each system's unit of time, from coarse to fine.
MEASURED = {
    "sho": (0.3, 0.2, 0.1, 0.05, 0.03),
    "henon_heiles": (0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01),
    "kepler": (30.0, 20.0, 10.0, 5.0, 3.0, 2.0),
}


def counts(findings: Findings) -> Table:
    """How many solutions of each kind there are, or, where parameters are free, how many were sampled."""
    header = ("stages", "first", "harmonic order", "free parameters", "starts", "hits", "distinct solutions")
    return header, [tuple(asdict(count).values()) for count in findings.counts]


def ranking(candidates: Sequence[Candidate]) -> Table:
    """The best candidates by the criterion, which no benchmark problem enters."""
    rows = [candidate.row() for candidate in candidates[:RANKED]]
    return tuple(rows[0]) if rows else (), [tuple(row.values()) for row in rows]


def measured(methods: Iterable[Tableau]) -> Table:
    """Largest and mean energy error of each method at the same cost on each system, and its rank there."""
    header = ("system", "tau/s", "method", "order", "max energy error", "mean energy error", "rank by maximum")
    tableaus, rows = list(methods), []
    for system, grid in MEASURED.items():
        runs = {t.name: sweep(system, t, [tau * t.stages for tau in grid], precision="extended") for t in tableaus}
        for i, tau in enumerate(grid):
            worst = {name: run.max_energy_error.values[i] for name, run in runs.items()}
            places = {name: place + 1 for place, name in enumerate(sorted(worst, key=worst.__getitem__))}
            for tableau in tableaus:
                mean = float(runs[tableau.name].mean_energy_error.values[i])
                place = places[tableau.name]
                rows.append((
                    systems[system].label, tau, tableau.label, tableau.order, float(worst[tableau.name]), mean, place,
                ))  # fmt: skip
    return header, rows


def document(found: Iterable[tuple[Candidate, Tableau]]) -> Mapping[str, Any]:
    """The polished winners with every digit, for a TOML file."""
    return {
        "method": [
            {
                "name": tableau.name,
                "label": tableau.label,
                "first": tableau.first,
                "kick": list(tableau.kick),
                "drift": list(tableau.drift),
                "digits": tableau.digits,
                "note": tableau.note,
                "criterion": candidate.row(),
            }
            for candidate, tableau in found
        ]
    }
