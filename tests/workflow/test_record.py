"""The record of real runs of the workflow: history and manifest, what fails and what is damaged."""

import os
import re
import shutil
import subprocess
import sys
from hashlib import sha256

import pytest

from support.projects.targets import FIGURES, METHODS, SYSTEMS
from support.projects.workflow_project import TINY, Project

pytestmark = pytest.mark.slow

COMMAND = ("-j2", "--quiet", "rules", *TINY)
#: A cube that needs no trajectory, and a file of trajectories: what takes least.
CUBE = "results/tiny/cubes/sho_terms.h5"
RUN = "results/tiny/runs/sho/ruth/0.h5"


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """A project under version control in which one command has run."""
    project = Project(tmp_path_factory.mktemp("fresh"))
    author = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    (project.folder / ".gitignore").write_text("results/\n.snakemake/\n__pycache__/\n")
    for words in (("init", "-q"), ("add", "."), (*author, "commit", "-qm", "all")):
        subprocess.run(["git", *words], cwd=project.folder, check=True)
    assert project.snakemake("fig2", CUBE, *COMMAND).returncode == 0
    return project


@pytest.fixture(scope="module")
def first(fresh):
    """Record of that command, and digest and size of each file that it made."""
    (run,) = fresh.history()
    content = {name: (fresh.results / name).read_bytes() for name in {"cubes/sho_terms.h5"} | FIGURES["fig2"]}
    made = {name: (sha256(text).hexdigest(), len(text)) for name, text in content.items()}
    return run, fresh.manifest()["files"], made


@pytest.fixture(autouse=True)
def _first(first):
    """Before any other command runs."""


def test_a_run_is_remembered_with_all_that_made_it(fresh, first):
    run, _, _ = first
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=fresh.folder, capture_output=True, text=True, check=True)
    assert (run["status"], run["exit_status"], run["targets"]) == ("ok", 0, ["fig2", CUBE])
    assert (run["commit"], run["dirty"]) == (head.stdout.strip(), False)
    assert run["cores"] == 2
    assert run["command"][1:] == ["fig2", CUBE, *COMMAND]
    assert run["config"]["integrators"] == list(METHODS)
    assert set(run["config"]["systems"]) == set(SYSTEMS)
    assert run["config"]["stability"]["rounding"]["seed"] == 1  # a default that the file does not hold
    assert re.fullmatch(r"\d{8}T\d{6}Z-[0-9a-f]{8}", run["id"])
    for key in ("work", "config_digest", "code_digest", "coefficients_digest"):
        assert re.fullmatch("[0-9a-f]{64}", run[key])
    assert run["start"] < run["end"]
    assert 0 < run["cpu_seconds"] < 20 * run["duration"]
    assert {
        "python", "numpy", "numba", "llvmlite", "mpmath", "xarray", "h5py", "h5netcdf", "matplotlib", "snakemake",
    } <= set(run["versions"])  # fmt: skip
    assert run["versions"]["python"] == ".".join(map(str, sys.version_info[:3]))
    assert run["cpu"]["model"]
    assert "cx16" in run["cpu"]["features"] or "neon" in run["cpu"]["features"]
    # The decomposition and its figure; no run of a step size.
    assert (run["jobs_run"], run["jobs_reused"], run["evaluations"], run["evaluations_skipped"]) == (2, 0, 0, None)


def test_the_manifest_covers_what_the_target_made_and_nothing_else(first):
    run, files, made = first
    assert {name: (entry["sha256"], entry["size"]) for name, entry in files.items()} == made
    assert run["made"] == sorted(made)


def test_a_run_with_nothing_to_do_leaves_no_trace(fresh):
    before = (fresh.results / "history.jsonl").read_bytes(), (fresh.results / "manifest.json").read_bytes()
    assert "Nothing to be done" in fresh.snakemake("fig2", CUBE, *COMMAND).stdout
    assert fresh.snakemake("fig1", "-n", *COMMAND).returncode == 0
    assert ((fresh.results / "history.jsonl").read_bytes(), (fresh.results / "manifest.json").read_bytes()) == before


def test_the_same_work_has_the_same_digest_and_another_id(fresh, first):
    assert fresh.snakemake(CUBE, "--forceall", *COMMAND).returncode == 0
    run, again = first[0], fresh.history()[-1]
    assert run["work"] == again["work"]
    assert run["id"] != again["id"]
    assert (again["jobs_run"], again["jobs_reused"]) == (1, 1)


def test_second_target_adds_to_manifest_and_reuses_what_is_there(fresh):
    for folder in ("runs", "logs/compile"):
        shutil.rmtree(fresh.results / folder, ignore_errors=True)
    assert fresh.snakemake("fig2", *COMMAND).returncode == 0
    assert fresh.snakemake(RUN, "fig2", *COMMAND).returncode == 0
    run = fresh.history()[-1]
    files = fresh.manifest()["files"]
    assert {"runs/sho/ruth/0.h5", "cubes/sho_terms.h5", "figures/fig2_decomposition.png"} <= set(files)
    assert run["made"] == ["runs/sho/ruth/0.h5"]
    assert (run["jobs_run"], run["jobs_reused"]) == (2, 2)  # compile and integrate; decompose and draw
    assert run["evaluations"] > 0


def test_another_config_is_other_work(fresh, first):
    place = fresh.folder / "config/tiny.yaml"
    text = place.read_text()
    place.write_text(text.replace("samples: 20", "samples: 21"))
    try:
        assert fresh.snakemake(RUN, *COMMAND).returncode == 0
    finally:
        place.write_text(text)
    before, after = first[0], fresh.history()[-1]
    assert after["config"]["samples"] == 21
    assert after["dirty"] is True
    assert before["work"] != after["work"]
    assert before["config_digest"] != after["config_digest"]
    assert before["code_digest"] == after["code_digest"]


def test_a_run_that_fails_is_remembered_as_failed(fresh):
    place = fresh.folder / "src/nearharmonic_paper/experiments/paper/tableaus.py"
    text = place.read_text()
    place.write_text(f"{text}\nassert not __name__\n")
    try:
        assert fresh.snakemake(CUBE, *COMMAND).returncode == 1
    finally:
        place.write_text(text)
    assert (fresh.history()[-1]["status"], fresh.history()[-1]["exit_status"]) == ("failed", 1)
    assert fresh.snakemake("fig2", *COMMAND).returncode == 0


def test_damaged_and_lost_files_are_made_again_in_one_go(fresh):
    assert fresh.snakemake("fig2", RUN, *COMMAND).returncode == 0
    manifest = (fresh.results / "manifest.json").read_bytes()
    figure, cube, run = (fresh.results / name for name in ("figures/fig2_decomposition.svg", CUBE[13:], RUN[13:]))
    contents = [place.read_bytes() for place in (figure, cube, run)]
    figure.unlink()
    cube.write_bytes(b"damaged")
    damaged = bytearray(contents[2])
    damaged[100] ^= 1
    run.write_bytes(damaged)
    assert fresh.nearharmonic("verify", "tiny").returncode == 1
    assert fresh.snakemake("fig2", RUN, *COMMAND).returncode == 0
    assert [place.read_bytes() for place in (figure, cube, run)] == contents
    assert (fresh.results / "manifest.json").read_bytes() == manifest
    assert fresh.manifest()["configfiles"] == ["config/tiny.yaml"]


def test_emptied_manifest_is_made_again_with_nothing_to_do(fresh):
    manifest = (fresh.results / "manifest.json").read_bytes()
    (fresh.results / "manifest.json").write_bytes(b"")
    assert "Nothing to be done" in fresh.snakemake("fig2", CUBE, *COMMAND).stdout
    assert (fresh.results / "manifest.json").read_bytes() == manifest


def test_failure_of_record_is_one_warning_without_lost_result(fresh):
    """No git, and a history that cannot be written; as root, permissions do not stop a writer, a folder does."""
    history = fresh.results / "history.jsonl"
    history.parent.mkdir(parents=True, exist_ok=True)
    kept = history.read_bytes() if history.is_file() else b""
    history.unlink(missing_ok=True)
    history.mkdir()
    programs = fresh.folder / "programs"
    programs.mkdir()
    for name in ("bash", "cc", "gcc"):
        if shutil.which(name):
            (programs / name).symlink_to(shutil.which(name))
    try:
        done = subprocess.run(
            [sys.executable, "-m", "snakemake", CUBE, "--forceall", *COMMAND],
            cwd=fresh.folder,
            env={**os.environ, "PYTHONPATH": str(fresh.folder / "src"), "PATH": str(programs)},
            capture_output=True,
            text=True,
            check=False,
        )
    finally:
        history.rmdir()
        history.write_bytes(kept)
    assert done.returncode == 0, done.stderr
    warnings = [line for line in done.stderr.splitlines() if line.startswith("nearharmonic: warning")]
    assert len(warnings) == 2
    assert warnings[0] == "nearharmonic: warning: the commit is not recorded: git is not installed"
    assert warnings[1].startswith("nearharmonic: warning: the history is not written: IsADirectoryError")
    assert "cubes/sho_terms.h5" in fresh.manifest()["files"]
