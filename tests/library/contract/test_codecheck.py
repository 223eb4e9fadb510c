"""codecheck.yml: its manifest is the figures and tables of the paper, as the default target makes them."""

from __future__ import annotations

from pathlib import Path

import yaml

from support.projects.targets import TARGETS

ROOT = Path(__file__).parents[3]


def test_the_manifest_is_the_figures_and_tables_of_the_paper():
    told = yaml.safe_load((ROOT / "codecheck.yml").read_text(encoding="utf-8"))
    files = {one["file"].removeprefix("results/paper/") for one in told["manifest"]}
    assert len(files) == len(told["manifest"])
    assert files <= TARGETS["all"]
    numbered = {name for name in TARGETS["all"] if name.startswith(("figures/fig", "tables/table"))}
    wanted = {name for name in numbered if name.endswith((".pdf", ".csv")) and "displaced" not in name}
    assert files == wanted | {"tables/claims.csv"}


def test_every_repository_address_is_that_of_the_citation():
    (address,) = (
        line.partition(": ")[2]
        for line in (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
        if line.startswith("repository-code: ")
    )
    for name in ("codecheck.yml", "pyproject.toml", "README.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        assert text.count("github.com/nearharmonic") == text.count(address) > 0, name
