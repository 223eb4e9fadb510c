"""docs/claims.json: results decide it again, and README and docs/results/claims.md are made from it."""

from __future__ import annotations

import csv
import json
import re

import pytest

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import BENCHMARKED, plain_integrators
from nearharmonic_paper.claims.claim import failures
from nearharmonic_paper.claims.documents import FAILURES, documents, failures_in_words, verdicts
from nearharmonic_paper.claims.table import decided
from nearharmonic_paper.pages.targets import stability
from support.projects.workflow_project import Project
from support.results.recorded_results import unpack
from support.results.stated_numbers import ROOT, flat

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


def test_recorded_results_are_those_of_registered_methods(tmp_path):
    """Sizes and symmetry from the coefficients, apart from the code that made the table."""
    with (unpack(tmp_path) / "tables/integrators.csv").open(encoding="utf-8") as file:
        rows = {row["integrator"]: row for row in csv.DictReader(file)}
    assert {*BENCHMARKED} < rows.keys() <= {*plain_integrators.registered}
    mirrored = {
        name for name, one in plain_integrators.items()
        if name in rows and one.kick == one.kick[::-1] and one.drift == one.drift[::-1]
    }  # fmt: skip
    assert {name for name, row in rows.items() if row["symmetric"] == "yes"} == mirrored
    assert VALUES["even-orders"] == f"{len(mirrored)} of {len(mirrored)} methods"


@pytest.mark.slow
def test_results_that_decide_not_all_write_nothing(tmp_path):
    with pytest.raises(NearharmonicError, match=r"undecided, like even-orders \(tables/.*: no verdict is"):
        verdicts(str(tmp_path), str(ROOT / "README.md"), plain_integrators.registered)


def test_misprints_are_errata_and_everything_else_is_decided():
    assert [entry["id"] for entry in ENTRIES if entry["verdict"] == "not decided here"] == []
    assert {entry["id"] for entry in ENTRIES if entry["verdict"] == "erratum"} == {
        entry["id"] for entry in ENTRIES if entry["kind"] == "misprint"
    }


def test_what_fails_in_substance_is_said_in_a_sentence():
    assert {entry["id"] for entry in failures(ENTRIES)} == set(FAILURES)
    assert failures_in_words(ENTRIES) in README
    assert "One failure is an attribution." in README


@pytest.mark.slow
def test_the_committed_verdicts_are_decided_again_from_recorded_results(tmp_path):
    assert decided(unpack(tmp_path), plain_integrators.registered)["document"] == TEXT


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
