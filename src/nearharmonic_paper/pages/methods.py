"""The tables of docs/reference/methods.md: proved orders of methods, and errors of those with a modified potential."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nearharmonic.engine.trajectory import sweep
from nearharmonic.integrators import implicit_integrators, modified_integrators, plain_integrators
from nearharmonic.integrators import integrators as registered
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.theory.order import harmonic_order, order_of

#: Time of a force with the gradient of its square over that of a force, as the page has it.
FACTORS = {"henon_heiles": 2.1, "kepler": 1.3}
#: Step sizes per stage, and the heads of their columns.
COSTS = {"henon_heiles": (0.05, 0.1, 0.2), "kepler": (10, 20, 40)}
HEADS = {"henon_heiles": "Hénon-Heiles, τ/s = {:g}", "kepler": "Kepler, {:g} h"}
#: Methods without a modified potential in the table of errors.
PLAIN = ("ruth", "srkn_b6", "srkn_b11", "srkn_a14", "nystrom_6a8", "babps8o7h")


def methods_table() -> str:
    """Return a row for each method without a modified potential."""
    rows = []
    for name in plain_integrators.registered:
        one, order = registered[name], order_of(registered[name])
        rows.append([*_first_cells(one), order, one.order if one.requires else order, harmonic_order(one)])
    header = ("name", "label", "composition", "stages", "order", "order for quadratic T", "harmonic order")
    return "\n".join(pipes(header, rows, align="lllr"))


def modified_table() -> str:
    """Return a row for each method with a modified potential."""
    found = [registered[name] for name in modified_integrators.registered]
    rows = [[*_first_cells(one), one.gradients, order_of(one), harmonic_order(one)] for one in found]
    header = ("name", "label", "composition", "stages", "gradients", "order", "harmonic order")
    return "\n".join(pipes(header, rows, align="lllr"))


def implicit_table() -> str:
    """Return a row for each implicit method."""
    found = [registered[name] for name in implicit_integrators.registered]
    rows = [[f"`{one.name}`", one.label, "implicit", one.stages, order_of(one), harmonic_order(one)] for one in found]
    return "\n".join(pipes(("name", "label", "composition", "stages", "order", "harmonic order"), rows, align="lllr"))


def _first_cells(one: Tableau) -> list[str | int]:
    return [f"`{one.name}`", one.label, {"drift": "ABA", "kick": "BAB"}[one.first], one.stages]


def decades(system: str, tableau: Tableau, factor: float) -> Floats:
    """Return log10 of the maximum energy error, with the cost of each stage in forces."""
    taus = [cost * tableau.stages * factor for cost in COSTS[system]]
    found: Floats = np.log10(sweep(system, tableau, taus).max_energy_error.values)
    return found


def errors_table() -> str:
    """Return errors at equal numbers of evaluations, and at equal times."""
    rows = []
    for name in (*modified_integrators.registered, *PLAIN):
        one, cells = registered[name], []
        for system, factor in FACTORS.items():
            both = zip(decades(system, one, 1), decades(system, one, factor), strict=True)
            cells += [f"{a:.1f} ({b:.1f})" if one.modified else f"{a:.1f}" for a, b in both]
        rows.append([f"`{name}`", *cells])
    header = [HEADS[system].format(cost) for system, costs in COSTS.items() for cost in costs]
    return "\n".join(pipes(["name", *header], rows, align="lr"))


def parts() -> dict[str, str]:
    """Return the tables by their marks on the page."""
    return {
        "methods": methods_table(),
        "modified": modified_table(),
        "implicit": implicit_table(),
        "errors": errors_table(),
    }


def page(page: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page."""
    return {"page": filled_page(page, parts())}
