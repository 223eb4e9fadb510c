"""The history: a line a run, whole lines only, killed runs closed by the next start."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import psutil
import pytest

from nearharmonic.reproduction.record import history

#: What every run has.
RUN = {"start": "2026-01-01T00:00:00.000Z", "config": {}}


def lines(folder):
    return (folder / "history.jsonl").read_text(encoding="utf-8").split("\n")


def a_dead_process():
    """Number and start of a process that has ended."""
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        created = psutil.Process(process.pid).create_time()
        process.communicate(b"\n")
    return {"host": platform.node(), "number": process.pid, "created": created}


def leave_marker(folder, run, process):
    (folder / "logs/running").mkdir(parents=True, exist_ok=True)
    (folder / "logs/running" / f"{run}.json").write_text(
        json.dumps({**RUN, "id": run, "status": "running", "process": process})
    )


def test_what_was_appended_is_read_oldest_first(tmp_path):
    for number in range(3):
        history.append(tmp_path, {**RUN, "id": str(number), "label": "Hénon-Heiles"})
    assert [run["id"] for run in history.runs_of(tmp_path)] == ["0", "1", "2"]
    assert history.runs_of(tmp_path)[0]["label"] == "Hénon-Heiles"
    assert len(lines(tmp_path)) == 4


def test_a_folder_without_history_has_no_runs(tmp_path):
    assert history.runs_of(tmp_path) == []


def test_a_line_that_broke_off_costs_that_line_alone(tmp_path):
    history.append(tmp_path, {**RUN, "id": "a"})
    with (tmp_path / "history.jsonl").open("a") as file:
        file.write('{"id": "b", "sta')
    history.append(tmp_path, {**RUN, "id": "c"})
    assert [run["id"] for run in history.runs_of(tmp_path)] == ["a", "c"]


def test_runs_that_end_at_once_do_not_mix_their_lines(tmp_path):
    with ThreadPoolExecutor(16) as pool:
        list(pool.map(lambda i: history.append(tmp_path, {**RUN, "id": str(i), "filling": "x" * 20_000}), range(64)))
    assert sorted(int(run["id"]) for run in history.runs_of(tmp_path)) == list(range(64))


def test_a_line_is_appended_in_one_write(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(os, "write", lambda file, data: written.append(data))
    history.append(tmp_path, {**RUN, "id": "a", "filling": "x" * 100_000})
    assert len(written) == 1
    assert written[0].endswith(b"\n")


def test_no_infinity_gets_into_the_history(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        history.append(tmp_path, {**RUN, "id": "a", "duration": float("inf")})
    assert not (tmp_path / "history.jsonl").exists()


def test_the_next_start_closes_a_killed_run(tmp_path):
    leave_marker(tmp_path, "old", a_dead_process())
    assert history.close_killed(tmp_path) == ["old"]
    (run,) = history.runs_of(tmp_path)
    assert (run["id"], run["status"]) == ("old", "killed")
    assert "process" not in run
    assert list((tmp_path / "logs/running").iterdir()) == []
    assert history.close_killed(tmp_path) == []


def test_a_run_beside_this_one_is_left_alone(tmp_path):
    history.mark(tmp_path, {**RUN, "id": "beside"})
    assert history.close_killed(tmp_path) == []
    assert [run["id"] for run in history.running_in(tmp_path)] == ["beside"]
    history.unmark(tmp_path, "beside")
    assert history.running_in(tmp_path) == []
    assert history.runs_of(tmp_path) == []


def test_later_process_with_number_of_killed_one_is_another(tmp_path):
    this = psutil.Process()
    leave_marker(tmp_path, "old", {"host": platform.node(), "number": this.pid, "created": this.create_time() - 86_400})
    assert history.close_killed(tmp_path) == ["old"]


def test_a_run_on_another_machine_is_left_alone(tmp_path):
    leave_marker(tmp_path, "far", {**a_dead_process(), "host": "elsewhere"})
    assert history.close_killed(tmp_path) == []
    assert [run["id"] for run in history.running_in(tmp_path)] == ["far"]


def test_a_marker_that_another_start_has_claimed_is_closed_once(tmp_path, monkeypatch):
    leave_marker(tmp_path, "old", a_dead_process())
    dead = list(history._dead(tmp_path))
    assert history.close_killed(tmp_path) == ["old"]
    monkeypatch.setattr(history, "_dead", lambda folder: dead)
    assert history.close_killed(tmp_path) == []
    assert len(history.runs_of(tmp_path)) == 1


@pytest.mark.parametrize(
    "line", ['{"id": "x"}', '{"id": 3, "start": "2026", "config": {}}', "[" * 200_000, "null", "7"]
)
def test_a_line_that_is_no_run_is_passed_over(tmp_path, line):
    history.append(tmp_path, {**RUN, "id": "a"})
    with (tmp_path / "history.jsonl").open("a") as file:
        file.write(f"{line}\n")
    assert [run["id"] for run in history.runs_of(tmp_path)] == ["a"]


@pytest.mark.parametrize("process", [{}, {"number": "x"}, {"number": 1}])
def test_marker_that_names_no_process_is_of_killed_run(tmp_path, process):
    leave_marker(tmp_path, "old", {"host": platform.node(), **process})
    assert history.close_killed(tmp_path) == ["old"]
