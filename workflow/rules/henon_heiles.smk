"""Long orbits of the Henon-Heiles system: Lyapunov exponents, and panel D of figure 6 outside its plane."""


rule chaos:
    output:
        cube=CUBE("henon_heiles_chaos"),
    log:
        LOG("reduce/henon_heiles_chaos"),
    priority: 2  # the claims wait for it
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.orbits:chaos", integrator="babps8o7h", t_end=200_000
        ),
    script:
        "../scripts/task.py"


rule displaced:
    output:
        cube=CUBE("substeps_displaced"),
    log:
        LOG("reduce/substeps_displaced"),
    priority: 2  # the claims wait for it
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.orbits:displaced", integrator="babs7o7h", iterations=100_000
        ),
    script:
        "../scripts/task.py"
