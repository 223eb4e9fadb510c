"""Kills of the workflow, at any moment or at an exact one, and what has to hold after the next start."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from support.projects.workflow_project import Project

RECORD = "nearharmonic_paper.record"
#: Moments between the last job and the end of the record: the process kills itself where this function is called.
MOMENTS = (
    f"{RECORD}.manifest:write", f"{RECORD}.history:append", f"{RECORD}.history:unmark",
    f"{RECORD}.workflow_run:save",
)  # fmt: skip
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)

#: Runs Snakemake with the words after the first; a function that the first one names kills the process.
_PROGRAM = """
import importlib, os, runpy, sys
moment = sys.argv.pop(1)
if moment:
    module, name = moment.split(":")
    setattr(importlib.import_module(module), name, lambda *given, **settings: os.kill(os.getpid(), 9))
sys.argv[0] = "snakemake"
runpy.run_module("snakemake", run_name="__main__", alter_sys=True)
"""


@dataclass(frozen=True)
class Kill:
    """A signal to the whole process group or to its leader alone, after some seconds; or a moment of the record."""

    signal: int = signal.SIGKILL
    whole: bool = True
    seconds: float = 0.0
    moment: str = ""


def random_kills(number: int, seconds: float, seed: int) -> Iterator[Kill]:
    """Kills within a run that takes some seconds; each fifth is one after the last job."""
    draw = random.Random(seed)
    for i in range(number):
        if i % 5 == 4:
            yield Kill(moment=MOMENTS[i // 5 % len(MOMENTS)])
        else:
            yield Kill(draw.choice(SIGNALS), draw.random() < 0.5, seconds=draw.uniform(0.5, seconds))


def files_in(folder: Path) -> dict[str, bytes]:
    """Bytes of all results, without the history and the logs, which hold times and ids."""
    names = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    kept = {str(name): path for name, path in names.items() if name.parts[0] not in {"logs", "history.jsonl"}}
    return {name: path.read_bytes() for name, path in sorted(kept.items())}


def clear(project: Project) -> None:
    """Remove results and Snakemake's memory of them."""
    for folder in (project.results, project.folder / ".snakemake"):
        shutil.rmtree(folder, ignore_errors=True)


def kill(project: Project, words: Sequence[str], how: Kill) -> None:
    """Start Snakemake with these words, end it, and check that no process of it works on."""
    process = subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, how.moment, *words],
        cwd=project.folder,
        env={**os.environ, "PYTHONPATH": str(project.folder / "src")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.wait(None if how.moment else how.seconds)
    except subprocess.TimeoutExpired:
        (os.killpg if how.whole else os.kill)(process.pid, how.signal)
        process.wait(300)
    until = time.monotonic() + 20
    while (left := _working_in(project.folder)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not left, left


def _working_in(folder: Path) -> list[str]:
    """Command lines of the processes in a folder."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.status() != psutil.STATUS_ZOMBIE and Path(process.cwd()).is_relative_to(folder):
                found.append(" ".join(process.cmdline())[:200])
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue
    return found


def check_next_start(project: Project, words: Sequence[str], expected: dict[str, bytes]) -> None:
    """Run Snakemake with these words: it ends well, with the expected files, and all runs are recorded."""
    done = project.snakemake(*words)
    assert done.returncode == 0, done.stdout[-1500:]
    found = files_in(project.results)
    assert found.keys() == expected.keys(), found.keys() ^ expected.keys()
    assert [name for name in expected if found[name] != expected[name]] == []
    assert not list(project.results.rglob("*.part"))
    assert not list((project.results / "logs/running").glob("*"))
    assert {run["status"] for run in project.history()} <= {"ok", "killed", "failed"}
