"""Generated parts of pages below docs/; a config of another name fills copies of the pages in its folder of results.

Pages are updated in place: their text stays, and so does the page if a job fails.
"""

from nearharmonic.integrators import integrators, plain_integrators
from nearharmonic.systems import systems
from nearharmonic_paper.tasks.provenance import command_digest

#: Registries whose names a page may show.
_METHODS = {"integrators": integrators}
_EVERY = _METHODS | {"systems": systems}
#: Every cube, and a run file of each kind, by their names on the page of variables.
_OF_KIND = {f"cubes/{stem}.h5": CUBE(stem) for one in EXPERIMENTS.values() for stem in one.cubes} | dict(
    sorted(KINDS.items())
)


# Page -> the function that fills it, registries, what the page is made of, and other results by the names of files.
_PAGES = {
    "start/gallery": (
        "nearharmonic_paper.pages.library:gallery",
        _EVERY,
        {"files": sorted(map(str, Path("examples").glob("*.py")))},
        {path.stem: f"gallery/{path.stem}.svg" for path in sorted(Path("examples").glob("*.py"))},
    ),
    "reference/methods": ("nearharmonic_paper.pages.library:methods", _EVERY, {}, {}),
    "how_to/files": (
        "nearharmonic_paper.pages.library:files",
        _EVERY,
        {
            "runs": [RUN(f"{system}/{METHODS[0]}/0") for system in ("sho", "kepler")],
            "cubes": [CUBE(system) for system in ("sho", "kepler")],
        },
        {},
    ),
    "reference/variables": (
        "nearharmonic_paper.pages.library:variables",
        {"systems": systems},
        {"files": list(_OF_KIND.values())},
        {},
    ),
    "how_to/adapters": (
        "nearharmonic_paper.pages.library:adapters",
        _METHODS,
        {"errors": "docs/how_to/adapters.csv"},
        {"figure": "adapters.svg"},
    ),
    "results/derivation": (
        "nearharmonic_paper.pages.targets:derivation",
        _METHODS,
        {"tables": CSV(*(f"derived_{name}" for name in ("counts", "solutions", "errors", "families", "routes")))},
        {},
    ),
    "results/exact_oscillator": (
        "nearharmonic_paper.pages.targets:exact_oscillator",
        _EVERY,
        {"cube": CUBE("exact_oscillator")},
        {},
    ),
    "results/crystals": ("nearharmonic_studies.crystals.results:page", _EVERY, {"cube": CUBE("crystals")}, {}),
    "results/samplers": ("nearharmonic_studies.samplers.results:page", _EVERY, {"cube": CUBE("samplers")}, {}),
    "results/stability": (
        "nearharmonic_paper.pages.targets:stability",
        _METHODS,
        {"tables": CSV("stability_henon_heiles", "stability_rounding", "kinetic_energy")},
        {},
    ),
    "results/timings": ("nearharmonic_paper.pages.targets:timings", _EVERY, {"cube": CUBE("work_precision")}, {}),
    "results/trained": (
        "nearharmonic_studies.trained.page:page",
        _METHODS,
        {"tables": CSV(*(f"trained_{name}" for name in ("gains", "methods", "ideas", "long", "times")))},
        {},
    ),
    "results/training": (
        "nearharmonic_studies.trained.page:training",
        _METHODS,
        {purpose: f"{RESULTS}/tables/trained_landscape_{purpose}.csv" for purpose in CONFIG.trained.purposes},
        {},
    ),
}
if any(systems[name].regularisation is not None for name in CONFIG.systems):  # as config/regularised.yaml has them
    _PAGES["results/regularised"] = (
        "nearharmonic_paper.pages.targets:regularised",
        _EVERY,
        {"cube": CUBE("work_precision")},
        {"file": "regularised.csv"},
    )
#: Settings of functions of pages beside these.
_SETTINGS = {
    "reference/variables": {"kinds": list(_OF_KIND), "explained": "docs/how_to/files.md"},
    "results/regularised": {"names": list(CONFIG.systems)},
}
# Page -> the command below benchmarks/ that measures for it, and the other files that it writes.
_MEASURED = {
    "start/choosing": ("which_method", ["which_method.csv"]),
    "results/examples": ("near_harmonic", ["near_harmonic.svg"]),
    "results/ranking": ("ranking", []),
    "how_to/gauss": ("gauss", ["gauss.svg"]),
    "how_to/tabulated_potentials": ("tabulated_potentials", ["tabulated_potentials.svg"]),
    "how_to/tailor": ("tailor", []),
    "how_to/tangent_maps": ("tangent_maps", ["tangent_maps.svg"]),
}
_OF_TIMES = ("results/ranking", "results/timings", "results/regularised")


for _page, (_function, _registries, _inputs, _others) in _PAGES.items():
    _section, _, _name = _page.partition("/")

    rule:
        name:
            f"page_of_{_name}"
        input:
            **_inputs,
        output:
            **{name: update(f"{DOCS}/{_section}/{file}") for name, file in _others.items()},
            page=update(f"{DOCS}/{_page}.md"),
        log:
            LOG(f"pages/{_name}"),
        params:
            # Its text as it is, and the names of all that its function looks up.
            task=lambda wildcards, page=_page, function=_function, registries=_registries: task(
                function,
                page=f"docs/{page}.md",
                **{kind: registry.registered for kind, registry in registries.items()},
                **_SETTINGS.get(page, {}),
            ),
        script:
            "../scripts/task.py"


for _page, (_command, _pictures) in _MEASURED.items():
    _section, _, _name = _page.partition("/")

    rule:
        name:
            f"page_of_{_name}"
        input:
            command=f"benchmarks/{_command}.py",
        output:
            pictures=[update(f"{DOCS}/{_section}/{file}") for file in _pictures],
            page=update(f"{DOCS}/{_page}.md"),
        log:
            LOG(f"pages/{_name}"),
        threads: ALL_CORES if _name == "ranking" else 1  # nothing runs beside what is timed
        params:
            python=sys.executable,
            docs=lambda wildcards: DOCS,
            code=lambda wildcards, input: command_digest(input.command),
        shell:
            "{params.python} {input.command} --page {params.docs} > {log} 2>&1"


#: The files of each page by its name.
_FILLED = {page: getattr(rules, f"page_of_{Path(page).name}").output for page in (*_PAGES, *_MEASURED)}


rule pages:
    input:
        rules.pictures.input,
        [files for page, files in _FILLED.items() if page not in _OF_TIMES],


rule pages_of_times:  # on a machine that does nothing else
    input:
        [_FILLED[page] for page in _OF_TIMES if page in _FILLED],


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
            task=lambda wildcards: task(
                "nearharmonic_paper.claims.documents:verdicts",
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
