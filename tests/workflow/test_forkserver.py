"""Local jobs as forks of one process: what they have, how they fail, and that none is left."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

#: Functions of jobs, in a module of their own as in the packages.
FUNCTIONS = """
import os, signal, sys, time
from pathlib import Path
from nearharmonic.errors import NearharmonicError

def told():
    return {"text": f"{os.getpid()} {os.getppid()} {'xarray' in sys.modules} {os.environ['OMP_NUM_THREADS']}"}

def refused():
    raise NearharmonicError("tau = 0 is not positive")

def killed():
    os.kill(os.getpid(), signal.SIGKILL)

def orphaned():
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(60)

def waiting():
    Path("waits").touch()
    time.sleep(60)
"""
SNAKEFILE = """
def task(name):
    task = dict.fromkeys(("code", "coefficients"), "") | dict.fromkeys(("modules", "systems", "integrators"), ())
    return task | {"function": f"functions:{name}", "settings": {}, "definitions": {}}

rule job:
    output: text="results/x/{name}.{number}"
    log: "results/x/logs/{name}.{number}.log"
    threads: lambda wildcards: int(wildcards.number)
    params: task=lambda wildcards: task(wildcards.name)
    script: "task.py"

rule command:
    output: "results/x/command"
    shell: "echo $PPID > {output}"
"""


class Workflow:
    """A workflow with jobs of each kind in ``folder``."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "functions.py").write_text(FUNCTIONS)
        (folder / "Snakefile").write_text(SNAKEFILE)
        (folder / "task.py").write_text("from nearharmonic_paper.tasks.job import run\nrun(snakemake)\n")

    def start(self, *targets):
        names = [f"results/x/{name}" for name in targets]
        command = [sys.executable, "-m", "snakemake", "-j2", "-k", "--executor", "nearharmonic-forkserver", *names]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(self.folder), *sys.path])}
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "start_new_session": True}
        return subprocess.Popen(command, cwd=self.folder, env=environment, **streams)

    def run(self, *targets):
        with self.start(*targets) as process:
            printed, _ = process.communicate(timeout=120)
        return process.returncode, printed

    def text(self, name):
        return Path(self.folder, "results/x", name).read_text(encoding="utf-8")

    def processes(self):
        """Those that work in the folder."""
        found = []
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                if process.cwd() == str(self.folder):
                    found.append(process)
        return found


@pytest.fixture
def workflow(tmp_path):
    return Workflow(tmp_path)


def waits_for(condition):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_jobs_are_forks_of_one_process_that_has_imported_what_they_need(workflow):
    status, printed = workflow.run("told.1", "told.2", "command")
    assert status == 0, printed
    (first, server, _, _), (second, other, _, threads) = (workflow.text(f"told.{n}").split() for n in (1, 2))
    assert first != second
    assert server == other
    assert workflow.text("told.1").split()[3] == "1"
    assert threads == "2"
    assert workflow.text("command").strip() != server
    assert not workflow.processes()


def test_a_failed_job_says_one_sentence_and_others_go_on(workflow):
    status, printed = workflow.run("refused.1", "told.1", "command")
    assert status == 1
    assert len(re.findall(r"^tau = 0 is not positive$", printed, re.MULTILINE)) == 1
    assert "results/x/logs/refused.1.log" in printed
    assert "Traceback" not in printed
    assert workflow.text("logs/refused.1.log") == "tau = 0 is not positive\n"
    assert (workflow.folder / "results/x/told.1").exists()
    assert (workflow.folder / "results/x/command").exists()


def test_a_killed_job_is_named_with_its_signal(workflow):
    status, printed = workflow.run("killed.1", "told.1")
    assert status == 1
    assert "the job was ended by SIGKILL" in printed
    assert (workflow.folder / "results/x/told.1").exists()


def test_jobs_of_a_killed_server_have_failed_and_later_ones_run(workflow):
    status, printed = workflow.run("orphaned.1", "told.2")
    assert status == 1
    assert "the process that starts jobs was ended" in printed
    assert (workflow.folder / "results/x/told.2").exists()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL], ids=["ctrl-c", "kill -9"])
def test_no_process_is_left_after(workflow, how):
    process = workflow.start("waiting.1", "told.1")
    waits_for((workflow.folder / "waits").exists)
    if how == signal.SIGINT:
        os.killpg(process.pid, how)
    else:
        process.kill()
    printed, _ = process.communicate(timeout=60)
    assert process.returncode != 0
    assert "Traceback" not in printed
    waits_for(lambda: not workflow.processes())
    assert not (workflow.folder / "results/x/waiting.1").exists()
