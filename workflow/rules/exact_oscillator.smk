"""Henon-Heiles with an exactly solved oscillator compared with T + V: errors, crossings, and cost on this machine."""

EXACT_OSCILLATOR = {
    "split": CONFIG.stepwise,
    "exact": CONFIG.exact_oscillator.methods,
    "settings": CONFIG.exact_oscillator,
}
TWO_STEPS["exact_oscillator"] = {
    "run": RUN("exact_oscillator/trajectories"),
    "results": {"cube": CUBE("exact_oscillator"), "table": TABLE("exact_oscillator")},
    "logs": ("exact_oscillator/run", "exact_oscillator/errors"),
    "measure": lambda wildcards: task(
        "nearharmonic_paper.experiments.exact_oscillator.run:measure", **EXACT_OSCILLATOR
    ),
    "reduce": lambda wildcards: task(
        "nearharmonic_paper.experiments.exact_oscillator.reductions:reduce", **EXACT_OSCILLATOR
    ),
}


rule exact_oscillator_times:
    input:
        cube=CUBE("exact_oscillator"),
    output:
        table=TABLE("exact_oscillator_times"),
    log:
        LOG("exact_oscillator/times"),
    threads: ALL_CORES  # no other job runs during the timing
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.exact_oscillator.reductions:measure_times",
            exact=CONFIG.exact_oscillator.methods,
            settings=CONFIG.exact_oscillator,
        ),
    script:
        "../scripts/task.py"


rule exact_oscillator:
    input:
        FILES("exact_oscillator"),
        SHOWN("exact_oscillator"),
