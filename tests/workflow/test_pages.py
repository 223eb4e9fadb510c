"""Targets ``pages`` and ``pages_of_times``: their jobs, and a page that is filled in place."""

from __future__ import annotations

import json
import re
import shutil
from inspect import signature
from pathlib import Path
from types import SimpleNamespace

import pytest
from PIL import Image

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED
from nearharmonic_paper.tasks.job import covered
from nearharmonic_paper.tasks.provenance import function_of
from support.projects import planned_jobs
from support.projects.planned_jobs import CORES
from support.projects.workflow_project import ROOT, TINY

pytestmark = pytest.mark.slow

MARKED = {
    str(path.relative_to(ROOT / "docs"))
    for path in ROOT.glob("docs/*/*.md")
    if "<!-- end -->" in path.read_text(encoding="utf-8")
}
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
def made(project):
    """Rule -> the job of a page or of a picture, with the target that makes it."""
    for name in ("docs", "examples"):
        shutil.copytree(ROOT / name, project.folder / name)
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


@pytest.mark.slow
def test_each_page_with_marks_has_a_rule(jobs):
    made = {name.rpartition("docs/")[2] for job in jobs.values() for name in job.output}
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "benchmarks").glob("*.py")]
    by_benchmarks = {page for text in texts for page in re.findall(r'^PAGE = "docs/(.*)"', text, re.MULTILINE)}
    assert len(by_benchmarks) > 5
    pages = {name for name in made if name.endswith(".md")}
    assert pages | by_benchmarks == MARKED - {"results/regularised.md"}
    assert pages & by_benchmarks == {"results/samplers.md", "results/timings.md"}  # have tables of both kinds
    assert all((ROOT / "docs" / name).is_file() for name in made)


def test_pages_of_times_have_a_target_of_their_own(jobs):
    apart = {rule for rule, job in jobs.items() if job.target == "pages_of_times"}
    assert apart == {"page_of_ranking", "page_of_timings"}
    assert {rule: job.threads for rule, job in jobs.items() if job.threads > 1} == {"page_of_ranking": CORES}


def test_the_page_of_regularised_times_has_a_rule(project):
    done = project.python(planned_jobs.__file__, "config/regularised.yaml", "pages_of_times")
    assert done.returncode == 0, done.stderr
    jobs = [SimpleNamespace(**json.loads(line)) for line in done.stdout.splitlines()]
    (job,) = (job for job in jobs if job.rule == "page_of_regularised")
    task = job.params["task"]
    assert bound(job)
    assert job.outputs["page"] == ["results/regularised/docs/results/regularised.md"]
    assert task["settings"]["page"] == "docs/results/regularised.md"


@pytest.mark.slow
def test_no_other_target_makes_a_page(planned):
    assert not [job.rule for job in planned if job.rule.startswith("page_of_")]


def test_the_function_of_a_page_takes_its_rules_inputs(jobs):
    for job in jobs.values():
        task = job.params["task"]
        assert bound(job)
        assert task["settings"]["page"] == f"docs/{job.outputs['page'][0].rpartition('docs/')[2]}"
        if job.rule != "page_of_variables":  # which depends on no method
            assert len(task["integrators"]) >= 80


def test_pages_show_pictures_of_figures_made_by_one_function(made):
    jobs = {rule.removeprefix("picture_of_"): job for rule, job in made.items() if rule.startswith("picture_of_")}
    papers = {"fig1_sho", "fig2_decomposition", "fig3_henon_heiles", "fig4_perihelion", "fig5_kepler", "fig6_substeps"}
    assert {name for name in jobs if name.startswith("fig")} == papers
    for name, job in jobs.items():
        folder = "logs/pages" if name == "regularised_times" else "figures"  # that one is of the file of its page
        assert job.inputs == {"figure": [f"results/tiny/{folder}/{name}.png"]}
        assert job.outputs == {"picture": [f"results/tiny/docs/results/{name}.png"]}
        function = function_of(job.params["task"])
        signature(function).bind(**job.params["task"]["settings"], **job.inputs)
        place = ROOT / f"docs/results/{name}.png"
        assert place.stat().st_size <= (70_000 if name in papers else 100_000)
        with Image.open(place) as picture:
            assert picture.width <= 1100
            assert len(picture.getcolors()) <= (20 if name in papers else 128)


def test_every_picture_below_docs_is_made_by_a_job(made):
    drawn = {Path(name).name for job in made.values() for name in job.output if name.endswith(".png")}
    assert drawn == {path.name for path in ROOT.glob("docs/*/*.png")}


def test_an_edit_of_an_example_makes_pages_again(jobs):
    for rule in ("page_of_examples", "page_of_tailor"):
        assert jobs[rule].inputs["files"] == sorted(f"examples/{path.name}" for path in ROOT.glob("examples/*.py"))


def test_pages_that_integrate_compile_one_at_a_time(jobs):
    alone = {rule for rule, job in jobs.items() if job.compiler}
    names = ("examples", "methods", "tabulated_potentials", "tailor", "tangent_maps")
    assert alone == {f"page_of_{name}" for name in names}


@pytest.fixture(scope="module")
def filled(jobs, project):
    """The project with tables of trained methods, and the arguments that fill the page from them."""
    (project.results / "tables").mkdir(parents=True, exist_ok=True)
    for name, text in TABLES.items():
        (project.results / f"tables/trained_{name}.csv").write_text(text)
    return (f"{TINY[1]}", "results/tiny/docs/results/trained.md", "--allowed-rules", "page_of_trained")


def bound(job):
    """Settings and inputs of a job as arguments of its function, without those that each page has."""
    settings = {name: value for name, value in job.params["task"]["settings"].items() if name not in EACH}
    return signature(function_of(job.params["task"])).bind(**settings, **job.inputs)


def fill(project, filled, *more):
    config, page, *rest = filled
    return project.snakemake(page, "-j1", *rest, *more, "--configfile", config)


@pytest.mark.slow
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
    assert fill(project, filled).returncode != 0
    assert page.read_text(encoding="utf-8") == text


def test_a_page_is_no_result(project, filled):
    fill(project, filled)
    assert not [name for name in project.manifest()["files"] if "docs" in name]


def test_the_page_of_results_names_each_method_it_shows(project):
    """Those of the paper's config, of which it holds the coefficients; a job refuses a method that its digests lack."""
    done = project.python(planned_jobs.__file__, "config/config.yaml", "report")
    assert done.returncode == 0, done.stderr
    jobs = [SimpleNamespace(**json.loads(line)) for line in done.stdout.splitlines()]
    (task,) = (job.params["task"] for job in jobs if job.rule == "page")
    with covered(task):
        assert [nh.integrators[name].name for name in BENCHMARKED] == list(BENCHMARKED)
