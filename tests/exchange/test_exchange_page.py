"""The page on checking coefficients: its table and its numbers are those of the files of this folder."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mpmath import cbrt, mpf

from support.methods.tableau_files import names, verdict

DOCS = Path(__file__).parents[2] / "docs"


def page():
    return " ".join(" ".join(path.read_text(encoding="utf-8") for path in sorted(DOCS.glob("exchange*.md"))).split())


def test_table_holds_every_file_of_library_whose_order_is_wrong():
    rows = set()
    for name in names("libraries"):
        found = verdict("libraries", name)
        orders = (found.order.order, found.quadratic_order.order, found.oscillator.order)
        if not found.holds and all(orders):  # a row whose sum is wrong has no order
            claimed = f"{found.file.order}{', quadratic T' if found.file.requires else ''}"
            rows.add(f"| {found.file.label} | {claimed} | {' | '.join(map(str, orders))} |")
    assert len(rows) == 9
    assert rows == set(re.findall(r"\| [^|]+ of [^|]+ \| \d[^|]* \| \d \| \d \| \d \|", page()))


def test_the_wrong_decimal_is_that_of_the_page():
    found = verdict("libraries", "teloy_8a17c")
    (decimal,) = re.findall(r"as decimal (\d+)", found.suspects[0].says)
    assert re.search(rf"\b{decimal}st decimal of `drift\[5\]` and of its mirror image", page())
    assert f"the drifts sum to 1 + {float(found.sums['drift'].value):.0e}" in page()


@pytest.mark.parametrize("n", [3, 5])
def test_weights_of_gromacs_have_root_of_page_upside_down(n):
    weights = [mpf(text) for text in verdict("libraries", f"suzuki_yoshida_{n}").file.kick]
    root = cbrt(mpf(n - 1))
    assert abs(weights[0] - 1 / (n - 1 - 1 / root)) < 1e-15
    assert abs(sum(weights) - 1) < 1e-15
    assert abs(sum(w**3 for w in weights)) > 0.02
    right = [1 / (n - 1 - root)] * (n - 1)
    right.insert(n // 2, 1 - sum(right))
    assert abs(sum(w**3 for w in right)) < 1e-14


def test_ordinarydiffeq_methods_have_page_orders_with_exchanged_roles():
    warning = verdict("libraries", "ordinarydiffeq_calvosanz4").warnings[0]
    assert warning == "for quadratic T the order is 3 with the drift first, and 4 with the roles exchanged"
    assert "CalvoSanz4 has order 4 for quadratic T" in page()
