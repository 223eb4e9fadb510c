"""Table 4 and the files that tables are written to."""

from __future__ import annotations

import csv
from dataclasses import replace

import nearharmonic as nh
from nearharmonic.output.table import SUFFIXES, Table, save
from nearharmonic.theory.oscillator import SETS, independent, table_4


def test_table_4_prints_the_paper_s_independent_coefficients():
    """Counted in the paper: 4 each for five stages, 5 for six, 6 for seven, 7 for eight, 8 for nine."""
    header, rows = table_4()
    assert header == ("set", "coefficient", "printed")
    assert len(rows) == 3 * 4 + 3 * 5 + 2 * 6 + 7 + 8
    assert rows[0] == (
        "ABAs5o6H",
        "d(1)",
        "0.1558593591762168313166117535752091422239663993391011462498104831549442591694",
    )
    assert rows[-1][1] == "c(4)"


def test_every_set_of_the_paper_is_in_the_table():
    assert set(SETS) == {name for name, t in nh.integrators.items() if "1501.04345" in t.source}


def test_a_derived_value_stands_beside_the_printed_one():
    tableau = nh.integrators["babs7o7h"]
    header, rows = table_4({"babs7o7h": replace(tableau, label="found")})
    assert header[-1] == "agreeing decimals"
    mine = [row for row in rows if row[0] == "BABs7o7H"]
    assert [row[2] for row in mine] == [value for _, _, value in independent(tableau)]
    assert {row[4] for row in mine} == {76}
    assert {row[4] for row in rows if row[0] != "BABs7o7H"} == {"not derived"}


def test_table_is_written_three_times_and_csv_keeps_every_digit(tmp_path):
    rows = [("Ruth", 1 / 3), ("A & B", 2.0)]
    table = Table(header=("method", "error"), rows=rows, caption="Errors.")
    paths = save(table, [tmp_path / f"errors.{suffix}" for suffix in SUFFIXES])
    assert [path.name for path in paths] == ["errors.csv", "errors.md", "errors.tex"]
    with paths[0].open() as file:
        assert float(list(csv.reader(file))[1][1]) == 1 / 3
    assert "| Ruth" in paths[1].read_text()
    assert "0.3333" in paths[1].read_text()
    assert r"A \& B" in paths[2].read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["errors.csv", "errors.md", "errors.tex"]
