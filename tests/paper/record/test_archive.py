"""The archive of a result: what it holds, its descriptions, its reproducibility, and reasons for refusal."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from datetime import datetime
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from urllib.parse import unquote, urlsplit
from zipfile import ZipFile

import pytest
import yaml
from rocrate.rocrate import ROCrate

from nearharmonic.cli import main
from nearharmonic.errors import ResultFileError, SettingError
from nearharmonic_paper.record import archive as pack
from nearharmonic_paper.record import description, verify
from nearharmonic_paper.record.archive import faults_of_archive
from support.results import finished_results
from support.results.finished_results import FILES, HISTORY, KILLED, NEWER, OLDER

ROOT = Path(__file__).parents[3]
METADATA, PREVIEW = "ro-crate-metadata.json", "ro-crate-preview.html"
WORKFLOW = {
    str(path.relative_to(ROOT))
    for path in (ROOT / "Snakefile", *ROOT.glob("workflow/**/*"))
    if path.is_file() and path.suffix != ".pyc"
}
DOCUMENTS = {"CITATION.cff", "LICENSE"}
ADDED = WORKFLOW | DOCUMENTS | {".zenodo.json", "README.md", "config.json", METADATA, PREVIEW}
RECORD = {"history.jsonl", "manifest.json"}
TRAJECTORIES = {path for path in FILES if path.startswith("runs/")}
HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)>&amp;'\""
FAILED = HISTORY[-1] | {"id": "20261122T090000Z-00000003", "status": "failed", "exit_status": 1}
PROFILES = {
    "https://w3id.org/ro/wfrun/process/0.5",
    "https://w3id.org/ro/wfrun/workflow/0.5",
    "https://w3id.org/workflowhub/workflow-ro-crate/1.0",
}


def saved(folder, files=FILES, history=HISTORY, **how):
    """The archive of a result with these files and runs, as names with bytes."""
    result = finished_results.write_result(folder / "little")
    for path, (content, _) in files.items():
        (result / path).parent.mkdir(parents=True, exist_ok=True)
        (result / path).write_bytes(content)
    finished_results.write_manifest(result, {path: finished_results.entry(*made) for path, made in files.items()})
    finished_results.write_history(result, history)
    place = pack.save(result, folder / "little.zip", **how)
    with ZipFile(place) as zipped:
        assert zipped.testzip() is None
        return result, place, {name: zipped.read(name) for name in zipped.namelist()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """An archive with trajectories: as ``rocrate`` reads it, its bytes by name, its entities by id, its preview."""
    more = {f"figures/fig{i}.{kind}": (b"x", NEWER) for i in range(7) for kind in ("pdf", "png", "svg")}
    folder = tmp_path_factory.mktemp("crate")
    _, place, held = saved(folder, {**FILES, **more}, [*HISTORY, FAILED], with_runs=True)
    document = json.loads(held[METADATA])
    graph = {entity["@id"]: entity for entity in document["@graph"]}
    assert len(graph) == len(document["@graph"])  # no @id twice
    page = held[PREVIEW].decode()
    return SimpleNamespace(read=ROCrate(place), held=held, document=document, graph=graph, page=page)


@pytest.fixture
def result(tmp_path):
    return finished_results.write_result(tmp_path / "results" / "little")


def values(value):
    return value if isinstance(value, list) else [value]


def references(value):
    return [each["@id"] for each in values(value)]


def typed(whole, kind):
    found = [entity for entity in whole.graph.values() if kind in values(entity["@type"])]
    assert found
    return found


def is_iso_8601(text):
    return datetime.fromisoformat(text).tzinfo is not None


def test_archive_holds_result_but_its_trajectories_and_its_logs(tmp_path):
    result, _, held = saved(tmp_path)
    (older,) = {name for name in held if name.startswith("config-")}
    assert set(held) == (FILES.keys() - TRAJECTORIES) | ADDED | RECORD | {older}
    assert all(held[path] == FILES[path][0] for path in FILES.keys() - TRAJECTORIES)
    assert all(held[name] == (result / name).read_bytes() for name in RECORD)
    assert all(held[name] == (ROOT / name).read_bytes() for name in WORKFLOW | DOCUMENTS)
    assert json.loads(held["config.json"]) == HISTORY[-1]["config"]
    assert json.loads(held[older]) == HISTORY[0]["config"]
    assert b"are not in this archive (files: 1)" in held["README.md"]


def test_archive_has_trajectories_on_request(whole):
    assert set(whole.held) > TRAJECTORIES
    assert b"not in this archive" not in whole.held["README.md"]


# MUSTs of https://w3id.org/ro/crate/1.1 and of the profiles that bind who writes a crate


def test_every_file_is_described_by_path_size_and_digest(whole):
    described = {unquote(entity["@id"]): entity for entity in typed(whole, "File")}
    assert described.keys() == whole.held.keys() - {METADATA, PREVIEW}
    for name, entity in described.items():
        content = whole.held[name]
        assert entity["contentSize"] == str(len(content))
        assert entity["sha256"] == hashlib.sha256(content).hexdigest()
        assert "/" in entity["encodingFormat"]
        assert not urlsplit(entity["@id"]).scheme
    assert sorted(references(whole.graph["./"]["hasPart"])) == sorted(one["@id"] for one in typed(whole, "File"))
    assert all(re.fullmatch(r"(?:[\w.~:/?#@!$&'()*+,;=-]|%[0-9A-Fa-f]{2})+", one, re.ASCII) for one in whole.graph)
    assert all(one.source.is_file() for one in whole.read.data_entities if not urlsplit(one.id).scheme)


def test_metadata_are_flattened_and_compacted_json_ld_with_known_terms(whole):
    assert whole.document.keys() == {"@context", "@graph"}
    assert whole.document["@context"] == [
        "https://w3id.org/ro/crate/1.1/context",
        {"sha256": "http://schema.org/sha256"},
    ]
    linked = set()
    for entity in whole.graph.values():
        for key, value in entity.items():
            assert not (isinstance(value, list) and len(value) < 2), (entity["@id"], key)
            assert all(isinstance(one, str) or set(one) == {"@id"} for one in values(value))
            linked |= {one["@id"] for one in values(value) if isinstance(one, dict)}
    web = {one for one in linked - whole.graph.keys() if urlsplit(one).scheme}
    assert linked - whole.graph.keys() == web
    statuses = {f"http://schema.org/{status}ActionStatus" for status in ("Completed", "Failed")}
    language = {
        one for entity in typed(whole, "ComputerLanguage") for one in references([entity["identifier"], entity["url"]])
    }
    assert web == {"https://w3id.org/ro/crate/1.1", *statuses, *language}


def test_root_and_descriptor_tell_what_the_profiles_ask_for(whole):
    root, descriptor = whole.graph["./"], whole.graph[METADATA]
    assert (root["@type"], descriptor["@type"], descriptor["about"]) == ("Dataset", "CreativeWork", {"@id": "./"})
    assert set(references(descriptor["conformsTo"])) == {"https://w3id.org/ro/crate/1.1", max(PROFILES)}
    assert set(references(root["conformsTo"])) == PROFILES
    assert all(whole.graph[profile]["version"] == profile.rpartition("/")[2] for profile in PROFILES)
    assert root["name"] == "nearharmonic results: little"
    assert root["description"]
    assert is_iso_8601(root["datePublished"])
    assert root["license"]["@id"] in whole.graph
    assert root["citation"] == {"@id": "https://arxiv.org/abs/1501.04345"}
    assert whole.graph["README.md"]["about"] == {"@id": "./"}


def test_each_run_is_an_action_with_its_times_files_and_software(whole):
    actions = {one["@id"].removeprefix("#run-"): one for one in typed(whole, "CreateAction")}
    assert actions.keys() == {run["id"] for run in (*HISTORY, FAILED)}
    assert Counter(references(whole.graph["./"]["mentions"])) == Counter(one["@id"] for one in actions.values())
    older, killed, newer, failed = (actions[name] for name in (OLDER, KILLED, NEWER, FAILED["id"]))
    assert older["result"] == {"@id": "cubes/sho.h5"}
    assert {"cubes/kepler.h5", "runs/kepler/ruth/0.h5"} <= set(references(newer["result"]))
    assert newer["object"] == {"@id": "config.json"} != older["object"]
    assert (newer["startTime"], newer["endTime"]) == ("2026-11-22T08:02:53.123+00:00", "2026-11-22T08:03:16.533+00:00")
    assert "snakemake -j2" in newer["description"]
    status = [one["actionStatus"]["@id"].rpartition("/")[2] for one in (newer, killed, failed)]
    assert status == ["CompletedActionStatus", "FailedActionStatus", "FailedActionStatus"]
    assert [one.get("error") for one in (newer, killed, failed)] == [None, "killed before its end", "exit status 1"]
    assert not {"endTime", "result"} & killed.keys()
    tools = [[whole.graph[tool] for tool in references(one["instrument"])] for one in (older, killed, newer)]
    assert [tool["version"] for _, tool in tools] == [
        f"0.1.0+{finished_results.COMMIT}.dirty", "0.1.0", f"0.1.0+{finished_results.COMMIT}",
    ]  # fmt: skip
    assert all(workflow["@id"] == "Snakefile" for workflow, _ in tools)
    libraries = [whole.graph[one] for one in references(tools[2][1]["softwareRequirements"])]
    assert {one["name"]: one["version"] for one in libraries} | {"nearharmonic": "0.1.0"} == finished_results.VERSIONS
    assert all(urlsplit(software["url"]).scheme == "https" for software in typed(whole, "SoftwareApplication"))


# The preview


def links(page):
    return re.findall(r'<a href="([^"]*)"', page)


def test_preview_lists_every_file_once_figures_in_one_row(whole):
    lists = whole.page.partition("<h2>")[2].partition("<h2>Runs of the workflow")[0]
    assert sorted(links(lists)) == sorted(f"./{one['@id']}" for one in typed(whole, "File"))
    tables = dict(re.findall(r"<h2>(.*?)</h2>\s*(<table>.*?</table>)", whole.page, flags=re.DOTALL))
    figures = {PurePosixPath(name).stem for name in whole.held if name.startswith("figures/")}
    assert sorted(re.findall(r"<tr><td>(\S+)</td>", tables["Figures"])) == sorted(figures)
    rows = {f"#{name}" for name in re.findall(r'<tr id="([^"]*)"', whole.page)}
    assert rows == {one["@id"] for kind in ("CreateAction", "SoftwareApplication") for one in typed(whole, kind)}


def test_preview_is_well_formed_and_makes_no_request(whole):
    assert whole.page.startswith("<!DOCTYPE html>\n")
    tree = ET.fromstring(whole.page)
    assert json.loads(tree.findtext("head/script")) == whole.document
    tags = {element.tag for element in tree.iter()}
    assert not {"img", "iframe", "object", "embed", "video", "audio", "source", "base", "form", "svg"} & tags
    names = [name for element in tree.iter() for name in element.attrib]
    assert not [name for name in names if name in {"src", "srcset", "style", "action", "data"} or name.startswith("on")]
    assert not re.search(r"url|@import|expression", tree.findtext("head/style"))
    assert "\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\"" in whole.page


def test_texts_of_a_result_are_no_markup_of_the_preview(tmp_path):
    run = HISTORY[-1] | {"targets": [HOSTILE], "command": ["snakemake", HOSTILE], "platform": HOSTILE}
    files = {**FILES, f"tables/{HOSTILE.replace('/', '_')}.csv": (b"1\n", NEWER)}
    _, _, held = saved(tmp_path, files, [*HISTORY[:-1], run], with_runs=True)
    page = held[PREVIEW].decode()
    tree = ET.fromstring(page)
    assert len(list(tree.iter("script"))) == 1
    assert not list(tree.iter("img"))
    assert "".join(tree.itertext()).count(HOSTILE) >= 3
    assert json.loads(tree.findtext("head/script")) == json.loads(held[METADATA])
    assert all(re.match(r"https?://|#|\./", one) for one in links(page))


# Zenodo


def test_deposit_says_what_the_crate_and_the_citation_file_say(whole):
    deposit, root = json.loads(whole.held[".zenodo.json"]), whole.graph["./"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    keys = {"title", "upload_type", "description", "creators", "access_right", "license"}
    assert deposit.keys() == keys | {"keywords", "language", "related_identifiers"}
    assert (deposit["title"], deposit["description"]) == (root["name"], f"<p>{root['description']}</p>")
    assert ", ".join(deposit["keywords"]) == root["keywords"]
    assert root["license"]["@id"] == f"https://spdx.org/licenses/{deposit['license']}"
    assert deposit["license"] == cited["license"]
    assert [one["name"] for one in deposit["creators"]] == [one["name"] for one in cited["authors"]]
    assert [(one["identifier"], one["relation"], one["scheme"]) for one in deposit["related_identifiers"]] == [
        ("arXiv:1501.04345", "references", "arxiv"), (cited["repository-code"], "isCompiledBy", "url"),
    ]  # fmt: skip


def test_people_are_creators_and_articles_have_their_address():
    people = [
        {
            "family-names": "Noether", "given-names": "Emmy", "affiliation": "Göttingen",
            "orcid": "https://orcid.org/0-1",
        },
        {"family-names": "Störmer", "given-names": "Carl"},
    ]  # fmt: skip
    article = {"title": "Some", "authors": [], "year": 1918, "url": "https://doi.org/10.1000/1"}
    cited = description.citation() | {"authors": people, "references": [article]}
    deposit = json.loads(description.zenodo(description.Archive("little", HISTORY, 0, cited)))
    first = {"name": "Noether, Emmy", "affiliation": "Göttingen", "orcid": "0-1"}
    assert deposit["creators"] == [first, {"name": "Störmer, Carl"}]
    assert deposit["related_identifiers"][0] == {
        "identifier": "https://doi.org/10.1000/1", "relation": "references", "resource_type": "publication-article",
        "scheme": "url",
    }  # fmt: skip


# Writing

SAVE = (
    "import sys\n"
    "from nearharmonic_paper.record import archive as pack\n"
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


def test_a_place_that_cannot_be_written_is_bad_input(result, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SettingError, match="cannot be written"):
        pack.save(result, tmp_path / "file" / "little.zip")


@pytest.mark.parametrize("name", description.DOCUMENTS)
def test_documents_come_from_installed_package_without_source_tree(tmp_path, monkeypatch, name):
    licences = tmp_path / "nearharmonic-0.1.0.dist-info" / "licenses"
    licences.mkdir(parents=True)
    (licences.parent / "METADATA").write_text("Metadata-Version: 2.4\nName: nearharmonic\nVersion: 0.1.0\n")
    (licences / name).write_text("installed")
    (licences.parent / "RECORD").write_text(f"nearharmonic-0.1.0.dist-info/licenses/{name},,\n")
    monkeypatch.setattr(description, "_SOURCE_TREE", tmp_path / "nowhere")
    monkeypatch.syspath_prepend(tmp_path)
    assert description.document(name) == b"installed"
    (licences / name).unlink()
    with pytest.raises(ResultFileError, match=f"{name} is missing from this installation"):
        description.document(name)


# The command


@pytest.fixture
def project(result, tmp_path, monkeypatch):
    """A working directory with the result ``little``, in which nothing is wrong."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(verify, "faults", lambda _: [])
    return tmp_path


def test_command_archives_a_result_by_its_name_and_tells_file_and_size(capsys, project):
    assert main(["archive", "little", "-o", "other.zip", "--with-runs", "--format", "json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    assert told == {"archive": "other.zip", "bytes": (project / "other.zip").stat().st_size}
    assert faults_of_archive("other.zip") == []


def test_command_refuses_a_result_with_a_fault_or_without_a_history(capsys, project, monkeypatch):
    (project / "results/little/history.jsonl").write_text("")
    assert main(["archive", "little"]) == 1
    assert "history.jsonl holds no run" in capsys.readouterr().out
    with pytest.raises(ResultFileError, match="holds no run"):
        pack.save("results/little")
    monkeypatch.setattr(verify, "faults", lambda _: ["cubes/kepler.h5 differs from the manifest"])
    assert main(["archive", "little"]) == 1
    assert "cubes/kepler.h5 differs from the manifest" in capsys.readouterr().out
    assert not (project / "little.zip").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("lttle", "unknown result 'lttle'. Did you mean 'little'?"),
        ("little -o little.tar", "-o = 'little.tar' is not allowed: a file with the ending .zip"),
        ("little -o little", "-o = 'little' is not allowed: a file with the ending .zip"),
        ("little -o folder.zip", "-o = 'folder.zip' is not allowed: a file with the ending .zip"),
        ("little -o results/little/a.zip", "a file outside of little"),
        ("little --with-run", "Did you mean '--with-runs'?"),
    ],
)
def test_bad_input_is_one_sentence_with_status_2(capsys, project, words, says):
    (project / "folder.zip").mkdir()
    assert main(["archive", *words.split()]) == 2
    assert says in capsys.readouterr().err
