"""Generated parts of pages below docs/; a config of another name fills copies of the pages in its folder of results.

Pages are updated in place: their text stays, and so does the page if a job fails.
"""

from nearharmonic.integrators import integrators
from nearharmonic.systems import systems

_EXAMPLES = {"files": sorted(map(str, Path("examples").glob("*.py")))}
#: Registries whose names a table may show.
_METHODS = {"integrators": integrators}
_EVERY = _METHODS | {"systems": systems}
#: Every cube, and a run file of each kind, by their names on the page of variables.
_OF_KIND = {f"cubes/{stem}.h5": CUBE(stem) for one in EXPERIMENTS.values() for stem in one.cubes} | dict(
    sorted(KINDS.items())
)


# What each page is made of, its pictures by the names of the results, and the function that fills it.
_PAGES = {
    "results/examples": (
        _EXAMPLES,
        {"figure": "near_harmonic"},
        lambda: task("nearharmonic_paper.pages.examples:page", **on("results/examples", _EVERY)),
    ),
    "start/gallery": (
        _EXAMPLES,
        {"figure": "gallery"},
        lambda: task("nearharmonic_paper.pages.gallery:page", **on("start/gallery", _EVERY)),
    ),
    "reference/methods": ({}, {}, lambda: task("nearharmonic_paper.pages.methods:page", **on("reference/methods", _EVERY))),
    "results/ranking": ({}, {}, lambda: task("nearharmonic_paper.pages.ranking:page", **on("results/ranking", _EVERY))),
    "how_to/files": (
        {
            "runs": [RUN(f"{system}/{METHODS[0]}/0") for system in ("sho", "kepler")],
            "cubes": [CUBE(system) for system in ("sho", "kepler")],
        },
        {},
        lambda: task("nearharmonic_paper.pages.how_to.variables:page", **on("how_to/files", _EVERY)),
    ),
    "reference/variables": (
        {"files": list(_OF_KIND.values())},
        {},
        lambda: task(
            "nearharmonic_paper.pages.how_to.variables:reference",
            kinds=list(_OF_KIND),
            **on("reference/variables", {}),
        ),
    ),
    "how_to/tabulated_potentials": (
        {},
        {"figure": "tabulated_potentials"},
        lambda: task("nearharmonic_paper.pages.how_to.tabulated:page", **on("how_to/tabulated_potentials", _EVERY)),
    ),
    "how_to/tangent_maps": (
        {},
        {"figure": "tangent_maps"},
        lambda: task("nearharmonic_paper.pages.how_to.tangent_maps:page", **on("how_to/tangent_maps", _EVERY)),
    ),
    "how_to/adapters": (
        {},
        {"figure": "adapters"},
        lambda: task("nearharmonic_paper.pages.how_to.adapters:page", **on("how_to/adapters", {})),
    ),
    "how_to/gauss": (
        {},
        {"figure": "gauss"},
        lambda: task("nearharmonic_paper.pages.how_to.gauss:page", **on("how_to/gauss", _EVERY)),
    ),
    "how_to/tailor": (
        _EXAMPLES,
        {},
        lambda: task("nearharmonic_paper.pages.how_to.tailor:page", **on("how_to/tailor", _EVERY)),
    ),
    "results/derivation": (
        {"tables": [TABLE(f"derived_{name}") for name in ("counts", "solutions", "errors", "families", "routes")]},
        {},
        lambda: task("nearharmonic_paper.pages.targets.derivation:page", **on("results/derivation", _METHODS)),
    ),
    "results/exact_oscillator": (
        {"cube": CUBE("exact_oscillator")},
        {},
        lambda: task("nearharmonic_paper.pages.targets.exact_oscillator:page", **on("results/exact_oscillator", _EVERY)),
    ),
    "results/crystals": (
        {"cube": CUBE("crystals")},
        {},
        lambda: task("nearharmonic_paper.pages.targets.crystals:page", **on("results/crystals", _EVERY)),
    ),
    "results/samplers": (
        {"cube": CUBE("samplers")},
        {},
        lambda: task("nearharmonic_paper.pages.targets.samplers:page", **on("results/samplers", _EVERY)),
    ),
    "results/stability": (
        {"tables": [TABLE(stem) for stem in ("stability_henon_heiles", "stability_rounding", "kinetic_energy")]},
        {},
        lambda: task("nearharmonic_paper.pages.targets.stability:page", **on("results/stability", _METHODS)),
    ),
    "results/timings": (
        {"cube": CUBE("work_precision")},
        {},
        lambda: task("nearharmonic_paper.pages.targets.timings:page", **on("results/timings", _EVERY)),
    ),
    "results/trained": (
        {"tables": [f"{RESULTS}/tables/trained_{name}.csv" for name in ("gains", "methods", "ideas", "long", "times")]},
        {},
        lambda: task("nearharmonic_paper.pages.trained:page", **on("results/trained", _METHODS)),
    ),
    "results/training": (
        {purpose: f"{RESULTS}/tables/trained_landscape_{purpose}.csv" for purpose in CONFIG.trained.purposes},
        {},
        lambda: task("nearharmonic_paper.pages.training:page", **on("results/training", _METHODS)),
    ),
}
if any(systems[name].regularisation is not None for name in CONFIG.systems):  # as config/regularised.yaml has them
    _PAGES["results/regularised"] = (
        {"cube": CUBE("work_precision")},
        {},
        lambda: task(
            "nearharmonic_paper.pages.targets.regularised:page",
            names=list(CONFIG.systems),
            **on("results/regularised", _EVERY),
        ),
    )
_OF_TIMES = ("results/ranking", "results/timings", "results/regularised")

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
            compiler=int(_name in ("examples", "methods", "tabulated_potentials", "tailor", "tangent_maps")),
        params:
            task=lambda wildcards, made=_made: made(),
        script:
            "../scripts/task.py"


#: The files of each page by its name.
_FILLED = {page: getattr(rules, f"page_of_{Path(page).name}").output for page in _PAGES}


rule pages:
    input:
        rules.pictures.input,
        [files for page, files in _FILLED.items() if page not in _OF_TIMES],


rule pages_of_times:  # on a machine that does nothing else
    input:
        [_FILLED[page] for page in _OF_TIMES if page in _PAGES],


if DOCS == "docs":
    from nearharmonic_paper.claims.table import FILES as _DECISIVE

    rule decide_committed:  # anew, from all targets
        input:
            files=[f"{RESULTS}/{name}" for name in _DECISIVE],
        output:
            recorded=update("tests/paper/claims/recorded.zip"),
            document=update("docs/claims.json"),
            page=update("docs/results/claims.md"),
            readme=update("README.md"),
        log:
            LOG("pages/verdicts"),
        params:
            own=digest_of_own(),
            task=task(
                "nearharmonic_paper.claims.pages.documents:verdicts",
                folder=RESULTS,
                readme="README.md",
                integrators=plain_integrators.registered,
            ),
        script:
            "../scripts/task.py"

    rule verdicts:  # the results come first: what is committed exists in any checkout
        input:
            rules.decide_committed.input,
            rules.decide_committed.output,
