"""The experiment that a test adds."""

_ADDED = {"methods": CONFIG.methods, "settings": CONFIG.added}
TWO_STEPS["added"] = {
    "run": RUN("added/steps"),
    "results": {"cube": CUBE("added"), "table": TABLE("added")},
    "logs": ("added/run", "added/cube"),
    "measure": task("nearharmonic_paper.experiments.added.run:measure", **_ADDED),
    "reduce": task("nearharmonic_paper.experiments.added.reduce:reduce", **_ADDED),
}


rule added:
    input:
        FILES("added"),
        SHOWN("added"),
