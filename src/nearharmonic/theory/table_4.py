"""Table 4 of the paper: the independent coefficients of each set, printed and derived."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from nearharmonic.exact.polynomials import decimals_in_common
from nearharmonic.integrators.nielsen_2015 import TABLEAUS
from nearharmonic.integrators.tableau import Tableau

Rows = list[tuple[str | int, ...]]


def independent(tableau: Tableau) -> Iterator[tuple[str, int, str]]:
    """Return (symbol, index from 1, value) of each coefficient in the table.

    The table has half of each row, without the value that follows from the sum. d is the outer and c the inner row for
    both compositions.
    """
    for symbol, row in (("d", tableau.outer), ("c", tableau.inner)):
        for i in range((len(row) + 1) // 2 - 1):
            yield symbol, i + 1, row[i]


def table_4(derived: Mapping[str, Tableau] | None = None) -> tuple[tuple[str, ...], Rows]:
    """Return the header and the rows of Table 4, with ``derived`` sets, by name, beside the printed ones.

    There is a row for each independent coefficient: set, coefficient and printed value, with ``derived`` also the
    derived value and the decimals that agree. A set without a derived counterpart is marked as not derived.
    """
    rows: Rows = []
    for printed in TABLEAUS:
        found = None if derived is None else derived.get(printed.name)
        others = list(independent(found)) if found is not None else None
        for k, (symbol, i, value) in enumerate(independent(printed)):
            row: tuple[str | int, ...] = (printed.label, f"{symbol}({i})", value)
            if derived is not None:
                other = others[k][2] if others is not None else ""
                row += (other, decimals_in_common(value, other) if other else "not derived")
            rows.append(row)
    header: tuple[str, ...] = ("set", "coefficient", "printed")
    return (header if derived is None else (*header, "derived", "agreeing decimals")), rows
