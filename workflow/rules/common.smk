"""The config, checked before any rule exists, and how rules name their files and their work."""

from snakemake.exceptions import WorkflowError

from nearharmonic.config import load
from nearharmonic.errors import NearharmonicError
from nearharmonic.output.declarations import figures_of
from nearharmonic.output.provenance import task

try:
    CONFIG = load(config, files=workflow.configfiles)
except NearharmonicError as error:
    raise WorkflowError(str(error)) from None

RESULTS = f"results/{CONFIG.name}"
FIGURES = []  # each experiment adds those that it declares


wildcard_constraints:
    system="|".join(CONFIG.systems),
    integrator="|".join(CONFIG.integrators),
    shard="[0-9]+",


def CUBE(stem):
    """The cube of this name."""
    return f"{RESULTS}/cubes/{stem}.h5"


def TABLE(stem):
    """The three files of a table."""
    return multiext(f"{RESULTS}/tables/{stem}", ".csv", ".md", ".tex")


def FIGURE(stem):
    """The three files of a figure."""
    return multiext(f"{RESULTS}/figures/{stem}", ".pdf", ".svg", ".png")


def LOG(stem):
    """The log file of a job."""
    return f"{RESULTS}/logs/{stem}.log"
