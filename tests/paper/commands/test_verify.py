"""``nearharmonic verify`` and ``nearharmonic adopt``: words, JSON and exit status."""

from __future__ import annotations

import json

import pytest

from nearharmonic.cli import main
from nearharmonic.errors import RefusedError
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.verify import check_tasks
from nearharmonic_paper.tasks.provenance import Receipt, task

TASK = task("nearharmonic_paper.experiments.paper.tableaus:decompose", integrators=["ruth"])
CUBE = "results/paper/cubes/sho_terms.h5"


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A result of one file."""
    monkeypatch.chdir(tmp_path)
    for name in ("cubes", "logs"):
        (tmp_path / "results/paper" / name).mkdir(parents=True)
    (tmp_path / CUBE).write_bytes(b"numbers")
    receipt = Receipt("results/paper/logs/a.log")
    receipt.add([CUBE], TASK)
    receipt.write()
    manifest.write(tmp_path / "results/paper")
    return tmp_path / "results/paper"


def test_a_result_without_fault_is_said_to_be_one(results, capsys):
    assert main(["verify", "paper"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == ["results/paper: no fault", "1 file, 7 bytes: each as its job wrote it, by this code"]


def test_each_fault_is_told_with_what_mends_it(results, capsys):
    (results / "cubes/sho_terms.h5").write_bytes(b"Numbers")
    assert main(["verify", "paper"]) == 1
    text = capsys.readouterr().out
    assert text.startswith("results/paper: 1 fault\n")
    assert "is damaged: its bytes differ from what its job wrote" in text
    assert f"Make it again: snakemake -j2 --force {CUBE}" in text
    assert main(["verify", "paper", "--rerun", "2"]) == 1
    assert "no run was integrated again, since there are faults" in capsys.readouterr().out


def test_faults_as_json_and_csv_hold_file_fault_and_mend(results, capsys):
    (results / "cubes/sho_terms.h5").unlink()
    assert main(["verify", "paper", "--format", "json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["result"] == "results/paper"
    assert told["faults"] == [
        {"file": "cubes/sho_terms.h5", "fault": "is missing", "mend": f"Make it again: snakemake -j2 --force {CUBE}"}
    ]
    assert main(["verify", "paper", "--format", "csv"]) == 1
    assert capsys.readouterr().out.splitlines()[0] == "file,fault,mend"


def test_a_result_outside_of_its_project_is_not_adopted(results, capsys):
    assert main(["adopt", "paper"]) == 1
    assert "copy it there, and adopt it from there" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("configs", "says"),
    [
        ({}, "no file in config/ has the name 'paper'; name its config: --configfile FILE"),
        ({"a": "name: paper", "b": "name: paper"}, "config/a.yaml and config/b.yaml have the name 'paper'"),
        ({"a": "name: [", "b": "- 1", "c": "name: other"}, "no file in config/ has the name 'paper'"),
    ],
)
def test_result_without_config_of_its_name_is_not_adopted(results, configs, says, capsys):
    (results.parents[1] / "Snakefile").write_text("")
    (results.parents[1] / "config").mkdir()
    for name, text in configs.items():
        (results.parents[1] / f"config/{name}.yaml").write_text(text)
    assert main(["adopt", "paper"]) == 1
    assert says in capsys.readouterr().err


def test_a_result_with_a_fault_is_not_adopted(results, capsys):
    (results.parents[1] / "Snakefile").write_text("")
    (results / "cubes/sho_terms.h5").write_bytes(b"Numbers")
    assert main(["adopt", "paper", "--format", "json"]) == 1
    told = capsys.readouterr()
    assert "is not adopted: cubes/sho_terms.h5 is damaged" in told.err
    assert json.loads(told.out)["adopted"] is False


def test_results_of_the_described_tasks_are_adopted(results):
    check_tasks(results, [TASK, {**TASK, "code": "0"}])


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"settings": {"integrators": ["leapfrog"]}}, "was made with other settings;"),
        ({"code": "0"}, "was made with other code;"),
        ({"coefficients": "0", "code": "0"}, "was made with other code and coefficients;"),
        (
            {"function": "nearharmonic_paper.experiments.paper.reductions:reduce"},
            "other settings and code and coefficients;",
        ),
    ],
)
def test_results_of_other_tasks_are_not(results, changes, says):
    with pytest.raises(RefusedError, match=says):
        check_tasks(results, [{**TASK, **changes}])
