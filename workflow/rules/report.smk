"""The page of results, one file that needs no network, and a page of each interactive figure alone."""

from nearharmonic_paper.report.page import digest
from nearharmonic_paper.report.shown import pages_alone


rule page:
    input:
        cubes=map(CUBE, [*SWEEPS, "sho_terms"]),
        claims=f"{RESULTS}/tables/claims.json" if CONFIG.has_systems_of_the_paper else [],
        figures=rules.figures.input,
        tables=rules.tables.input,
    output:
        **{name: f"{RESULTS}/{file}" for name, file in pages_alone(FIGURES).items()},
        page=f"{RESULTS}/report.html",
    log:
        LOG("report"),
    params:
        assets=digest(),  # the code digest does not cover template, style and script
        task=lambda wildcards: page_task(),
    script:
        "../scripts/task.py"


rule report:
    input:
        rules.page.output,
