"""The manifest: every file as its job wrote it; files changed without a job are reported and never accepted."""

import json
import os
import shutil
from hashlib import sha256
from pathlib import Path

import pytest

from nearharmonic.errors import ResultFileError, UnknownNameError
from nearharmonic.output.atomic import sealed
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.manifest import folder_of, result_names
from nearharmonic_paper.tasks.provenance import Receipt, damaged_receipts, names_made_by, receipts_in, task

TASK = task("nearharmonic_paper.experiments.paper.tableaus:decompose", integrators=["ruth"])


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NEARHARMONIC_RUN", "first")
    folder = tmp_path / "results/paper"
    for name in ("cubes", "tables", "logs/reduce"):
        (folder / name).mkdir(parents=True)
    return folder


def make(folder, name, content, log="logs/reduce/a.log", **remarks):
    """A file, and the receipt of the job that made it."""
    (folder / name).write_bytes(content)
    receipt = Receipt(f"results/paper/{log}")
    receipt.add([f"results/paper/{name}"], TASK, **remarks)
    receipt.write()


def test_it_holds_size_digest_and_origin_of_each_file(results):
    make(results, "cubes/a.h5", b"numbers", volatile=["seconds"], evaluations=7)
    assert manifest.write(results) == []
    found = manifest.read(results)
    assert found["files"] == {
        "cubes/a.h5": {
            "size": 7,
            "sha256": sha256(b"numbers").hexdigest(),
            "function": "nearharmonic_paper.experiments.paper.tableaus:decompose",
            "code": TASK["code"],
            "coefficients": TASK["coefficients"],
            "settings": sha256(b'{"integrators": ["ruth"]}').hexdigest(),
            "systems": [],
            "integrators": ["ruth"],
            "volatile": ["seconds"],
            "evaluations": 7,
            "inputs": {},
        }
    }
    assert found["changed"] == []
    assert found["format"] == "nearharmonic manifest 1"


def test_files_of_other_targets_stay_when_one_target_runs_again(results, monkeypatch):
    make(results, "cubes/a.h5", b"one", log="logs/reduce/a.log")
    make(results, "cubes/b.h5", b"two", log="logs/reduce/b.log")
    manifest.write(results)
    monkeypatch.setenv("NEARHARMONIC_RUN", "second")
    make(results, "cubes/b.h5", b"three", log="logs/reduce/b.log")
    manifest.write(results)
    files = manifest.read(results)["files"]
    assert list(files) == ["cubes/a.h5", "cubes/b.h5"]
    assert files["cubes/b.h5"]["sha256"] == sha256(b"three").hexdigest()


def test_lost_receipt_is_made_up_for_by_manifest_before(results):
    make(results, "cubes/a.h5", b"one")
    manifest.write(results)
    shutil.rmtree(results / "logs")
    assert manifest.write(results) == []
    assert list(manifest.read(results)["files"]) == ["cubes/a.h5"]


@pytest.mark.parametrize("receipts", ["kept", "lost"])
def test_file_that_changed_without_job_is_reported_and_not_blessed(results, receipts):
    make(results, "cubes/a.h5", b"numbers")
    manifest.write(results)
    (results / "cubes/a.h5").write_bytes(b"Numbers")
    if receipts == "lost":
        shutil.rmtree(results / "logs")
    for _ in range(2):
        assert manifest.write(results) == ["cubes/a.h5"]
        found = manifest.read(results)
        assert found["changed"] == ["cubes/a.h5"]
        assert found["files"]["cubes/a.h5"]["sha256"] == sha256(b"numbers").hexdigest()


def test_deleted_file_stays_listed_while_job_makes_it(results):
    make(results, "cubes/a.h5", b"numbers")
    manifest.write(results)
    (results / "cubes/a.h5").unlink()
    manifest.write(results, makeable=["cubes/a.h5"])
    assert list(manifest.read(results)["files"]) == ["cubes/a.h5"]
    manifest.write(results, makeable=["cubes/b.h5"])
    assert manifest.read(results)["files"] == {}


def test_former_and_unrecorded_files_are_named(results):
    make(results, "cubes/a.h5", b"numbers", log="logs/reduce/a.log")
    make(results, "cubes/b.h5", b"numbers", log="logs/reduce/b.log")
    (results / "cubes/c.h5").write_bytes(b"no receipt")
    (results / "cubes/mine.h5").write_bytes(b"no job")
    manifest.write(results, makeable=["cubes/b.h5", "cubes/c.h5", "cubes/d.h5"], configfiles=["config/x.yaml"])
    found = manifest.read(results)
    assert list(found["files"]) == ["cubes/a.h5", "cubes/b.h5"]
    assert (found["former"], found["unrecorded"]) == (["cubes/a.h5"], ["cubes/c.h5"])
    assert found["configfiles"] == ["config/x.yaml"]


def test_receipt_records_sealed_digest_or_digest_of_all_bytes(results):
    (results / "cubes/a.h5").write_bytes(b"x\nnearharmonic sha256 " + b"ab" * 32 + b"\n")
    (results / "tables/t.csv").write_bytes(b"a,b\n")
    (results / "logs/reduce/done").write_bytes(b"")
    read = [f"results/paper/{name}" for name in ("cubes/a.h5", "tables/t.csv", "logs/reduce/done")]
    receipt = Receipt("results/paper/logs/reduce/b.log", read)
    (results / "cubes/b.h5").write_bytes(b"made")
    receipt.add(["results/paper/cubes/b.h5"], TASK)
    receipt.write()
    manifest.write(results)
    assert manifest.read(results)["files"]["cubes/b.h5"]["inputs"] == {
        "cubes/a.h5": "ab" * 32,
        "tables/t.csv": sha256(b"a,b\n").hexdigest(),
    }


@pytest.mark.parametrize(
    "damage", ["", "{}", "[1]", '{"format": "x", "files": {}}', '{"format": "nearharmonic manifest 1"}']
)
def test_damaged_manifest_is_named_with_command_that_makes_it_again(results, damage):
    (results / "manifest.json").write_text(damage)
    with pytest.raises(ResultFileError, match=r"manifest\.json is damaged.* snakemake -j2 --force"):
        manifest.read(results)


@pytest.mark.parametrize("name", ["/etc/passwd", "../smoke/cubes/a.h5", "cubes/../../a"])
def test_a_manifest_names_no_file_outside_of_its_folder(results, name):
    make(results, "cubes/a.h5", b"numbers")
    manifest.write(results)
    document = manifest.read(results)
    document["files"][name] = document["files"].pop("cubes/a.h5")
    (results / "manifest.json").write_text(json.dumps(sealed(document)))
    with pytest.raises(ResultFileError, match="must be the name of a file inside the folder of results"):
        manifest.read(results)


def test_a_damaged_receipt_is_passed_over(results):
    make(results, "cubes/a.h5", b"numbers")
    damaged = ("{", "[]", '{"x": 1}', '{"cubes/a.h5": {"sha256": "0"}}', "[" * 200_000)
    for number, text in enumerate(damaged):
        (results / f"logs/{number}.json").write_text(text)
    manifest.write(results)
    assert list(manifest.read(results)["files"]) == ["cubes/a.h5"]


def test_receipt_with_a_changed_digit_is_named_and_not_believed(results):
    make(results, "cubes/a.h5", b"numbers", evaluations=7)
    manifest.write(results)
    place = results / "logs/reduce/a.json"
    place.write_text(place.read_text().replace('"evaluations": 7', '"evaluations": 8'))
    assert damaged_receipts(results) == [place]
    manifest.write(results)
    assert manifest.read(results)["files"]["cubes/a.h5"]["evaluations"] == 7
    assert names_made_by(receipts_in(results), "first") == []


def test_old_receipt_does_not_replace_entry_that_agrees_with_file(results):
    make(results, "cubes/a.h5", b"before")
    old = (results / "logs/reduce/a.json").read_bytes()
    make(results, "cubes/a.h5", b"after!")
    manifest.write(results)
    (results / "logs/reduce/a.json").write_bytes(old)
    assert manifest.write(results) == []
    assert manifest.read(results)["files"]["cubes/a.h5"]["sha256"] == sha256(b"after!").hexdigest()
    (results / "cubes/a.h5").write_bytes(b"edited")
    assert manifest.write(results) == ["cubes/a.h5"]


def test_neither_clock_nor_run_stands_in_the_manifest(results, monkeypatch):
    make(results, "cubes/a.h5", b"numbers")
    manifest.write(results)
    before = (results / "manifest.json").read_bytes()
    monkeypatch.setenv("NEARHARMONIC_RUN", "second")
    os.utime(results / "cubes/a.h5", (1, 1))
    make(results, "cubes/a.h5", b"numbers")
    manifest.write(results)
    assert (results / "manifest.json").read_bytes() == before


def test_a_receipt_that_cannot_be_written_costs_a_warning(results, capsys):
    (results / "logs/reduce/a.json").mkdir()
    make(results, "cubes/a.h5", b"numbers")
    assert "warning: no receipt" in capsys.readouterr().out


@pytest.mark.parametrize("replace", [os.mkfifo, os.mkdir, lambda place: place.symlink_to("/dev/zero")])
def test_what_is_no_regular_file_counts_as_changed(results, replace):
    make(results, "cubes/a.h5", b"numbers")
    entry = manifest.entries_of(results)["cubes/a.h5"]
    assert not manifest.is_changed(results / "cubes/a.h5", entry)
    (results / "cubes/a.h5").unlink()
    replace(results / "cubes/a.h5")
    assert manifest.is_changed(results / "cubes/a.h5", entry)


# --- Results by folder or by name, and errors for unknown names.


def test_result_is_named_by_its_folder_or_below_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownNameError, match=r"no folder below results/ holds a result\. Make the first: snakemake"):
        folder_of("paper")
    for place in ("results/paper/cubes", "results/smoke", "results/empty", "elsewhere/mine", "paper"):
        Path(place).mkdir(parents=True)
    Path("results/smoke/history.jsonl").touch()
    Path("elsewhere/mine/manifest.json").touch()
    assert [folder_of(name) for name in ("paper", "smoke")] == [Path("results/paper"), Path("results/smoke")]
    for name in ("results/paper", "elsewhere/mine", tmp_path / "elsewhere/mine"):
        assert folder_of(str(name)) == Path(name)
    assert result_names() == ["paper", "smoke"]
    with pytest.raises(UnknownNameError, match=r"^unknown result 'papr'\. Did you mean 'paper'\? Known: paper, smoke$"):
        folder_of("papr")
    with pytest.raises(UnknownNameError, match="unknown result 'empty'"):
        folder_of("empty")
