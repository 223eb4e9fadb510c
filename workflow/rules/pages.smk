"""Generated parts of pages below docs/; a config of another name fills copies of the pages in its folder of results.

Pages are updated in place: their text stays, and so does the page if a job fails.
"""

from nearharmonic.integrators import integrators
from nearharmonic.systems import systems

DOCS = "docs" if CONFIG.name == "paper" else f"{RESULTS}/docs"
EXAMPLES = sorted(map(str, Path("examples").glob("*.py")))
#: Whose names a table may show.
METHODS = {"integrators": integrators}
EVERY = METHODS | {"systems": systems}


def PAGE(name):
    """The file of a page, or of its picture."""
    return update(f"{DOCS}/{name}")


def on(page, **registries):
    """Settings of a page: its text as it is, and the names of all that its function looks up."""
    return {"page": f"docs/{page}.md", **{name: one.registered for name, one in registries.items()}}


rule page_of_examples:
    input:
        files=EXAMPLES,
    output:
        page=PAGE("examples.md"),
        figure=PAGE("near_harmonic.png"),
    log:
        LOG("pages/examples"),
    resources:
        compiler=1,
    params:
        task=lambda wildcards: task("reproduction.pages.examples:page", **on("examples", **EVERY)),
    script:
        "../scripts/task.py"


rule page_of_tailor:
    input:
        files=EXAMPLES,
    output:
        page=PAGE("tailor.md"),
    log:
        LOG("pages/tailor"),
    resources:
        compiler=1,
    params:
        task=lambda wildcards: task("reproduction.pages.tailor:page", **on("tailor", **EVERY)),
    script:
        "../scripts/task.py"


rule page_of_training:
    input:
        **{purpose: f"{RESULTS}/tables/trained_landscape_{purpose}.csv" for purpose in CONFIG.trained.purposes},
    output:
        page=PAGE("training.md"),
    log:
        LOG("pages/training"),
    params:
        task=lambda wildcards: task("reproduction.pages.training:page", **on("training", **METHODS)),
    script:
        "../scripts/task.py"


rule page_of_trained:
    input:
        tables=[f"{RESULTS}/tables/trained_{name}.csv" for name in ("gains", "methods", "ideas", "long", "times")],
        pictures=[f"{RESULTS}/figures/{name}.png" for name in EXPERIMENTS["trained"].figures],
    output:
        **{name: PAGE(f"{name}.png") for name in EXPERIMENTS["trained"].figures},
        page=PAGE("trained.md"),
    log:
        LOG("pages/trained"),
    params:
        task=lambda wildcards: task("reproduction.pages.trained:page", **on("trained", **METHODS)),
    script:
        "../scripts/task.py"


rule page_of_ranking:
    output:
        page=PAGE("ranking.md"),
    log:
        LOG("pages/ranking"),
    threads: ALL_CORES  # nothing runs beside what is timed
    params:
        task=lambda wildcards: task("reproduction.pages.ranking:page", **on("ranking", **EVERY)),
    script:
        "../scripts/task.py"


rule page_of_timings:
    input:
        cube=CUBE("work_precision"),
    output:
        page=PAGE("timings.md"),
    log:
        LOG("pages/timings"),
    params:
        task=lambda wildcards: task("reproduction.pages.timings:page", **on("timings", **EVERY)),
    script:
        "../scripts/task.py"


rule pages:
    input:
        [getattr(rules, f"page_of_{name}").output for name in ("examples", "tailor", "training", "trained")],


rule pages_of_times:  # on a machine that does nothing else
    input:
        rules.page_of_ranking.output,
        rules.page_of_timings.output,
