"""The command ``nearharmonic recommend``: its options, and JSON that agrees with the Dataset."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import nearharmonic as nh
from nearharmonic.cli import main

METHODS = "ruth,aba864, babps9o7h"


def told(capsys, *words):
    """(what JSON holds, exit status) of the command."""
    status = main(["recommend", *words, "--format", "json"])
    return json.loads(capsys.readouterr().out), status


def test_interval_methods_and_budget_are_those_of_the_options(capsys):
    words = ["--error", "1e-6", "--t-end", "50", "--methods", METHODS, "--budget", "5000"]
    document, status = told(capsys, "henon_heiles", *words)
    assert (status, document["t_end"], document["budget"], document["error"]) == (0, "50", 5000, 1e-6)
    assert {choice["method"] for choice in document["choices"]} == {"ruth", "aba864", "babps9o7h"}
    for choice in document["choices"]:
        run = nh.integrate("henon_heiles", choice["method"], choice["tau"], t_end="50", summation=choice["summation"])
        assert run.max_energy_error.item() == choice["error"] == choice["max_energy_error"] <= 1e-6
        assert run.evaluations.item() == choice["evaluations"] <= 5000


@pytest.mark.slow
def test_missed_error_gives_no_rank_and_status_1_for_all(capsys):
    words = ["sho", "--error", "1e-6", "--methods", "leapfrog,babps9o7h"]
    document, status = told(capsys, *words, "--budget", "20000")
    assert status == 0
    assert [(choice["rank"], choice["status"]) for choice in document["choices"]] == [(1, "met"), (None, "missed")]
    document, status = told(capsys, *words, "--budget", "100")
    assert status == 1
    assert {choice["rank"] for choice in document["choices"]} == {None}


def test_interval_of_option_takes_place_of_that_of_config(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text(
        "name: mine\nintegrators: [ruth]\nsystems:\n  far:\n    system: sho\n    q0: [2]\n    t_end: 30\n"
        "    tau_per_stage: {lowest: 0.01, highest: 1, points_per_decade: 20}\n"
    )
    words = ["far", "--config", "mine.yaml", "--error", "1e-3", "--methods", "ruth"]
    document, _ = told(capsys, *words)
    assert (document["t_end"], document["call"]) == ("30", "")  # no Python without the config
    assert told(capsys, *words, "--t-end", "12.5")[0]["t_end"] == "12.5"


@pytest.mark.slow
def test_ten_rows_names_and_python_of_the_first(capsys):
    words = ["recommend", "sho", "--error", "1e-3", "--budget", "3000", "--results", "/nowhere"]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [line.split() for line in lines if re.match(r" +\d+ ", line)]
    assert len(rows) == 10
    assert all(row[1] in nh.integrators.registered for row in rows)
    (more,) = re.findall(r"^(\d+) more meet the error: --limit (\d+)$", "\n".join(lines), re.MULTILINE)
    assert int(more[1]) == int(more[0]) + 10
    call = lines[-1].removeprefix("the best in Python: ")
    assert eval(call, {"nh": nh}).max_energy_error <= 1e-3
    assert main([*words, "--limit", "1", "--methods", "verlet,BAB's8o7H,6A8"]) == 0
    (row,) = re.findall(r"^ +\d+ .*", capsys.readouterr().out, re.MULTILINE)
    assert row.split()[1] in ("babps8o7h", "nystrom_6a8")  # leapfrog needs 20 times as many evaluations


def test_help_explains_every_column(capsys):
    assert main(["recommend", "--help"]) == 0
    told = re.findall(r"^  (\w+) +\w", capsys.readouterr().out.partition("columns:\n")[2], re.MULTILINE)
    assert main(["recommend", "sho", "--error", "1e-3", "--methods", "ruth"]) == 0
    assert told == capsys.readouterr().out.splitlines()[1].split()


@pytest.mark.long
def test_other_libraries_are_left_out_if_methods_are_named(capsys):
    with_all, _ = told(capsys, "sho", "--error", "1e-2", "--budget", "2000", "--results", "/nowhere")
    assert "other libraries: not timed (/nowhere" in with_all["basis"]
    named, _ = told(capsys, "sho", "--error", "1e-2", "--budget", "2000", "--methods", "ruth")
    assert "other libraries" not in named["basis"]
