"""Pages for developers and the changelog: they are short, name tests that exist, and have one version everywhere."""

from __future__ import annotations

import ast
import re
import tomllib

import pytest
import yaml

import nearharmonic as nh
from support.projects.extras import EXTRAS
from support.results.stated_numbers import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
FOLDER = ROOT / "docs/developers"
#: Most words of pages beside the usual number.
WORDS = {"SECURITY.md": 120, "CHANGELOG.md": 1200}
PAGES = [*sorted(FOLDER.glob("*.md")), ROOT / "CONTRIBUTING.md", *(ROOT / name for name in WORDS)]
CITED = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_page_is_short_and_names_tests_that_exist(page):
    text = page.read_text(encoding="utf-8")
    by_hand = re.sub(r"<!-- \w+ -->.*?<!-- end -->", "", text, flags=re.DOTALL)
    assert len(by_hand.split()) <= WORDS.get(page.name, 1400)
    for file, name in re.findall(r"\b(tests/[\w/]+\.py)(?:::(\w+))?", text):
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert not name or name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, name


def test_marks_and_extras_are_listed():
    marks = {mark.partition(":")[0] for mark in PROJECT["tool"]["pytest"]["ini_options"]["markers"]}
    for name, wanted in {"testing": marks, "releasing": {*EXTRAS}}.items():
        page = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
        assert set(re.findall(r"^\| `([\w-]+)` \|", page, re.MULTILINE)) == wanted


def test_drawing_has_the_layers_of_the_import_contracts():
    drawn = re.findall(r'<tspan class="room">(\w+)<', (FOLDER / "layers.svg").read_text(encoding="utf-8"))
    contracts = {one["name"]: one for one in PROJECT["tool"]["importlinter"]["contracts"]}
    layers = [layer for of in ("paper", "library") for layer in contracts[f"rooms of the {of} are in layers"]["layers"]]
    assert drawn == [room.strip() for layer in layers for room in layer.split("|")]


def test_the_map_of_the_house_names_what_exists():
    (listing,) = re.findall(r"```\n(.*?)```", (FOLDER / "house.md").read_text(encoding="utf-8"), re.DOTALL)
    folder = ROOT
    for line in listing.splitlines():
        names = re.findall(r"[\w./]+(?:/|\.py)(?=[\s,]|$)", line)
        if not line.startswith(" ") and names:
            folder = ROOT / names[0]
        assert [name for name in names if not (folder / name).exists() and not (ROOT / name).exists()] == []


def test_newest_release_is_the_version_of_package_and_citation():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    version, day = re.findall(r"^## \[(\d\S*)\] - (\S+)$", text, re.MULTILINE)[0]
    assert (version, day) == (CITED["version"], CITED["date-released"].isoformat())
    assert version == nh.__version__
