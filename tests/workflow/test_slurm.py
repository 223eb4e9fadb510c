"""The workflow on SLURM: files as on this computer, whatever happens to jobs and to the node."""

import shutil
import subprocess
import sys
import tempfile
import textwrap
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from support.projects.slurm_node import SlurmNode, missing
from support.projects.workflow_project import Project

pytestmark = [pytest.mark.slurm, pytest.mark.skipif(bool(missing()), reason=missing())]

SMOKE = ("--configfile", "config/smoke.yaml")
SLURM = ("--workflow-profile", "profiles/slurm", "--nearharmonic-init-seconds-before-status-checks", "2")
CUBE = "results/smoke/cubes/sho.h5"
FOLDERS = ("runs", "cubes", "figures", "tables")


@pytest.fixture(scope="module")
def node():
    # The path of a socket has at most 107 characters.
    with tempfile.TemporaryDirectory(prefix="slurm.", dir="/tmp") as folder:
        started = SlurmNode(Path(folder))
        yield started
        started.stop()


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """The project after the smoke run on this computer."""
    project = Project(tmp_path_factory.mktemp("local"))
    done = project.python("-m", "snakemake", "-j2", *SMOKE)
    assert done.returncode == 0, done.stderr
    return project


@pytest.fixture
def cluster(local, node, tmp_path, monkeypatch):
    """Copy of the project without results, whose Snakemake finds the node."""
    monkeypatch.setenv("SLURM_CONF", str(node.configuration))
    project = local.copy(tmp_path / "project")
    for name in ("results", ".snakemake"):
        shutil.rmtree(project.folder / name)
    return project


def submitted(project, *targets):
    """Run the jobs of ``targets`` on the node, and return what Snakemake prints."""
    done = project.python("-m", "snakemake", *SLURM, *SMOKE, "--", *targets)
    assert done.returncode == 0, done.stderr
    return done.stderr


def python_of_nodes(folder, monkeypatch, text):
    """Let jobs start by a shell script that runs ``text`` first."""
    script = folder / "python"
    script.write_text(f'#!/bin/sh\n{textwrap.dedent(text)}\nexec {sys.executable} "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("NEARHARMONIC_NODE_PYTHON", str(script))


def files_of(project, *folders):
    """The bytes of all files in folders of the results."""
    results = project.folder / "results/smoke"
    found = [path for folder in folders for path in (results / folder).rglob("*") if path.is_file()]
    return {str(path.relative_to(results)): path.read_bytes() for path in found}


def test_all_files_are_those_of_a_local_run(cluster, local):
    printed = submitted(cluster)
    assert "has been submitted with SLURM jobid" in printed
    found, expected = files_of(cluster, *FOLDERS), files_of(local, *FOLDERS)
    assert found.keys() == expected.keys()
    assert [name for name in found if found[name] != expected[name]] == []
    # Nothing is left to do, here or there.
    done = cluster.python("-m", "snakemake", "-n", *SMOKE)
    assert "Nothing to be done" in done.stdout + done.stderr


def test_a_killed_job_starts_again(cluster, local, node, tmp_path, monkeypatch):
    first = tmp_path / "first"
    python_of_nodes(tmp_path, monkeypatch, f"mkdir {first} 2> /dev/null && sleep 600")
    with ThreadPoolExecutor() as pool:
        running = pool.submit(submitted, cluster, CUBE)
        node.wait_until(first.exists)
        [job] = node.jobs("RUNNING")
        node.client("scancel", "--full", "--signal=KILL", job)
        assert "Trying to restart job" in running.result()
    assert (cluster.folder / CUBE).read_bytes() == (local.folder / CUBE).read_bytes()


def test_a_job_over_its_memory_gets_more(cluster, local, tmp_path, monkeypatch):
    greedy = "import time; held = bytearray(b'1') * 1_500_000_000; time.sleep(60)"
    python_of_nodes(
        tmp_path,
        monkeypatch,
        f"""
        echo $SLURM_MEM_PER_NODE >> {tmp_path}/memory
        if [ $SLURM_MEM_PER_NODE -lt 1500 ] && mkdir {tmp_path}/greedy 2> /dev/null
        then exec {sys.executable} -c "{greedy}"
        fi
        """,
    )
    assert "Trying to restart job" in submitted(cluster, CUBE)
    before, after, *_ = map(int, (tmp_path / "memory").read_text().split())
    assert after == 2 * before
    assert (cluster.folder / CUBE).read_bytes() == (local.folder / CUBE).read_bytes()


def test_jobs_wait_for_a_drained_node(cluster, local, node):
    node.client("scontrol", "update", "NodeName=localhost", "State=DRAIN", "Reason=test")
    with ThreadPoolExecutor() as pool:
        running = pool.submit(submitted, cluster, CUBE)
        try:
            node.wait_until(lambda: node.jobs("PENDING"))
        finally:
            node.client("scontrol", "update", "NodeName=localhost", "State=RESUME")
        running.result()
    assert (cluster.folder / CUBE).read_bytes() == (local.folder / CUBE).read_bytes()


def test_an_interrupted_run_cancels_its_jobs_and_resumes(cluster, local, node, tmp_path, monkeypatch):
    python_of_nodes(tmp_path, monkeypatch, f"mkdir {tmp_path}/first 2> /dev/null && sleep 600")
    command = [sys.executable, "-m", "snakemake", *SLURM, *SMOKE, "--", CUBE]
    environment = {**node.environment, "PYTHONPATH": str(cluster.folder / "src")}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(command, cwd=cluster.folder, env=environment, **quiet) as leader:
        node.wait_until((tmp_path / "first").exists)
        leader.send_signal(2)
        assert leader.wait(60) != 0
    node.wait_until(lambda: not node.jobs("PENDING", "RUNNING", "COMPLETING"))
    submitted(cluster, CUBE)
    assert (cluster.folder / CUBE).read_bytes() == (local.folder / CUBE).read_bytes()
