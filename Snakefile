"""The paper from its config to its figures: config -> plan -> integrate -> reduce -> render."""

import atexit
import gc

# While this file is read, no object becomes garbage: collections would waste time.
gc.disable()

from snakemake.utils import min_version

from nearharmonic_paper.config.refusal import refuse_unreadable
from nearharmonic_paper.experiments.paper.grid.omissions import summary_line

min_version("9.0")


# Snakemake merges configs, so systems of the default config would appear in another: a given config is used alone.
if not workflow.overwrite_configfiles:
    refuse_unreadable(Path("config").glob("config.yaml"))

    configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/henon_heiles.smk"
include: "workflow/rules/claims.smk"
include: "workflow/rules/derivation.smk"
include: "workflow/rules/sixth_order.smk"
include: "workflow/rules/work_precision.smk"
include: "workflow/rules/structure.smk"
include: "workflow/rules/stability.smk"
include: "workflow/rules/exact_oscillator.smk"
include: "workflow/rules/crystals.smk"
include: "workflow/rules/samplers.smk"
include: "workflow/rules/trained_search.smk"
include: "workflow/rules/trained.smk"
include: "workflow/rules/two_steps.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/pictures.smk"
include: "workflow/rules/pages.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/record.smk"


rule all:
    default_target: True
    input:
        PAPER_RUNS,
        PAPER_CUBES,
        rules.figures.input,
        rules.tables.input,
        rules.claims.input if CONFIG.has_systems_of_the_paper else [],
        rules.report.input,


rule everything:  # but the searches for trained methods: what they found is registered
    input:
        [getattr(rules, one.cubes_target).input for one in EXPERIMENTS.values()],


check_first(workflow, makeable_files, refuse)


# The garbage collector skips all modules and rules loaded so far: scanning them takes a fifth of a dry run.
gc.freeze()
gc.enable()


onstart:
    record_start()


onsuccess:
    record_end(exit_status=0)
    # Only a run that made the table again prints the summary.
    if THIS_RUN.made("tables/skipped.csv"):
        print(summary_line(f"{RESULTS}/tables/skipped.csv"))
    if THIS_RUN.made(CLAIMS):
        print(verdicts(f"{RESULTS}/{CLAIMS}"))
    if Path(f"{RESULTS}/report.html").exists():
        # Snakemake prints its log file and its time after this.
        atexit.register(print, f"Open the page of results: {RESULTS}/report.html", flush=True)


onerror:
    record_end(exit_status=1)
