"""The target that derives coefficients, end to end on the tiny config: found and proved."""

from __future__ import annotations

import csv
import tomllib

import pytest

SMOKE = ("--configfile", "config/smoke.yaml")


def table(everything, stem):
    with (everything.folder / f"results/tiny/tables/{stem}.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_isolated_sets_of_table_4_match_every_printed_decimal(everything):
    rows = [row for row in table(everything, "table4_derived") if row["set"].startswith(("ABAs5o6H", "BABs6o7H"))]
    assert len(rows) == 17
    assert {row["agreeing decimals"] for row in rows} == {"76"}


@pytest.mark.slow
def test_every_real_solution_is_proved_and_none_is_missing(everything):
    rows = table(everything, "derived_counts")
    assert [row["real solutions by Sturm"] for row in rows] == ["4", "3", "9"]
    assert [row["proved to exist"] for row in rows] == ["4", "3", "9"]
    assert {row["complete"] for row in rows} == {"yes"}


@pytest.mark.slow
def test_the_document_holds_128_digits_and_where_they_come_from(everything):
    document = tomllib.loads((everything.folder / "results/tiny/derived/coefficients.toml").read_text())
    assert {"package_version", "code_digest", "settings"} <= set(document["provenance"])
    for case in document["isolated"]:
        for root in case["roots"]:
            assert all(len(c.partition(".")[2]) >= 127 for c in root["outer"])


@pytest.mark.slow
def test_a_figure_derives_nothing(drawn):
    assert not {"derive_coefficients", "search_sixth_order"} & set(drawn.jobs("figures", *SMOKE))


@pytest.mark.slow
def test_everything_holds_what_the_default_leaves_out(project):
    more = set(project.jobs("everything", *SMOKE)) - set(project.jobs("all", *SMOKE))
    assert {"search_sixth_order", "work_precision_times", "stability_run"} <= more
