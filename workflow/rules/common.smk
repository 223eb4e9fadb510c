"""The config, validated before any rule exists, and functions for the files and tasks of rules.

Rules name no environments of their own, as ``snakemake --lint`` asks for. They all run in the one that the package is
installed in, whose versions ``constraints.txt`` pins and every result file records.
"""

import os
import re

from snakemake_interface_common.exceptions import WorkflowError

from nearharmonic_paper.config import refuse, warn_of_name
from nearharmonic_paper.config import load
from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.record.verify import ADOPTING, noting
from nearharmonic_paper.experiments.paper.run import REDUCED_AT_ONCE, shards_of
from nearharmonic_paper.experiments.paper.experiment import ORBITS
from nearharmonic_paper.tasks.experiment import figures_of
from nearharmonic_paper.tasks.experiment import experiments
from nearharmonic_paper.tasks.provenance import task
from nearharmonic_paper.tasks.provenance import RUN as RUN_ID
from snakemake_executor_plugin_nearharmonic_forkserver import expect_jobs

if ADOPTING in os.environ:
    task, TASKS = noting(task)

#: True in a process that Snakemake starts for a job; of the command: a dry run, or one that computes nothing.
IS_JOB = RUN_ID in os.environ
IS_DRY = any(word in ("--dry-run", "--dryrun") or re.fullmatch("-[a-zA-Z]*n[a-zA-Z]*", word) for word in sys.argv)
IS_TOUCHED = not {"-t", "--touch"}.isdisjoint(sys.argv)

try:
    CONFIG = load(config, files=CONFIGFILES)
except NearharmonicError as error:
    refuse(error)
if not IS_JOB:
    warn_of_name(CONFIG.name, CONFIGFILES)

RESULTS = f"results/{CONFIG.name}"
IS_NEW = not os.path.exists(f"{RESULTS}/manifest.json") or not {"-F", "--forceall"}.isdisjoint(sys.argv)
if IS_NEW and not (IS_JOB or IS_DRY or IS_TOUCHED):
    expect_jobs()
SWEEPS = {sweep.system: sweep for sweep in CONFIG.sweeps}
METHODS = CONFIG.methods
EXPERIMENTS = experiments()
#: Cubes that are not named after a system; long orbits of the paper's systems are made for configs with one of these alone.
CUBES = [
    stem for one in EXPERIMENTS.values() for stem in one.cubes if CONFIG.has_systems_of_the_paper or stem not in ORBITS
]
FIGURES = [one for one in figures_of(CONFIG.systems, CUBES) if one.method in ("", *METHODS)]
#: Values of the placeholders in names of files, by experiment.
VALUES = {name: {"system": CONFIG.systems, **one.values(CONFIG)} for name, one in EXPERIMENTS.items()}
#: Run files of all experiments but the paper's, whose shards differ by method, and one file of each kind.
RUNS = [
    f"{RESULTS}/{run}" for name, one in EXPERIMENTS.items() if name != "paper" for run in one.run_files(**VALUES[name])
]
KINDS = {
    kind: f"{RESULTS}/{run}"
    for name, one in EXPERIMENTS.items()
    if name != "paper"
    for kind, run in one.kinds_of_runs(**VALUES[name]).items()
}
TWO_STEPS = {}  # each experiment adds its jobs

try:
    ALL_CORES = workflow.cores
except WorkflowError:  # --summary, --list-changes, --report and remote executors come without --cores
    ALL_CORES = os.cpu_count()


wildcard_constraints:
    system="[^/]+",  # a list of all names would be matched for each file
    integrator="[^/]+",
    shard="[0-9]+",


def RUN(stem):
    """Return the run file of this name."""
    return f"{RESULTS}/runs/{stem}.h5"


def CUBE(stem):
    """Return the cube of this name."""
    return f"{RESULTS}/cubes/{stem}.h5"


def TABLE(stem):
    """Return the three files of a table."""
    return multiext(f"{RESULTS}/tables/{stem}", ".csv", ".md", ".tex")


def CSV(*stems):
    """Return these tables in CSV."""
    return [f"{RESULTS}/tables/{stem}.csv" for stem in stems]


def FIGURE(stem):
    """Return the three files of a figure."""
    return multiext(f"{RESULTS}/figures/{stem}", ".pdf", ".svg", ".png")


#: Parameter of rules that draw; the default is left out, so that the parameters of earlier results stay.
LOOK = {"transparent": True} if CONFIG.background == "transparent" else {}


def shown(stem, category, label):
    """Return the three files of a figure, with its picture marked for the report."""
    *vector, png = FIGURE(stem)
    return [*vector, report(png, caption="../report/figures.rst", category=category, labels={"figure": label})]


def FILES(experiment, **values):
    """Return the files of an experiment's target, with other values of some placeholders."""
    names = EXPERIMENTS[experiment].files(**VALUES[experiment] | values)
    return [f"{RESULTS}/{name}" for name in names]


def SHOWN(target):
    """Return the mark of the job that shows the files of a target on the page of results, if there is one."""
    return f"{RESULTS}/logs/shown/{target}.done"


def LOG(stem):
    """Return the log file of a job."""
    return f"{RESULTS}/logs/{stem}.log"


def run_files(system):
    """Return the run files of each method on one system, by method."""
    folder = f"{RESULTS}/runs/{system}"
    return {
        name: [f"{folder}/{name}/{shard}.h5" for shard in range(shards_of(SWEEPS[system], name))] for name in METHODS
    }


def compiled(wildcards):
    """Return the mark of the kernels that a run needs; wildcards alone admit any names."""
    if wildcards.system not in SWEEPS or wildcards.integrator not in METHODS:
        raise WorkflowError(f"the config has no runs of {wildcards.integrator} on {wildcards.system}")
    return f"{RESULTS}/logs/compile/{wildcards.system}.done"


def shard_of(wildcards):
    """Return the settings of the job of a shard."""
    return {
        "sweep": SWEEPS[wildcards.system],
        "integrator": wildcards.integrator,
        "shard": int(wildcards.shard),
    }


def reduced_files(system):
    """Return the files that a cube is made from, by method: its run files, or the reduced numbers of many."""
    folder = f"{RESULTS}/reduced/{system}"
    return {
        name: [f"{folder}/{name}.h5"] if len(paths) > REDUCED_AT_ONCE else paths
        for name, paths in run_files(system).items()
    }


def installed():
    """Return the installed libraries as a setting, so that a library that is installed later is timed too."""
    from nearharmonic_paper.experiments.work_precision.peers import LIBRARIES, is_installed

    return {library: is_installed(library) for library in LIBRARIES}
