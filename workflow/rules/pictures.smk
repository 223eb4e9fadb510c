"""Pictures below docs/ of figures of the results, in few colours; those of another config are in its folder of results."""

DOCS = "docs" if CONFIG.name == "paper" else f"{RESULTS}/docs"
#: Figures that pages show as pictures of few colours, with the number of colours: the paper's six, the gain, and others.
_PAPERS = {one.stem: 20 for one in FIGURES if one.target in [f"fig{number}" for number in range(1, 7)]}
_ALL_OF = ("crystals", "exact_oscillator", "samplers", "trained")
_OTHERS = (*(stem for one in _ALL_OF for stem in EXPERIMENTS[one].figures), "henon_heiles_stability")
_GAIN = [one.stem for one in FIGURES if one.stem == "gain"]
_SHOWN = _PAPERS | dict.fromkeys((*_GAIN, *_OTHERS, "regularised_times"), 128)
#: The figure of the times on a page, which another computer would measure anew.
_OF_FILE = f"{RESULTS}/logs/pages/regularised_times.png"


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


for _stem, _colours in _SHOWN.items():

    rule:
        name:
            f"picture_of_{_stem}"
        input:
            figure=_OF_FILE if _stem == "regularised_times" else f"{RESULTS}/figures/{_stem}.png",
        output:
            picture=update(f"{DOCS}/results/{_stem}.png"),
        log:
            LOG(f"pages/{_stem}"),
        params:
            task=lambda wildcards, colours=_colours: task(
                "nearharmonic_paper.report.shown:few_colours", colours=colours
            ),
        script:
            "../scripts/task.py"


rule pictures:
    input:
        [f"{DOCS}/results/{stem}.png" for stem in _SHOWN],
