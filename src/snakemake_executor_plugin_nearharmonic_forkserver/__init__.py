"""Executor of Snakemake for this computer: each job is a fork of one process, which has imported what jobs import.

A job of half a second spends most of it on the start of Python and on imports; a fork takes a few milliseconds. Other
jobs (shell commands, groups, those with a software environment) and computers without a safe ``fork`` have Snakemake's
own local executor.
"""

from __future__ import annotations

import os
import pickle
import platform
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any, ClassVar

from snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo
from snakemake_interface_executor_plugins.executors.real import RealExecutor
from snakemake_interface_executor_plugins.registry import ExecutorPluginRegistry
from snakemake_interface_executor_plugins.settings import CommonSettings, ExecMode, ExecutorSettingsBase

#: Names by which Snakemake finds what a plugin has.
common_settings = CommonSettings(
    non_local_exec=False,
    implies_no_shared_fs=False,
    job_deploy_sources=False,
    auto_deploy_default_storage_provider=False,
)
#: macOS has frameworks that are not safe in a fork.
FORKS = hasattr(os, "fork") and sys.platform != "darwin"
#: Numbers of threads that numerical libraries read; a fork has none of the threads of the server.
THREADS = tuple(f"{name}_THREADS" for name in ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "VECLIB_MAXIMUM", "NUMEXPR_NUM"))
#: Settings of the C library by which freed memory is used again: the system clears each page of new memory, which takes
#: a fourth of the time of a reduction.
MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(2**25), "MALLOC_TRIM_THRESHOLD_": str(2**28)}


class Server:
    """The process that forks, and this end of its pipe."""

    def __init__(self) -> None:
        self.pipe, its_end = Pipe()
        command = [sys.executable, "-P", "-m", f"{__name__}.server", str(its_end.fileno())]
        environment = {**MEMORY, **os.environ, **dict.fromkeys(THREADS, "1")}
        self.process = subprocess.Popen(command, pass_fds=[its_end.fileno()], env=environment)
        its_end.close()

    def send(self, request: Any) -> None:
        """Send a request, if the server is there."""
        with suppress(OSError):  # who listens is told that it has ended
            self.pipe.send(request)

    def end(self, how: signal.Signals | None = None) -> None:
        """Wait for its end, after its jobs or after a signal to them."""
        self.send(how)
        self.process.wait()


@dataclass
class ExecutorSettings(ExecutorSettingsBase):  # type: ignore[misc]
    """No settings: Snakemake makes this object if the executor is chosen, before it reads the workflow."""

    #: A server that is started beside the reading of the workflow.
    early: ClassVar[list[Server]] = []
    is_chosen: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Note the choice."""
        type(self).is_chosen = FORKS


def expect_jobs() -> None:
    """Start the server, which imports while Snakemake plans the jobs, if this executor will run them."""
    if ExecutorSettings.is_chosen:
        ExecutorSettings.early.append(Server())


def cancel_timers() -> None:
    """Cancel the timers of Snakemake's limit of jobs per time, which would hold the end of its process."""
    for thread in threading.enumerate():
        if isinstance(thread, threading.Timer):
            thread.cancel()


class Executor(RealExecutor):  # type: ignore[misc]
    """Local executor whose jobs are forks of a server, in the module ``server`` beside this one."""

    def __post_init__(self) -> None:
        """Make the executor of other jobs; the server starts with the first job."""
        self._local = ExecutorPluginRegistry().get_plugin("local").executor(self.workflow, self.logger)
        self._running: dict[int, SubmittedJobInfo] = {}
        self._server: Server | None = None

    def run_job(self, job: Any) -> None:
        """Run a job in a fork of the server, or as Snakemake does."""
        if not FORKS or job.is_group() or not _has_task(job) or self.workflow.deployment_settings.deployment_method:
            self._local.run_job(job)
            return
        if self._server is None:
            self._server = ExecutorSettings.early.pop() if ExecutorSettings.early else Server()
            self._listener = threading.Thread(target=self._listen, args=[self._server.pipe], daemon=True)
            self._listener.start()
        if not self._listener.is_alive():  # the server was killed
            self._local.run_job(job)
            return
        from nearharmonic_paper.tasks.job import LEADER, frozen

        ours, info = frozen(job), SubmittedJobInfo(job=job)
        self.report_job_submission(info)
        self._running[job.jobid] = info
        environment = {
            **os.environ,
            **dict.fromkeys(THREADS, str(ours.threads)),
            # A job ends with the server, and this with Snakemake.
            LEADER: f"{platform.node()}:{self._server.process.pid}",
        }
        systems = {name for task in ours.tasks for name in task["systems"]}
        self._server.send((job.jobid, ours.modules, systems, str(Path.cwd()), environment, pickle.dumps(ours)))

    def _listen(self, pipe: Connection) -> None:
        """Report the ends of jobs until the server ends; jobs that run then have failed."""
        with suppress(EOFError, OSError):
            while True:
                jobid, status = pipe.recv()
                info = self._running.pop(jobid)
                if status == 0:
                    self.report_job_success(info)
                elif status > 0:
                    self.report_job_error(info)
                else:
                    self.report_job_error(info, msg=f"the job was ended by {signal.Signals(-status).name}")
        for info in self._running.values():
            self.report_job_error(info, msg="the process that starts jobs was ended")

    def shutdown(self) -> None:
        """End the server after its jobs."""
        self._local.shutdown()
        if self._server is not None:
            self._server.end()
        cancel_timers()

    def cancel(self) -> None:
        """End the jobs that run, and the server."""
        if self._server is not None:
            self._server.end(signal.SIGINT)
        self._local.cancel()

    @property
    def cores(self) -> Any:
        """The number of cores that Snakemake has."""
        return self._local.cores

    def get_exec_mode(self) -> ExecMode:
        """Return the mode of Snakemake in a process that it starts for a job."""
        return ExecMode.SUBPROCESS

    def get_python_executable(self) -> str:
        """Return the path of Python."""
        return sys.executable


def _has_task(job: Any) -> bool:
    """Return True for a job of functions of the packages, which is no shell command and makes all of its files anew.

    Snakemake keeps the pages that a job updates, and gives them back if it fails.
    """
    is_page = any("docs" in Path(file).parts for file in job.output)
    return not is_page and any(name in {"task", "tasks", "documents"} for name, _ in job.params.items())
