"""The targets that derive coefficients, end to end on the smoke config: found, proved, and the same again."""

from __future__ import annotations

import csv
import tomllib

import pytest

SMOKE = ("--configfile", "config/smoke.yaml")


@pytest.fixture(scope="module")
def derived(project):
    done = project.snakemake("-j2", "derive", *SMOKE)
    assert done.returncode == 0, done.stdout
    return project


def table(project, stem):
    with (project.folder / f"results/smoke/tables/{stem}.csv").open() as file:
        return list(csv.DictReader(file))


def test_the_isolated_sets_of_table_4_come_out_to_every_printed_decimal(derived):
    rows = [row for row in table(derived, "table4_derived") if row["set"].startswith(("ABAs5o6H", "BABs6o7H"))]
    assert len(rows) == 17
    assert {row["agreeing decimals"] for row in rows} == {"76"}


def test_every_real_solution_is_proved_and_none_is_missing(derived):
    rows = table(derived, "derived_counts")
    assert [row["real solutions by Sturm"] for row in rows] == ["4", "3", "9"]
    assert [row["proved to exist"] for row in rows] == ["4", "3", "9"]
    assert {row["complete"] for row in rows} == {"yes"}


def test_the_document_holds_128_digits_and_where_they_come_from(derived):
    document = tomllib.loads((derived.folder / "results/smoke/derived/coefficients.toml").read_text())
    assert {"package_version", "code_digest", "settings"} <= set(document["provenance"])
    for case in document["isolated"]:
        for root in case["roots"]:
            assert all(len(c.partition(".")[2]) >= 127 for c in root["outer"])


def test_a_figure_derives_nothing(derived):
    assert not {"derive_coefficients", "search_sixth_order"} & set(derived.jobs("figures", *SMOKE))


def test_everything_holds_what_the_default_leaves_out(derived):
    more = set(derived.jobs("everything", *SMOKE)) - set(derived.jobs("all", *SMOKE))
    assert {"search_sixth_order", "work_precision_times", "stability_run"} <= more
