"""The workflow killed at any moment: the next start completes it, with the same bytes and no command by hand."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from support.projects.killed_runs import MOMENTS, Kill, check_next_start, clear, files_in, kill, random_kills
from support.projects.workflow_project import TINY, Project

#: The oscillator's runs, their cube and two figures.
WORDS = ("fig1", "fig2", "-j2", "--quiet", "rules", *TINY)
#: One job of runs.
FEW = ("results/tiny/runs/sho/ruth/0.h5", "-j2", "--quiet", "rules", *TINY)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return Project(tmp_path_factory.mktemp("killed"))


def undisturbed(project, words):
    """The files that a run without a kill makes, and the seconds that it takes."""
    clear(project)
    began = time.monotonic()
    done = project.snakemake(*words)
    assert done.returncode == 0, done.stdout
    return files_in(project.results), time.monotonic() - began


def try_kills(campaign, project, words, expected, kills):
    for how in kills:
        with campaign.case(how):
            clear(project)
            kill(project, words, how)
            check_next_start(project, words, expected)


@pytest.mark.slow
def test_few_kills_are_completed_by_the_next_start(project, trials):
    expected, seconds = undisturbed(project, FEW)
    campaign = trials("C. kills")
    try_kills(campaign, project, FEW, expected, [Kill(moment=MOMENTS[0])])
    (killed,) = project.history()  # the next start had nothing to do but to complete the record
    assert (killed["status"], killed["end"]) == ("killed", None)
    assert killed["made"] == [FEW[0].removeprefix("results/tiny/")]
    try_kills(campaign, project, FEW, expected, [Kill(whole=False, seconds=0.8 * seconds)])
    assert [run["status"] for run in project.history()] in (["killed", "ok"], ["ok"], ["killed"])


@pytest.mark.long
def test_many_kills_are_completed_by_the_next_start(project, trials):
    expected, seconds = undisturbed(project, WORDS)
    try_kills(trials("C. kills"), project, WORDS, expected, random_kills(50, seconds, 2))


@pytest.mark.long
def test_kills_of_default_target_are_completed_by_next_start(project, trials):
    words = WORDS[2:]
    expected, seconds = undisturbed(project, words)
    assert "report.html" in expected
    try_kills(trials("C. kills"), project, words, expected, random_kills(10, seconds, 3))


@pytest.mark.slow
def test_second_run_in_a_folder_names_the_first(project):
    clear(project)
    command = [sys.executable, "-c", HOLDER, str(project.results)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as first:
        host = first.stdout.readline().strip()
        second = project.snakemake(*FEW)
        os.kill(first.pid, signal.SIGKILL)
    (said,) = [line for line in second.stdout.splitlines() if "in use" in line]
    assert second.returncode == 1
    assert said == (
        f"results/tiny is in use by a run of the workflow (process {first.pid} on {host}); wait for its end, or stop it"
    )


#: Holds the lock of a folder of results until its input ends.
HOLDER = """
import platform, sys
from pathlib import Path
from nearharmonic_paper.record.workflow_run import lock

lock(Path(sys.argv[1]))
print(platform.node(), flush=True)
sys.stdin.read()
"""
