"""The statements of the paper that numbers decide; cubes of other targets count as far as they are there."""

from nearharmonic.integrators import integrators


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
        task=task("reproduction.claims.table:decided", folder=RESULTS, integrators=integrators.registered),
    script:
        "../scripts/task.py"


rule claims:
    input:
        rules.decide_claims.output,
