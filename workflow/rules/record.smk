"""The record of this run: history.jsonl and manifest.json. They are no outputs: every target changes them."""

import functools
import itertools
import os
import sys
import warnings

from nearharmonic.integrators import plain_integrators
from nearharmonic_paper.experiments.paper.earlier import forget, keep
from nearharmonic_paper.experiments.paper.run import summary_line
from nearharmonic_paper.record.verify import check_tasks
from snakemake_executor_plugin_nearharmonic_forkserver import cancel_timers

CLAIMS, OMISSIONS = "tables/claims.json", "tables/skipped.csv"
#: Former names of targets, which warn, and their present names.
FORMER = {"beyond": "sixth_order"}


@functools.cache
def makeable():
    """Return the names of all files that jobs of this config make, in the folder of results."""
    targets = [getattr(rules, one.target).input for one in EXPERIMENTS.values()]
    asked_by_name = rules.claims.input, rules.columns.input, map(CUBE, PAPER.cubes)
    figures = (FIGURE(one.stem) for one in FIGURES)  # also the ones that no experiment draws by default
    paths = itertools.chain(*targets, *asked_by_name, *figures, RUNS)
    return {str(path).removeprefix(f"{RESULTS}/") for path in paths if not str(path).endswith(".done")}


def leftovers():
    """Return the names of the cubes, figures, tables and pages in the folder of results that no job of this config makes."""
    shown = ("cubes/*", "figures/*", "tables/*", "*.html")
    there = (path.relative_to(RESULTS).as_posix() for pattern in shown for path in Path(RESULTS).glob(pattern))
    return sorted({*there} - makeable())


def document(rule, log):
    """Return the files of a rule for the rule refresh."""
    outputs = {name: [made] if isinstance(made, str) else made for name, made in rule.output.items()}
    outputs = {name: [*map(str, files)] for name, files in outputs.items()}
    return {"input": [*map(str, rule.input)], "output": outputs, "log": log}


def claims_task():
    """Return the task of the rule decide_claims."""
    return task(
        "nearharmonic_paper.claims.table:decided",
        folder=RESULTS,
        integrators=plain_integrators.registered,
        leftovers=leftovers(),
    )


def page_task():
    """Return the task of the rule page; figure 6 in motion has the coefficients of these integrators."""
    return task(
        "nearharmonic_paper.report.page:page",
        folder=RESULTS,
        integrators=tuple(dict.fromkeys((*CONFIG.methods, *CONFIG.decomposed))),
        leftovers=leftovers(),
    )


def is_target(word):
    """Return True if a word of a command is the name of a rule or of a result."""
    try:
        return word.startswith(f"{RESULTS}/") or bool(getattr(rules, word))
    except WorkflowError:
        return False


def record_start():
    """Write a marker, and pass the id of the run to its jobs."""
    if ADOPTING in os.environ:
        check_tasks(Path(RESULTS), TASKS)
    if IS_TOUCHED:
        return
    targets = [word for word in sys.argv[1:] if is_target(word)]
    for name in FORMER.keys() & targets:
        warnings.warn(f"the target {name} is now {FORMER[name]}", FutureWarning, stacklevel=1)
    THIS_RUN.begin(sys.argv, sorted(targets) or ["all"], ALL_CORES)
    keep(Path(RESULTS), [run for system in SWEEPS for files in run_files(system).values() for run in files])


def record_end(exit_status):
    """Write the manifest and the line of the history."""
    cancel_timers()  # also timers of interrupted runs and of other executors
    if not IS_TOUCHED:
        if not exit_status:
            forget(Path(RESULTS))
        THIS_RUN.end(exit_status)


def closing_lines():
    """Return what this run made: figures, verdicts, what was left out, time, and the page of results."""
    told = THIS_RUN.told
    figures = {Path(name).stem for name in told["made"] if name.startswith("figures/")}
    if figures:
        yield f"Figures: {len(figures)} in {RESULTS}/figures"
    if CLAIMS in told["made"]:
        from nearharmonic_paper.claims.claim import verdicts_line
        from nearharmonic.output.store import workflow_command

        document = f"{RESULTS}/{CLAIMS}"
        yield verdicts_line(document, workflow_command(document)).replace("Of", "Verdicts: of", 1)
    if OMISSIONS in told["made"]:
        table = f"{RESULTS}/{OMISSIONS}"
        yield f"{summary_line(table)}: {table}"
    jobs = told["jobs_run"] or 0
    work = f"{jobs} job{'s' * (jobs != 1)}, {told['evaluations'] or 0:.2g} force evaluations in all"
    yield f"Time: {told['duration']:.1f} s, {told['cpu_seconds']:.1f} s of CPU, {work}"
    if Path(f"{RESULTS}/report.html").exists():
        yield f"Page: {RESULTS}/report.html"
