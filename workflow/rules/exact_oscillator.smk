"""The oscillator of Henon-Heiles solved exactly beside T + V: errors and crossings, and what that costs here."""

from nearharmonic.reproduction.experiments.exact_oscillator import CUBES as EXACT_OSCILLATOR_CUBES

EXACT_OSCILLATOR_FIGURES = figures_of(
    "reproduction.experiments.exact_oscillator", CONFIG.systems, EXACT_OSCILLATOR_CUBES
)
FIGURES += EXACT_OSCILLATOR_FIGURES
RUNS.append(RUN("exact_oscillator/trajectories"))
EXACT_OSCILLATOR = {
    "split": CONFIG.stepwise,
    "exact": CONFIG.exact_oscillator.methods,
    "settings": CONFIG.exact_oscillator,
}


rule exact_oscillator_run:
    output:
        run=RUN("exact_oscillator/trajectories"),
    log:
        LOG("exact_oscillator/run"),
    params:
        task=task("reproduction.experiments.exact_oscillator.run:measure", **EXACT_OSCILLATOR),
    script:
        "../scripts/task.py"


rule exact_oscillator_cube:
    input:
        run=RUN("exact_oscillator/trajectories"),
    output:
        cube=CUBE("exact_oscillator"),
        table=TABLE("exact_oscillator"),
    log:
        LOG("exact_oscillator/errors"),
    params:
        task=task("reproduction.experiments.exact_oscillator.reduce:reduce", **EXACT_OSCILLATOR),
    script:
        "../scripts/task.py"


rule exact_oscillator_times:
    input:
        cube=CUBE("exact_oscillator"),
    output:
        table=TABLE("exact_oscillator_times"),
    log:
        LOG("exact_oscillator/times"),
    threads: ALL_CORES  # nothing runs beside what is timed
    params:
        task=task(
            "reproduction.experiments.exact_oscillator.times:measure",
            exact=CONFIG.exact_oscillator.methods,
            settings=CONFIG.exact_oscillator,
        ),
    script:
        "../scripts/task.py"


rule exact_oscillator:
    input:
        [CUBE(stem) for stem in EXACT_OSCILLATOR_CUBES],
        TABLE("exact_oscillator"),
        TABLE("exact_oscillator_times"),
        [FIGURE(one.stem) for one in EXACT_OSCILLATOR_FIGURES],
