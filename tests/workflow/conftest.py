"""Copies of the project to run Snakemake in, one of them finished."""

from __future__ import annotations

import pytest

from workflow_project import TINY, Project


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return Project(tmp_path_factory.mktemp("project"))


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The project after ``snakemake everything`` on the tiny config; tests only read it, or mend what they break."""
    project = Project(tmp_path_factory.mktemp("finished"))
    done = project.snakemake("everything", "-j2", *TINY)
    assert done.returncode == 0, done.stdout
    return project
