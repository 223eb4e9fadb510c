"""Jobs for other computers: a file is believed only whole, on a node with the same code and with all inputs."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.tasks.job import PYTHON, SUFFIX, Files, FrozenJob, command_of, is_in_array, main, read_job
from nearharmonic_paper.tasks.provenance import task
from snakemake_executor_plugin_nearharmonic import has_accounting


@pytest.fixture
def warming(tmp_path):
    """A job without outputs whose input is there."""
    given = tmp_path / "given"
    given.touch()
    return FrozenJob(
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
    found = read_job(warming.write(tmp_path))
    assert (found, found.output.cube) == (warming, "c")
    assert [*found.output.items()] == [("table", ["a", "b"]), ("cube", "c")]


def test_each_flipped_bit_of_a_frozen_job_is_found(warming, tmp_path):
    place = warming.write(tmp_path)
    content = bytearray(place.read_bytes())
    for bit in range(0, 8 * len(content), 397):
        content[bit // 8] ^= 1 << bit % 8
        place.write_bytes(content)
        with pytest.raises(NearharmonicError, match="is damaged"):
            read_job(place)
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
    command = [sys.executable, "-X", "importtime", "-m", main.__module__, str(warming.write(tmp_path))]
    with (tmp_path / "imports").open("w") as imports:
        started = subprocess.Popen(command, stderr=imports)
    _, status, used = os.wait4(started.pid, 0)
    started.returncode = os.waitstatus_to_exitcode(status)
    assert started.returncode == 0
    assert used.ru_utime + used.ru_stime < 0.8
    loaded = {line.rpartition("|")[2].strip() for line in (tmp_path / "imports").read_text().splitlines()}
    assert "nearharmonic_paper.tasks.job" in loaded
    assert not loaded & {"snakemake", "pydantic", "numba", "xarray", "matplotlib", "pandas"}


def _job(**changes):
    """A job of Snakemake, as far as its frozen form needs it."""
    plain = {"log": ["x.log"], "threads": 1, "params": {"task": {"definitions": {}}, "own": 1}}
    files = {"input": Files([], {}), "output": Files([], {"a": "x", "b": ["y", "z"]})}
    return SimpleNamespace(**plain | files | changes)


def test_the_command_of_a_job_names_its_file(tmp_path):
    environment, _, command = command_of(_job(), tmp_path).partition(f" {sys.executable} ")
    assert environment == "env -u NEARHARMONIC_LEADER"
    frozen = read_job(command.removeprefix("-m nearharmonic_paper.tasks.job "))
    assert vars(frozen.params) == {"task": {"definitions": {}}}
    assert [*frozen.output.items()] == [("a", "x"), ("b", ["y", "z"])]


def test_jobs_may_run_in_a_container(tmp_path, monkeypatch):
    monkeypatch.setenv(PYTHON, "apptainer exec image.sif python")
    assert " apptainer exec image.sif python -m " in command_of(_job(), tmp_path)


@pytest.mark.parametrize(
    ("arrays", "name", "told"),
    [("all", "a", True), ("b, a", "a", True), ("b;a", "a", True), ("b", "a", False), (None, "a", False)],
)
def test_arrays_keep_the_command_of_snakemake(arrays, name, told):
    assert is_in_array(SimpleNamespace(name=name), arrays) is told


@pytest.mark.parametrize(("status", "has"), [(0, True), (1, False), (None, False)])
def test_states_of_jobs_come_from_what_the_site_has(tmp_path, monkeypatch, status, has):
    if status is not None:
        (tmp_path / "sacct").write_text(f"#!/bin/sh\nexit {status}\n")
        (tmp_path / "sacct").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert has_accounting() is has
