"""The record of this run: history.jsonl and manifest.json. They are no outputs: every target changes them."""

import itertools
import os
import sys
from types import SimpleNamespace

from nearharmonic_paper.experiments.paper.grid.earlier import forget, keep
from nearharmonic_paper.tasks.job import run
from nearharmonic_paper.config.targets import check_first
from nearharmonic_paper.record.adopt import ADOPTING, check_jobs
from nearharmonic_paper.record.running.guard import guard
from nearharmonic_paper.record.running.workflow_run import WorkflowRun
from nearharmonic_paper.tasks.remote.submission import submit_frozen

CLAIMS = "tables/claims.json"
THIS_RUN = WorkflowRun(RESULTS, CONFIG, sources=workflow.basedir)


def record_start():
    """Write a marker, and pass the id of the run to its jobs."""
    if workflow.touch and ADOPTING in os.environ:
        check_jobs(Path(RESULTS), workflow.dag.jobs)
    if not workflow.touch:
        keep(Path(RESULTS), (job.output.run for job in workflow.dag.needrun_jobs() if job.rule.name == "integrate"))
        THIS_RUN.begin(sys.argv, sorted(workflow.dag_settings.targets) or ["all"], ALL_CORES)
        submit_frozen(workflow)
        if workflow.local_exec:
            # It adds a thread and a round of scheduling to each round, a quarter of the time of this process.
            workflow.scheduler.job_rate_limiter = None


def record_end(exit_status):
    """Update the page, then write the manifest and the line of the history."""
    if not workflow.touch:
        working = {job for job in workflow.dag.jobs if not job.is_norun}
        needed = set(workflow.dag.needrun_jobs(exclude_finished=False))
        ended = working & needed & set(workflow.dag.finished_jobs)
        counts = {"jobs_run": len(ended), "jobs_reused": len(working - needed)}
        if not exit_status:
            forget(Path(RESULTS))
        THIS_RUN.end(exit_status, **counts, refresh=refresh, makeable=makeable(), configfiles=configfiles())


def complete_record():
    """Complete the record of a run that was killed, and that left no job to run."""
    if THIS_RUN.is_incomplete:
        forget(Path(RESULTS))
        THIS_RUN.complete(refresh, makeable(), configfiles())
        THIS_RUN.save_state(makeable())


def makeable():
    """Return the names of all files that jobs of this config make, in the folder of results."""
    return {path.removeprefix(f"{RESULTS}/") for path in makeable_files()}


def makeable_files():
    """Return the paths of these files."""
    targets = [getattr(rules, one.target).input for one in EXPERIMENTS.values()]
    asked_by_name = rules.claims.input, map(CUBE, PAPER.cubes)
    return {str(path) for path in (*itertools.chain.from_iterable((*targets, *asked_by_name)), *RUNS)}


def leftovers():
    """Return the names of the cubes, figures, tables and pages in the folder of results that no job of this config makes."""
    shown = ("cubes/*", "figures/*", "tables/*", "*.html")
    there = (path.relative_to(RESULTS).as_posix() for pattern in shown for path in Path(RESULTS).glob(pattern))
    return sorted({*there} - makeable())


def configfiles():
    """Return the paths of the config."""
    return [os.path.relpath(path) for path in workflow.configfiles]


def refresh():
    """Make claims and page again if this run made newer results, of other targets."""
    from nearharmonic_paper.claims.own import own_claims
    from nearharmonic_paper.claims.table import FILES

    shown = {*FILES, *(name for one in own_claims() for name in (*one.needs, *one.also))}
    if THIS_RUN.outdates(CLAIMS, shown=shown):
        again(rules.decide_claims, LOG("tables/claims"))
    if THIS_RUN.outdates("report.html"):
        again(rules.page, LOG("report"))


def again(rule, log):
    """Run the job of a rule in this process."""
    described = rule.params.task
    params = SimpleNamespace(task=described(None))
    run(SimpleNamespace(input=rule.input, output=rule.output, params=params, log=[log], threads=1))


def verdicts(document):
    """Return a line on the verdicts of this run, and the command that decides the open statements."""
    from nearharmonic_paper.claims.pages.summary import verdicts_line
    from nearharmonic.output.store import workflow_command

    return verdicts_line(document, workflow_command(document))


guard(workflow, Path(RESULTS), THIS_RUN, makeable, complete_record)
