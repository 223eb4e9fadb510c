"""Methods trained on near-harmonic systems: all methods on problems that were not used in training."""

from nearharmonic_studies.trained.settings import (
    contestants,
    exact_contestants,
    kind_of,
)

CONTESTANTS = contestants()
PROOF = {"methods": CONTESTANTS, "settings": CONFIG.trained.proof}
LONG = PROOF | {"methods": [name for name in CONTESTANTS if kind_of(name) == "trained"], "beside": "babps8o7h"}
IDEAS = PROOF | {"exact": exact_contestants(CONFIG.exact_oscillator.methods)}
TWO_STEPS["trained_proof"] = {
    "run": RUN("trained/proof"),
    "results": {
        "cube": CUBE("trained"),
        "gains": TABLE("trained_gains"),
        "methods": TABLE("trained_methods"),
    },
    "logs": ("trained/proof_run", "trained/proof"),
    "measure": lambda wildcards: task("nearharmonic_studies.trained.run:proof_measure", **PROOF),
    "reduce": lambda wildcards: task("nearharmonic_studies.trained.reductions:reduce_proof", **PROOF),
}
TWO_STEPS["trained_ideas"] = {
    "run": RUN("trained/ideas"),
    "results": {"cube": CUBE("trained_ideas"), "table": TABLE("trained_ideas")},
    "logs": ("trained/ideas_run", "trained/ideas"),
    "measure": lambda wildcards: task("nearharmonic_studies.trained.run:ideas_measure", **IDEAS),
    "reduce": lambda wildcards: task("nearharmonic_studies.trained.reductions:reduce_ideas", **IDEAS),
}
TWO_STEPS["trained_long"] = {
    "run": RUN("trained/long"),
    "results": {"table": TABLE("trained_long")},
    "logs": ("trained/long_run", "trained/long"),
    "measure": lambda wildcards: task("nearharmonic_studies.trained.run:long_runs_measure", **LONG),
    "reduce": lambda wildcards: task("nearharmonic_studies.trained.reductions:reduce_long_runs", **LONG),
}


rule trained_times_table:
    input:
        cube=CUBE("trained"),
    output:
        table=TABLE("trained_times"),
    log:
        LOG("trained/times"),
    threads: ALL_CORES  # no other job runs during the timing
    params:
        task=lambda wildcards: task("nearharmonic_studies.trained.run:measure_times", **PROOF),
    script:
        "../../scripts/task.py"


rule trained_proof:
    input:
        [name for name in FILES("trained", purpose=()) if not name.startswith(f"{RESULTS}/derived/")],
        SHOWN("trained_proof"),


rule trained:
    input:
        FILES("trained"),
        SHOWN("trained"),
