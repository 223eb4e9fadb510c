"""The command ``nearharmonic archive``: what it prints, and its exit status."""

from __future__ import annotations

import json

import pytest

from nearharmonic.cli import main
from nearharmonic_paper.record import verify
from nearharmonic_paper.record.archive.check import faults_of_archive
from support.results import finished_results


@pytest.fixture(autouse=True)
def _project(tmp_path, monkeypatch):
    """A working directory with the result ``little``, in which nothing is wrong."""
    finished_results.write_result(tmp_path / "results" / "little")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(verify, "faults", lambda _: [])


def test_a_result_is_archived_by_its_name(capsys, tmp_path):
    assert main(["archive", "little"]) == 0
    place = tmp_path / "little.zip"
    assert faults_of_archive(place) == []
    assert str(place.stat().st_size) in capsys.readouterr().out


def test_the_answer_as_json_tells_file_and_size(capsys, tmp_path):
    assert main(["archive", "results/little", "-o", "other.zip", "--with-runs", "--format", "json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    assert told == {"archive": "other.zip", "bytes": (tmp_path / "other.zip").stat().st_size}


def test_a_result_with_a_fault_is_refused_with_status_1(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(verify, "faults", lambda _: ["cubes/kepler.h5 differs from the manifest"])
    assert main(["archive", "little"]) == 1
    assert "cubes/kepler.h5 differs from the manifest" in capsys.readouterr().out
    assert not (tmp_path / "little.zip").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["lttle"], "unknown result 'lttle'. Did you mean 'little'?"),
        (["little", "-o", "little.tar"], "-o = 'little.tar' is not allowed: a file with the ending .zip"),
        (["little", "-o", "results/little/a.zip"], "a file outside of little"),
        (["little", "--with-run"], "Did you mean '--with-runs'?"),
    ],
)
def test_bad_input_is_one_sentence_with_status_2(capsys, words, says):
    assert main(["archive", *words]) == 2
    assert says in capsys.readouterr().err
