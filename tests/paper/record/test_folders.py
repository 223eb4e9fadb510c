"""Results by folder or by name, and errors for unknown names."""

from __future__ import annotations

from pathlib import Path

import pytest

from nearharmonic.errors import UnknownNameError
from nearharmonic_paper.record.files.folders import folder_of, result_names


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A project with two results, an empty folder among them, and a result elsewhere."""
    monkeypatch.chdir(tmp_path)
    for place in ("results/paper/cubes", "results/smoke", "results/empty", "elsewhere/mine", "paper"):
        Path(place).mkdir(parents=True)
    Path("results/smoke/history.jsonl").touch()
    Path("elsewhere/mine/manifest.json").touch()
    return tmp_path


@pytest.mark.parametrize(
    ("name", "folder"),
    [
        ("paper", "results/paper"),
        ("smoke", "results/smoke"),
        ("results/paper", "results/paper"),
        ("results/paper/", "results/paper"),
        ("elsewhere/mine", "elsewhere/mine"),
    ],
)
def test_a_result_is_named_by_its_folder_or_below_results(project, name, folder):
    assert folder_of(name) == Path(folder)


def test_a_result_is_named_by_an_absolute_folder(project):
    assert folder_of(str(project / "elsewhere/mine")) == project / "elsewhere/mine"


def test_a_name_that_is_no_result_gets_its_nearest_match(project):
    with pytest.raises(UnknownNameError, match=r"^unknown result 'papr'\. Did you mean 'paper'\? Known: paper, smoke$"):
        folder_of("papr")


def test_a_folder_without_a_result_is_none(project):
    with pytest.raises(UnknownNameError, match="unknown result 'empty'"):
        folder_of("empty")
    assert result_names() == ["paper", "smoke"]


def test_where_nothing_has_run_command_is_said_that_makes_result(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        UnknownNameError, match=r"no folder below results/ holds a result\. Make the first: snakemake -j2"
    ):
        folder_of("paper")
