"""Decisions on the statements of the paper; existing cubes of other targets are used."""

from nearharmonic_paper.claims.table import digest as digest_of_own


rule decide_claims:
    input:
        # Unnamed inputs: the job finds them, and cubes of other targets, in the folder.
        PAPER_CUBES,
        list(PAPER_TABLES.values()),
    output:
        table=multiext(f"{RESULTS}/tables/claims", ".csv", ".md"),
        document=f"{RESULTS}/tables/claims.json",
    log:
        LOG("tables/claims"),
    priority: 1  # the page waits for it
    params:
        own=digest_of_own(),  # statements that the code digest of the task does not cover
        task=lambda wildcards: claims_task(),
    script:
        "../scripts/task.py"


rule claims:
    input:
        rules.decide_claims.output,
