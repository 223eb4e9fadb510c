"""The page on upgrades: its commands are those of the lock and of CI, and its table is what the digests cover."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata

import pytest

from nearharmonic.core.machine import native
from nearharmonic_paper.report import assets
from nearharmonic_paper.tasks import provenance
from support.projects.workflow_project import ROOT

PAGE = (ROOT / "docs/how_to/upgrades.md").read_text(encoding="utf-8")
BASH = "".join(re.findall(r"```bash\n(.*?)```", PAGE, flags=re.DOTALL))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def in_one_line(text):
    return re.sub(r"\s*\\\n#?\s*", " ", text)


def row(words):
    """Packages of the row of the table whose effect has these words."""
    (found,) = [line for line in PAGE.splitlines() if line.startswith("| `") and words in line]
    return re.findall(r"`([^`]+)`", found.split("|")[1])


def test_command_of_the_lock_is_that_of_its_header():
    header = (ROOT / "requirements.lock").read_text(encoding="utf-8").partition("annotated-types")[0]
    (made,) = re.findall(r"^# Made by: (.*)$", in_one_line(header), flags=re.MULTILINE)
    assert made.strip() in in_one_line(BASH)


def test_extras_of_the_constraints_are_pinned():
    (extras,) = re.findall(r"fresh/bin/pip install -e '\.\[([\w,]+)\]'", BASH)
    optional = PROJECT["project"]["optional-dependencies"]
    assert {*extras.split(",")} <= optional.keys()
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").lower().replace("_", "-").splitlines()
    pinned = {line.partition("==")[0] for line in lines}
    asked = [text for name in extras.split(",") for text in optional[name]]
    names = {re.match(r"[\w-]+", text)[0].lower() for text in asked} - {"nearharmonic"}
    assert names <= pinned


def test_libraries_that_invalidate_results_are_those_of_the_digests():
    assert tuple(row("in the digest of every job")) == provenance.NUMERICAL_LIBRARIES
    recorded = {*provenance.LIBRARIES} - {*provenance.NUMERICAL_LIBRARIES}
    assert {*row("files may have other bytes")} - {"h5netcdf"} == recorded


@pytest.mark.parametrize("package", row("in the digest of every kernel"))
def test_version_of_a_compiler_is_in_the_digest_of_kernels(monkeypatch, package):
    digest = native._source_digest.__wrapped__
    before = digest()
    monkeypatch.setattr(native, "version", lambda name: "99" if name == package else metadata.version(name))
    assert digest() != before


def test_version_of_bokeh_is_in_the_digest_of_the_page(monkeypatch):
    assert row("in the digest of the page") == ["bokeh"]
    before = assets.digest()
    monkeypatch.setattr(assets, "version", lambda name: "99")
    assert assets.digest() != before


def test_commands_of_tests_are_those_of_ci():
    run = (ROOT / ".ci/run").read_text(encoding="utf-8")
    weekly = (ROOT / ".github/workflows/weekly.yml").read_text(encoding="utf-8")
    lowest = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
    chosen = re.findall(r'fresh/bin/pytest -m "(.*?)"', BASH)
    assert f'"{chosen[0]}"' in run
    assert f'"{chosen[1]}"' in weekly
    assert "--resolution lowest-direct -e '.[test]'" in BASH
    assert "--resolution lowest-direct -e '.[test]'" in lowest
    assert re.search(r"low/bin/(pytest .*)", BASH)[1] in lowest
    for tool in re.findall(r"fresh/bin/(ruff check \.|mypy|lint-imports)", BASH):
        assert tool in run


def test_files_that_the_page_names_exist():
    for name in re.findall(r"(?:tests|benchmarks|config)/[\w/]+\.(?:py|yaml)", PAGE):
        assert (ROOT / name).is_file(), name
    assert PROJECT["tool"]["pytest"]["ini_options"]["filterwarnings"] == ["error"]
