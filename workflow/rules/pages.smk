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
    "examples": (
        _EXAMPLES,
        {"figure": "near_harmonic"},
        lambda: task("reproduction.pages.examples:page", **on("examples", _EVERY)),
    ),
    "gallery": (
        _EXAMPLES,
        {"figure": "gallery"},
        lambda: task("reproduction.pages.gallery:page", **on("gallery", _EVERY)),
    ),
    "methods": ({}, {}, lambda: task("reproduction.pages.methods:page", **on("methods", _EVERY))),
    "ranking": ({}, {}, lambda: task("reproduction.pages.ranking:page", **on("ranking", _EVERY))),
    "tailor": (_EXAMPLES, {}, lambda: task("reproduction.pages.tailor:page", **on("tailor", _EVERY))),
    "timings": (
        {"cube": CUBE("work_precision")},
        {},
        lambda: task("reproduction.pages.timings:page", **on("timings", _EVERY)),
    ),
    "trained": (
        {
            "tables": [
                f"{RESULTS}/tables/trained_{name}.csv" for name in ("gains", "methods", "ideas", "long", "times")
            ],
            "pictures": [f"{RESULTS}/figures/{name}.png" for name in _PICTURES],
        },
        {name: name for name in _PICTURES},
        lambda: task("reproduction.pages.trained:page", **on("trained", _METHODS)),
    ),
    "training": (
        {purpose: f"{RESULTS}/tables/trained_landscape_{purpose}.csv" for purpose in CONFIG.trained.purposes},
        {},
        lambda: task("reproduction.pages.training:page", **on("training", _METHODS)),
    ),
}
_OF_TIMES = ("ranking", "timings")

for _name, (_inputs, _pictures, _made) in _PAGES.items():

    rule:
        name:
            f"page_of_{_name}"
        input:
            **_inputs,
        output:
            **{name: update(f"{DOCS}/{picture}.png") for name, picture in _pictures.items()},
            page=update(f"{DOCS}/{_name}.md"),
        log:
            LOG(f"pages/{_name}"),
        threads: ALL_CORES if _name == "ranking" else 1  # nothing runs beside what is timed
        resources:
            compiler=int(_name in ("examples", "methods", "tailor")),
        params:
            task=lambda wildcards, made=_made: made(),
        script:
            "../scripts/task.py"


rule pages:
    input:
        [getattr(rules, f"page_of_{name}").output for name in _PAGES if name not in _OF_TIMES],


rule pages_of_times:  # on a machine that does nothing else
    input:
        [getattr(rules, f"page_of_{name}").output for name in _OF_TIMES],
