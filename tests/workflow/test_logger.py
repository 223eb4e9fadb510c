"""What a run prints on a terminal and in a pipe: records of Snakemake, made by hand, and runs of the tiny config."""

import io
import json
import logging
import os
import pty
import re
import subprocess
import sys
import termios
from contextlib import redirect_stderr
from types import SimpleNamespace

import pytest

from snakemake_logger_plugin_nearharmonic import LogHandler, Progress, evaluations_beside
from support.projects.workflow_project import TINY

#: Settings of Snakemake without options.
PLAIN = {"dryrun": False, "verbose": False, "debug_dag": False, "nocolor": False}


def record(event=None, level=logging.INFO, text=None, created=0.0, **fields):
    """A record of Snakemake."""
    return logging.makeLogRecord({"event": event, "levelno": level, "msg": text, "created": created, **fields})


def start(number, rule, reads=(), writes=("file",), at=0.0, **wildcards):
    fields = {"jobid": number, "rule_name": rule, "input": list(reads), "output": list(writes), "log": []}
    return record("job_info", created=at, wildcards=wildcards, **fields)


def finish(number, at=0.0):
    return record("job_finished", job_id=number, created=at)


def told(*records):
    """The lines of finished groups, by the record that ends them."""
    progress = Progress()
    return [[str(group) for group in progress.follow(one)] for one in records]


def test_job_without_other_wildcards_is_a_finished_group():
    reduced = start(1, "reduce", system="kepler", at=10.0)
    assert told(reduced, finish(1, at=11.25)) == [[], ["reduce kepler 1.2 s"]]
    assert told(start(2, "page"), finish(2, at=3.0)) == [[], ["page 3.0 s"]]


def test_group_of_several_jobs_ends_when_all_its_files_are_read():
    runs = [start(n, "integrate", writes=[f"{n}.h5"], system="sho", integrator=str(n)) for n in (1, 2)]
    first, second = (start(n, "reduce_method", reads=[f"{n - 2}.h5"], system="sho", integrator=str(n)) for n in (3, 4))
    lines = told(*runs, finish(1, at=1.0), finish(2, at=2.5), first, second)
    assert lines == [[], [], [], [], [], ["integrate sho 2/2 3.5 s"]]


def test_group_with_a_running_job_is_not_finished():
    runs = [start(n, "integrate", writes=[f"{n}.h5"], system="sho", integrator=str(n)) for n in (1, 2)]
    early = start(3, "reduce_method", reads=["1.h5"], system="sho", integrator="1")
    assert told(*runs, finish(1), early) == [[], [], [], []]


def test_files_that_nothing_reads_end_their_group_with_the_run():
    runs = [start(n, "integrate", writes=[f"{n}.h5"], system="sho", integrator=str(n)) for n in (1, 2)]
    steps = [record("progress", done=done, total=2) for done in (1, 2)]
    lines = told(*runs, finish(1, at=1.0), steps[0], finish(2, at=1.0), steps[1])
    assert lines == [[], [], [], [], [], ["integrate sho 2/2 2.0 s"]]


def test_target_without_files_is_no_group():
    assert told(start(0, "all", writes=()), finish(0)) == [[], []]


def test_records_without_fields_are_followed():
    assert told(record("job_info"), record("job_finished"), record("progress"), record("error"), record()) == [[]] * 5


def test_evaluations_are_those_of_the_receipt(tmp_path):
    log = tmp_path / "integrate.log"
    assert evaluations_beside(str(log)) == 0
    receipt = log.with_suffix(".json")
    receipt.write_text(json.dumps({"files": {"a": {"evaluations": 3}, "b": {"evaluations": 4}}, "seal": ""}))
    assert evaluations_beside(str(log)) == 7
    for damaged in ("", "[]", '{"files": 1}', '{"files": {"a": {}}}'):
        receipt.write_text(damaged)
        assert evaluations_beside(str(log)) == 0


def printed(*records, about=None, **options):
    """Output of a handler that Snakemake would make, with a filter such as the one of ``--quiet``."""
    with redirect_stderr(io.StringIO()) as stream:
        handler = LogHandler(SimpleNamespace(**PLAIN | options), None)
        handler.addFilter(about or (lambda one: True))
        for one in records:
            handler.handle(one)
        handler.close()
    return stream.getvalue()


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (record(text="Nothing to be done"), "Nothing to be done\n"),
        (record(text="Building DAG of jobs..."), ""),
        (record(text="Select jobs to execute..."), ""),
        (record(text="Complete log(s): a.log"), ""),
        (record(), ""),
        (record("run_info", text="Job stats: ..."), ""),
        (record("job_finished", text="Finished jobid: 3 (Rule: page)", job_id=3), ""),
        (record(text="Select jobs, all of them", level=logging.WARNING), "Select jobs, all of them\n"),
        (record("job_error", text="Error in rule page", level=logging.ERROR), "Error in rule page\n"),
        (record("shellcmd", text="echo 1"), "echo 1\n"),
    ],
)
def test_what_says_nothing_of_this_run_is_not_printed(given, expected):
    assert printed(given) == expected


def test_log_file_is_named_after_an_error():
    given = record("error", text="WorkflowError", level=logging.ERROR), record(text="Complete log(s): a.log")
    assert printed(*given) == "WorkflowError\nComplete log(s): a.log\n"


def test_lines_of_groups_keep_silent_with_quiet_progress():
    given = start(1, "page"), finish(1, at=1.0)
    assert printed(*given).endswith("page 1.0 s\n")
    assert printed(*given, about=lambda one: one.event not in {"progress", "job_info"}) == ""


@pytest.mark.parametrize("option", ["dryrun", "verbose", "debug_dag"])
def test_handler_of_snakemake_prints_where_its_whole_account_is_asked_for(option):
    assert LogHandler(SimpleNamespace(**PLAIN), None).writes_to_stream
    assert not LogHandler(SimpleNamespace(**PLAIN | {option: True}), None).writes_to_stream
    assert printed(start(1, "page"), finish(1), record(text="end"), **{option: True}) == ""


class Screen:
    """A terminal that knows the control sequences of the logger, by its own rules: lines, and the cursor."""

    def __init__(self):
        self.lines, self.row, self.column = [""], 0, 0

    def feed(self, text):
        for sign in re.findall(r"\033\[\d*[A-Za-z]|[^\033]", text):
            if sign == "\033[J":
                del self.lines[self.row + 1 :]
                self.lines[self.row] = self.lines[self.row][: self.column]
            elif sign == "\033[A":
                self.row -= 1
            elif sign == "\r":
                self.column = 0
            elif sign == "\n":
                self.row += 1
                self.lines += [""] * (self.row == len(self.lines))
            elif not sign.startswith("\033"):
                line = self.lines[self.row].ljust(self.column)
                self.lines[self.row] = line[: self.column] + sign + line[self.column + 1 :]
                self.column += 1


def on_terminal(command, folder, environment):
    """What a command leaves on a terminal of 100 columns, all that it writes, and its exit status."""
    leader, follower = pty.openpty()
    termios.tcsetwinsize(follower, (50, 100))
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdin=follower, stdout=follower, stderr=follower
    ) as run:
        os.close(follower)
        written = b""
        try:
            while more := os.read(leader, 65536):
                written += more
        except OSError:  # the end of the terminal
            pass
        os.close(leader)
    screen = Screen()
    screen.feed(written.decode())
    return [line.rstrip() for line in screen.lines], written.decode(), run.returncode


#: A handler with a bar, and a job that prints an error by itself.
PROGRAM = """
import os, sys, time, logging
from types import SimpleNamespace
from snakemake_logger_plugin_nearharmonic import LogHandler

handler = LogHandler(SimpleNamespace(dryrun=False, verbose=False, debug_dag=False, nocolor=True), None)
def tell(event=None, text=None, level=20, **fields):
    handler.handle(logging.makeLogRecord({"event": event, "msg": text, "levelno": level, "created": 0.0, **fields}))
tell("job_info", jobid=1, rule_name="page", output=["a"], wildcards={})
tell("job_info", jobid=2, rule_name="reduce", output=["b"], wildcards={"system": "sho"})
tell("job_finished", job_id=1)
tell("progress", done=1, total=2)
os.write(2, b"a job fails (traceback in a.log)\\n")
time.sleep(1.5)
tell(text="and a warning", level=30)
handler.close()
"""


def test_bar_hides_no_line_and_leaves_nothing_behind(tmp_path):
    lines, written, status = on_terminal([sys.executable, "-c", PROGRAM], tmp_path, os.environ)
    assert status == 0, written
    assert lines == ["page 0.0 s", "a job fails (traceback in a.log)", "and a warning", ""]
    _, _, meanwhile = written.partition("a job fails")
    bars = re.findall(r"\S* +1/2 jobs, \S+, \S+ left", meanwhile.partition("and a warning")[0])
    assert len(bars) > 1  # one before the warning, and one each second
    assert max(map(len, re.split("[\r\n]", re.sub(r"\033\[\w", "", written)))) < 100


@pytest.mark.slow
def test_run_prints_lines_of_groups_and_its_sum(project):
    done = project.snakemake("fig3", "-j2", *TINY)
    assert done.returncode == 0, done.stdout
    profile, *groups, figures, time_ = done.stdout.splitlines()
    assert "profile" in profile
    seconds = r" \d+\.\d s"
    kinds = ("compile henon_heiles", r"integrate henon_heiles 4/4", "reduce henon_heiles", "draw_henon_heiles")
    assert [bool(re.fullmatch(kind + seconds, line)) for kind, line in zip(kinds, groups, strict=True)] == [True] * 4
    assert re.fullmatch(r"Figures: \d+ in results/tiny/figures", figures)
    assert re.fullmatch(rf"Time:{seconds},{seconds} of CPU, 7 jobs, \S+ force evaluations in all", time_)
