"""Copies of the project to run Snakemake in; two of them finished, which tests only read."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from support.projects.targets import MADE_BY
from support.projects.workflow_project import TINY, Project


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return Project(tmp_path_factory.mktemp("project"))


def _after(target, folder):
    project = Project(folder)
    done = project.snakemake(target, "-j2", *TINY)
    assert done.returncode == 0, done.stdout
    return project


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The project after the default target on the tiny config."""
    return _after("all", tmp_path_factory.mktemp("finished"))


@pytest.fixture(scope="session")
def everything(tmp_path_factory):
    """The project after ``everything`` on the tiny config: a minute and a half of jobs, for slow tests."""
    return _after("everything", tmp_path_factory.mktemp("everything"))


@pytest.fixture
def breakable(finished, tmp_path):
    """A copy of the finished project that a test may change."""
    return finished.copy(tmp_path / "breakable")


@pytest.fixture(params=["all", pytest.param("everything", marks=pytest.mark.slow)])
def after(request):
    """The project after a target, and the files that this has made."""
    project = request.getfixturevalue({"all": "finished", "everything": "everything"}[request.param])
    return SimpleNamespace(folder=project.folder, made=MADE_BY[request.param])
