"""The whole search, from a seed to refined methods, and a comparison with other methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from typing import Any

from nearharmonic.engine.trajectory import sweep
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.integrators import zymplectic
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.table import Table
from nearharmonic.systems import henon_heiles, kepler, sho
from nearharmonic_studies.sixth_order.cascade import Candidate, Findings, find_solutions, registered, winners
from nearharmonic_studies.sixth_order.settings import SixthOrderSettings

SOURCE = "found by nearharmonic_studies.sixth_order"
#: Published methods of this kind: 6A8.
PUBLISHED = zymplectic.TABLEAUS


def search(
    settings: SixthOrderSettings, integrators: Sequence[str], threads: int
) -> dict[str, Table | Mapping[str, Any]]:
    """Search for methods of order six with a harmonic order, and compare them with :data:`PUBLISHED` and other methods.

    Among the ``integrators``, methods with modified potentials are omitted. The result does not depend on ``threads``.

    The result has ``document``, for a TOML file, and a :class:`Table` for each other key.
    """
    findings = find_solutions(settings, threads=threads)
    best = [(candidate, registered(candidate, source=SOURCE)) for candidate in winners(findings)]
    plain = [methods_by_name[name] for name in integrators if not methods_by_name[name].modified]
    others = plain + [one for one in PUBLISHED if one.name not in integrators]
    compared = [*others, *(tableau for _, tableau in best)]
    return {
        "document": document(best),
        "sixth_order_counts": counts(findings),
        "sixth_order_ranking": ranking(findings.candidates),
        "sixth_order_measured": measured(compared),
    }


#: Candidates that the ranking shows.
RANKED = 40
#: Comparison of the winners: systems, and step sizes per stage in their units of time, from coarse to fine.
MEASURED = (
    (sho.SYSTEM, (0.3, 0.2, 0.1, 0.05, 0.03)),
    (henon_heiles.SYSTEM, (0.3, 0.2, 0.1, 0.05, 0.03, 0.02, 0.01)),
    (kepler.SYSTEM, (30.0, 20.0, 10.0, 5.0, 3.0, 2.0)),
)


def counts(findings: Findings) -> Table:
    """Tabulate the numbers of solutions of each kind, or of samples if parameters are free."""
    header = ("stages", "first", "harmonic order", "free parameters", "starts", "hits", "distinct solutions")
    rows = [astuple(count) for count in findings.counts]
    return Table(header=header, rows=rows, caption="Solutions by stages, composition and harmonic order.")


def ranking(candidates: Sequence[Candidate]) -> Table:
    """Tabulate the best candidates by the criterion, which uses no benchmark problem."""
    rows = [candidate.row() for candidate in candidates[:RANKED]]
    return Table(
        header=tuple(rows[0]) if rows else (),
        rows=[tuple(row.values()) for row in rows],
        caption="The best by a criterion that runs no problem.",
    )


def measured(methods: Iterable[Tableau]) -> Table:
    """Measure the largest and mean energy error of each method at equal cost on each system, and its rank."""
    header = ("system", "tau/s", "method", "order", "max energy error", "mean energy error", "rank by maximum")
    tableaus, rows = list(methods), []
    for system, grid in MEASURED:
        runs = {t.name: sweep(system, t, [tau * t.stages for tau in grid], precision="extended") for t in tableaus}
        for i, tau in enumerate(grid):
            worst = {name: run.max_energy_error.values[i] for name, run in runs.items()}
            places = {name: place + 1 for place, name in enumerate(sorted(worst, key=worst.__getitem__))}
            for tableau in tableaus:
                mean = float(runs[tableau.name].mean_energy_error.values[i])
                place = places[tableau.name]
                rows.append((
                    system.label, tau, tableau.label, tableau.order, float(worst[tableau.name]), mean, place,
                ))  # fmt: skip
    return Table(header=header, rows=rows, caption="The winners beside the others, at the same cost.")


def document(found: Iterable[tuple[Candidate, Tableau]]) -> Mapping[str, Any]:
    """Return the polished winners with every digit, for a TOML file."""
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
