"""Submission of frozen jobs: replaces the command with which an executor of Snakemake submits a job.

Snakemake's own command starts Snakemake twice on the node and reads the whole workflow each time. It is still used for
groups, job arrays, containers, and outputs that Snakemake prepares in a special way.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from nearharmonic_paper.tasks.job import LEADER
from nearharmonic_paper.tasks.remote.plan import Files, FrozenJob

#: Command that runs Python on the nodes, for example in a container; by default the present interpreter.
PYTHON = "NEARHARMONIC_NODE_PYTHON"
#: The process that ends the jobs of this computer with itself has no meaning on another.
_ENVIRONMENT = f"env -u {LEADER}"
#: Parameters of rules that jobs read.
PARAMS = ("task", "tasks", "captions", "transparent", "earlier")
#: Functions of the module job, by the scripts of the rules.
_FUNCTIONS = {"task.py": "run", "draw.py": "draw"}
#: Marks of outputs that need nothing on the node.
_PLAIN = {"multiext", "report", "touch"}


def submit_frozen(workflow: Any) -> None:
    """Let the executor of ``workflow`` submit frozen jobs, if it is one for other computers.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        The workflow, when its executor exists.
    """
    if workflow.local_exec:
        return
    executor = workflow.scheduler.get_executor(SimpleNamespace(is_local=False))
    if hasattr(executor.executor_settings, "status_command") and not _has_accounting():
        executor.executor_settings.status_command = "squeue"
    executor.format_job_exec = partial(_command, executor, executor.format_job_exec)


def _command(executor: Any, usual: Callable[[Any], str], job: Any) -> str:
    """Return the shell command of a job on a node."""
    arrays = re.split(r"[,;\s]+", getattr(executor.executor_settings, "array_jobs", None) or "")
    if not is_plain(job) or {"all", job.rule.name}.intersection(arrays):
        return f"{_ENVIRONMENT} {usual(job)}"
    place = frozen(job, executor.workflow.execution_settings.latency_wait).write(executor.tmpdir)
    python = os.environ.get(PYTHON) or shlex.quote(sys.executable)
    return f"{_ENVIRONMENT} {python} -m {__package__} {shlex.quote(str(place))}"


def is_plain(job: Any) -> bool:
    """Return True if a job of Snakemake can be frozen."""
    if job.is_group() or Path(job.rule.script or "").name not in _FUNCTIONS:
        return False
    special = job.benchmark or job.conda_env_spec or job.container_img_url or job.env_modules or job.is_shadow
    return not special and all(_PLAIN.issuperset(file.flags) for file in job.output)


def frozen(job: Any, patience: float) -> FrozenJob:
    """Return the frozen form of a job of Snakemake."""
    return FrozenJob(
        function=_FUNCTIONS[Path(job.rule.script).name],
        input=_files(job.input),
        output=_files(job.output),
        params=SimpleNamespace(**{name: value for name, value in job.params.items() if name in PARAMS}),
        log=[str(file) for file in job.log],
        threads=int(job.threads),
        patience=float(patience),
    )


def _files(files: Any) -> Files:
    named = {name: str(one) if isinstance(one, str) else [*map(str, one)] for name, one in files.items()}
    return Files(map(str, files), named)


def _has_accounting() -> bool:
    """Return True if SLURM has an accounting database, which ``sacct`` asks."""
    try:
        return subprocess.run(["sacct", "-n", "-X"], capture_output=True, timeout=60, check=False).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False
