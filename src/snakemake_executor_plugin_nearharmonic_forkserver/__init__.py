"""Executor of Snakemake for this computer: each job is a fork of one process, which has imported what jobs import.

A job of half a second spends most of it on the start of Python and on imports; a fork takes a few milliseconds. Other
jobs (shell commands, groups, those with a software environment) and computers without a safe ``fork`` have Snakemake's
own local executor.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from contextlib import suppress
from multiprocessing.connection import Pipe
from threading import Thread
from typing import Any

from snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo
from snakemake_interface_executor_plugins.executors.real import RealExecutor
from snakemake_interface_executor_plugins.registry import ExecutorPluginRegistry
from snakemake_interface_executor_plugins.settings import CommonSettings, ExecMode

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
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS")


class Executor(RealExecutor):
    """Local executor whose jobs are forks of a server, :mod:`snakemake_executor_plugin_nearharmonic_forkserver.server`."""

    def __post_init__(self) -> None:
        """Make the executor of other jobs; the server starts with the first job."""
        self._local = ExecutorPluginRegistry().get_plugin("local").executor(self.workflow, self.logger)
        self._running: dict[int, SubmittedJobInfo] = {}
        self._server: subprocess.Popen[bytes] | None = None

    def run_job(self, job: Any) -> None:
        """Run a job in a fork of the server, or as Snakemake does."""
        if not FORKS or job.is_group() or not _has_task(job) or self.workflow.deployment_settings.deployment_method:
            self._local.run_job(job)
            return
        if self._server is None:
            self._start()
        if not self._listener.is_alive():  # the server was killed
            self._local.run_job(job)
            return
        from nearharmonic_paper.tasks.job import frozen

        ours, info = frozen(job), SubmittedJobInfo(job=job)
        self.report_job_submission(info)
        self._running[job.jobid] = info
        environment = {**os.environ, **dict.fromkeys(THREADS, str(ours.threads))}
        self._send((job.jobid, ours.modules, os.getcwd(), environment, pickle.dumps(ours)))

    def _start(self) -> None:
        """Start the server, and the thread that waits for the ends of its jobs."""
        self._connection, its_end = Pipe()
        command = [sys.executable, "-P", "-m", f"{__name__}.server", str(its_end.fileno())]
        environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
        self._server = subprocess.Popen(command, pass_fds=[its_end.fileno()], env=environment)
        its_end.close()
        self._listener = Thread(target=self._listen, daemon=True)
        self._listener.start()

    def _send(self, request: Any) -> None:
        with suppress(OSError):  # the listener tells that the server has ended
            self._connection.send(request)

    def _listen(self) -> None:
        """Report the ends of jobs until the server ends; jobs that run then have failed."""
        with suppress(EOFError, OSError):
            while True:
                jobid, status = self._connection.recv()
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
            self._send(None)
            self._server.wait()

    def cancel(self) -> None:
        """End the jobs that run, and the server."""
        if self._server is not None:
            self._send(signal.SIGINT)
            self._server.wait()
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
    """Return True for a job of functions of the packages, False for a shell command."""
    return any(name in {"task", "tasks", "documents"} for name, _ in job.params.items())
