"""All rules, planned and run: inputs and cores agree with the function of the rule."""

from inspect import Parameter, signature

import pytest

from nearharmonic_paper.report import page as assets
from nearharmonic_paper.tasks import provenance as sources
from nearharmonic_paper.tasks.provenance import function_of
from support.projects.opened_files import read_by_jobs
from support.projects.planned_jobs import CORES
from support.projects.targets import METHODS, SYSTEMS
from support.projects.workflow_project import TINY

RESULTS = "results/tiny/"


@pytest.fixture(scope="module")
def working(planned):
    """Jobs of one function, each with it."""
    found = [job for job in planned if "task" in job.params]
    for job in found:
        job.task = job.params["task"]
        job.function = function_of(job.task)
    return found


@pytest.fixture(scope="module")
def makers(planned):
    """File -> the job that makes it."""
    return {file: job for job in planned for file in job.output}


def above(job, makers):
    """All files that are there before ``job`` begins."""
    found, waiting = set(), [*job.input]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting += makers[file].input
    return found


def test_function_is_called_with_settings_and_inputs_of_its_rule(working):
    for job in working:
        taken = signature(job.function)
        given = job.task["settings"] | job.inputs
        taken.bind(**given, **{name: None for name in ("threads", "report") if name in taken.parameters})
        if "folder" not in given and any(one.kind is Parameter.VAR_KEYWORD for one in taken.parameters.values()):
            one_each = set(SYSTEMS if "sweeps" in given else METHODS)
            assert set(given) - set(taken.parameters) == one_each, job.rule


def test_figure_is_drawn_of_cube_if_its_function_takes_one(planned):
    for job in planned:
        for task in job.params.get("tasks", {}).values():
            taken = [one for one in signature(function_of(task)).parameters.values() if one.default is one.empty]
            several = any(one.kind is one.VAR_POSITIONAL for one in taken)
            assert several or len(taken) == len(job.inputs.get("cubes", ())), job.rule


def test_experiment_reduces_its_own_runs_with_settings_of_runs(working, makers):
    for job in working:
        for made in (makers[file] for name in ("run", "runs", "cube", *METHODS) for file in job.inputs.get(name, ())):
            room = made.function.__module__.rpartition(".")[0]
            assert job.function.__module__.startswith(f"{room}."), job.rule
            ours, theirs = job.task["settings"], made.task["settings"]
            same = [key for key in ours.keys() & theirs.keys() if isinstance(ours[key], type(theirs[key]))]
            assert {key: ours[key] for key in same} == {key: theirs[key] for key in same}, job.rule


def test_only_jobs_that_measure_times_have_all_cores(working, makers):
    def measures(job):
        reaches = "nearharmonic.numerics.clock" in job.task["modules"]
        return reaches and hasattr(job.function, "measures_time")

    timing = [job for job in working if measures(job) and not any(measures(makers[file]) for file in job.input)]
    assert {job.rule for job in timing} >= {"work_precision_times", "exact_oscillator_times", "trained_times_table"}
    assert {job.rule: job.threads for job in timing} == {job.rule: CORES for job in timing}
    rest = {job.rule: job.threads for job in working if job not in timing}
    assert rest == {
        job.rule: 2 if "threads" in signature(job.function).parameters else 1 for job in working if job not in timing
    }


def test_run_waits_only_for_kernels_that_it_calls(working, makers):
    waiting = [(job, makers[file]) for job in working for file in job.input if file.endswith(".done")]
    assert {job.rule for job, _ in waiting} == {"integrate", "stability_run"}
    for job, compiling in waiting:
        if job.rule == "integrate":
            sweep = job.task["settings"]["sweep"]
            asked = {"system": sweep["system"], "precisions": sweep["precision"]}
            assert compiling.task["settings"] == asked
        else:
            assert compiling.function.__module__ == job.function.__module__


def test_job_reads_results_that_its_rule_names_and_no_other(planned, makers, followed):
    by_log = {job.log[0]: job for job in planned if job.log}
    for log, files in read_by_jobs(followed.folder).items():
        job = by_log[log]
        read = {file for file in files if file.startswith(RESULTS)} & makers.keys() - {*job.output}
        named = {file for file in job.input if not file.endswith(".done")}
        assert named <= read, job.rule
        folder = "task" in job.params and "folder" in job.params["task"]["settings"]
        assert read <= (above(job, makers) if folder else named), job.rule


@pytest.mark.slow
def test_edit_of_what_page_is_made_of_makes_it_again(finished):
    """Template, style and script, the files of the package that jobs read; fonts count as part of matplotlib."""
    sources_of_project = "src/"
    read = {
        (log, name)
        for log, files in read_by_jobs(finished.folder).items()
        for name in files
        if name.startswith(sources_of_project) and not name.endswith((".py", ".pyc", ".ttf"))
    }
    places = [
        f"{sources_of_project}{place.relative_to(sources.ROOT)}" for place in map(assets.FOLDER.joinpath, assets.NAMES)
    ]
    assert read == {(f"{RESULTS}logs/report.log", name) for name in places}
    place = finished.folder / places[-1]
    text = place.read_bytes()
    place.write_bytes(text + b"\n")
    try:
        assert finished.jobs(*TINY) == {"page": 1, "all": 1}
    finally:
        place.write_bytes(text)
