"""The paper from its config to its figures: config -> plan -> integrate -> reduce -> render."""

import gc
import time

from snakemake.utils import min_version

from nearharmonic.experiments.paper.omissions import summary_line

min_version("9.0")
STARTED = time.time()


# Snakemake merges configs, and systems of the default would leak into another: one that is given stands alone.
if not workflow.overwrite_configfiles:

    configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/derivation.smk"
include: "workflow/rules/sixth_order.smk"
include: "workflow/rules/work_precision.smk"
include: "workflow/rules/stability.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"


rule all:
    default_target: True
    input:
        f"{RESULTS}/manifest.json",
        rules.figures.input,
        rules.tables.input,
        rules.report.output,


rule everything:
    input:
        rules.all.input,
        rules.derive.input,
        rules.sixth_order.input,
        rules.stability.input,
        rules.work_precision.input,


# The garbage collector skips all modules and rules loaded so far: scanning them takes a fifth of a dry run.
gc.freeze()


onsuccess:
    # Only a run that made the table again has something new to say.
    _skipped = Path(f"{RESULTS}/tables/skipped.csv")
    if _skipped.is_file() and _skipped.stat().st_mtime >= STARTED:
        print(summary_line(_skipped))
