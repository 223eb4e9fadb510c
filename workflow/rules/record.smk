"""The record of this run: history.jsonl and manifest.json. They are no outputs of rules, since any target adds to them."""

import os
import sys

from nearharmonic.record.adopt import ADOPTING, check_jobs
from nearharmonic.record.workflow_run import WorkflowRun

THIS_RUN = WorkflowRun(RESULTS, CONFIG, sources=workflow.basedir)


def record_start():
    """Leave a marker, and hand the id of the run to its jobs."""
    if workflow.touch and ADOPTING in os.environ:
        check_jobs(Path(RESULTS), workflow.dag.jobs)
    if not workflow.touch:
        THIS_RUN.begin(sys.argv, sorted(workflow.dag_settings.targets) or ["all"], workflow.cores)


def record_end(exit_status):
    """Bring the page up to date, then write the manifest and the line of the history."""
    if not workflow.touch:
        working = {job for job in workflow.dag.jobs if not job.is_norun}
        needed = set(workflow.dag.needrun_jobs(exclude_finished=False))
        ended = working & needed & set(workflow.dag.finished_jobs)
        THIS_RUN.end(exit_status, len(ended), len(working - needed), refresh)


def refresh():
    """Make claims and page again if this run made results that they do not know yet."""
