"""Targets ``pages`` and ``pages_of_times``: their jobs, and a page that is filled in place."""

import json
import re
import shutil
from inspect import signature
from types import SimpleNamespace

import pytest

from nearharmonic_paper.tasks.provenance import function_of
from support.projects import planned_jobs
from support.projects.workflow_project import ROOT, TINY, Project
from support.results.result_folder import write_manifest

pytestmark = pytest.mark.slow

#: Settings of every page.
EACH = {"page", "systems", "integrators"}
#: Tables of the results that docs/results/trained.md shows, as short as can be.
TABLES = {
    "gains": "ensemble,tau_per_stage,best published,log10_error,best trained,log10_error_trained,gain,gain_low,"
    "gain_high,verdict\nMorse,0.1,srkn_a14,-5,trained_light,-5.5,0.5,0.4,0.6,ahead\n",
    "methods": "method,ensemble,ahead_from,ahead_to,largest_gain\ntrained_light,Morse,0.1,0.2,0.5\n",
    "ideas": "tau_per_stage,anharmonicity,ahead,ahead with T + V\n",
    "long": "system,method\n",
    "times": "ensemble,gain\n",
}


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """The project with the sources of its pages."""
    made = Project(tmp_path_factory.mktemp("project"))
    for name in ("docs", "examples", "benchmarks"):
        shutil.copytree(ROOT / name, made.folder / name)
    return made


@pytest.fixture(scope="module")
def made(project):
    """Rule -> the job of a page or of a picture, with the target that makes it."""
    found = {}
    for target in ("pages", "pages_of_times"):
        done = project.python(planned_jobs.__file__, TINY[1], target)
        assert done.returncode == 0, done.stderr
        for job in (SimpleNamespace(**json.loads(line), target=target) for line in done.stdout.splitlines()):
            if job.rule.startswith(("page_of_", "picture_of_")):
                found[job.rule] = job
    return found


@pytest.fixture(scope="module")
def jobs(made):
    """Rule -> the job of a page."""
    return {rule: job for rule, job in made.items() if rule.startswith("page_of_")}


def test_the_page_of_regularised_times_has_a_rule(project):
    done = project.python(planned_jobs.__file__, "config/regularised.yaml", "pages_of_times")
    assert done.returncode == 0, done.stderr
    jobs = [SimpleNamespace(**json.loads(line)) for line in done.stdout.splitlines()]
    (job,) = (job for job in jobs if job.rule == "page_of_regularised")
    task = job.params["task"]
    assert bound(job)
    assert job.outputs["page"] == ["results/regularised/docs/results/regularised.md"]
    assert task["settings"]["page"] == "docs/results/regularised.md"


def test_no_other_target_makes_a_page(planned):
    assert not [job.rule for job in planned if job.rule.startswith("page_of_")]


def test_the_function_of_a_page_takes_its_rules_inputs(jobs):
    measured = {rule for rule, job in jobs.items() if "task" not in job.params}
    assert measured == {rule for rule, job in jobs.items() if "command" in job.inputs}
    for job in (job for rule, job in jobs.items() if rule not in measured):
        task = job.params["task"]
        assert bound(job)
        assert task["settings"]["page"] == f"docs/{job.outputs['page'][0].rpartition('docs/')[2]}"
        if job.rule != "page_of_variables":  # which depends on no method
            assert len(task["integrators"]) >= 80


@pytest.fixture(scope="module")
def filled(jobs, project):
    """The project with tables of trained methods, and the arguments that fill the page from them."""
    (project.results / "tables").mkdir(parents=True, exist_ok=True)
    for name, text in TABLES.items():
        (project.results / f"tables/trained_{name}.csv").write_text(text)
    write_manifest(project.results)
    return (f"{TINY[1]}", "results/tiny/docs/results/trained.md", "--allowed-rules", "page_of_trained")


def bound(job):
    """Settings and inputs of a job as arguments of its function, without those that each page has."""
    settings = {name: value for name, value in job.params["task"]["settings"].items() if name not in EACH}
    return signature(function_of(job.params["task"])).bind(**settings, **job.inputs)


def fill(project, filled, *more):
    config, page, *rest = filled
    return project.snakemake(page, "-j1", *rest, *more, "--configfile", config)


def test_a_page_is_filled_once_and_survives_failing_jobs(project, filled):
    page = project.results / "docs/results/trained.md"
    done = fill(project, filled)
    assert done.returncode == 0, done.stdout
    text = page.read_text(encoding="utf-8")
    assert "| Morse | **+0.50** |" in text
    own = (ROOT / "docs/results/trained.md").read_text(encoding="utf-8")
    assert (project.folder / "docs/results/trained.md").read_text(encoding="utf-8") == own
    assert re.findall(r"^#.*", text, re.MULTILINE) == re.findall(r"^#.*", own, re.MULTILINE)
    assert "page_of_trained" not in fill(project, filled, "-n").stdout

    (project.results / "tables/trained_gains.csv").write_text("ensemble\nMorse\n")
    write_manifest(project.results)
    assert fill(project, filled).returncode != 0
    assert page.read_text(encoding="utf-8") == text


def test_a_page_is_no_result(project, filled):
    fill(project, filled)
    assert not [name for name in project.manifest()["files"] if "docs" in name]
