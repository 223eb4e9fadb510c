"""The paper's tables for a named method.

Each function except :func:`paper_tables` returns ``(header, rows)``: names of columns, and rows of strings, integers
and floats as long as the header. Symbols are the paper's, d for kicks and c for drifts, both counted from 1, k = s + 1
and a padding 0 at the end of the shorter row. ``first`` selects the composition, "drift" for ABA and "kick" for BAB;
None for the declared one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from nearharmonic.integrators import forest_ruth_1990
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.output.table import Table
from nearharmonic.theory.order import closed_sums, momentum_row, position_rows
from nearharmonic.theory.oscillator import table_4, tableau_of
from nearharmonic_paper.experiments.paper.tableaus.overview import Cells, Columns, Header, overview

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
