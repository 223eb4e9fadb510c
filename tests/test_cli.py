"""The command: what it prints, and its exit status: 0 yes, 1 no, 2 bad input, with one message."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from nearharmonic.cli import main

ROOT = Path(__file__).parents[1]


def test_recommend_prints_a_ranking_and_its_basis(capsys, tmp_path):
    assert main(["recommend", "sho", "--error", "1e-6", "--results", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert out.startswith("simple harmonic oscillator, t = 500: maximum of |H - H0|/|H0| <= 1e-06\n")
    assert "  1. " in out
    assert "Based on: measured on the spot" in out


def test_an_error_that_no_method_reaches_ends_with_status_1_and_the_list_of_the_best(capsys, tmp_path):
    assert main(["recommend", "sho", "--error", "1e-20", "--results", str(tmp_path)]) == 1
    out, err = capsys.readouterr()
    assert "no method reaches this error within 200000 evaluations" in out
    assert err == ""


def test_timings_that_cannot_be_read_are_bad_input(capsys, tmp_path):
    (tmp_path / "cubes").mkdir()
    (tmp_path / "cubes/work_precision.h5").write_bytes(b"not HDF5")
    assert main(["recommend", "sho", "--error", "1e-6", "--results", str(tmp_path)]) == 2
    assert "is truncated or no result file" in capsys.readouterr().err


def test_list_prints_one_kind_or_both(capsys):
    assert main(["list", "systems"]) == 0
    systems = capsys.readouterr().out
    assert "kepler" in systems
    assert "aba864" not in systems
    assert main(["list"]) == 0
    both = capsys.readouterr().out
    assert "aba864" in both
    assert both.endswith(systems)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["recommend", "keplr", "--error", "1e-9"], "unknown system 'keplr'. Did you mean 'kepler'?"),
        (["recommend", "kepler", "--error", "small"], "error = 'small' is not allowed: a finite number above 0"),
        (["recommend", "kepler", "--error", "1e-9", "--measure", "men"], "Did you mean 'mean'?"),
        (["recommend", "nowhere/mine.py", "--error", "1e-9"], "nowhere/mine.py: no such file"),
        (["recommend", "kepler"], "the following arguments are required: --error"),
        (["recomend"], "invalid choice: 'recomend'"),
        (["list", "planets"], "invalid choice: 'planets'"),
        ([], "the following arguments are required: command"),
    ],
)
def test_bad_input_ends_with_status_2_and_one_message(arguments, says, capsys):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("nearharmonic: ")
    assert says in err
    assert err.count("\n") == 1


def test_the_command_is_installed_under_its_name():
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["scripts"] == {"nearharmonic": "nearharmonic.cli:main"}


def test_a_reader_that_has_seen_enough_is_no_error():
    command = f"{sys.executable} -m nearharmonic.cli list | head -n 1"
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(command, shell=True, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.split()[:2] == ["name", "label"]
    assert done.stderr == ""
