"""The page of results: one file with claims, figures and tables, which needs no network."""

from nearharmonic.reproduction.report.assets import digest


rule page:
    input:
        cubes=map(CUBE, [*SWEEPS, "sho_terms"]),
        claims=f"{RESULTS}/tables/claims.json",
        figures=rules.figures.input,
        tables=rules.tables.input,
    output:
        page=f"{RESULTS}/report.html",
    log:
        LOG("report"),
    params:
        assets=digest(),  # the code digest does not cover template, style and script
        task=task("reproduction.report.page:page", folder=RESULTS),
    script:
        "../scripts/task.py"


rule report:
    input:
        rules.page.output,
