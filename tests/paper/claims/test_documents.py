"""docs/claims.json: results decide it again, and README and docs/results/claims.md are made from it."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import plain_integrators
from nearharmonic_paper.claims.pages.documents import CARRYING, SUBSTANCE, documents, failures_in_words, verdicts
from nearharmonic_paper.claims.pages.summary import failures, of_the_paper
from nearharmonic_paper.claims.table import decided
from nearharmonic_paper.pages.targets import stability
from support.projects.workflow_project import Project
from support.results.recorded_results import unpack
from support.results.stated_numbers import ROOT, flat, numbers, states

TEXT = (ROOT / "docs/claims.json").read_text(encoding="utf-8")
ENTRIES = json.loads(TEXT)
VALUES = {entry["id"]: entry["value"] for entry in ENTRIES}
PAGE = (ROOT / "docs/results/claims.md").read_text(encoding="utf-8")
README = flat("README.md")


def test_page_and_readme_are_made_from_the_committed_verdicts():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    damaged = re.sub(r"\*\*holds\*\*", "**fails**", readme)
    assert damaged != readme
    assert documents(TEXT, damaged) == {"page": PAGE, "readme": readme}


def test_recorded_results_are_those_of_every_registered_method(tmp_path):
    """Sizes and symmetry from the coefficients, apart from the code that made the table."""
    with (unpack(tmp_path) / "tables/integrators.csv").open(encoding="utf-8") as file:
        rows = {row["integrator"]: row for row in csv.DictReader(file)}
    assert rows.keys() == {*plain_integrators.registered}
    mirrored = {
        name for name, one in plain_integrators.items()
        if name in rows and one.kick == one.kick[::-1] and one.drift == one.drift[::-1]
    }  # fmt: skip
    assert {name for name, row in rows.items() if row["symmetric"] == "yes"} == mirrored
    assert VALUES["even-orders"] == f"{len(mirrored)} of {len(mirrored)} methods"


def test_results_that_decide_not_all_write_nothing(tmp_path):
    with pytest.raises(NearharmonicError, match=r"undecided, like even-orders \(tables/.*: no verdict is"):
        verdicts(str(tmp_path), str(ROOT / "README.md"), plain_integrators.registered)


def test_no_page_line_is_long_and_every_statement_is_folded():
    assert max(map(len, PAGE.splitlines())) <= 300
    folded = re.findall(r"<details>.*?</details>", PAGE, re.DOTALL)
    for entry in of_the_paper(ENTRIES):
        assert sum(f"`{entry['id']}`" in one for one in folded) == 1, entry["id"]
    before = PAGE.partition("<details>")[0]
    assert sum(f"`{name}`" in before for name in CARRYING) == len(CARRYING) == 12


def test_misprints_are_errata_and_nothing_else_is():
    assert {entry["id"] for entry in ENTRIES if entry["verdict"] == "erratum"} == {
        entry["id"] for entry in ENTRIES if entry["kind"] == "misprint"
    }


def test_the_attribution_to_kahan_is_wrong():
    assert [entry["verdict"] for entry in ENTRIES if entry["kind"] == "attribution"] == ["fails"]


def test_what_fails_in_substance_is_said_in_a_sentence():
    assert {entry["id"] for entry in failures(ENTRIES)} == set(SUBSTANCE)
    assert failures_in_words(ENTRIES) in README
    assert "One failure is an attribution." in README


@pytest.mark.slow
def test_the_committed_verdicts_are_decided_again_from_recorded_results(tmp_path):
    assert decided(unpack(tmp_path), plain_integrators.registered)["document"] == TEXT


def test_everything_that_can_be_decided_is():
    assert [entry["id"] for entry in ENTRIES if entry["verdict"] == "not decided here"] == []


def test_the_first_sentence_of_readme_promises_what_was_measured():
    """Whole decades of the best gain over Ruth's method on the near-harmonic system, Hénon-Heiles."""
    (gain,) = numbers(VALUES["outperform-ruth-henon-heiles"], r"over the best up to (.*)$")
    word = {3: "three", 4: "four", 5: "five"}[int(np.log10(gain))]
    assert f"up to {word} decades better than Ruth's method" in README


def test_the_caption_of_readme_has_the_stretches_that_were_measured():
    value = VALUES["fig-3-sixth-order-descent"]
    found = [one for name in ("8", "9") for one in numbers(value, rf"BAB's{name}o7H for τ/s = (\S+) to (\S+) \(")]
    for ends in (found[:2], found[2:]):
        assert states("README.md", [float(f"{one:.2g}") for one in ends], "BAB's8o7H", "BAB's9o7H", "τ/s", "falls")


def test_the_page_states_the_gains_by_compensated_sums():
    gains = numbers(VALUES["compensated-summation"], r"gains (\d+) \(Ruth\) to (\d+)")
    assert states("docs/results/stability.md", gains, "compensation", "times smaller")


@pytest.mark.slow
@pytest.mark.reproduction
def test_the_committed_verdicts_are_those_of_a_run(tmp_path):
    """The default run and the targets that statements need, on the paper's config; a few minutes."""
    project = Project(tmp_path)
    needed = ("all", "derive", "stability", "results/paper/cubes/trained.h5")
    assert project.snakemake(*needed, "-j2").returncode == 0
    done = project.snakemake("results/paper/tables/claims.json", "--force", "-j2")
    assert done.returncode == 0, done.stdout
    assert (tmp_path / "results/paper/tables/claims.json").read_text(encoding="utf-8") == TEXT
    names = ("stability_henon_heiles", "stability_rounding", "kinetic_energy")
    tables = [str(tmp_path / f"results/paper/tables/{name}.csv") for name in names]
    page = ROOT / "docs/results/stability.md"
    assert stability(str(page), tables=tables)["page"] == page.read_text(encoding="utf-8")
