"""Methods trained on near-harmonic systems: all methods on problems that none was trained on, and what they show."""

from nearharmonic.reproduction.experiments.trained import CUBES as TRAINED_CUBES
from nearharmonic.reproduction.experiments.trained.comparison.contestants import contestants, kind_of

CONTESTANTS = contestants()
TRAINED_FIGURES = figures_of("reproduction.experiments.trained", CONFIG.systems, TRAINED_CUBES)
FIGURES += TRAINED_FIGURES
RUNS += [RUN("trained/proof"), RUN("trained/ideas"), RUN("trained/long")]
PROOF = {"methods": CONTESTANTS, "settings": CONFIG.trained.proof}
LONG = PROOF | {"methods": [name for name in CONTESTANTS if kind_of(name) == "trained"], "beside": "babps8o7h"}


rule trained_proof_run:
    output:
        run=RUN("trained/proof"),
    log:
        LOG("trained/proof_run"),
    params:
        task=task("reproduction.experiments.trained.proof.run:measure", **PROOF),
    script:
        "../scripts/task.py"


rule trained_proof_cube:
    input:
        run=RUN("trained/proof"),
    output:
        cube=CUBE("trained"),
        gains=TABLE("trained_gains"),
        methods=TABLE("trained_methods"),
    log:
        LOG("trained/proof"),
    params:
        task=task("reproduction.experiments.trained.proof.reduce:reduce", **PROOF),
    script:
        "../scripts/task.py"


rule trained_ideas_run:
    output:
        run=RUN("trained/ideas"),
    log:
        LOG("trained/ideas_run"),
    params:
        task=task("reproduction.experiments.trained.ideas.run:measure", exact=CONFIG.exact_oscillator.methods, **PROOF),
    script:
        "../scripts/task.py"


rule trained_ideas_cube:
    input:
        run=RUN("trained/ideas"),
    output:
        cube=CUBE("trained_ideas"),
        table=TABLE("trained_ideas"),
    log:
        LOG("trained/ideas"),
    params:
        task=task(
            "reproduction.experiments.trained.ideas.reduce:reduce", exact=CONFIG.exact_oscillator.methods, **PROOF
        ),
    script:
        "../scripts/task.py"


rule trained_long_run:
    output:
        run=RUN("trained/long"),
    log:
        LOG("trained/long_run"),
    params:
        task=task("reproduction.experiments.trained.long_runs.run:measure", **LONG),
    script:
        "../scripts/task.py"


rule trained_long_table:
    input:
        run=RUN("trained/long"),
    output:
        table=TABLE("trained_long"),
    log:
        LOG("trained/long"),
    params:
        task=task("reproduction.experiments.trained.long_runs.reduce:reduce", **LONG),
    script:
        "../scripts/task.py"


rule trained_times_table:
    input:
        cube=CUBE("trained"),
    output:
        table=TABLE("trained_times"),
    log:
        LOG("trained/times"),
    threads: ALL_CORES  # nothing runs beside what is timed
    params:
        task=task("reproduction.experiments.trained.proof.times:measure", **PROOF),
    script:
        "../scripts/task.py"


rule trained_proof:
    input:
        [CUBE(stem) for stem in TRAINED_CUBES],
        [TABLE(f"trained_{stem}") for stem in ("gains", "methods", "ideas", "long", "times")],
        [FIGURE(one.stem) for one in TRAINED_FIGURES],


rule trained:
    input:
        TRAINED_METHODS,
        rules.register_trained.output,
        [TABLE(f"trained_landscape_{purpose}") for purpose in CONFIG.trained.purposes],
        rules.trained_proof.input,
