"""The whole search, from a seed to polished methods, and these measured beside others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.integrators import zymplectic
from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.sixth_order import tables
from nearharmonic.reproduction.experiments.sixth_order.cascade import find_solutions, winners
from nearharmonic.reproduction.experiments.sixth_order.registration import registered
from nearharmonic.reproduction.experiments.sixth_order.settings import SixthOrderSettings

SOURCE = "found by nearharmonic.reproduction.experiments.sixth_order"
#: Methods of the same kind that others published: 6A8.
PUBLISHED = zymplectic.TABLEAUS


def search(
    settings: SixthOrderSettings, integrators: Sequence[str], threads: int, report: Callable[[str], None]
) -> dict[str, Table | Mapping[str, Any]]:
    """Search for methods of order six with a harmonic order, and tabulate what is found.

    Parameters
    ----------
    settings : SixthOrderSettings
        How hard to search.
    integrators : sequence of str
        Names of the methods that the winners are measured beside, and :data:`PUBLISHED`; those with kicks of a modified
        potential are left out.
    threads : int
        The result does not depend on it.
    report : callable
        Is told of the progress.

    Returns
    -------
    dict
        ``document``, for a TOML file, and a :class:`Table` for each other key.
    """
    findings = find_solutions(settings, threads=threads, report=report)
    best = [(candidate, registered(candidate, source=SOURCE)) for candidate in winners(findings)]
    plain = [methods_by_name[name] for name in integrators if not methods_by_name[name].modified]
    others = plain + [one for one in PUBLISHED if one.name not in integrators]
    compared = [*others, *(tableau for _, tableau in best)]
    return {
        "document": tables.document(best),
        "sixth_order_counts": tables.counts(findings),
        "sixth_order_ranking": tables.ranking(findings.candidates),
        "sixth_order_measured": tables.measured(compared),
    }
