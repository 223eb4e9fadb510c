"""``nearharmonic history``: newest first, one result or all, one run in full, and runs under way."""

import csv
import io
import json
from pathlib import Path

import pytest

from nearharmonic.cli import main
from support.results.finished_results import write_history
from support.results.result_folder import history_line, run_id


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Two results with two runs each: one run of the other result is between the runs of the paper."""
    monkeypatch.chdir(tmp_path)
    for name, lines in {
        "paper": [
            history_line(7, status="failed", exit_status=1),
            history_line(9, dirty=True, targets=["fig1", "fig2"], commit=None),
        ],
        "smoke": [history_line(6, status="killed", end=None, duration=None), history_line(8)],
    }.items():
        Path("results", name).mkdir(parents=True)
        write_history(Path("results", name), lines)
    return tmp_path


def told(capsys, *arguments):
    assert main(["history", *arguments, "--format", "csv"]) == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def test_the_runs_of_a_result_are_listed_newest_first(project, capsys):
    first, second = told(capsys, "paper")
    assert first == {
        "when": "2026-11-22 09:02:53", "id": run_id(9), "commit": "", "dirty": "True", "targets": "fig1 fig2",
        "duration": "23.41", "status": "ok",
    }  # fmt: skip
    assert (second["commit"], second["dirty"], second["status"]) == ("0123456789", "False", "failed")


def test_runs_of_all_results_are_listed_with_naming_column(project, capsys):
    rows = told(capsys)
    assert [(row["result"], row["id"]) for row in rows] == [
        ("paper", run_id(9)), ("smoke", run_id(8)), ("paper", run_id(7)), ("smoke", run_id(6)),
    ]  # fmt: skip
    assert rows[-1]["duration"] == ""


def test_current_run_is_listed_as_running_until_history_has_it(project, capsys):
    marker = project / f"results/paper/logs/running/{run_id(10)}.json"
    marker.parent.mkdir(parents=True)
    started = history_line(10, status="running", end=None, duration=None)
    marker.write_text(json.dumps(started))
    marker.with_name("torn.json").write_text('{"id": "2026')
    assert [row["status"] for row in told(capsys, "paper")] == ["running", "ok", "failed", "damaged"]
    marker.with_name("torn.json").unlink()
    write_history(project / "results/paper", [history_line(10)])
    assert [row["status"] for row in told(capsys, "paper")] == ["ok"]


def test_full_shows_every_field_of_newest_or_named_run(project, capsys):
    for arguments, hour in ((["--full"], 9), (["--full", run_id(7)], 7), ([f"--full={run_id(7)[:11]}"], 7)):
        assert main(["history", "paper", *arguments, "--format", "json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["id"] == run_id(hour)
        assert set(found) == set(history_line(7))
    fields = {row["field"]: row["value"] for row in told(capsys, "paper", "--full", run_id(7))}
    assert fields["config.systems.kepler.tau_per_stage.lowest"] == "10.0"
    assert fields["versions.numpy"] == "2.4.6"
    assert fields["command"] == "snakemake -j2"
    assert fields["cpu.features"] == "avx2"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["paper", "--full", "20261122T0"], "2 runs begin with it, 20261122T090253Z-3f9a1c2e, 20261122T070253Z"),
        (["paper", "--full", "20261122T070253Z-3f9a1c2f"], "Did you mean '20261122T070253Z-3f9a1c2e'?"),
        (["papr"], "unknown result 'papr'. Did you mean 'paper'?"),
    ],
)
def test_an_id_that_is_none_or_not_unique_is_refused(project, arguments, says, capsys):
    assert main(["history", *arguments]) == 2
    assert says in capsys.readouterr().err


def test_a_result_without_a_history_has_no_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("results/paper/cubes").mkdir(parents=True)
    assert main(["history", "paper"]) == 0
    assert capsys.readouterr().out == "no run is recorded in results/paper\n"
    assert told(capsys, "paper") == []
    assert main(["history", "paper", "--full"]) == 2
    assert "no run is recorded" in capsys.readouterr().err
