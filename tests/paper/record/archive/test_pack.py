"""The archive of a result: its content, its reproducibility, and reasons for refusal."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from nearharmonic.errors import ResultFileError, SettingError
from nearharmonic_paper.record import verify
from nearharmonic_paper.record.archive import pack
from nearharmonic_paper.record.archive.description import software
from support.results import finished_results
from support.results.finished_results import FILES, HISTORY, KILLED, NEWER, OLDER

ROOT = Path(__file__).parents[4]
WORKFLOW = {
    str(path.relative_to(ROOT))
    for path in (ROOT / "Snakefile", *ROOT.glob("workflow/*/*"))
    if path.is_file() and path.suffix != ".pyc"
}
ADDED = WORKFLOW | {
    ".zenodo.json",
    "CITATION.cff",
    "LICENSE",
    "README.md",
    "config.json",
    "history.jsonl",
    "manifest.json",
    "ro-crate-metadata.json",
    "ro-crate-preview.html",
}
TRAJECTORIES = {path for path in FILES if path.startswith("runs/")}


@pytest.fixture
def result(tmp_path):
    return finished_results.write_result(tmp_path / "results" / "little")


def contents(place):
    with ZipFile(place) as zipped:
        assert zipped.testzip() is None
        return {name: zipped.read(name) for name in zipped.namelist()}


def graph(place):
    document = json.loads(contents(place)["ro-crate-metadata.json"])
    return {entity["@id"]: entity for entity in document["@graph"]}


def references(value):
    return [each["@id"] for each in (value if isinstance(value, list) else [value])]


def software_of(action):
    """Identifier of the software of a run beside the workflow."""
    (found,) = [one for one in references(action["instrument"]) if one != "Snakefile"]
    return found


def test_archive_holds_result_but_its_trajectories_and_its_logs(result, tmp_path):
    held = contents(pack.save(result, tmp_path / "little.zip"))
    (older,) = {name for name in held if name.startswith("config-")}
    assert set(held) == (FILES.keys() - TRAJECTORIES) | ADDED | {older}
    assert {path: held[path] for path in FILES.keys() - TRAJECTORIES} == {
        path: FILES[path][0] for path in FILES.keys() - TRAJECTORIES
    }
    assert held["history.jsonl"] == (result / "history.jsonl").read_bytes()
    assert held["manifest.json"] == (result / "manifest.json").read_bytes()
    assert held["LICENSE"] == (ROOT / "LICENSE").read_bytes()
    assert held["CITATION.cff"] == (ROOT / "CITATION.cff").read_bytes()
    assert {name: held[name] for name in WORKFLOW} == {name: (ROOT / name).read_bytes() for name in WORKFLOW}
    assert json.loads(held["config.json"]) == HISTORY[-1]["config"]
    assert json.loads(held[older]) == HISTORY[0]["config"]


def test_trajectories_are_added_on_request(result, tmp_path):
    held = contents(pack.save(result, tmp_path / "little.zip", with_runs=True))
    assert set(held) > TRAJECTORIES
    assert b"not in this archive" not in held["README.md"]


def test_every_file_is_described_with_its_size_and_digest(result, tmp_path):
    place = pack.save(result, tmp_path / "little.zip", with_runs=True)
    described = graph(place)
    for name, content in contents(place).items():
        if name not in ("ro-crate-metadata.json", "ro-crate-preview.html"):
            entity = described[name.replace("%", "%25").replace(" ", "%20")]
            assert entity["contentSize"] == str(len(content))
            assert entity["sha256"] == hashlib.sha256(content).hexdigest()
            assert "/" in entity["encodingFormat"]
            assert entity["description"].endswith(".")


def test_an_action_tells_what_its_run_took_and_made(result, tmp_path):
    described = graph(pack.save(result, tmp_path / "little.zip"))
    older, newer = described[f"#run-{OLDER}"], described[f"#run-{NEWER}"]
    assert older["result"] == {"@id": "cubes/sho.h5"}
    assert "cubes/kepler.h5" in references(newer["result"])
    assert not TRAJECTORIES & set(references(newer["result"]))
    assert newer["object"] == {"@id": "config.json"} != older["object"]
    assert newer["startTime"] == "2026-11-22T08:02:53.123+00:00"
    assert newer["endTime"] == described["./"]["datePublished"] == "2026-11-22T08:03:16.533+00:00"
    assert newer["actionStatus"]["@id"].endswith("/CompletedActionStatus")
    assert "snakemake -j2" in newer["description"]
    assert "error" not in newer


def test_run_software_has_version_commit_and_libraries(result, tmp_path):
    described = graph(pack.save(result, tmp_path / "little.zip"))
    tools = {name: described[software_of(described[f"#run-{name}"])] for name in (OLDER, KILLED, NEWER)}
    assert tools[NEWER]["version"] == f"0.1.0+{finished_results.COMMIT}"
    assert tools[OLDER]["version"] == f"0.1.0+{finished_results.COMMIT}.dirty"
    assert tools[KILLED]["version"] == "0.1.0"
    libraries = {
        described[each]["name"]: described[each]["version"] for each in references(tools[NEWER]["softwareRequirements"])
    }
    assert libraries | {"nearharmonic": "0.1.0"} == finished_results.VERSIONS


def test_a_killed_run_has_failed_and_has_no_end(result, tmp_path):
    action = graph(pack.save(result, tmp_path / "little.zip"))[f"#run-{KILLED}"]
    assert action["actionStatus"]["@id"].endswith("/FailedActionStatus")
    assert action["error"] == "killed before its end"
    assert not {"endTime", "result"} & action.keys()


def test_a_run_that_failed_tells_its_exit_status(result, tmp_path):
    failed = HISTORY[-1] | {"id": "20261122T090000Z-00000003", "status": "failed", "exit_status": 1}
    with (result / "history.jsonl").open("a") as lines:
        lines.write(json.dumps(failed) + "\n")
    action = graph(pack.save(result, tmp_path / "little.zip"))["#run-20261122T090000Z-00000003"]
    assert action["actionStatus"]["@id"].endswith("/FailedActionStatus")
    assert action["error"] == "exit status 1"


SAVE = (
    "import sys\n"
    "from nearharmonic_paper.record.archive import pack\n"
    "pack.save(sys.argv[1], sys.argv[2], with_runs=True)\n"
)  # fmt: skip


@pytest.mark.slow
def test_same_result_gives_same_bytes_anywhere_and_at_any_time(result, tmp_path):
    first = pack.save(result, tmp_path / "first.zip", with_runs=True)
    copy = shutil.copytree(result, tmp_path / "elsewhere" / "little")
    for path in copy.rglob("*"):
        os.utime(path, (1, 1))
        path.chmod(0o755)
    environment = os.environ | {"PYTHONHASHSEED": "1", "TZ": "Asia/Tokyo"}
    subprocess.run([sys.executable, "-c", SAVE, copy, tmp_path / "second.zip"], check=True, env=environment)
    assert (tmp_path / "second.zip").read_bytes() == first.read_bytes()


@pytest.mark.parametrize("content", [b"other bytes", None])
def test_changing_file_leaves_only_old_archive(result, tmp_path, content):
    place = tmp_path / "zips" / "little.zip"
    place.parent.mkdir()
    place.write_bytes(b"old")
    damaged = result / "cubes" / "kepler.h5"
    damaged.unlink() if content is None else damaged.write_bytes(content)
    with pytest.raises(ResultFileError, match=r"kepler\.h5"):
        pack.save(result, place)
    assert place.read_bytes() == b"old"
    assert [path.name for path in place.parent.iterdir()] == ["little.zip"]


def test_a_result_without_a_history_is_refused(result, tmp_path, monkeypatch):
    monkeypatch.setattr(verify, "faults", lambda _: [])
    assert pack.faults(result) == []
    (result / "history.jsonl").write_text("")
    (reason,) = pack.faults(result)
    assert "history.jsonl holds no run" in reason
    with pytest.raises(ResultFileError, match="holds no run"):
        pack.save(result, tmp_path / "little.zip")


@pytest.mark.parametrize("place", ["little.tar", "little", "results/little/little.zip", "folder.zip"])
def test_an_archive_is_a_zip_file_outside_of_its_result(result, tmp_path, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.zip").mkdir()
    with pytest.raises(SettingError, match=r"-o = .* is not allowed: a file"):
        pack.save(result, place)


def test_a_place_that_cannot_be_written_is_bad_input(result, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SettingError, match="cannot be written"):
        pack.save(result, tmp_path / "file" / "little.zip")


@pytest.mark.parametrize("name", software.DOCUMENTS)
def test_documents_come_from_installed_package_without_source_tree(tmp_path, monkeypatch, name):
    licences = tmp_path / "nearharmonic-0.1.0.dist-info" / "licenses"
    licences.mkdir(parents=True)
    (licences.parent / "METADATA").write_text("Metadata-Version: 2.4\nName: nearharmonic\nVersion: 0.1.0\n")
    (licences / name).write_text("installed")
    (licences.parent / "RECORD").write_text(f"nearharmonic-0.1.0.dist-info/licenses/{name},,\n")
    monkeypatch.setattr(software, "_SOURCE_TREE", tmp_path / "nowhere")
    monkeypatch.syspath_prepend(tmp_path)
    assert software.document(name) == b"installed"
    (licences / name).unlink()
    with pytest.raises(ResultFileError, match=f"{name} is missing from this installation"):
        software.document(name)


def test_every_library_of_a_history_has_a_home_page():
    assert software.HOMES.keys() == finished_results.VERSIONS.keys() - {"nearharmonic"}
