"""Executor of Snakemake for this computer: each job is a fork of one process, which has imported what jobs import.

Shell commands, groups, jobs with a software environment, and all jobs on computers without a safe ``fork`` have the
local executor of Snakemake.
"""

from __future__ import annotations

import os
import pickle
import platform
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Pipe
from pathlib import Path
from signal import SIGINT, Signals
from typing import Any, ClassVar

from snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo
from snakemake_interface_executor_plugins.executors.real import RealExecutor
from snakemake_interface_executor_plugins.registry import ExecutorPluginRegistry
from snakemake_interface_executor_plugins.settings import CommonSettings, ExecMode, ExecutorSettingsBase

common_settings = CommonSettings(non_local_exec=False, implies_no_shared_fs=False, job_deploy_sources=False)
#: macOS has frameworks that are not safe in a fork.
FORKS = hasattr(os, "fork") and sys.platform != "darwin"
#: Numbers of threads that numerical libraries read; a fork has none of the threads of the server.
THREADS = tuple(f"{name}_THREADS" for name in ("OMP_NUM", "OPENBLAS_NUM", "MKL_NUM", "VECLIB_MAXIMUM", "NUMEXPR_NUM"))
#: The C library uses freed memory again: clearing new memory takes the system a fourth of the time of a reduction.
MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(2**25), "MALLOC_TRIM_THRESHOLD_": str(2**28)}


@dataclass
class ExecutorSettings(ExecutorSettingsBase):  # type: ignore[misc]
    """No settings: Snakemake makes this object if the executor is chosen, before it reads the workflow."""

    is_chosen: ClassVar[bool] = False
    #: The server and the end of its pipe; it may be started beside the reading of the workflow.
    server: ClassVar[Any] = None

    def __post_init__(self) -> None:
        """Note the choice."""
        type(self).is_chosen = FORKS


def expect_jobs() -> None:
    """Start the server, which imports while Snakemake plans the jobs, if this executor will run them."""
    if ExecutorSettings.is_chosen and ExecutorSettings.server is None:
        pipe, its_end = Pipe()
        command = [sys.executable, "-P", "-m", f"{__name__}.server", str(its_end.fileno())]
        environment = {**MEMORY, **os.environ, **dict.fromkeys(THREADS, "1")}
        server = subprocess.Popen(command, pass_fds=[its_end.fileno()], env=environment)
        its_end.close()
        ExecutorSettings.server = server, pipe


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
        self._listener: threading.Thread | None = None

    def run_job(self, job: Any) -> None:
        """Run a job in a fork of the server, or as Snakemake does."""
        is_plain = not job.is_group() and not self.workflow.deployment_settings.deployment_method
        if self._listener is None and FORKS:
            expect_jobs()
            self._listener = threading.Thread(target=self._listen, daemon=True)
            self._listener.start()
        if not (is_plain and _has_task(job) and self._listener and self._listener.is_alive()):  # it may be killed
            self._local.run_job(job)
            return
        from nearharmonic_paper.tasks.job import LEADER, frozen

        ours, info = frozen(job), SubmittedJobInfo(job=job)
        self.report_job_submission(info)
        self._running[job.jobid] = info
        leader = f"{platform.node()}:{ExecutorSettings.server[0].pid}"  # which ends with Snakemake, and jobs with it
        environment = {**os.environ, LEADER: leader, **dict.fromkeys(THREADS, str(ours.threads))}
        self._ask((job.jobid, ours.modules, str(Path.cwd()), environment, pickle.dumps(ours)))

    def _ask(self, request: Any) -> None:
        with suppress(OSError):  # the listener is told that the server has ended
            ExecutorSettings.server[1].send(request)

    def _listen(self) -> None:
        """Report the ends of jobs until the server ends; jobs that run then have failed."""
        with suppress(EOFError, OSError):
            while True:
                jobid, status = ExecutorSettings.server[1].recv()
                info = self._running.pop(jobid)
                if status == 0:
                    self.report_job_success(info)
                else:
                    msg = None if status > 0 else f"the job was ended by {Signals(-status).name}"
                    self.report_job_error(info, msg=msg)
        for info in self._running.values():
            self.report_job_error(info, msg="the process that starts jobs was ended")

    def shutdown(self) -> None:
        """End the server after its jobs."""
        self._local.shutdown()
        if self._listener is not None:
            self._ask(None)
            ExecutorSettings.server[0].wait()
        cancel_timers()

    def cancel(self) -> None:
        """End the jobs that run, and the server."""
        if self._listener is not None:
            self._ask(SIGINT)
        self.shutdown()

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
    """Return True for a job of package functions, unless it updates a page, which Snakemake keeps for its failure."""
    is_page = any("docs" in Path(file).parts for file in job.output)
    return not is_page and any(name in {"task", "tasks", "documents"} for name, _ in job.params.items())
