"""Tables of methods: the paper's, and one of all methods."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from nearharmonic.core import disk
from nearharmonic.exact.decimals import fixed_point
from nearharmonic.integrators import forest_ruth_1990, plain_integrators
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.math import pow
from nearharmonic.output.table import Table
from nearharmonic.theory.linear_stability import stability_gaps
from nearharmonic.theory.order import (
    ErrorTerm,
    closed_sums,
    generalised_order_of,
    harmonic_orders_of,
    leading_errors,
    momentum_row,
    nystrom_order_of,
    order_of,
    position_rows,
)
from nearharmonic.theory.oscillator import table_4, tableau_of
from nearharmonic_paper.tasks.provenance import code_digest, coefficients_digest

# --- Table of all methods, computed without integration; the paper has no such table.
#
# The module is separate from the tables of the paper because its rows are cached on disk: a row depends only on the
# coefficients and the code, and its proofs take up to a second for a method of order ten.

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


# --- The paper's tables for a named method.
#
# Each function except :func:`paper_tables` returns ``(header, rows)``: names of columns, and rows of strings,
# integers and floats as long as the header. Symbols are the paper's, d for kicks and c for drifts, both counted from
# 1, k = s + 1 and a padding 0 at the end of the shorter row. ``first`` selects the composition, "drift" for ABA and
# "kick" for BAB; None for the declared one.

NOTHING = ""

#: File names of the paper's tables, and of the table of all methods.
STEMS = (
    "table1_structure", "table2_recursion", "table2_values", "table3_even_orders", "table4_coefficients", "integrators",
)  # fmt: skip


def paper_tables(integrators: Sequence[str]) -> dict[str, Table]:
    """Return the paper's tables, and the table of the methods ``integrators``, by their file names, :data:`STEMS`.

    The paper illustrates its Tables 2 and 3 with three stages in the BAB composition; here they are for Ruth's method.
    """
    (ruth,) = forest_ruth_1990.TABLEAUS
    columns = (
        (structure(ruth), "Table 1: mirror images among the coefficients of Ruth's method."),
        (recursion_symbols(ruth, first="kick"), "Table 2: the recursion for three stages as BAB, in symbols."),
        (recursion_values(ruth, first="kick"), "Table 2 for Ruth's method as BAB, in numbers."),
        (even_orders(ruth, first="kick"), "Table 3: closed sums for Ruth's method as BAB, beside Table 2's numbers."),
        (table_4(), "Table 4: independent coefficients; d is the outer row, c the inner one."),
        (overview(*integrators), "Every integrator: structure, orders, leading errors, linear stability."),
    )
    tables = (Table(header=header, rows=rows, caption=caption) for (header, rows), caption in columns)
    return dict(zip(STEMS, tables, strict=True))


def structure(integrator: str | Tableau) -> Columns:
    """Return Table 1: equal coefficients of both compositions, in symbols and in numbers.

    One row for each i = 1, ..., k; four columns name the mirror image of d_i and c_i, four hold their values.
    """
    tableau = tableau_of(integrator)
    compositions = [("ABA", tableau.role("drift")), ("BAB", tableau.role("kick"))]
    header, indices = ["i"], range(1, tableau.stages + 2)
    rows: list[list[str | int]] = [[i] for i in indices]
    for label, role in compositions:
        for symbol, coefficients in (("d", role.kick), ("c", role.drift)):
            header += [f"{label} {symbol}", f"{label} {symbol} value"]
            for i, row in zip(indices, rows, strict=True):
                row += [_equality(symbol, i, len(coefficients), tableau), *(*coefficients, "0")[i - 1 : i]]
    return tuple(header), [tuple(row) for row in rows]


def recursion_symbols(integrator: str | Tableau, *, first: First | None = None) -> Columns:
    """Return Table 2 in symbols, for the stages of the method: Cbar_h = 1 + C_h, and Qbar is the force at Q over m.

    C_h = c_h / c_(h-1), and D_h = -c_h d_h for BAB, -c_h d_(h-1) for ABA. The last row adds the new momentum over m,
    which the paper does not decompose (last line of Eq. 6).
    """
    tableau = tableau_of(integrator, first)
    drifts, width = len(tableau.drift), _powers(tableau)
    rows: list[Cells] = [(0, *_padded(["q_a"], width))]
    rows.append((1, *_padded(["Q[0,0]", "c_1 p_a / m", "D_1 Qbar[0,0]"][: _highest(tableau, 1) + 1], width)))
    for h in range(2, drifts + 1):
        cells = [_recursion_entry(tableau, h, power) for power in range(_highest(tableau, h) + 1)]
        rows.append((h, *_padded(cells, width)))
    return _powers_header(width), [*rows, ("p_b / m", *_padded(_momentum_entries(tableau), width))]


def recursion_values(integrator: str | Tableau, *, first: First | None = None) -> Columns:
    """Return Table 2 in numbers for m = k = 1; even powers have units of q_a, odd ones p_a (momentum: vice versa)."""
    tableau = tableau_of(integrator, first)
    width = _powers(tableau)
    rows: list[Cells] = [
        (h, *_padded(map(float, row[: _highest(tableau, h) + 1]), width))
        for h, row in enumerate(position_rows(tableau))
    ]
    return _powers_header(width), [*rows, ("p_b", *_padded(map(float, momentum_row(tableau)), width))]


def even_orders(integrator: str | Tableau, *, first: First | None = None) -> Columns:
    """Return Table 3: the closed sums for q_a = m = 1, and the numbers of the recursion.

    The column "as printed" has the inner upper limit h - 1 of Table 3 in place of the correct limit h of Eq. 16.
    """
    tableau = tableau_of(integrator, first)
    header = ("h", "tau^0", "tau^2", "tau^4", "tau^2 of Table 2", "tau^4 of Table 2", "tau^4 as printed")
    rows: list[Cells] = []
    for h, (sums, row) in enumerate(zip(closed_sums(tableau), position_rows(tableau), strict=True)):
        recursion = [float(x) for x in (*row, Fraction(0), Fraction(0))][2:5:2]
        rows.append((h, *map(float, sums[:3]), *recursion, float(sums.tau4_as_printed)))
    return header, rows


def _equality(symbol: str, i: int, length: int, tableau: Tableau) -> str:
    mirror = length + 1 - i
    image = f" = {symbol}_{mirror}" if tableau.symmetric and mirror != i else ""
    return f"{symbol}_{i}" + (image if mirror else " = 0")


def _highest(tableau: Tableau, h: int) -> int:
    """Return the highest power of tau in row h of Table 2."""
    return max(0, 2 * h - (tableau.first == "drift"))


def _powers(tableau: Tableau) -> int:
    """Return the number of powers for position and momentum; one of them has tau^(2s + 1)."""
    return 2 * tableau.stages + 2


def _powers_header(width: int) -> Header:
    return ("h", *(f"tau^{power}" for power in range(width)))


def _padded(cells: Iterable[str | float], width: int) -> Cells:
    row = list(cells)
    return (*row, *[NOTHING] * (width - len(row)))


def _recursion_entry(tableau: Tableau, h: int, power: int) -> str:
    """Return entry (h, power) of Table 2 without empty terms."""
    before, two_before = _highest(tableau, h - 1), _highest(tableau, h - 2)
    text = f"Q[{h - 1},{power}] Cbar_{h}" if power <= before else ""
    text += f" - C_{h} Q[{h - 2},{power}]" if power <= two_before else ""
    text += f" + D_{h} Qbar[{h - 1},{power - 2}]" if power >= 2 else ""
    return text.removeprefix(" + ")


def _momentum_entries(tableau: Tableau) -> list[str]:
    """Return the last line of Eq. 6, one entry for each power."""
    h, kicked = len(tableau.drift), tableau.first == "kick"
    entries = []
    for power in range(_highest(tableau, h) + 2 * kicked):
        ahead = power + 1
        text = f"Q[{h},{ahead}]" if ahead <= _highest(tableau, h) else ""
        if ahead <= _highest(tableau, h - 1):
            text = f"({text} - Q[{h - 1},{ahead}])"
        text += f" / c_{h}" if text else ""
        text += f" - d_{h + 1} Qbar[{h},{power - 1}]" if kicked and power else ""
        entries.append(text.strip())
    return entries
