"""Results from the coefficients of methods alone: the paper's tables, one of all methods, and error terms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from nearharmonic.exact.polynomials import BigFloat, fixed_point
from nearharmonic.integrators import forest_ruth_1990, plain_integrators
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.math import pow
from nearharmonic.output.store import assembled, coordinate, method_coordinates, variable
from nearharmonic.output.table import Table
from nearharmonic.theory import order
from nearharmonic.theory.oscillator import kappa, lambda_max, stability_gaps, tableau_of
from nearharmonic.theory.table_4 import table_4

if TYPE_CHECKING:
    import xarray as xr


# --- Table of all methods, computed without integration; the paper has no such table.

Header = tuple[str, ...]
Cell = str | int | float
Cells = tuple[Cell, ...]
Columns = tuple[Header, list[Cells]]

#: Quantities whose harmonic order is a column.
HARMONIC = ("position", "momentum", "energy")
#: Potentials for which an order is a column besides, by degree; T is quadratic.
POLYNOMIALS = {"quartic": 4, "cubic": 3}


def overview(*names: str) -> Columns:
    """Return the columns and one row for each method, by default for each one without modified potentials.

    Errors are powers of tau with the norms of :func:`nearharmonic.theory.order.leading_errors`. An
    effective error is s norm^(1/order), which includes the cost of s stages. Edges of stability have 12 decimals.
    """
    rows = [columns_of(registry[name]) for name in names or plain_integrators]
    return tuple(rows[0]), [tuple(row.values()) for row in rows]


def columns_of(tableau: Tableau) -> dict[str, Cell]:
    """Return the row of a method by column; what holds for any T is left empty if kicks are of a modified potential."""
    harmonic, errors = order.harmonic_orders_of(tableau), order.leading_errors(tableau)
    gaps, is_general = stability_gaps(tableau), not tableau.modified
    coefficients = [Fraction(c) for c in (*tableau.kick, *tableau.drift)]
    return {
        "integrator": tableau.name,
        "label": tableau.label,
        "composition": "ABA" if tableau.first == "drift" else "BAB",
        "symmetric": "yes" if tableau.symmetric else "no",
        "stages": tableau.stages,
        "order": order.order_of(tableau),
        "Nystrom order": order.nystrom_order_of(tableau),
        **{f"order for {name} V": order.order_of(tableau, potential_degree=n) for name, n in POLYNOMIALS.items()},
        "generalised order": _generalised(tableau, quadratic=False) if is_general else "",
        "Nystrom generalised order": _generalised(tableau, quadratic=True),
        **{f"harmonic order of {what}": value for what, value in zip(HARMONIC, harmonic, strict=False)},
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


def _leading(kind: str, error: order.ErrorTerm | None, tableau: Tableau) -> dict[str, Cell]:
    """The leading error of a kind with its norm, and the effective error."""
    cells: tuple[Cell, ...] = ("", "", "")
    if error is not None:
        cells = (*error, float(tableau.stages * pow(error.norm, 1 / (error.degree - 1))))
    names = (f"{kind}leading error", f"{kind}leading error norm", f"{kind}effective error")
    return dict(zip(names, cells, strict=True))


def _generalised(tableau: Tableau, *, quadratic: bool) -> str:
    return "(" + ", ".join(map(str, order.generalised_order_of(tableau, quadratic=quadratic))) + ")"


# --- The paper's tables for a named method.
#
# Each function except :func:`paper_tables` returns ``(header, rows)``: names of columns, and rows of strings,
# integers and floats as long as the header. Symbols are the paper's, d for kicks and c for drifts, both counted from
# 1, k = s + 1 and a padding 0 at the end of the shorter row. ``first`` selects the composition, "drift" for ABA and
# "kick" for BAB; None for the declared one.

NOTHING = ""


def paper_tables(integrators: Sequence[str]) -> dict[str, Table]:
    """Return the paper's tables, and the table of the methods ``integrators``, by their file names.

    The paper illustrates its Tables 2 and 3 with three stages in the BAB composition; here they are for Ruth's method.
    """
    (ruth,) = forest_ruth_1990.TABLEAUS
    symbols, values = (made(ruth, first="kick") for made in (recursion_symbols, recursion_values))
    made: dict[str, tuple[tuple[Header, Sequence[Cells]], str]] = {
        "table1_structure": (structure(ruth), "Table 1: mirror images among the coefficients of Ruth's method."),
        "table2_recursion": (symbols, "Table 2: the recursion for three stages as BAB, in symbols."),
        "table2_values": (values, "Table 2 for Ruth's method as BAB, in numbers."),
        "table3_even_orders": (
            even_orders(ruth, first="kick"), "Table 3: closed sums for Ruth's method as BAB, beside Table 2's numbers."
        ),
        "table4_coefficients": (table_4(), "Table 4: independent coefficients; d is the outer row, c the inner one."),
        "integrators": (
            overview(*integrators), "Every integrator: structure, orders, leading errors, linear stability."
        ),
    }  # fmt: skip
    return {stem: Table(header=header, rows=rows, caption=text) for stem, ((header, rows), text) in made.items()}


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
    first_drift = ["Q[0,0]", "c_1 p_a / m", "D_1 Qbar[0,0]"][: _highest(tableau, 1) + 1]
    later = [
        (h, [_recursion_entry(tableau, h, power) for power in range(_highest(tableau, h) + 1)])
        for h in range(2, len(tableau.drift) + 1)
    ]
    return _by_power(tableau, [(0, ["q_a"]), (1, first_drift), *later, ("p_b / m", _momentum_entries(tableau))])


def recursion_values(integrator: str | Tableau, *, first: First | None = None) -> Columns:
    """Return Table 2 in numbers for m = k = 1; even powers have units of q_a, odd ones p_a (momentum: vice versa)."""
    tableau = tableau_of(integrator, first)
    rows = [(h, row[: _highest(tableau, h) + 1]) for h, row in enumerate(order.position_rows(tableau))]
    every: list[tuple[str | int, Sequence[Any]]] = [*rows, ("p_b", order.momentum_row(tableau))]
    return _by_power(tableau, [(h, [float(x) for x in row]) for h, row in every])


def even_orders(integrator: str | Tableau, *, first: First | None = None) -> Columns:
    """Return Table 3: the closed sums for q_a = m = 1, and the numbers of the recursion.

    The column "as printed" has the inner upper limit h - 1 of Table 3 in place of the correct limit h of Eq. 16.
    """
    tableau = tableau_of(integrator, first)
    header = ("h", "tau^0", "tau^2", "tau^4", "tau^2 of Table 2", "tau^4 of Table 2", "tau^4 as printed")
    rows: list[Cells] = []
    for h, (sums, row) in enumerate(zip(order.closed_sums(tableau), order.position_rows(tableau), strict=True)):
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


def _by_power(tableau: Tableau, rows: Iterable[tuple[str | int, Sequence[str | float]]]) -> Columns:
    """Return the columns and rows of Table 2; a row has no entries for the highest powers, up to tau^(2s + 1)."""
    width = 2 * tableau.stages + 2
    header = ("h", *(f"tau^{power}" for power in range(width)))
    return header, [(h, *cells, *[NOTHING] * (width - len(cells))) for h, cells in rows]


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


# --- Error terms of the oscillator: errors of the position after one step, order by order.

#: Decimals from which rounded coefficients leave terms far below 1e-30: the ten benchmarked methods have as many.
MANY_DIGITS = 39


def decompose(integrators: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the ``cube`` of position error terms kappa over (integrator, first, order).

    Terms are up to the highest order of each composition, and NaN in the exchanged role of a method with modified
    potentials, which does not exist.
    """
    tableaus, roles = [registry[name] for name in integrators], get_args(First)
    terms = [[_terms(t, first) for first in roles] for t in tableaus]
    highest = max(len(row) for rows in terms for row in rows)
    values = [[[*map(float, row), *[np.nan] * (highest - len(row))] for row in rows] for rows in terms]
    text = "position error term kappa of the harmonic oscillator; kick first is BAB, drift first is ABA"
    variables = {
        **method_coordinates(tableaus),
        **coordinate("first", roles, "operator that comes first"),
        **coordinate("order", np.arange(1, highest + 1), "order lambda in tau"),
        "kappa": variable(("integrator", "first", "order"), values, text),
    }
    return {"cube": assembled(variables, ["label"], {})}


def _terms(tableau: Tableau, first: First) -> list[BigFloat]:
    """Return the terms; terms that vanish to the digits of a method are 0, not their rounding errors."""
    if tableau.modified and first != tableau.first:
        return []
    terms = kappa(tableau, lambda_max(tableau, first=first), first=first)
    vanishing = order.harmonic_order(tableau, first=first) if tableau.digits < MANY_DIGITS else 0
    return [*(0 * term for term in terms[:vanishing]), *terms[vanishing:]]
