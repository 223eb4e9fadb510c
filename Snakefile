"""The paper from its config to its figures: config -> plan -> integrate -> reduce -> render."""

import atexit
import gc
import os
import sys

from snakemake.utils import min_version

from nearharmonic_paper.config import CONFIGS, checked_configs
from nearharmonic_paper.record.workflow_run import WorkflowRun

min_version("9.0")
# Collections of garbage take a fifth of a dry run: rules and planned jobs stay to the end.
gc.disable()
# Snakemake would load pandas for 0.3 s at each start, to look for its tables among parameters; there are none.
sys.modules["pandas"] = None


# Snakemake merges configs, so systems of the default config would appear in another: a given config is used alone.
CONFIGFILES = checked_configs(sys.argv[1:], config)
if CONFIGFILES == CONFIGS:

    configfile: CONFIGS[0]


# A file an experiment.
include: "workflow/rules/common.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/henon_heiles.smk"
include: "workflow/rules/claims.smk"
include: "workflow/rules/derivation.smk"
include: "workflow/rules/work_precision.smk"
include: "workflow/rules/structure.smk"
include: "workflow/rules/stability.smk"
include: "workflow/rules/exact_oscillator.smk"
include: "workflow/rules/studies.smk"
include: "workflow/rules/two_steps.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/pictures.smk"
include: "workflow/rules/pages.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/record.smk"
include: "workflow/rules/refresh.smk"


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
        [FIGURE(one.stem) for one in PAPER_FIGURES],
        rules.columns.input,


THIS_RUN = WorkflowRun(RESULTS, CONFIG, makeable(), [os.path.relpath(path) for path in CONFIGFILES])
# Damaged results are no longer there when Snakemake looks at the files, so that it makes them again.
if not (IS_JOB or IS_TOUCHED):
    THIS_RUN.prepare(is_dry=IS_DRY)


atexit.register(gc.freeze)


onstart:
    record_start()
    gc.freeze()
    gc.enable()


onsuccess:
    record_end(exit_status=0)
    if not IS_TOUCHED:
        print(*closing_lines(), sep="\n", flush=True)


onerror:
    record_end(exit_status=1)
