"""Table of all methods, computed without integration; the paper has no such table."""

from __future__ import annotations

from fractions import Fraction

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

Header = tuple[str, ...]
Cell = str | int | float
Cells = tuple[Cell, ...]
Columns = tuple[Header, list[Cells]]

#: Quantities whose harmonic order is a column.
HARMONIC = ("position", "momentum", "energy")


def overview(*names: str) -> Columns:
    """Return the columns and one row for each method, by default for each one without modified potentials.

    Errors are powers of tau with the norms of :func:`nearharmonic.theory.order.leading_errors`. An effective error is s
    norm^(1/order), which includes the cost of s stages. Edges of stability have 12 decimals.
    """
    rows = [columns_of(methods_by_name[name]) for name in names or plain_integrators]
    return tuple(rows[0]), [tuple(row.values()) for row in rows]


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
