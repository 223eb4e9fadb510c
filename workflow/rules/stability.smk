"""Limits of trust in the methods: three ensembles, one job a method and then a cube; and three cubes beside them."""

from nearharmonic.reproduction.experiments.stability import CUBES as STABILITY_CUBES
from nearharmonic.systems import systems

ENSEMBLES = ("henon_heiles", "kepler", "rounding")
STABILITY_FIGURES = figures_of("reproduction.experiments.stability", CONFIG.systems, STABILITY_CUBES)
FIGURES += STABILITY_FIGURES
RUNS += expand(RUN("stability/{ensemble}/{name}"), ensemble=ENSEMBLES, name=CONFIG.stepwise)
RUNS.append(RUN("stability/kinetic_energy"))

# Structure is measured on every autonomous system, over the interval that the config gives or the system has.
# The phase space in which a regularised system is integrated is not that of its states.
STRUCTURE_T_END = {
    name: system.t_end
    for name, system in systems.items()
    if not system.time_dependent and system.regularisation is None
}
STRUCTURE_T_END |= {sweep.system: sweep.t_end for sweep in CONFIG.sweeps if sweep.system in STRUCTURE_T_END}
STRUCTURE_RUNS = [RUN(f"stability/structure/{name}") for name in STRUCTURE_T_END]
RUNS += STRUCTURE_RUNS


wildcard_constraints:
    ensemble="|".join(ENSEMBLES),
    autonomous="|".join(STRUCTURE_T_END),


rule stability_compile:
    output:
        touch(f"{RESULTS}/logs/compile/stability_{{ensemble}}.done"),
    log:
        LOG("stability/{ensemble}/compile"),
    priority: 1  # all runs wait for these
    resources:
        compiler=1,  # as in the rule compile
    params:
        task=lambda wildcards: task(f"reproduction.experiments.stability.{wildcards.ensemble}.run:warm_up"),
    script:
        "../scripts/task.py"


rule stability_run:
    input:
        f"{RESULTS}/logs/compile/stability_{{ensemble}}.done",
    output:
        run=RUN("stability/{ensemble}/{integrator}"),
    log:
        LOG("stability/{ensemble}/{integrator}"),
    params:
        task=lambda wildcards: task(
            f"reproduction.experiments.stability.{wildcards.ensemble}.run:measure",
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
            f"reproduction.experiments.stability.{wildcards.ensemble}.reduce:reduce",
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
        task=task("reproduction.experiments.stability.linear.run:measure", integrators=CONFIG.methods),
    script:
        "../scripts/task.py"


rule structure_run:
    output:
        run=RUN("stability/structure/{autonomous}"),
    log:
        LOG("stability/structure/{autonomous}"),
    params:
        task=lambda wildcards: task(
            "reproduction.experiments.stability.conservation.run:measure",
            system=wildcards.autonomous,
            integrators=CONFIG.stepwise,
            t_end=STRUCTURE_T_END[wildcards.autonomous],
        ),
    script:
        "../scripts/task.py"


rule structure_cube:
    input:
        runs=STRUCTURE_RUNS,
    output:
        cube=CUBE("structure"),
        table=TABLE("structure"),
    log:
        LOG("stability/conservation"),
    params:
        task=task(
            "reproduction.experiments.stability.conservation.reduce:reduce",
            integrators=CONFIG.stepwise,
            t_end=STRUCTURE_T_END,
        ),
    script:
        "../scripts/task.py"


rule kinetic_energy_run:
    output:
        run=RUN("stability/kinetic_energy"),
    log:
        LOG("stability/kinetic_energy_run"),
    params:
        task=task("reproduction.experiments.stability.kinetic_energy.run:measure", integrators=CONFIG.methods),
    script:
        "../scripts/task.py"


rule kinetic_energy_cube:
    input:
        run=RUN("stability/kinetic_energy"),
    output:
        cube=CUBE("kinetic_energy"),
        table=TABLE("kinetic_energy"),
    log:
        LOG("stability/kinetic_energy"),
    params:
        task=task("reproduction.experiments.stability.kinetic_energy.reduce:reduce", integrators=CONFIG.methods),
    script:
        "../scripts/task.py"


rule stability:
    input:
        [CUBE(stem) for stem in STABILITY_CUBES],
        [TABLE(stem) for stem in STABILITY_CUBES],
        [FIGURE(one.stem) for one in STABILITY_FIGURES],
