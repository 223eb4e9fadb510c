"""Table of all methods, computed without integration; the paper has no such table.

The module is separate from the tables of the paper because its rows are cached on disk: a row depends only on the
coefficients and the code, and its proofs take up to a second for a method of order ten.
"""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

from nearharmonic.core.machine import disk
from nearharmonic.exact.decimals import fixed_point
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.integrators import plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import pow
from nearharmonic.theory.linear_stability import stability_gaps
from nearharmonic.theory.order import (
    ErrorTerm,
    generalised_order_of,
    harmonic_orders_of,
    leading_errors,
    nystrom_order_of,
    order_of,
)
from nearharmonic_paper.tasks.provenance import code_digest, coefficients_digest

Header = tuple[str, ...]
Cell = str | int | float
Cells = tuple[Cell, ...]
Columns = tuple[Header, list[Cells]]

#: Maximum number of rows on disk, half a kilobyte each. A larger cache is cleared.
MOST_KEPT = 1000
#: Quantities whose harmonic order is a column.
HARMONIC = ("position", "momentum", "energy")
#: Potentials for which an order is a column besides, by degree; T is quadratic.
POLYNOMIALS = {"quartic": 4, "cubic": 3}


def overview(*names: str) -> Columns:
    """Return the columns and one row for each method, by default for each one without modified potentials.

    Errors are powers of tau with the norms of :func:`nearharmonic.theory.order.leading_errors`. An
    effective error is s norm^(1/order), which includes the cost of s stages. Edges of stability have 12 decimals.

    Rows are kept by the digest of their method, in a file in the folder of compiled code, which is writable only for
    the user. Its name depends on all code that computes a row.
    """
    tableaus = [methods_by_name[name] for name in names or plain_integrators]
    keys = [coefficients_digest([tableau]) for tableau in tableaus]
    place = disk.place_of(f"overview-{code_digest(__name__)[:32]}")
    kept = disk.read(place) if place else None
    rows: dict[str, Any] = json.loads(kept[1]) if kept else {}
    missing = {key: columns_of(tableau) for key, tableau in zip(keys, tableaus, strict=True) if key not in rows}
    rows |= missing
    if missing and place:
        disk.write(place, "overview", json.dumps(rows if len(rows) <= MOST_KEPT else missing).encode())
    return tuple(rows[keys[0]]), [tuple(rows[key].values()) for key in keys]


def columns_of(tableau: Tableau) -> dict[str, Cell]:
    """Return the row of a method by column; what holds for any T is left empty if kicks are of a modified potential."""
    harmonic, errors = harmonic_orders_of(tableau), leading_errors(tableau)
    gaps, is_general = stability_gaps(tableau), not tableau.modified
    coefficients = [Fraction(c) for c in (*tableau.kick, *tableau.drift)]
    return {
        "integrator": tableau.name,
        "label": tableau.label,
        "composition": "ABA" if tableau.first == "drift" else "BAB",
        "symmetric": "yes" if tableau.symmetric else "no",
        "stages": tableau.stages,
        "order": order_of(tableau),
        "Nystrom order": nystrom_order_of(tableau),
        **{f"order for {name} V": order_of(tableau, potential_degree=degree) for name, degree in POLYNOMIALS.items()},
        "generalised order": _generalised(tableau, quadratic=False) if is_general else "",
        "Nystrom generalised order": _generalised(tableau, quadratic=True),
        **{f"harmonic order of {what}": order for what, order in zip(HARMONIC, harmonic, strict=False)},
        "sum of absolute values": float(sum(map(abs, coefficients))),
        "negative coefficients": sum(c < 0 for c in coefficients),
        **_leading("", errors.general if is_general else None, tableau),
        **_leading("Nystrom ", errors.nystrom, tableau),
        **dict(zip(("harmonic leading error", "harmonic leading error norm"), errors.harmonic, strict=True)),
        "stability limit": fixed_point(gaps[0][0], 12),
        "stability limit per stage": fixed_point(gaps[0][0] / tableau.stages, 12),
        "first gap closes": fixed_point(gaps[0][1], 12),
        "unstable for good from": fixed_point(gaps[-1][0], 12),
        "guaranteed digits": tableau.digits,
    }


def _leading(kind: str, error: ErrorTerm | None, tableau: Tableau) -> dict[str, Cell]:
    """The leading error of a kind with its norm, and the effective error."""
    cells: tuple[Cell, ...] = ("", "", "")
    if error is not None:
        cells = (*error, float(tableau.stages * pow(error.norm, 1 / (error.degree - 1))))
    names = (f"{kind}leading error", f"{kind}leading error norm", f"{kind}effective error")
    return dict(zip(names, cells, strict=True))


def _generalised(tableau: Tableau, *, quadratic: bool) -> str:
    return "(" + ", ".join(map(str, generalised_order_of(tableau, quadratic=quadratic))) + ")"
