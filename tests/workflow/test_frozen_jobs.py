"""Jobs as a cluster runs them, without Snakemake, write the files that Snakemake's own jobs wrote."""

import json
import shutil
from pathlib import Path

import pytest

from support.projects.workflow_project import ROOT, TINY

FREEZING = ROOT / "tests/support/projects/frozen_jobs.py"


def _frozen(project, target):
    done = project.python(str(FREEZING), TINY[1], target, "frozen")
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def frozen(finished, tmp_path_factory):
    """A copy of the finished project, and its jobs."""
    project = finished.copy(tmp_path_factory.mktemp("frozen") / "project")
    return project, _frozen(project, "all")


def _run_again(project, job):
    """Run a frozen job, and return what its files held before and hold now."""
    outputs = [project.folder / name for name in job["output"]]
    before = [path.read_bytes() for path in outputs]
    done = project.python("-m", "nearharmonic_paper.tasks.job", job["place"])
    assert done.returncode == 0, done.stderr
    return before, [path.read_bytes() for path in outputs]


@pytest.mark.slow
@pytest.mark.parametrize(
    "rule", ["integrate", "skipped", *(pytest.param(name, marks=pytest.mark.slow) for name in ("reduce", "draw_sho"))]
)
def test_a_frozen_job_writes_the_same_bytes(frozen, rule):
    project, jobs = frozen
    before, now = _run_again(project, next(job for job in jobs if job["rule"] == rule))
    assert now == before


@pytest.mark.slow
def test_all_jobs_of_the_default_target_can_be_frozen(frozen):
    _, jobs = frozen
    assert [job["rule"] for job in jobs if job["place"] is None and not job["norun"]] == []
    assert len({Path(job["place"]).name for job in jobs if job["place"]}) == len(jobs) - sum(j["norun"] for j in jobs)


@pytest.mark.slow
def test_all_other_jobs_can_be_frozen_but_one_that_stays_here(finished, tmp_path):
    jobs = _frozen(finished.copy(tmp_path / "project"), "everything")
    assert {job["rule"] for job in jobs if job["place"] is None and not job["norun"]} == {"refresh"}  # a local rule
    documented = finished.copy(tmp_path / "pages")
    for name in ("docs", "examples", "benchmarks"):
        shutil.copytree(ROOT / name, documented.folder / name)
    pages = _frozen(documented, "pages")
    names = ("choosing", "examples", "gauss", "tabulated_potentials", "tailor", "tangent_maps")
    measured = {f"page_of_{name}" for name in names}
    # Commands of a shell; the ranking is a page of times.
    assert {job["rule"] for job in pages if job["place"] is None and not job["norun"]} == measured
