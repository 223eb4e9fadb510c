"""Logger of Snakemake: a bar on a terminal, a line for each finished group of jobs, and each warning and error.

Snakemake's own handler prints where its whole account is asked for: in dry runs, with ``--verbose`` and
``--debug-dag``. Its log file has the whole account of every run. Snakemake finds a plugin by the name of its package.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Any, TextIO

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

#: Events that the bar and the lines of groups replace.
REPLACED = (
    LogEvent.RUN_INFO, LogEvent.RESOURCES_INFO, LogEvent.JOB_STARTED, LogEvent.JOB_FINISHED, LogEvent.PROGRESS,
)  # fmt: skip
#: Beginnings of messages of every run; if a later Snakemake words them otherwise, they are printed.
ROUTINE = ("Assuming unrestricted", "Building DAG", "Using shell", "Select jobs", "Touching output", "Elapsed time")
DIVIDING = "system"  # wildcard that divides the jobs of a rule into groups
BAR = "{bar} {n_fmt}/{total_fmt} jobs{postfix}, {elapsed}, {remaining} left"
#: Control sequences of terminals: erase all after the cursor, start of the line above, and colours of levels.
ERASE, UP, PLAIN = "\033[J", "\033[A\r", "\033[0m"
COLOURS = {logging.WARNING: "\033[33m", logging.ERROR: "\033[31m", logging.CRITICAL: "\033[31m"}


@dataclass
class Group:
    """Jobs of one rule, on one system if the rule has this wildcard; ``unread`` are files for later jobs."""

    label: str
    is_single: bool
    seconds: float = 0.0
    jobs: set[int] = field(default_factory=set)
    running: set[int] = field(default_factory=set)
    unread: set[str] = field(default_factory=set)

    def __str__(self) -> str:
        counted = "" if self.is_single else f" {len(self.jobs - self.running)}/{len(self.jobs)}"
        return f"{self.label}{counted} {self.seconds:.1f} s"


class Progress:
    """Progress of a run by groups of jobs.

    Snakemake does not say beforehand how many jobs a group has: it is finished as soon as later jobs have read all of
    its files. A job without other wildcards than the system is a group of its own.
    """

    def __init__(self) -> None:
        self._done = self._total = self._evaluations = 0
        self._began = time.time()
        self._jobs: dict[int, tuple[Group, logging.LogRecord]] = {}
        self._groups: dict[str, Group] = {}

    @property
    def is_running(self) -> bool:
        """True from the start of the first job to the end of the last one."""
        return bool(self._jobs) and not 0 < self._total == self._done

    def follow(self, record: logging.LogRecord) -> Iterator[Group]:
        """Note what a record tells of jobs; yield the groups that it finishes."""
        match getattr(record, "event", None):
            case LogEvent.JOB_INFO:
                yield from self._start(record)
            case LogEvent.JOB_FINISHED:
                yield from self._finish(record)
            case LogEvent.PROGRESS:
                self._done, self._total = getattr(record, "done", 0), getattr(record, "total", 0)
                yield from (one for one in self._groups.values() if one.unread and not self.is_running)

    def _start(self, record: logging.LogRecord) -> Iterator[Group]:
        inputs = getattr(record, "input", None) or []
        for one in self._groups.values():
            if not one.unread.isdisjoint(inputs):
                one.unread.difference_update(inputs)
                if not one.unread and not one.running:
                    yield one
        wildcards, number = getattr(record, "wildcards", {}), getattr(record, "jobid", -1)
        label = f"{getattr(record, 'rule_name', 'job')} {wildcards.get(DIVIDING, '')}".strip()
        group = self._groups.setdefault(label, Group(label, is_single={*wildcards} <= {DIVIDING}))
        self._jobs[number] = group, record
        group.jobs.add(number)
        group.running.add(number)

    def _finish(self, record: logging.LogRecord) -> Iterator[Group]:
        number = getattr(record, "job_id", -1)
        if number in self._jobs:
            group, started = self._jobs[number]
            group.running.discard(number)
            group.seconds += record.created - started.created  # of all jobs together
            self._evaluations += sum(map(evaluations_beside, getattr(started, "log", None) or []))
            output = getattr(started, "output", None) or []
            group.unread.update([] if group.is_single else output)
            if group.is_single and output:  # the job of a target makes no file
                yield group

    def bar(self, terminal: TextIO) -> str:
        """Return the bar in a line of this terminal."""
        from tqdm import tqdm  # here, so that a start without jobs does not load it

        look: dict[str, Any] = {"total": self._total or None, "bar_format": BAR, "n": self._done}
        look["ncols"] = (os.get_terminal_size(terminal.fileno()).columns or 80) - 1
        look["ascii"] = not terminal.encoding.lower().startswith("utf")
        look["postfix"] = f"{self._evaluations:.2g} force evaluations" if self._evaluations else ""
        return tqdm.format_meter(elapsed=time.time() - self._began, **look)


def evaluations_beside(log: str) -> int:
    """Return the force evaluations in the receipt beside a log; 0 if there is none."""
    try:
        files = json.loads(Path(log).with_suffix(".json").read_bytes())["files"]
        return sum(entry["evaluations"] for entry in files.values())
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return 0


class LogHandler(LogHandlerBase):
    """Handler of Snakemake's records, which come one by one from a thread of Snakemake.

    Jobs print their errors to the terminal by themselves. The cursor therefore waits on an empty line above the bar:
    such a line does not stand behind the bar, and is not erased with it.
    """

    def __post_init__(self) -> None:
        """Read the options of the run and the properties of the terminal."""
        asked = self.common_settings
        self._is_silent, self._stream = asked.dryrun or asked.verbose or asked.debug_dag, sys.stderr
        self._is_terminal = self._stream.isatty() and os.environ.get("TERM") != "dumb"
        self._colours = COLOURS if self._is_terminal and not asked.nocolor else {}
        self._progress, self._has_failed = Progress(), False
        self._writing, self._ended = Lock(), Event()
        self._clock = Thread(target=self._redraw, daemon=True)

    @property
    def writes_to_stream(self) -> bool:
        """False where Snakemake's own handler prints."""
        return not self._is_silent

    writes_to_file = has_filter = has_formatter = needs_rulegraph = False

    @cached_property
    def _shows_progress(self) -> bool:
        """True if the filter, which Snakemake makes from ``--quiet``, lets progress pass."""
        return bool(self.filter(logging.makeLogRecord({"event": LogEvent.PROGRESS})))

    def handle(self, record: logging.LogRecord) -> bool:
        """Follow every record, also records that ``--quiet`` hides."""
        if self._is_silent:
            return False
        try:
            self._has_failed |= record.levelno >= logging.ERROR
            finished = [*map(str, self._progress.follow(record))]
            self._write(*(finished if self._shows_progress else ()))
            return bool(super().handle(record))
        except Exception:
            self.handleError(record)
            return False

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record in Snakemake's words, if neither the bar nor the lines of groups replace it."""
        text, event = self.format(record), getattr(record, "event", None)
        routine = ROUTINE if self._has_failed else (*ROUTINE, "Complete log")  # Snakemake's log file explains errors
        is_routine = event in REPLACED or (record.levelno < logging.WARNING and text.startswith(routine))
        if not is_routine and text not in {"", "None"}:  # a record may have no text
            colour = self._colours.get(record.levelno, "")
            self._write(f"{colour}{text}{PLAIN}" if colour else text)

    def _write(self, *lines: str) -> None:
        """Print lines, and below them the bar if this is a terminal."""
        with self._writing:
            text = "".join([ERASE if self._is_terminal else "", *(f"{line}\n" for line in lines)])
            if self._is_terminal and self._shows_progress and self._progress.is_running and not self._ended.is_set():
                text += f"\n{self._progress.bar(self._stream)}{UP}"
                if self._clock.ident is None:
                    self._clock.start()
            self._stream.write(text)
            self._stream.flush()

    def _redraw(self) -> None:
        """Draw the bar every second, so that its times go on during a long job."""
        while not self._ended.wait(1.0):
            self._write()

    def close(self) -> None:
        """Erase the bar."""
        self._ended.set()
        if not self._is_silent:
            self._write()
        super().close()
