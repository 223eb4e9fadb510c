"""The table that the paper lacks: all methods compared, nothing integrated.

It is apart from the paper's tables because its rows are kept on disk: what a row says depends on the coefficients and
on the code alone, and to prove it takes up to a second for a method of order ten.
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
from nearharmonic.reproduction.tasks.provenance import code_digest, coefficients_digest
from nearharmonic.theory.linear_stability import stability_gaps
from nearharmonic.theory.order import (
    ErrorTerm,
    generalised_order_of,
    harmonic_orders_of,
    leading_errors,
    nystrom_order_of,
    order_of,
)

Header = tuple[str, ...]
Cells = tuple[str | int | float, ...]
Columns = tuple[Header, list[Cells]]

#: Rows on disk, half a kilobyte each. Beyond this number they are made afresh.
MOST_KEPT = 1000

OVERVIEW = (
    "integrator",
    "label",
    "composition",
    "symmetric",
    "stages",
    "order",
    "Nystrom order",
    "generalised order",
    "Nystrom generalised order",
    "harmonic order of position",
    "harmonic order of momentum",
    "harmonic order of energy",
    "sum of absolute values",
    "negative coefficients",
    "leading error",
    "leading error norm",
    "effective error",
    "Nystrom leading error",
    "Nystrom leading error norm",
    "Nystrom effective error",
    "harmonic leading error",
    "harmonic leading error norm",
    "stability limit",
    "stability limit per stage",
    "first gap closes",
    "unstable for good from",
    "guaranteed digits",
)


def overview(*names: str) -> Columns:
    """Return one row for each method: what decides between them, nothing integrated.

    Errors are powers of tau, with norms as :func:`nearharmonic.theory.order.leading_errors` defines them; an effective
    error is s norm^(1/order), which allows for the cost of s stages. Edges of stability have 12 decimals.

    Parameters
    ----------
    *names : str
        Names of the methods; every registered one with kicks of V alone if none is given.

    Returns
    -------
    Columns
        :data:`OVERVIEW` and the rows, in the order of the names.

    Raises
    ------
    UnknownNameError
        No integrator has one of the names.
    """
    tableaus = [methods_by_name[name] for name in names or plain_integrators]
    keys = [coefficients_digest([tableau]) for tableau in tableaus]
    kept = KeptRows()
    missing = {key: row_of(tableau) for key, tableau in zip(keys, tableaus, strict=True) if key not in kept.rows}
    if missing:
        kept.add(missing)
    return OVERVIEW, [tuple(kept.rows[key]) for key in keys]


class KeptRows:
    """The rows that were made before, by the digest of their method, kept on disk from process to process.

    The file is in the folder of compiled code, which only the user can write to. Its name depends on all code that
    makes a row.
    """

    def __init__(self) -> None:
        self._place = disk.place_of(f"overview-{code_digest(__name__)[:32]}")
        kept = disk.read(self._place) if self._place else None
        self.rows: dict[str, Any] = json.loads(kept[1]) if kept else {}

    def add(self, rows: dict[str, Cells]) -> None:
        """Add rows, and write the file: with all rows, or with the new ones alone beyond :data:`MOST_KEPT`."""
        self.rows.update(rows)
        if self._place:
            written = self.rows if len(self.rows) <= MOST_KEPT else rows
            disk.write(self._place, "overview", json.dumps(written).encode())


def row_of(tableau: Tableau) -> Cells:
    """Return the row of a method; what holds for any T is left empty if kicks are of a modified potential."""
    harmonic, errors = harmonic_orders_of(tableau), leading_errors(tableau)
    gaps, is_general = stability_gaps(tableau), not tableau.modified
    coefficients = [Fraction(c) for c in (*tableau.kick, *tableau.drift)]
    return (
        tableau.name,
        tableau.label,
        "ABA" if tableau.first == "drift" else "BAB",
        "yes" if tableau.symmetric else "no",
        tableau.stages,
        order_of(tableau),
        nystrom_order_of(tableau),
        *(_generalised(tableau, quadratic=q) if q or is_general else "" for q in (False, True)),
        *harmonic[:3],
        float(sum(map(abs, coefficients))),
        sum(c < 0 for c in coefficients),
        *((*errors.general, _effective(errors.general, tableau)) if is_general else ("", "", "")),
        *errors.nystrom,
        _effective(errors.nystrom, tableau),
        *errors.harmonic,
        *(fixed_point(edge, 12) for edge in (gaps[0][0], gaps[0][0] / tableau.stages, gaps[0][1], gaps[-1][0])),
        tableau.digits,
    )


def _generalised(tableau: Tableau, *, quadratic: bool) -> str:
    return "(" + ", ".join(map(str, generalised_order_of(tableau, quadratic=quadratic))) + ")"


def _effective(error: ErrorTerm, tableau: Tableau) -> float:
    return float(tableau.stages * pow(error.norm, 1 / (error.degree - 1)))
