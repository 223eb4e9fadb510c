"""Sums of verdicts, and the message of a run on open statements."""

from __future__ import annotations

import json
import re

import pytest

from nearharmonic_paper.claims.claim import failures, sums, tally, verdicts_line
from nearharmonic_paper.claims.table import CLAIMS

TARGETS = {one.id: one.target for one in CLAIMS}


def entry(name, verdict, kind="result"):
    return {"id": name, "verdict": verdict, "kind": kind}


ENTRIES = [
    entry("a", "holds"), entry("b", "holds"), entry("c", "fails"), entry("d", "fails", "attribution"),
    entry("e", "erratum", "misprint"), entry("f", "holds", "finding"), entry("g", "holds but for edges", "background"),
]  # fmt: skip


def test_findings_are_not_counted():
    told = "2 hold, 1 holds but for edges, 2 fail, 1 erratum"
    assert tally(ENTRIES) == f"Of the 6 statements of the paper that are checked {told}"


def test_sums_are_by_kind_in_the_order_of_their_weight():
    assert [(kind, number) for kind, number, _ in sums(ENTRIES)] == [
        ("results", 3), ("background", 1), ("attributions", 1), ("misprints", 1),
    ]  # fmt: skip
    assert sums(ENTRIES)[0][2]["holds"] == 2


def test_only_results_and_mathematics_fail_in_substance():
    assert [one["id"] for one in failures(ENTRIES)] == ["c"]


@pytest.mark.parametrize(
    ("missing", "end"),
    [
        ((), "statements of the paper that are checked 1 holds."),
        (("derive", "stability"), "snakemake -j2 derive stability decides all of those left open (50 s, 70 s)."),
        (("all", "derive"), "snakemake -j2 derive decides most of those left open (50 s)."),
        (("all",), "1 holds, 1 not decided here."),
    ],
)
def test_run_names_command_that_decides_what_it_leaves_open(tmp_path, missing, end):
    names = [next(name for name, target in TARGETS.items() if target == one) for one in missing]
    entries = [entry("x", "holds"), *(entry(name, "not decided here") for name in names)]
    document = tmp_path / "claims.json"
    document.write_text(json.dumps(entries), encoding="utf-8")
    line = verdicts_line(document, "snakemake -j2")
    assert line.startswith(f"Of the {len(entries)} statements")
    assert line.endswith(end)
    other = verdicts_line(document, "snakemake -j2 --configfile a.yaml")
    assert other == re.sub("(snakemake -j2.*?)( decides)", r"\1 --configfile a.yaml\2", line)
