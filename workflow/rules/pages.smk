"""Generated parts of pages below docs/; a config of another name fills copies of the pages in its folder of results.

Pages are updated in place: their text stays, and so does the page if a job fails.
"""

from nearharmonic.integrators import integrators
from nearharmonic.systems import systems

DOCS = "docs" if CONFIG.name == "paper" else f"{RESULTS}/docs"
_EXAMPLES = {"files": sorted(map(str, Path("examples").glob("*.py")))}
#: Registries whose names a table may show.
_METHODS = {"integrators": integrators}
_EVERY = _METHODS | {"systems": systems}


# What each page is made of, its pictures by the names of the results, and the function that fills it.
_PAGES = {
    "results/examples": (
        _EXAMPLES,
        {"figure": "near_harmonic"},
        lambda: task("reproduction.pages.examples:page", **on("results/examples", _EVERY)),
    ),
    "start/gallery": (
        _EXAMPLES,
        {"figure": "gallery"},
        lambda: task("reproduction.pages.gallery:page", **on("start/gallery", _EVERY)),
    ),
    "reference/methods": ({}, {}, lambda: task("reproduction.pages.methods:page", **on("reference/methods", _EVERY))),
    "results/ranking": ({}, {}, lambda: task("reproduction.pages.ranking:page", **on("results/ranking", _EVERY))),
    "how_to/tailor": (_EXAMPLES, {}, lambda: task("reproduction.pages.tailor:page", **on("how_to/tailor", _EVERY))),
    "results/timings": (
        {"cube": CUBE("work_precision")},
        {},
        lambda: task("reproduction.pages.timings:page", **on("results/timings", _EVERY)),
    ),
    "results/trained": (
        {"tables": [f"{RESULTS}/tables/trained_{name}.csv" for name in ("gains", "methods", "ideas", "long", "times")]},
        {},
        lambda: task("reproduction.pages.trained:page", **on("results/trained", _METHODS)),
    ),
    "results/training": (
        {purpose: f"{RESULTS}/tables/trained_landscape_{purpose}.csv" for purpose in CONFIG.trained.purposes},
        {},
        lambda: task("reproduction.pages.training:page", **on("results/training", _METHODS)),
    ),
}
#: Figures that pages show as pictures of few colours, with the number of colours: the paper's six, and others.
_PAPERS = {one.stem: 20 for one in FIGURES if one.target in [f"fig{number}" for number in range(1, 7)]}
_OTHERS = (*EXPERIMENTS["exact_oscillator"].figures, *EXPERIMENTS["trained"].figures, "henon_heiles_stability")
_SHOWN = _PAPERS | dict.fromkeys((*_OTHERS, "regularised_times"), 128)
#: The figure of the tables of times on a page, which another computer would measure anew.
_OF_TABLES = f"{RESULTS}/logs/pages/regularised_times.png"
_OF_TIMES = ("results/ranking", "results/timings")

for _page, (_inputs, _pictures, _made) in _PAGES.items():
    _section, _, _name = _page.partition("/")

    rule:
        name:
            f"page_of_{_name}"
        input:
            **_inputs,
        output:
            **{name: update(f"{DOCS}/{_section}/{picture}.png") for name, picture in _pictures.items()},
            page=update(f"{DOCS}/{_page}.md"),
        log:
            LOG(f"pages/{_name}"),
        threads: ALL_CORES if _name == "ranking" else 1  # nothing runs beside what is timed
        resources:
            compiler=int(_name in ("examples", "methods", "tailor")),
        params:
            task=lambda wildcards, made=_made: made(),
        script:
            "../scripts/task.py"


rule figure_of_regularised:
    input:
        page="docs/results/regularised.md",
    output:
        figure=temp(_OF_TABLES),
    log:
        LOG("pages/figure_of_regularised"),
    params:
        task=task("reproduction.experiments.work_precision.figures.regularised:figure_of_tables"),
    script:
        "../scripts/task.py"


for _stem, _colours in _SHOWN.items():

    rule:
        name:
            f"picture_of_{_stem}"
        input:
            figure=_OF_TABLES if _stem == "regularised_times" else f"{RESULTS}/figures/{_stem}.png",
        output:
            picture=update(f"{DOCS}/results/{_stem}.png"),
        log:
            LOG(f"pages/{_stem}"),
        params:
            task=task("reproduction.report.shown.pictures:few_colours", colours=_colours),
        script:
            "../scripts/task.py"


_FILLED = {page: getattr(rules, f"page_of_{Path(page).name}").output for page in _PAGES}


rule pictures:
    input:
        [f"{DOCS}/results/{stem}.png" for stem in _SHOWN],


rule pages:
    input:
        rules.pictures.input,
        [files for page, files in _FILLED.items() if page not in _OF_TIMES],


rule pages_of_times:  # on a machine that does nothing else
    input:
        [_FILLED[page] for page in _OF_TIMES],
