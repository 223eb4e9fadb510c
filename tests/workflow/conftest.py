"""Copies of the project to run Snakemake in; three of them with results, which tests only read."""

import json
from types import SimpleNamespace

import pytest

from support.projects import planned_jobs
from support.projects.opened_files import follow
from support.projects.targets import MADE_BY
from support.projects.workflow_project import TINY, Project


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return Project(tmp_path_factory.mktemp("project"))


def _after(project, *targets):
    done = project.snakemake(*targets, "-j2", *TINY)
    assert done.returncode == 0, done.stdout
    return project


@pytest.fixture(scope="session")
def drawn(tmp_path_factory):
    """The project after one figure on the tiny config: a job of most kinds, for README's command."""
    project = Project(tmp_path_factory.mktemp("drawn"))
    follow(project.folder / "src")
    return _after(project, "fig3")


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The project after the default target on the tiny config: a minute of jobs, for slow tests."""
    project = Project(tmp_path_factory.mktemp("finished"))
    follow(project.folder / "src")
    return _after(project, "all")


@pytest.fixture(scope="session")
def everything(finished, tmp_path_factory):
    """The project after all other targets as well: a minute of jobs, for slow tests."""
    return _after(finished.copy(tmp_path_factory.mktemp("everything") / "project"), "everything", "trained")


@pytest.fixture(scope="session")
def planned(drawn):
    """All jobs of all targets on the tiny config, as Snakemake would run them."""
    done = drawn.python(planned_jobs.__file__, TINY[1], "everything", "trained")
    assert done.returncode == 0, done.stderr
    return [SimpleNamespace(**json.loads(line)) for line in done.stdout.splitlines()]


@pytest.fixture
def breakable(finished, tmp_path):
    """A copy of the finished project that a test may change."""
    return finished.copy(tmp_path / "breakable")


@pytest.fixture(params=["drawn", pytest.param("finished", marks=pytest.mark.slow)])
def followed(request):
    """A project whose jobs noted what they open."""
    return request.getfixturevalue(request.param)


@pytest.fixture(params=["fig3", *(pytest.param(target, marks=pytest.mark.slow) for target in ("all", "everything"))])
def after(request):
    """The project after a target, and the files that this has made."""
    project = request.getfixturevalue({"fig3": "drawn", "all": "finished", "everything": "everything"}[request.param])
    return SimpleNamespace(folder=project.folder, made=MADE_BY[request.param])
