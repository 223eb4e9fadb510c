"""The key ``background`` of a config reaches the jobs that draw, and no parameter of a job changes without it."""

import json
from types import SimpleNamespace

import pytest

from support.projects import planned_jobs
from support.projects.workflow_project import TINY

pytestmark = pytest.mark.slow


def drawing_jobs(project, *lines):
    """The jobs that draw figures of a config with these lines more: those with files of the ending of SVG."""
    place = project.folder / "config/drawn.yaml"
    tiny = (project.folder / TINY[1]).read_text(encoding="utf-8")
    place.write_text("\n".join([tiny, *lines]), encoding="utf-8")
    found = []
    for target in ("figures", "work_precision"):
        done = project.python(planned_jobs.__file__, "config/drawn.yaml", target)
        assert done.returncode == 0, done.stderr
        jobs = (SimpleNamespace(**json.loads(line)) for line in done.stdout.splitlines())
        found += [job for job in jobs if any(name.endswith(".svg") for name in job.output)]
    assert {"draw_sho", "work_precision_figure", "library_times_figures"} <= {job.rule for job in found}
    return found


def test_every_job_that_draws_has_the_background_of_config(project):
    assert {job.params.get("transparent") for job in drawing_jobs(project)} == {None}
    assert {job.params.get("transparent") for job in drawing_jobs(project, "background: transparent")} == {True}
