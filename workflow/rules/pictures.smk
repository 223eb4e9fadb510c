"""Pictures below docs/ of figures of the results, for light and dark pages; another config writes them to its folder of results."""

DOCS = "docs" if CONFIG.name == "paper" else f"{RESULTS}/docs"
#: Figures that pages show as pictures: the paper's six, the gain, and others.
_NUMBERED = [f"fig{number}" for number in range(1, 7)]
_PAPERS = [one.stem for one in FIGURES if one.stem == "gain" or one.target in _NUMBERED]
_ALL_OF = ("crystals", "exact_oscillator", "samplers", "trained")
_OTHERS = [stem for one in _ALL_OF for stem in EXPERIMENTS[one].figures]
_SHOWN = [*_PAPERS, *_OTHERS, "henon_heiles_stability", "regularised_times"]
#: The figure of the times on a page, which another computer would measure anew.
_OF_FILE = f"{RESULTS}/logs/pages/regularised_times.svg"


rule figure_of_regularised:
    input:
        times="docs/results/regularised.csv",
    output:
        figure=temp(_OF_FILE),
    log:
        LOG("pages/figure_of_regularised"),
    params:
        task=lambda wildcards: task("nearharmonic_paper.experiments.work_precision.figures:figure_of_file"),
    script:
        "../scripts/task.py"


for _stem in _SHOWN:

    rule:
        name:
            f"picture_of_{_stem}"
        input:
            figure=_OF_FILE if _stem == "regularised_times" else f"{RESULTS}/figures/{_stem}.svg",
        output:
            picture=update(f"{DOCS}/results/{_stem}.svg"),
        log:
            LOG(f"pages/{_stem}"),
        params:
            task=lambda wildcards: task("nearharmonic_paper.report.shown:on_page"),
        script:
            "../scripts/task.py"


rule pictures:
    input:
        [f"{DOCS}/results/{stem}.svg" for stem in _SHOWN],
