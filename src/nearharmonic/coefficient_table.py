"""The paper's Table 4: the independent coefficients of each set, as printed and as derived."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from decimal import Decimal, localcontext

from nearharmonic.integrators import integrators
from nearharmonic.tableau import Tableau

#: The sets of Table 4 in its order.
SETS = (
    "abas5o6h", "abas5o6h_b", "abas5o6h_c", "babs6o7h", "babs6o5h", "babps6o5h", "babs7o7h", "babps7o6h",
    "babps8o7h", "babps9o7h",
)  # fmt: skip

Rows = list[tuple[str | int, ...]]


def independent(tableau: Tableau) -> Iterator[tuple[str, int, str]]:
    """(symbol, index from 1, value) of what the paper prints: half of each row but for what the sum implies.

    As in the table, d is the outer and c the inner row, whatever the operator.
    """
    for symbol, row in (("d", tableau.outer), ("c", tableau.inner)):
        for i in range((len(row) + 1) // 2 - 1):
            yield symbol, i + 1, row[i]


def agreeing_digits(printed: str, derived: str) -> int:
    """Decimals, at most those printed, to which two numbers differ by less than one unit, however the print rounds."""
    with localcontext(prec=300):
        places = -int(Decimal(printed).as_tuple().exponent)
        difference = abs(Decimal(derived) - Decimal(printed))
        return next((n for n in range(places, 0, -1) if difference < Decimal(1).scaleb(-n)), 0)


def table_4(derived: Mapping[str, Tableau] | None = None) -> tuple[tuple[str, ...], Rows]:
    """Table 4: set, coefficient, printed value; with ``derived`` tableaus the derived value and agreeing decimals."""
    rows: Rows = []
    for name in SETS:
        printed = integrators[name]
        found = None if derived is None else derived.get(name)
        others = list(independent(found)) if found is not None else None
        for k, (symbol, i, value) in enumerate(independent(printed)):
            row: tuple[str | int, ...] = (printed.label, f"{symbol}({i})", value)
            if derived is not None:
                other = others[k][2] if others is not None else ""
                row += (other, agreeing_digits(value, other) if other else "not derived")
            rows.append(row)
    header: tuple[str, ...] = ("set", "coefficient", "printed")
    return (header if derived is None else (*header, "derived", "agreeing decimals")), rows
