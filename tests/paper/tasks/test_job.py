"""Jobs: their logs hold all that they print, and on other computers they are believed only whole."""

import re
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import xarray as xr
import yaml

from nearharmonic.errors import NearharmonicError, ResultFileError
from nearharmonic.output.store import read
from nearharmonic_paper.tasks import job
from nearharmonic_paper.tasks.provenance import task
from snakemake_executor_plugin_nearharmonic import has_accounting


def test_what_a_job_prints_goes_to_its_log(tmp_path, capsys):
    with job.logged(str(tmp_path / "log")):
        sys.stdout.write("out\n")
        sys.stderr.write("err\n")
    assert (tmp_path / "log").read_text() == "out\nerr\n"
    assert capsys.readouterr() == ("", "")


def test_error_of_family_ends_job_with_its_own_words(tmp_path):
    with pytest.raises(SystemExit, match=r"^0\.h5 is truncated$"), job.logged(str(tmp_path / "log")):
        raise ResultFileError("0.h5 is truncated")
    assert (tmp_path / "log").read_text() == "0.h5 is truncated\n"


def test_any_other_error_leaves_its_traceback_in_the_log(tmp_path):
    place = str(tmp_path / "log")
    with pytest.raises(SystemExit) as end, job.logged(place):
        raise ZeroDivisionError("by zero")
    assert str(end.value) == f"ZeroDivisionError: by zero (traceback in {place})"
    assert "Traceback" in (tmp_path / "log").read_text()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_full_disk_under_the_log_does_not_hide_the_error(tmp_path):
    (tmp_path / "log").symlink_to("/dev/full")
    stack = ExitStack()
    stack.enter_context(job.logged(str(tmp_path / "log")))
    sys.stdout.write("out\n" * 10_000)
    error = ResultFileError("0.h5 is truncated")
    with pytest.raises(SystemExit, match=r"^0\.h5 is truncated$"):
        stack.__exit__(ResultFileError, error, None)


def test_log_that_cannot_be_made_ends_job_with_sentence(tmp_path):
    with pytest.raises(SystemExit, match=r" cannot be written: Is a directory$"), job.logged(str(tmp_path)):
        sys.stdout.write("out\n")
    with pytest.raises(SystemExit, match=r"^.* cannot be written: No such file or directory$"), job.logged("none/log"):
        sys.stdout.write("out\n")


def test_dataset_goes_to_hdf5_file_though_it_is_mapping(tmp_path):
    cube = xr.Dataset({"error": ("tau", [1.0, 2.0], {"units": "1", "long_name": "error"})})
    job.write(cube, [str(tmp_path / "cube.h5")], {"settings": "{}"})
    assert read(tmp_path / "cube.h5").error.values.tolist() == [1.0, 2.0]


@pytest.mark.slow
@pytest.mark.parametrize("background", [{}, pytest.param({"transparent": True}, marks=pytest.mark.slow)])
def test_job_draws_svg_file_with_background_that_its_rule_asks(tmp_path, background):
    function = "nearharmonic_paper.experiments.paper.figures:fig6_substeps"
    place = str(tmp_path / "results/x/figures/fig6_substeps.svg")
    log = tmp_path / "results/x/logs/draw.log"
    log.parent.mkdir(parents=True)
    job.draw(
        job.FrozenJob(
            input=job.Files([], {}),
            output=job.Files([place], {"fig6": [place]}),
            params=SimpleNamespace(tasks={"fig6": task(function)}, captions={"fig6": "Six. Two."}, **background),
            log=[str(log)],
            threads=1,
            patience=0,
        )
    )
    text = Path(place).read_text(encoding="utf-8")
    (sheet,) = re.findall(r'<g id="patch_1">\s*<path [^>]*style="([^"]*)"', text)
    assert sheet == ("fill: none" if background else "fill: #ffffff")


# --- Jobs for other computers: a file is believed only whole, on a node with the same code and with all inputs.


@pytest.fixture
def warming(tmp_path):
    """A job without outputs whose input is there."""
    given = tmp_path / "given"
    given.touch()
    return job.FrozenJob(
        input=job.Files([str(given)], {}),
        output=job.Files([], {}),
        params=SimpleNamespace(
            task=task("nearharmonic.engine.trajectory:warm_up", system="sho", precisions=["double"])
        ),
        log=[str(tmp_path / "results/x/logs/warming.log")],
        threads=1,
        patience=0,
    )


def test_a_frozen_job_is_read_as_it_was(warming, tmp_path):
    warming = replace(warming, output=job.Files(["a", "b", "c"], {"table": ["a", "b"], "cube": "c"}))
    found = job.read_job(warming.write(tmp_path))
    assert (found, found.output.cube) == (warming, "c")
    assert [*found.output.items()] == [("table", ["a", "b"]), ("cube", "c")]


def test_each_flipped_bit_of_a_frozen_job_is_found(warming, tmp_path):
    place = warming.write(tmp_path)
    content = bytearray(place.read_bytes())
    for bit in range(0, 8 * len(content), 397):
        content[bit // 8] ^= 1 << bit % 8
        place.write_bytes(content)
        with pytest.raises(NearharmonicError, match="is damaged"):
            job.read_job(place)
        content[bit // 8] ^= 1 << bit % 8


def test_an_absent_job_ends_in_one_sentence(tmp_path):
    with pytest.raises(SystemExit, match=rf"^the job .*/0{job.SUFFIX} cannot be read: No such file or directory$"):
        job.main(str(tmp_path / f"0{job.SUFFIX}"))


def test_a_node_with_other_code_refuses_the_job(warming, tmp_path):
    warming.params.task["code"] = "0" * 64
    with pytest.raises(SystemExit, match="this node has another version of the package"):
        job.main(str(warming.write(tmp_path)))


@pytest.mark.slow
def test_a_missing_input_ends_the_job_before_its_work(warming, tmp_path):
    missing = replace(warming, input=job.Files([str(tmp_path / "gone")], {}), patience=0.1)
    with pytest.raises(SystemExit, match=r"the input .*gone is not visible on this node after 0\.1 s"):
        job.main(str(missing.write(tmp_path)))
    assert not (tmp_path / "results").exists()


def test_a_job_removes_its_earlier_output_first(warming, tmp_path):
    old = tmp_path / "results/x/tables/old.csv"
    old.parent.mkdir(parents=True)
    old.write_text("of another run")
    job.main(str(replace(warming, output=job.Files([str(old)], {})).write(tmp_path)))
    assert not old.exists()


def test_a_job_loads_no_library_that_it_does_without(warming, tmp_path):
    """Each of these takes longer to load than a short job runs."""
    command = [sys.executable, "-X", "importtime", "-m", job.main.__module__, str(warming.write(tmp_path))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "nearharmonic_paper.tasks.provenance" in loaded
    assert not loaded & {"snakemake", "pydantic", "numba", "xarray", "matplotlib", "pandas"}


def _job(**changes):
    """A job of Snakemake, as far as its frozen form needs it."""
    plain = {"log": ["x.log"], "threads": 1, "params": {"task": {"definitions": {}}, "own": 1}}
    files = {"input": job.Files([], {}), "output": job.Files([], {"a": "x", "b": ["y", "z"]})}
    return SimpleNamespace(**plain | files | changes)


def test_the_command_of_a_job_names_its_file(tmp_path):
    environment, _, command = job.command_of(_job(), tmp_path).partition(f" {sys.executable} ")
    assert environment == "env -u NEARHARMONIC_LEADER"
    frozen = job.read_job(command.removeprefix("-m nearharmonic_paper.tasks.job "))
    assert vars(frozen.params) == {"task": {"definitions": {}}}
    assert [*frozen.output.items()] == [("a", "x"), ("b", ["y", "z"])]


def test_jobs_may_run_in_a_container(tmp_path, monkeypatch):
    monkeypatch.setenv(job.PYTHON, "apptainer exec image.sif python")
    assert " apptainer exec image.sif python -m " in job.command_of(_job(), tmp_path)


@pytest.mark.parametrize(
    ("arrays", "name", "told"),
    [("all", "a", True), ("b, a", "a", True), ("b;a", "a", True), ("b", "a", False), (None, "a", False)],
)
def test_arrays_keep_the_command_of_snakemake(arrays, name, told):
    assert job.is_in_array(SimpleNamespace(name=name), arrays) is told


@pytest.mark.parametrize(("status", "has"), [(0, True), (1, False), (None, False)])
def test_states_of_jobs_come_from_what_the_site_has(tmp_path, monkeypatch, status, has):
    if status is not None:
        (tmp_path / "sacct").write_text(f"#!/bin/sh\nexit {status}\n")
        (tmp_path / "sacct").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert has_accounting() is has


# --- The profile for SLURM: it names rules that exist, and gives a whole node to each rule that measures times.

ROOT = Path(__file__).parents[3]
PROFILE = yaml.safe_load((ROOT / "profiles/slurm/config.yaml").read_text(encoding="utf-8"))
TEXTS = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "workflow/rules").rglob("*.smk"))
RULES = dict(re.findall(r"^rule (\w+):\n((?:\n|[ ].*\n)*)", TEXTS, re.MULTILINE))


def test_the_profile_names_rules_that_exist():
    assert "integrate" in PROFILE["set-resources"]
    assert {*PROFILE["set-resources"], *PROFILE["set-threads"]} <= RULES.keys()


def test_measured_times_have_a_node_of_their_own():
    timing = {name for name, text in RULES.items() if "threads: ALL_CORES" in text}
    assert "work_precision_times" in timing
    assert dict.fromkeys(timing, 1) == PROFILE["set-threads"]
    alone = {name for name, given in PROFILE["set-resources"].items() if "--exclusive" in given.get("slurm_extra", "")}
    assert alone == timing


def test_memory_and_time_grow_with_each_attempt():
    limits = [PROFILE["default-resources"], *PROFILE["set-resources"].values()]
    given = [text for one in limits for key, text in one.items() if key in {"mem_mb", "runtime"}]
    assert given
    assert all(re.fullmatch(r"\d+ \* attempt", text) for text in given)
