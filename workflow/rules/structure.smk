"""Symplecticity, reversibility and drift of the energy, measured on every autonomous system."""

from nearharmonic_paper.experiments.stability.experiment import intervals

STRUCTURE_T_END = intervals(CONFIG)


wildcard_constraints:
    autonomous="|".join(STRUCTURE_T_END),


rule structure_run:
    output:
        run=RUN("stability/structure/{autonomous}"),
    log:
        LOG("stability/structure/{autonomous}"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.stability.run:conservation_measure",
            system=wildcards.autonomous,
            integrators=CONFIG.stepwise,
            t_end=STRUCTURE_T_END[wildcards.autonomous],
        ),
    script:
        "../scripts/task.py"


rule structure_cube:
    input:
        runs=[RUN(f"stability/structure/{name}") for name in STRUCTURE_T_END],
    output:
        cube=CUBE("structure"),
        table=TABLE("structure"),
    log:
        LOG("stability/conservation"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.stability.reductions:structure",
            integrators=CONFIG.stepwise,
            t_end=STRUCTURE_T_END,
        ),
    script:
        "../scripts/task.py"
