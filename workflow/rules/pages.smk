"""Generated parts of pages below docs/; a config of another name fills copies of the pages in its folder of results.

Pages are updated in place: their text stays, and so does the page if a job fails.
"""

from nearharmonic.integrators import integrators
from nearharmonic.systems import systems

DOCS = "docs" if CONFIG.name == "paper" else f"{RESULTS}/docs"
_EXAMPLES = {"files": sorted(map(str, Path("examples").glob("*.py")))}
_PICTURES = [*EXPERIMENTS["trained"].figures]
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
    "how_to/tabulated_potentials": (
        {},
        {"figure": "tabulated_potentials"},
        lambda: task("reproduction.pages.how_to.tabulated:page", **on("how_to/tabulated_potentials", _EVERY)),
    ),
    "how_to/tailor": (
        _EXAMPLES,
        {},
        lambda: task("reproduction.pages.how_to.tailor:page", **on("how_to/tailor", _EVERY)),
    ),
    "results/timings": (
        {"cube": CUBE("work_precision")},
        {},
        lambda: task("reproduction.pages.timings:page", **on("results/timings", _EVERY)),
    ),
    "results/trained": (
        {
            "tables": [
                f"{RESULTS}/tables/trained_{name}.csv" for name in ("gains", "methods", "ideas", "long", "times")
            ],
            "pictures": [f"{RESULTS}/figures/{name}.png" for name in _PICTURES],
        },
        {name: name for name in _PICTURES},
        lambda: task("reproduction.pages.trained:page", **on("results/trained", _METHODS)),
    ),
    "results/training": (
        {purpose: f"{RESULTS}/tables/trained_landscape_{purpose}.csv" for purpose in CONFIG.trained.purposes},
        {},
        lambda: task("reproduction.pages.training:page", **on("results/training", _METHODS)),
    ),
}
#: Figures of the paper, which pages show as pictures of few colours.
_FIGURES = [one.stem for one in FIGURES if one.target in [f"fig{number}" for number in range(1, 7)]]
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
            compiler=int(_name in ("examples", "methods", "tabulated_potentials", "tailor")),
        params:
            task=lambda wildcards, made=_made: made(),
        script:
            "../scripts/task.py"


rule pictures:
    input:
        **{stem: f"{RESULTS}/figures/{stem}.png" for stem in _FIGURES},
    output:
        **{stem: update(f"{DOCS}/results/{stem}.png") for stem in _FIGURES},
    log:
        LOG("pages/pictures"),
    params:
        task=task("reproduction.report.shown.pictures:pictures"),
    script:
        "../scripts/task.py"


def filled(pages):
    return [getattr(rules, f"page_of_{Path(page).name}").output for page in pages]


rule pages:
    input:
        rules.pictures.output,
        filled(page for page in _PAGES if page not in _OF_TIMES),


rule pages_of_times:  # on a machine that does nothing else
    input:
        filled(_OF_TIMES),
