"""Stress tests of the methods: three ensembles, each with one job per method and then a cube; and three other cubes."""

from nearharmonic_paper.experiments.stability.experiment import ENSEMBLES

TWO_STEPS["kinetic_energy"] = {
    "run": RUN("stability/kinetic_energy"),
    "results": {"cube": CUBE("kinetic_energy"), "table": TABLE("kinetic_energy")},
    "logs": ("stability/kinetic_energy_run", "stability/kinetic_energy"),
    "measure": lambda wildcards: task(
        "nearharmonic_paper.experiments.stability.run:kinetic_energy_measure", integrators=CONFIG.methods
    ),
    "reduce": lambda wildcards: task(
        "nearharmonic_paper.experiments.stability.reductions:kinetic_energy", integrators=CONFIG.methods
    ),
}


wildcard_constraints:
    ensemble="|".join(ENSEMBLES),


rule stability_compile:
    output:
        touch(f"{RESULTS}/logs/compile/stability_{{ensemble}}.done"),
    log:
        LOG("stability/{ensemble}/compile"),
    priority: 1  # all runs wait for these
    params:
        task=lambda wildcards: task("nearharmonic_paper.experiments.stability.run:warm_up", ensemble=wildcards.ensemble),
    script:
        "../scripts/task.py"


rule stability_run:
    input:
        f"{RESULTS}/logs/compile/stability_{{ensemble}}.done",
    output:
        run=RUN("stability/{ensemble}/{integrator}"),
    log:
        LOG("stability/{ensemble}/{integrator}"),
    wildcard_constraints:
        integrator="|".join(METHODS),
    params:
        task=lambda wildcards: task(
            f"nearharmonic_paper.experiments.stability.run:{wildcards.ensemble}_measure",
            integrator=wildcards.integrator,
            settings=getattr(CONFIG.stability, wildcards.ensemble),
        ),
    script:
        "../scripts/task.py"


rule stability_cube:
    input:
        **{name: RUN(f"stability/{{ensemble}}/{name}") for name in CONFIG.stepwise},
    output:
        cube=CUBE("stability_{ensemble}"),
        table=TABLE("stability_{ensemble}"),
    log:
        LOG("stability/{ensemble}"),
    params:
        task=lambda wildcards: task(
            f"nearharmonic_paper.experiments.stability.reductions:{wildcards.ensemble}",
            integrators=CONFIG.stepwise,
            settings=getattr(CONFIG.stability, wildcards.ensemble),
        ),
    script:
        "../scripts/task.py"


rule linear_stability_cube:
    output:
        cube=CUBE("linear_stability"),
        table=TABLE("linear_stability"),
    log:
        LOG("stability/linear"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.stability.reductions:linear", integrators=CONFIG.methods
        ),
    script:
        "../scripts/task.py"


rule stability:
    input:
        FILES("stability"),
        SHOWN("stability"),
