"""A project with a finished result, made once a process, and others to compare it with."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from support.results import result_folder
from support.results.result_folder import SWEEPS


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A small finished result, for reading alone."""
    return result_folder.build(tmp_path_factory.mktemp("finished") / "results/paper")


@pytest.fixture
def project(finished, tmp_path, monkeypatch):
    """The working folder: a copy of that result, which a test may change, under the name paper."""
    shutil.copytree(finished, tmp_path / "results/paper")
    monkeypatch.chdir(tmp_path)
    return Path("results/paper")


@pytest.fixture
def copy(project):
    """A copy of the result paper, under the name copy, for a test to change."""
    place = project.with_name("copy")
    shutil.copytree(project, place)
    return place


@pytest.fixture
def other(project):
    """A result of other methods, grids, intervals and precisions than paper; kepler is not among its systems."""
    sweeps = [
        replace(SWEEPS[0], t_end="20", lowest=0.02, points_per_decade=3, shards=1),
        replace(SWEEPS[2], t_end="20", precision=("double",), highest=0.5),
    ]
    return result_folder.build(project.with_name("other"), sweeps=sweeps, methods=("babps9o7h", "aba104"))
