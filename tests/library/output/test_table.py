"""Tables: their forms, and reading one back from CSV."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import tabulate

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.table import Table, from_csv

TABLE = Table(header=["name", "size"], rows=[["a, b", 0.1234567], ["c", 2]], caption="Sizes.")


def test_each_form_holds_the_digits_that_its_readers_see():
    assert TABLE.csv() == 'name,size\n"a, b",0.1234567\nc,2\n'
    assert TABLE.markdown().splitlines()[0::4] == ["Sizes.", "| a, b   | 0.1235 |"]
    assert TABLE.latex().startswith("% Sizes.\n\\begin{tabular}")
    assert [line.split() for line in TABLE.lines(digits=2)] == [
        ["Sizes."],
        ["name", "size"],
        ["a,", "b", "0.12"],
        ["c", "2"],
    ]
    assert TABLE.records()[1] == {"name": "c", "size": 2}


def test_bar_in_a_cell_ends_no_cell_of_markdown():
    table = Table(header=["x"], rows=[["|q| < 1"]], caption="Sizes.")
    assert table.markdown().splitlines()[-1] == r"| \|q\| < 1 |"


def test_bytes_are_the_same_with_and_without_wcwidth(monkeypatch):
    """Each cell is padded to its number of characters: a combining accent counts, a Chinese character counts once."""
    odd = Table(header=["name", "size"], rows=[["He\u0301non", 1], ["\u7cfb", 2], ["plain", 3]], caption="Odd.")
    found = []
    for library in (SimpleNamespace(wcswidth=lambda text: 2 * len(text)), None):
        monkeypatch.setattr(tabulate, "wcwidth", library)
        monkeypatch.setattr(tabulate, "WIDE_CHARS_MODE", library is not None)
        found.append((odd.markdown(), odd.latex(), odd.lines()))
        assert (library is not None) is tabulate.WIDE_CHARS_MODE
    assert found[0] == found[1]
    assert len({len(line) for line in found[0][0].splitlines()[2:]}) == 1


def test_table_read_from_its_csv_has_same_cells_as_texts():
    again = from_csv(TABLE.csv())
    assert (again.header, again.rows) == (["name", "size"], [["a, b", "0.1234567"], ["c", "2"]])


@pytest.mark.parametrize(
    ("text", "says"), [("", "no table"), ("a,b\n1\n", "row 0 has 1 cells under 2 names"), ("a\nb,c\n", "row 0")]
)
def test_a_text_that_is_no_table_is_refused(text, says):
    with pytest.raises(NearharmonicError, match=says):
        from_csv(text)
