"""Guard around a run of the workflow: one run at a time, which first repairs what a killed run or damage has left.

It is entered by every run, also by one with nothing to do, of which Snakemake tells no other hook.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from typing import Any

from nearharmonic.errors import RefusedError
from nearharmonic_paper.record.running.lock import locked
from nearharmonic_paper.record.running.state import files_to_remake
from nearharmonic_paper.record.running.workflow_run import WorkflowRun

Makeable = Callable[[], Collection[str]]


def guard(workflow: Any, folder: Path, run: WorkflowRun, makeable: Makeable, complete: Callable[[], None]) -> None:
    """Let ``workflow`` execute under the lock of ``folder`` alone, and make damaged files again.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        The workflow, as its Snakefile is read.
    folder : Path
        Folder of results.
    run : WorkflowRun
        Record of the run.
    makeable : callable
        Function that returns the names of all files that jobs of the present config make.
    complete : callable
        Function that completes the record of earlier runs.
    """
    execute = workflow.execute

    @wraps(execute)
    def guarded(executor_plugin: Any, **settings: Any) -> Any:
        kind = executor_plugin.common_settings
        if not kind.touch_exec:
            _force_damaged(workflow, folder, run, makeable)
        if kind.dryrun_exec:
            return execute(executor_plugin=executor_plugin, **settings)
        workflow.dag_settings.force_incomplete = True  # a killed job runs again
        recorded = not (kind.touch_exec or workflow.execution_settings.no_hooks)
        workflow.execution_settings.lock = False  # Snakemake's lock outlives a killed process
        with ExitStack() as held:
            try:
                held.enter_context(locked(folder))
            except RefusedError as error:
                from snakemake.exceptions import WorkflowError

                raise WorkflowError(str(error)) from None
            if recorded:
                run.recover()
            result = execute(executor_plugin=executor_plugin, **settings)
            if recorded and not run.id:
                complete()
            return result

    if workflow.is_main_process:
        workflow.execute = guarded


def _force_damaged(workflow: Any, folder: Path, run: WorkflowRun, makeable: Makeable) -> None:
    """Mark damaged files for their jobs when the graph of the jobs is prepared; files of other targets are left."""
    prepare = workflow._prepare_dag

    @wraps(prepare)
    def prepared(*arguments: Any, **settings: Any) -> None:
        prepare(*arguments, **settings)
        if run.differing != set():
            damaged = files_to_remake(folder, makeable(), run.differing)
            workflow.dag.forcefiles.update(f"{folder}/{name}" for name in damaged)

    workflow._prepare_dag = prepared
