"""The statements of the paper that numbers decide; cubes of other targets count as far as they are there."""

from nearharmonic.integrators import integrators
from nearharmonic.reproduction.claims.own import digest as digest_of_own


rule decide_claims:
    input:
        # By position: the job looks for them, and for those of other targets, in the folder.
        [CUBE(stem) for stem in (*SWEEPS, *PAPER.cubes)],
        list(PAPER_TABLES.values()),
    output:
        table=multiext(f"{RESULTS}/tables/claims", ".csv", ".md"),
        document=f"{RESULTS}/tables/claims.json",
    log:
        LOG("tables/claims"),
    params:
        own=digest_of_own(),  # of statements that the code of the task does not reach
        task=task("reproduction.claims.table:decided", folder=RESULTS, integrators=integrators.registered),
    script:
        "../scripts/task.py"


rule claims:
    input:
        rules.decide_claims.output,
