"""Results never run code: files that a result names are run only if the user's command line names them too."""

from __future__ import annotations

import hashlib
import json
import shlex
from pathlib import Path

import pytest

from nearharmonic.cli import main
from nearharmonic.errors import SettingError, UntrustedFileError
from nearharmonic.output.store import NAME_KEY
from nearharmonic.registry import trusting_only
from nearharmonic_paper.config import load, read
from nearharmonic_paper.record.query import rerun
from nearharmonic_paper.record.verify import adopt
from nearharmonic_paper.tasks.provenance import digest_of_file as digest_of
from support.results.finished_results import write_history
from support.results.result_folder import edited, history_line, write_manifest

EVIL = """from pathlib import Path

Path("ran").write_text("code of a result was run")
from nearharmonic.examples import nothing
"""
COMMANDS = (
    "verify paper", "verify paper --rerun 3", "show paper sho ruth 0.1", "show paper mine ruth 50",
    "compare paper copy", "archive paper -o paper.zip", "runs paper", "history paper", "adopt paper",
)  # fmt: skip


@pytest.fixture
def evil(project, copy):
    """A Python file inside the result, which leaves a mark if it is run."""
    place = project / "evil.py"
    place.write_text(EVIL)
    return place


def resealed(folder, beginning="", **changes):
    """The manifest of a folder made again as a forger would, with ``changes`` of the entries of some names."""
    write_manifest(folder)
    manifest = json.loads((folder / "manifest.json").read_text())
    del manifest["sha256"]
    for name in manifest["files"]:
        if name.startswith(beginning):
            manifest["files"][name] |= changes
    text = json.dumps(manifest, sort_keys=True, ensure_ascii=False)
    manifest["sha256"] = hashlib.sha256(text.encode()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


def tried(command):
    """Exit status of a command, which must be an answer or a sentence."""
    status = main(shlex.split(command))
    assert status in {0, 1, 2}
    return status


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["integrators", pytest.param("systems", marks=pytest.mark.slow)])
def test_no_command_runs_definition_of_manifest(project, evil, kind, capsys):
    told = {"file": str(evil)} | ({"written": "evil.py"} if kind == "integrators" else {})
    resealed(project, definitions={kind: {"mine": told}}, **{kind: ["mine"]})
    for command in COMMANDS:
        tried(command)
    assert "Traceback" not in capsys.readouterr().err
    assert not Path("ran").exists()


@pytest.mark.slow
@pytest.mark.parametrize("kind", [pytest.param("integrators", marks=pytest.mark.slow), "systems"])
def test_no_command_runs_path_in_place_of_name(project, evil, kind):
    resealed(project, **{kind: [str(evil)]})
    for command in COMMANDS:
        tried(command)
    assert not Path("ran").exists()


@pytest.mark.slow
def test_no_command_runs_definition_of_cube_or_run_file(project, evil, capsys):
    (project / "cubes/kepler.h5").rename(project / "cubes/mine.h5")
    (project / "runs/kepler").rename(project / "runs/mine")
    for path in (project / "cubes/mine.h5", *(project / "runs/mine").rglob("*.h5")):
        with edited(path) as file:
            settings = json.loads(file.attrs["settings"].replace('"kepler"', '"mine"'))
            file.attrs["system"] = "mine"
            file.attrs[NAME_KEY] = path.relative_to(project).as_posix()
            file.attrs["settings"] = json.dumps(settings | {"definitions": {"systems": {"mine": {"file": str(evil)}}}})
    resealed(project, "runs/mine/", function="nearharmonic_paper.experiments.paper.run:integrate")
    with trusting_only([]), pytest.raises(UntrustedFileError, match="is Python code, which is not run"):
        rerun(project, 1000)
    assert tried("show paper mine ruth 50") == 0
    assert f"are in {evil}, whose code this command does not run" in capsys.readouterr().out
    for command in COMMANDS:
        tried(command)
    assert not Path("ran").exists()


def test_config_of_result_runs_no_file(evil):
    grid = {"lowest": 0.1, "highest": 0.2, "points_per_decade": 4}
    mapping = {
        "name": "paper",
        "integrators": ["ruth"],
        "systems": {"mine": {"file": str(evil), "t_end": 1, "tau_per_stage": grid}},
    }
    with trusting_only([]), pytest.raises(SettingError, match=r"^systems\.mine: .* is Python code, which is not run"):
        load(mapping)
    assert not Path("ran").exists()


def test_adopt_refuses_before_snakemake_and_names_file_digest_and_option(project, evil, capsys, monkeypatch):
    monkeypatch.setattr("nearharmonic_paper.record.verify.faults", lambda folder: [])
    monkeypatch.setattr("subprocess.run", lambda *_, **__: pytest.fail("Snakemake was started"))
    Path("Snakefile").write_text("")
    resealed(project, definitions={"systems": {"mine": {"file": str(evil)}}})
    assert tried("adopt paper") == 2
    digest = hashlib.sha256(EVIL.encode()).hexdigest()
    assert capsys.readouterr().err == (
        f"nearharmonic: {evil} (SHA-256 {digest}) is Python code, which is not run: "
        f"read it, and allow it by --trust {evil}\n"
    )


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("missing.py", "--trust = 'missing.py' is not allowed: a Python file that the results name"),
        ("own.py", "the history of results/paper has no digest of such a file"),
        ("results/paper/evil.py", "is not the file that made results/paper: its code has the digest"),
    ],
)
def test_trust_in_other_file_than_recorded_is_refused(project, evil, given, says, capsys):
    Path("own.py").write_text(EVIL)
    write_history(project, [history_line(8, user_files={str(evil): "0" * 64})])
    assert tried(f"verify paper --rerun 1 --trust {given}") == 2
    assert says in capsys.readouterr().err
    assert not Path("ran").exists()


def test_trusted_file_with_recorded_digest_is_run(project, evil, capsys):
    """The file fails when it is run, and leaves its mark."""
    write_history(project, [history_line(8, user_files={str(evil): digest_of(evil)})])
    told = {"file": str(evil), "written": "evil.py"}
    resealed(project, definitions={"integrators": {"mine": told}}, integrators=["mine"])
    assert tried("verify paper") == 1
    assert not Path("ran").exists()
    assert tried(f"verify paper --trust {evil}") == 1
    assert "evil.py cannot be run" in capsys.readouterr().out
    assert Path("ran").exists()


def test_edit_of_integrators_file_is_found_without_running_it(project, evil, capsys):
    told = {"file": str(evil), "written": "evil.py"}
    resealed(project, definitions={"integrators": {"mine": told}}, integrators=["mine"])
    write_history(project, [history_line(8, user_files={str(evil): "0" * 64})])
    tried("verify paper")
    assert "was made with other code and coefficients" in capsys.readouterr().out
    write_history(project, [history_line(8, user_files={str(evil): digest_of(evil)})])
    tried("verify paper")
    assert "coefficients" not in capsys.readouterr().out
    assert not Path("ran").exists()


def test_inner_block_cannot_allow_more_than_outer_block(evil):
    from nearharmonic.registry import load_file as load_module

    with trusting_only([]), trusting_only([evil]), pytest.raises(UntrustedFileError):
        load_module(evil, "", UntrustedFileError)
    with pytest.raises(UntrustedFileError, match="cannot be run"):
        load_module(evil, "", UntrustedFileError)


def test_file_with_the_name_of_a_trusted_one_is_not_run(evil, tmp_path):
    from nearharmonic.registry import load_file as load_module

    with trusting_only([tmp_path / "elsewhere" / evil.name]), pytest.raises(UntrustedFileError, match="is not run"):
        load_module(evil, "", UntrustedFileError)


def test_archive_takes_no_file_that_history_has_not_recorded(project, evil, capsys, monkeypatch):
    """A forged manifest names a private file, which would be published with the archive."""
    monkeypatch.setattr("nearharmonic_paper.record.archive.reasons_against", lambda folder: [])
    Path("private.py").write_text("PASSWORD = 1\n")
    resealed(project, definitions={"systems": {"mine": {"file": "private.py"}}})
    assert tried("archive paper -o paper.zip") == 2
    assert "private.py is not archived: its code has no digest in the history" in capsys.readouterr().err
    assert not Path("paper.zip").exists()


@pytest.mark.parametrize("form", ["table", "json", "csv"])
def test_escape_sequences_of_history_do_not_reach_terminal(project, capsys, form):
    write_history(project, [history_line(8, status="a\x1b[2J\x9b", targets=["\u202eall", "\x07"])])
    for command in ("history", "history paper --full", "history --full \x1b"):
        tried(f"{command} --format {form}")
    shown = "".join(capsys.readouterr())
    assert not set("\x1b\x9b\x07\u202e") & set(shown)
    assert r"a\u001b[2J\u009b" in shown


TEMPLATE = '__use_yte__: true\nname: ?__import__("pathlib").Path("ran").write_text("paper")\n'


@pytest.mark.parametrize(
    "text", [TEMPLATE, '{"__use_yte__": true, "name": "paper",}', 'a: &a {"\\x5f_use_yte__": true}\n<<: *a\n']
)
def test_template_in_place_of_config_is_refused_before_snakemake(project, text, monkeypatch):
    monkeypatch.setattr("nearharmonic_paper.record.verify.faults", lambda folder: [])
    monkeypatch.setattr("subprocess.run", lambda *_, **__: pytest.fail("Snakemake was started"))
    Path("Snakefile").write_text("")
    Path("own.yaml").write_text(text)
    resealed(project)
    with pytest.raises(SettingError, match=r"^__use_yte__ = True is not allowed: a config is data"):
        adopt(project, "own.yaml")
    with pytest.raises(SettingError, match=r"^__use_yte__ = True is not allowed: a config is data"):
        read(Path("own.yaml"))
    assert not Path("ran").exists()
