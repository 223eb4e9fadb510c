"""Jobs for other computers: a file is believed only whole, on a node with the same code and with all inputs."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.tasks.provenance import task
from nearharmonic_paper.tasks.remote.__main__ import main
from nearharmonic_paper.tasks.remote.plan import SUFFIX, Files, FrozenJob, read
from nearharmonic_paper.tasks.remote.submission import PYTHON, submit_frozen


@pytest.fixture
def warming(tmp_path):
    """A job without outputs whose input is there."""
    given = tmp_path / "given"
    given.touch()
    return FrozenJob(
        function="run",
        input=Files([str(given)], {}),
        output=Files([], {}),
        params=SimpleNamespace(
            task=task("nearharmonic.engine.trajectory:warm_up", system="sho", precisions=["double"])
        ),
        log=[str(tmp_path / "results/x/logs/warming.log")],
        threads=1,
        patience=0,
    )


def test_a_frozen_job_is_read_as_it_was(warming, tmp_path):
    warming = replace(warming, output=Files(["a", "b", "c"], {"table": ["a", "b"], "cube": "c"}))
    found = read(warming.write(tmp_path))
    assert (found, found.output.cube) == (warming, "c")
    assert [*found.output.items()] == [("table", ["a", "b"]), ("cube", "c")]


def test_each_flipped_bit_of_a_frozen_job_is_found(warming, tmp_path):
    place = warming.write(tmp_path)
    content = bytearray(place.read_bytes())
    for bit in range(0, 8 * len(content), 397):
        content[bit // 8] ^= 1 << bit % 8
        place.write_bytes(content)
        with pytest.raises(NearharmonicError, match="is damaged"):
            read(place)
        content[bit // 8] ^= 1 << bit % 8


def test_an_absent_job_ends_in_one_sentence(tmp_path):
    with pytest.raises(SystemExit, match=rf"^the job .*/0{SUFFIX} cannot be read: No such file or directory$"):
        main(str(tmp_path / f"0{SUFFIX}"))


def test_a_node_with_other_code_refuses_the_job(warming, tmp_path):
    warming.params.task["code"] = "0" * 64
    with pytest.raises(SystemExit, match="this node has another version of the package"):
        main(str(warming.write(tmp_path)))


@pytest.mark.slow
def test_a_missing_input_ends_the_job_before_its_work(warming, tmp_path):
    missing = replace(warming, input=Files([str(tmp_path / "gone")], {}), patience=0.1)
    with pytest.raises(SystemExit, match=r"the input .*gone is not visible on this node after 0\.1 s"):
        main(str(missing.write(tmp_path)))
    assert not (tmp_path / "results").exists()


def test_a_job_removes_its_earlier_output_first(warming, tmp_path):
    old = tmp_path / "results/x/tables/old.csv"
    old.parent.mkdir(parents=True)
    old.write_text("of another run")
    main(str(replace(warming, output=Files([str(old)], {})).write(tmp_path)))
    assert not old.exists()


def test_a_job_costs_less_than_a_second_and_no_snakemake(warming, tmp_path):
    room = main.__module__.rpartition(".")[0]
    command = [sys.executable, "-X", "importtime", "-m", room, str(warming.write(tmp_path))]
    with (tmp_path / "imports").open("w") as imports:
        started = subprocess.Popen(command, stderr=imports)
    _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    assert started.returncode == 0
    assert used.ru_utime + used.ru_stime < 0.8
    loaded = {line.rpartition("|")[2].strip() for line in (tmp_path / "imports").read_text().splitlines()}
    assert "nearharmonic_paper.tasks.job" in loaded
    assert not loaded & {"snakemake", "pydantic", "numba", "xarray", "matplotlib", "pandas"}


class _Executor:
    """The members of an executor for other computers that submission uses."""

    tmpdir = "jobs"

    def __init__(self, **settings):
        self.executor_settings = SimpleNamespace(**settings)
        self.workflow = SimpleNamespace(execution_settings=SimpleNamespace(latency_wait=5))

    def format_job_exec(self, job):
        return f"snakemake of {job.rule.name}"


def _job(**changes):
    """A job of Snakemake, as far as submission looks."""
    plain = {
        "is_group": lambda: False, "rule": SimpleNamespace(name="reduce", script="../scripts/task.py"), "output": [],
        "input": Files([], {}), "log": ["x.log"], "threads": 1, "params": {"task": {"definitions": {}}, "own": 1},
        "benchmark": None, "conda_env_spec": None, "container_img_url": None, "env_modules": None, "is_shadow": False,
    }  # fmt: skip
    return SimpleNamespace(**{**plain, "output": Files([], {}), **changes})


def _submitting(executor):
    scheduler = SimpleNamespace(get_executor=lambda _: executor)
    submit_frozen(SimpleNamespace(local_exec=False, scheduler=scheduler))
    return executor


def test_the_command_of_a_job_names_its_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    environment, _, command = _submitting(_Executor()).format_job_exec(_job()).partition(f" {sys.executable} ")
    assert environment == "env -u NEARHARMONIC_LEADER"
    place = command.removeprefix("-m nearharmonic_paper.tasks.remote ")
    frozen = read(place)
    assert (frozen.function, frozen.patience, vars(frozen.params)) == ("run", 5, {"task": {"definitions": {}}})


def test_jobs_may_run_in_a_container(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(PYTHON, "apptainer exec image.sif python")
    assert " apptainer exec image.sif python -m " in _submitting(_Executor()).format_job_exec(_job())


@pytest.mark.parametrize(
    "changes",
    [
        {"is_group": lambda: True},
        {"rule": SimpleNamespace(name="reduce", script=None)},
        {"container_img_url": "docker://x"},
        {"output": [SimpleNamespace(flags={"update": True})]},
    ],
    ids=["group", "no script", "container", "updated output"],
)
def test_special_jobs_keep_the_command_of_snakemake(changes):
    command = _submitting(_Executor()).format_job_exec(_job(**changes))
    assert command == "env -u NEARHARMONIC_LEADER snakemake of reduce"


@pytest.mark.parametrize("rules", ["all", "integrate, reduce", "reduce;integrate"])
def test_arrays_keep_the_command_of_snakemake(rules):
    command = _submitting(_Executor(array_jobs=rules)).format_job_exec(_job())
    assert command.endswith("snakemake of reduce")


def test_rules_beside_those_of_arrays_are_frozen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert SUFFIX in _submitting(_Executor(array_jobs="integrate")).format_job_exec(_job())


@pytest.mark.parametrize(("status", "asked"), [(0, "sacct"), (1, "squeue"), (None, "squeue")])
def test_states_of_jobs_come_from_what_the_site_has(tmp_path, monkeypatch, status, asked):
    if status is not None:
        (tmp_path / "sacct").write_text(f"#!/bin/sh\nexit {status}\n")
        (tmp_path / "sacct").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert _submitting(_Executor(status_command="sacct")).executor_settings.status_command == asked


def test_jobs_of_this_computer_are_left_alone():
    submit_frozen(SimpleNamespace(local_exec=True))
