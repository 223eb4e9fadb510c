"""The record of a run: its fingerprint; failures are warnings, and damaged files are set aside."""

from __future__ import annotations

import os
import shutil
import subprocess
from hashlib import sha256
from pathlib import Path

import pytest
import yaml

from nearharmonic_paper.config import load
from nearharmonic_paper.record import history, manifest
from nearharmonic_paper.record import workflow_run as fingerprint
from nearharmonic_paper.record import workflow_run as state
from nearharmonic_paper.record.verify import faults
from nearharmonic_paper.record.workflow_run import WorkflowRun, package_digest, revision
from nearharmonic_paper.tasks.provenance import PACKAGES, ROOT, Receipt, receipts_in, task

SMOKE = Path(__file__).parents[3] / "config/smoke.yaml"
MADE = ("cubes/a.h5", "cubes/b.h5", "tables/skipped.csv")
TASK = task("nearharmonic_paper.experiments.paper.tableaus:decompose", integrators=["ruth"])


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A run that has begun in an empty folder of results."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NEARHARMONIC_RUN", "another")
    monkeypatch.setenv("NEARHARMONIC_LEADER", "elsewhere:1")
    (tmp_path / "results/smoke/logs").mkdir(parents=True)
    begun = WorkflowRun("results/smoke", load(yaml.safe_load(SMOKE.read_text(encoding="utf-8"))), MADE)
    begun.begin(["/somewhere/bin/snakemake", "-j2"], ["all"], cores=2)
    return begun


def make(name, log):
    place = Path("results/smoke") / name
    place.parent.mkdir(exist_ok=True)
    place.write_text(name)
    receipt = Receipt(f"results/smoke/logs/{log}.log")
    receipt.add([str(place)], TASK, evaluations=5)
    receipt.write()
    return place


def test_run_leaves_marker_and_its_id_for_its_jobs(run):
    (marked,) = history.running_in(Path("results/smoke"))
    assert marked["id"] == run.id == os.environ["NEARHARMONIC_RUN"]
    assert (marked["status"], marked["end"], marked["command"]) == ("running", None, ["snakemake", "-j2"])
    assert history.runs_of(Path("results/smoke")) == []


@pytest.mark.parametrize(("exit_status", "status"), [(0, "ok"), (1, "failed")])
def test_its_end_is_a_line_of_the_history(run, exit_status, status, capsys):
    make("cubes/a.h5", "a")
    make("cubes/b.h5", "b")
    run.end(exit_status)
    (line,) = history.runs_of(Path("results/smoke"))
    assert (line["status"], line["exit_status"], line["jobs_run"], line["jobs_reused"]) == (status, exit_status, 2, 0)
    assert (line["evaluations"], line["evaluations_skipped"]) == (10, None)
    assert line["duration"] >= 0
    assert history.running_in(Path("results/smoke")) == []
    assert set(manifest.read(Path("results/smoke"))["files"]) == {"cubes/a.h5", "cubes/b.h5"}
    assert capsys.readouterr().err == ""


def history_faults():
    return [fault.says for fault in faults(Path("results/smoke")) if fault.file == "history.jsonl"]


def test_flipped_receipt_with_its_old_time_is_healed(run, capsys):
    make("cubes/a.h5", "a")
    run.end(0)
    place = Path("results/smoke/logs/a.json")
    before, content = place.stat(), place.read_bytes()
    place.write_bytes(content[:100] + bytes([content[100] ^ 4]) + content[101:])
    os.utime(place, ns=(before.st_atime_ns, before.st_mtime_ns))
    config = load(yaml.safe_load(SMOKE.read_text(encoding="utf-8")))
    for says in ("1 damaged receipts are removed", ""):
        WorkflowRun("results/smoke", config, MADE).prepare()
        assert says in capsys.readouterr().err
    assert state.differing(Path("results/smoke")) == set()
    assert [fault.says for fault in faults(Path("results/smoke")) if "receipt" in fault.says] == []


@pytest.mark.parametrize("left", [0, 1])
def test_lost_last_line_is_told_until_next_run_records_it(run, left):
    folder, place = Path("results/smoke"), Path("results/smoke/history.jsonl")
    for _ in range(2):
        run.end(0)
    assert history_faults() == []
    lines = place.read_text().splitlines(keepends=True)
    place.write_text("".join(lines[:left]))
    state.save(folder, MADE, receipts_in(folder))  # a start that has nothing to do
    assert history_faults() == [f"has lost its last line or more; it has {left}"]
    run.end(0)
    assert history_faults() == []
    assert sha256(lines[-1].strip().encode()).hexdigest() in place.read_text()


def test_files_of_earlier_runs_do_not_count_as_made(run, monkeypatch):
    make("cubes/b.h5", "b")
    monkeypatch.setenv("NEARHARMONIC_RUN", "earlier")
    make("cubes/a.h5", "a")
    run.end(0)
    assert run.told["made"] == ["cubes/b.h5"]


def test_a_table_that_cannot_be_read_is_a_warning(run, capsys):
    make("tables/skipped.csv", "skipped")
    run.end(0)
    assert capsys.readouterr().err.startswith("nearharmonic: warning: the evaluations are not recorded: ")
    (line,) = history.runs_of(Path("results/smoke"))
    assert line["evaluations"] is None


def test_changed_files_are_told(run, capsys):
    make("cubes/a.h5", "a").write_text("something else")
    run.end(0)
    assert capsys.readouterr().err == (
        "nearharmonic: warning: changed since their jobs wrote them: cubes/a.h5 in results/smoke\n"
    )


def test_damaged_file_and_what_is_made_from_it_are_aside_until_the_end(run):
    folder = Path("results/smoke")
    for name, inputs in (("cubes/a.h5", []), ("cubes/b.h5", ["results/smoke/cubes/a.h5"])):
        place = folder / name
        place.parent.mkdir(exist_ok=True)
        place.write_text(name)
        receipt = Receipt(f"results/smoke/logs/{name[6]}.log", inputs)
        receipt.add([str(place)], TASK)
        receipt.write()
    run.end(0)
    (folder / "cubes/a.h5").write_text("damaged")
    config = load(yaml.safe_load(SMOKE.read_text(encoding="utf-8")))
    for is_dry in (True, False):  # the second start is after a kill of the first
        WorkflowRun(folder, config, MADE).prepare(is_dry=is_dry)
        assert not list((folder / "cubes").iterdir())
    (folder / "cubes/b.h5").write_text("made again")
    run.end(0)
    assert (folder / "cubes/a.h5").read_text() == "damaged"
    assert (folder / "cubes/b.h5").read_text() == "made again"
    assert not (folder / "logs/aside").exists()


# --- Fingerprint that distinguishes one piece of work from another.


def resolved(**changes):
    return load({**yaml.safe_load(SMOKE.read_text(encoding="utf-8")), **changes})


@pytest.fixture
def package(tmp_path):
    """A copy of the packages."""
    for name in PACKAGES:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "moved"),
    [
        ({"samples": 101}, {"config", "config_digest", "work"}),
        ({"integrators": ["ruth", "srkn_b6"]}, {"config", "config_digest", "coefficients_digest", "work"}),
        ({"overview": ["leapfrog"]}, {"config", "config_digest", "coefficients_digest", "work"}),
    ],
)
def test_a_setting_moves_its_digest_and_no_other(changes, moved):
    before, after = fingerprint.fingerprint(resolved()), fingerprint.fingerprint(resolved(**changes))
    assert {key for key in before if before[key] != after[key]} == moved


@pytest.mark.slow
def test_code_anywhere_in_the_package_counts_and_comments_do_not(package):
    before = package_digest(package)
    for name in ("nearharmonic_paper/record/history.py", "nearharmonic/systems/kepler.py", "nearharmonic/__init__.py"):
        place = package / name
        text = place.read_text(encoding="utf-8") if place.is_file() else ""
        place.write_text(text + "\n# a comment\n", encoding="utf-8")
        if text:
            assert package_digest(package) == before, name
        place.write_text(text + "\n_EDITED = 1\n", encoding="utf-8")
        assert package_digest(package) != before, name
        before = package_digest(package)


def git(folder, *words):
    author = ("-c", "user.name=a", "-c", "user.email=a@example.org")
    return subprocess.run(["git", *author, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


def test_a_working_tree_is_clean_until_something_changes(tmp_path):
    git(tmp_path, "init", "-q")
    (tmp_path / "a").write_text("1")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "a")
    head = git(tmp_path, "rev-parse", "HEAD").strip()
    assert revision(tmp_path) == {"commit": head, "dirty": False}
    (tmp_path / "b").write_text("a file that is not under version control")
    assert revision(tmp_path) == {"commit": head, "dirty": True}
    (tmp_path / "b").unlink()
    (tmp_path / "a").write_text("2")
    assert revision(tmp_path) == {"commit": head, "dirty": True}


def test_a_folder_without_version_control_has_no_commit(tmp_path, monkeypatch):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert revision(tmp_path) == {"commit": None, "dirty": None}
