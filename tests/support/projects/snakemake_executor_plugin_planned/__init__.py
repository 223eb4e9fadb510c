"""Executor of Snakemake that runs nothing and keeps each job that it is asked to run: a dry run for tests."""

from __future__ import annotations

from typing import Any

from snakemake_interface_executor_plugins.executors.base import AbstractExecutor, SubmittedJobInfo
from snakemake_interface_executor_plugins.settings import CommonSettings

common_settings = CommonSettings(
    non_local_exec=False, dryrun_exec=True, implies_no_shared_fs=False, job_deploy_sources=False
)
#: The jobs, in the order in which they would run.
JOBS: list[Any] = []


class Executor(AbstractExecutor):
    """The executor ``planned``."""

    def run_job(self, job: Any) -> None:
        JOBS.append(job)
        submitted = SubmittedJobInfo(job=job)
        self.report_job_submission(submitted)
        self.report_job_success(submitted)

    def printjob(self, job: Any) -> None:
        pass

    def shutdown(self) -> None:
        pass

    def cancel(self) -> None:
        pass

    def handle_job_success(self, job: Any) -> None:
        pass

    def handle_job_error(self, job: Any) -> None:
        pass
