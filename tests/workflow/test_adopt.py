"""Results of every target: all of them recorded and verified, and taken over elsewhere."""

from __future__ import annotations

import json
import shutil
from zipfile import ZipFile

import pytest

from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_paper.tasks.provenance import receipts_in
from support.projects.targets import MADE, MADE_BY, SYSTEMS, TARGETS
from support.projects.workflow_project import TINY, Project

pytestmark = pytest.mark.slow


def check_manifest_and_verify(project, target):
    made = MADE_BY[target]
    assert project.snakemake(target, "-j2", *TINY).returncode == 0
    assert set(project.manifest()["files"]) == made
    verified = project.nearharmonic("verify", "tiny", "--rerun", "3")
    assert verified.returncode == 0, verified.stdout + verified.stderr
    assert "3 runs integrated again: 3 are bitwise identical" in verified.stdout


def test_each_file_is_in_the_manifest_and_verified(finished):
    check_manifest_and_verify(finished, "all")


def test_after_everything_each_file_is_in_the_manifest_and_verified(everything):
    check_manifest_and_verify(everything, "everything")


def test_measured_times_are_marked(everything):
    files = everything.manifest()["files"]
    volatile = {name: entry["volatile"] for name, entry in files.items() if entry["volatile"]}
    whole = {name for name, columns in volatile.items() if columns == ["*"]}
    timed = {
        name
        for one in experiments().values()
        for name in MADE & TARGETS[one.target]
        if one.measured and name.startswith(one.measured)
    }
    assert whole == timed
    assert {name: volatile[name] for name in volatile.keys() - whole} == {
        f"tables/derived_routes.{suffix}": ["seconds"] for suffix in ("csv", "md", "tex")
    }


def test_evaluations_of_run_match_table_of_skipped_work(finished):
    """Counted here by the jobs, there from the cubes of the grid; two cubes of long orbits are no part of that."""
    run = next(run for run in finished.history() if run["targets"] == ["all"])
    rows = (finished.results / "tables/skipped.csv").read_text().splitlines()
    count = {tuple(row.split(",")[2:4]): int(row.rpartition(",")[2]) for row in rows if row.startswith("all,all,")}
    receipts = {name: entry for _, one in receipts_in(finished.results) for name, entry in one.items()}
    names = ("cubes/henon_heiles_chaos.h5", "cubes/substeps_displaced.h5")
    orbits = sum(receipts[name]["evaluations"] for name in names)
    # Two orbits of 200 scalings of 1000 steps and a kick; ten of 100 000 steps and a kick, but for those that leave.
    assert 2 * 400 * 8001 < orbits < 2 * 400 * 8001 + 10 * 700_001
    assert run["evaluations"] == count["all", "done"] + orbits
    assert run["evaluations"] + run["evaluations_skipped"] == count["all", "full grid"] + orbits


def test_results_that_were_copied_are_adopted_and_nothing_runs_again(finished, tmp_path):
    copy = Project(tmp_path / "copy")
    shutil.copytree(finished.folder / "src", copy.folder / "src", dirs_exist_ok=True)
    without_logs = shutil.ignore_patterns("logs")
    shutil.copytree(finished.results, copy.results, ignore=without_logs, copy_function=shutil.copy)
    assert copy.jobs(*TINY) != {}
    adopted = copy.nearharmonic("adopt", "tiny")
    assert adopted.returncode == 0, adopted.stderr
    assert copy.jobs(*TINY) == {}
    assert copy.nearharmonic("verify", "tiny").returncode == 0
    edited = copy.folder / "src/nearharmonic_paper/experiments/paper/reductions.py"
    edited.write_text(edited.read_text() + "_EDITED = 1\n")
    assert copy.jobs("results/tiny/cubes/sho.h5", *TINY) == {"reduce": 1}


@pytest.mark.parametrize("fault", ["another setting", "a flipped bit", "no config"])
def test_deceptive_results_are_refused_with_reason(finished, tmp_path, fault):
    copy = Project(tmp_path / "copy")
    without_logs = shutil.ignore_patterns("logs")
    shutil.copytree(finished.results, copy.results, ignore=without_logs, copy_function=shutil.copy)
    config = copy.folder / "config/tiny.yaml"
    if fault == "a flipped bit":
        place = copy.results / "figures/fig1_sho.png"
        place.write_bytes(place.read_bytes()[:-1] + b"?")
        reason = "figures/fig1_sho.png is damaged"
    elif fault == "another setting":
        config.write_text(config.read_text().replace("t_end: 25", "t_end: 26"))
        reason = "was made with other settings"
    else:
        config.unlink()
        reason = "no file in config/ has the name 'tiny'"
    refused = copy.nearharmonic("adopt", "tiny")
    assert refused.returncode == 1
    assert reason in refused.stderr
    assert not (copy.folder / ".snakemake/metadata").is_dir() or not list(
        (copy.folder / ".snakemake/metadata").iterdir()
    )
    assert (copy.results / "manifest.json").read_bytes() == (finished.results / "manifest.json").read_bytes()


def test_the_commands_that_verify_prints_mend_what_it_found(breakable):
    damaged = breakable.results / "runs/sho/ruth/0.h5"
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[:99] + bytes([whole[99] ^ 1]) + whole[100:])
    (breakable.results / "cubes/sho.h5").unlink()
    found = json.loads(breakable.nearharmonic("verify", "tiny", "--format", "json").stdout)["faults"]
    assert {fault["file"] for fault in found[:2]} == {"runs/sho/ruth/0.h5", "cubes/sho.h5"}
    for fault in found:
        command = fault["mend"].partition(": snakemake ")[2].split()
        assert breakable.snakemake(*command).returncode == 0, fault
    assert damaged.read_bytes() == whole
    verified = breakable.nearharmonic("verify", "tiny")
    assert verified.returncode == 0, verified.stdout
    assert breakable.jobs(*TINY) == {}


def test_the_settings_in_an_archive_make_the_same_results(breakable):
    assert breakable.nearharmonic("archive", "tiny", "-o", "tiny.zip").returncode == 0
    with ZipFile(breakable.folder / "tiny.zip") as archive:
        (breakable.folder / "config.json").write_bytes(archive.read("config.json"))
    assert breakable.jobs("--configfile", "config.json") == {}
    assert breakable.nearharmonic("verify", "tiny.zip").returncode == 0


def test_files_of_former_config_are_told_until_they_are_gone(breakable):
    config = breakable.folder / "config/tiny.yaml"
    text = config.read_text()
    config.write_text(text.replace("integrators: [ruth, babs7o7h]", "integrators: [ruth]"))
    assert breakable.snakemake("results/tiny/cubes/sho.h5", "-j2", *TINY).returncode == 0
    found = json.loads(breakable.nearharmonic("verify", "tiny", "--format", "json").stdout)["faults"]
    former = {fault["file"] for fault in found if fault["fault"].startswith("is of a former config")}
    assert former >= {f"runs/{system}/babs7o7h/{shard}.h5" for system in SYSTEMS for shard in (0, 1)}
    assert all("babs7o7h" in file for file in former)
    config.write_text(text)
    assert breakable.snakemake("results/tiny/cubes/sho.h5", "-j2", *TINY).returncode == 0
    assert breakable.nearharmonic("verify", "tiny").returncode == 0


def test_adopt_runs_no_file_of_its_config(finished, tmp_path):
    """The manifest names no user's file, and the config in config/ does: Snakemake reads it in a process of its own."""
    copy = Project(tmp_path / "copy")
    shutil.copytree(finished.results, copy.results, ignore=shutil.ignore_patterns("logs"), copy_function=shutil.copy)
    (copy.folder / "evil.py").write_text("from pathlib import Path\n\nPath('ran').touch()\n")
    config = copy.folder / "config/tiny.yaml"
    text = config.read_text()
    assert "integrators: [ruth, babs7o7h]" in text
    config.write_text(text.replace("integrators: [ruth, babs7o7h]", "integrators: [ruth, babs7o7h, evil.py]"))
    refused = copy.nearharmonic("adopt", "tiny")
    assert refused.returncode == 1
    assert "evil.py (SHA-256 " in refused.stderr
    assert "is not run" in refused.stderr
    assert not (copy.folder / "ran").exists()
