"""The history: a sealed line a run, chained; killed runs are closed by the next start; no damage hides a run."""

import hashlib
import json
import platform
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import psutil
import pytest

from nearharmonic_paper.record import history

#: What every run has.
RUN = {"start": "2026-01-01T00:00:00.000Z", "config": {}}


def faults(folder):
    """Numbers of the lines with a fault that no later line records."""
    return [line.number for line in history.faulty_lines(history.lines_of(folder / "history.jsonl"))]


def two_runs(folder):
    """A history of two runs, and its bytes."""
    for name in ("20260101T000000Z-00000001", "20260102T000000Z-00000002"):
        history.append(folder, {**RUN, "id": name, "status": "ok", "versions": {"numpy": "2"}, "duration": 1.5})
    return (folder / "history.jsonl").read_bytes()


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


def test_a_line_that_broke_off_costs_that_line_alone(tmp_path):
    history.append(tmp_path, {**RUN, "id": "a"})
    with (tmp_path / "history.jsonl").open("a") as file:
        file.write('{"id": "b", "sta')
    history.append(tmp_path, {**RUN, "id": "c"})
    assert [run["id"] for run in history.runs_of(tmp_path)] == ["a", "line-2", "c"]
    assert faults(tmp_path) == []  # the line of the run after it records the fault


@pytest.mark.slow
def test_runs_that_end_at_once_do_not_mix_their_lines(tmp_path):
    with ThreadPoolExecutor(16) as pool:
        list(pool.map(lambda i: history.append(tmp_path, {**RUN, "id": str(i), "filling": "x" * 5_000}), range(64)))
    assert sorted(int(run["id"]) for run in history.runs_of(tmp_path)) == list(range(64))


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


def test_a_run_whose_process_has_ended_is_listed_as_killed(tmp_path):
    leave_marker(tmp_path, "old", a_dead_process())
    history.mark(tmp_path, {**RUN, "id": "beside", "status": "running"})
    told = {run["id"]: run["status"] for _, run in history.runs_newest_first([tmp_path])}
    assert told == {"old": "killed", "beside": "running"}


def test_a_run_beside_this_one_is_left_alone(tmp_path):
    history.mark(tmp_path, {**RUN, "id": "beside"})
    assert history.close_killed(tmp_path) == []
    assert [run["id"] for run in history.running_in(tmp_path)] == ["beside"]
    history.unmark(tmp_path, "beside")
    assert history.running_in(tmp_path) == []
    assert history.runs_of(tmp_path) == []


def test_a_run_on_another_machine_is_left_alone(tmp_path):
    leave_marker(tmp_path, "far", {**a_dead_process(), "host": "elsewhere"})
    assert history.close_killed(tmp_path) == []
    assert [run["id"] for run in history.running_in(tmp_path)] == ["far"]


@pytest.mark.parametrize(
    "line", ['{"id": "x"}', '{"id": 3, "start": "2026", "config": {}}', "[" * 200_000, "null", "7"]
)
def test_a_line_that_is_no_run_is_shown_as_damaged(tmp_path, line):
    history.append(tmp_path, {**RUN, "id": "a"})
    with (tmp_path / "history.jsonl").open("a") as file:
        file.write(f"{line}\n")
    assert [(run["id"], run.get("status")) for run in history.runs_of(tmp_path)] == [("a", None), ("line-2", "damaged")]
    assert faults(tmp_path) == [2]


#: A later process has the number of the killed one.
LATER = {"number": psutil.Process().pid, "created": psutil.Process().create_time() - 86_400}


@pytest.mark.parametrize("process", [{}, {"number": "x"}, {"number": 1}, LATER], ids=["none", "odd", "part", "later"])
def test_marker_that_names_no_live_process_is_of_killed_run(tmp_path, process):
    leave_marker(tmp_path, "old", {"host": platform.node(), **process})
    assert history.close_killed(tmp_path) == ["old"]


def test_line_holds_its_seal_and_digest_of_line_before(tmp_path):
    texts = two_runs(tmp_path).splitlines()
    first, second = map(json.loads, texts)
    assert (first["before"], second["before"]) == (None, hashlib.sha256(texts[0]).hexdigest())
    for document in (first, second):
        seal = document.pop("sha256")
        text = json.dumps(document, sort_keys=True, ensure_ascii=False)
        assert seal == hashlib.sha256(text.encode()).hexdigest()
    assert [set(run) & {"before", "sha256"} for run in history.runs_of(tmp_path)] == [set(), set()]


@pytest.mark.slow
def test_every_flipped_bit_is_found_and_hides_no_run(tmp_path):
    content = two_runs(tmp_path)
    sound = history.runs_of(tmp_path)
    for place, bit in ((place, (place * 5 + more) % 8) for place in range(len(content)) for more in (0, 3)):
        flipped = bytearray(content)
        flipped[place] ^= 1 << bit
        (tmp_path / "history.jsonl").write_bytes(flipped)
        runs = history.runs_of(tmp_path)
        assert len(runs) >= 2
        assert faults(tmp_path) or runs == sound, (place, bit)
        assert all(run in sound or run["status"] == "damaged" for run in runs)


@pytest.mark.parametrize("change", ["lost", "doubled", "exchanged", "unsealed"])
def test_a_lost_added_or_moved_line_is_found(tmp_path, change):
    two_runs(tmp_path)
    history.append(tmp_path, {**RUN, "id": "20260103T000000Z-00000003"})
    place = tmp_path / "history.jsonl"
    one, two, three = place.read_text().splitlines(keepends=True)
    bare = json.dumps({**RUN, "id": "20260102T000000Z-00000002", "status": "ok"}) + "\n"
    lines = {"lost": [one, three], "doubled": [one, one, two, three], "exchanged": [one, three, two]}
    place.write_text("".join(lines.get(change, [one, bare, three])))
    assert faults(tmp_path)[0] == 2


def test_next_line_records_the_faults_before_it(tmp_path):
    place = tmp_path / "history.jsonl"
    place.write_bytes(two_runs(tmp_path).replace(b'"status": "ok"', b'"status": "no"', 1))
    assert faults(tmp_path) == [1]
    history.append(tmp_path, {**RUN, "id": "20260103T000000Z-00000003"})
    assert faults(tmp_path) == []
    assert [run.get("status") for run in history.runs_of(tmp_path)] == ["damaged", "ok", None]
    assert history.runs_of(tmp_path)[0]["start"] == "2026-01-01T00:00:00.000Z"


def test_a_history_without_seals_is_read_and_continued(tmp_path):
    (tmp_path / "history.jsonl").write_text("".join(json.dumps({**RUN, "id": name}) + "\n" for name in "ab"))
    history.append(tmp_path, {**RUN, "id": "c"})
    assert [run["id"] for run in history.runs_of(tmp_path)] == ["a", "b", "c"]
    assert [line.is_sealed for line in history.lines_of(tmp_path / "history.jsonl")] == [False, False, True]
    assert faults(tmp_path) == []


def test_a_damaged_marker_is_of_a_run_that_is_closed(tmp_path):
    history.mark(tmp_path, {**RUN, "id": "20260101T000000Z-00000001"})
    (marker,) = (tmp_path / "logs/running").iterdir()
    marker.write_bytes(marker.read_bytes()[:-9])
    assert history.close_killed(tmp_path) == ["20260101T000000Z-00000001"]
    assert [run["status"] for run in history.runs_of(tmp_path)] == ["damaged"]
