"""The paper from its config to its figures: config -> plan -> integrate -> reduce -> render."""

import time

from snakemake.utils import min_version

from nearharmonic.tables import summary_line

min_version("9.0")
STARTED = time.time()


# Snakemake merges configs, and systems of the default would leak into another: one that is given stands alone.
if not workflow.overwrite_configfiles:

    configfile: "config/config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/compile.smk"
include: "workflow/rules/integrate.smk"
include: "workflow/rules/reduce.smk"
include: "workflow/rules/render.smk"
include: "workflow/rules/tables.smk"
include: "workflow/rules/derive.smk"
include: "workflow/rules/beyond.smk"


STABILITY_FILES = []  # each rule file of the stress tests adds its own


include: "workflow/rules/stability.smk"
include: "workflow/rules/stability_structure.smk"
include: "workflow/rules/work_precision.smk"


rule all:
    default_target: True
    input:
        f"{RESULTS}/manifest.json",
        FIGURE_FILES,
        TABLE_FILES,


rule figures:
    input:
        FIGURE_FILES,


rule tables:
    input:
        TABLE_FILES,


rule stability:
    input:
        STABILITY_FILES,


rule work_precision:
    input:
        WORK_PRECISION_FILES,


rule everything:
    input:
        rules.all.input,
        DERIVE_FILES,
        BEYOND_FILES,
        STABILITY_FILES,
        WORK_PRECISION_FILES,


onsuccess:
    # Only a run that made the table again has something new to say.
    _skipped = Path(f"{RESULTS}/tables/skipped.csv")
    if _skipped.is_file() and _skipped.stat().st_mtime >= STARTED:
        print(summary_line(_skipped))
