"""Fingerprint that distinguishes one piece of work from another."""

from __future__ import annotations

import importlib.metadata
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from nearharmonic_paper.config import load
from nearharmonic_paper.record import workflow_run as fingerprint
from nearharmonic_paper.record.workflow_run import package_digest, revision
from nearharmonic_paper.tasks.provenance import PACKAGES, ROOT

SMOKE = Path(__file__).parents[3] / "config/smoke.yaml"


def config(**changes):
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
    before, after = fingerprint.fingerprint(config()), fingerprint.fingerprint(config(**changes))
    assert {key for key in before if before[key] != after[key]} == moved


@pytest.mark.slow
def test_a_new_version_of_a_library_is_other_work(monkeypatch):
    before = fingerprint.fingerprint(config())
    version = importlib.metadata.version
    monkeypatch.setattr(fingerprint, "version", lambda name: "0.0" if name == "matplotlib" else version(name))
    after = fingerprint.fingerprint(config())
    assert {key for key in before if before[key] != after[key]} == {"versions", "work"}


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
