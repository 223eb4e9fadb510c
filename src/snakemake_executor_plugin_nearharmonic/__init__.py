"""Executor of Snakemake for SLURM: the executor of the plugin for SLURM, but it submits frozen jobs.

A frozen job reads neither the workflow nor the config on its node; Snakemake's own command reads both, twice.
"""

from __future__ import annotations

import subprocess
from typing import Any

from snakemake_interface_common.exceptions import WorkflowError
from snakemake_interface_executor_plugins.executors.remote import RemoteExecutor
from snakemake_interface_executor_plugins.settings import CommonSettings, ExecutorSettingsBase

try:
    import snakemake_executor_plugin_slurm as slurm
except ImportError:  # Snakemake imports all plugins at each start
    slurm = None

#: Names by which Snakemake finds what a plugin has, and the executor that this one extends.
common_settings: CommonSettings
if slurm is None:
    common_settings = CommonSettings(non_local_exec=True, implies_no_shared_fs=False, job_deploy_sources=False)
    ExecutorSettings, _Slurm = ExecutorSettingsBase, RemoteExecutor
else:
    common_settings, ExecutorSettings, _Slurm = slurm.common_settings, slurm.ExecutorSettings, slurm.Executor


class Executor(_Slurm):  # type: ignore[misc,valid-type]
    """Submission of frozen jobs; groups and job arrays keep Snakemake's own command."""

    def __new__(cls, *given: Any, **settings: Any) -> Any:
        """Refuse work where the plugin for SLURM is not installed."""
        if slurm is None:
            raise WorkflowError("this executor extends the plugin for SLURM: pip install 'nearharmonic[cluster]'")
        return super().__new__(cls)

    def __post_init__(self, *given: Any, **settings: Any) -> None:
        """Ask for the states of jobs where the site has them."""
        if not has_accounting():
            self.workflow.executor_settings.status_command = "squeue"
        super().__post_init__(*given, **settings)

    def format_job_exec(self, job: Any) -> str:
        """Return the shell command of a job on a node."""
        from nearharmonic_paper.tasks.job import ENVIRONMENT, command_of, is_in_array

        if job.is_group() or is_in_array(job, self.workflow.executor_settings.array_jobs):
            return f"{ENVIRONMENT} {super().format_job_exec(job)}"
        return command_of(job, self.tmpdir)


def has_accounting() -> bool:
    """Return True if SLURM has an accounting database, which ``sacct`` asks."""
    try:
        return subprocess.run(["sacct", "-n", "-X"], capture_output=True, timeout=60, check=False).returncode == 0
    except (OSError, subprocess.TimeoutExpired):
        return False
