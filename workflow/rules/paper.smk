"""The paper: runs, cubes, figures, and tables of coefficients and of omissions."""

PAPER = EXPERIMENTS["paper"]
PAPER_FIGURES = [one for one in FIGURES if one.experiment == PAPER.name]
PAPER_TABLES = {stem: TABLE(stem) for stem in PAPER.tables}
PAPER_CUBES = [CUBE(stem) for stem in (*SWEEPS, *PAPER.cubes) if stem in SWEEPS or stem in CUBES]
#: Run files and reduced files, so that a lost one is made again although the cubes are there.
PAPER_RUNS = list(
    dict.fromkeys(
        path
        for system in SWEEPS
        for files in (run_files(system), reduced_files(system))
        for paths in files.values()
        for path in paths
    )
)
TABLE_FILES = [f"{RESULTS}/tables/skipped.csv", *PAPER_TABLES.values()]


# On a cluster they run where Snakemake runs: each takes a few seconds.
localrules:
    skipped,
    paper_tables,


rule compile:
    # One job per system, so that later parallel jobs find the kernels and do not compile them again. What is common to
    # all systems is compiled by the first of these jobs, and the others wait for it.
    output:
        touch(f"{RESULTS}/logs/compile/{{system}}.done"),
    log:
        LOG("compile/{system}"),
    wildcard_constraints:
        system="|".join(SWEEPS),
    priority: 3  # all runs wait for these
    params:
        task=lambda wildcards: task(
            "nearharmonic.engine.trajectory:warm_up",
            system=wildcards.system,
            precisions=SWEEPS[wildcards.system].precision,
        ),
    script:
        "../scripts/task.py"


rule integrate:
    input:
        compiled,
    output:
        run=RUN("{system}/{integrator}/{shard}"),
    log:
        LOG("integrate/{system}/{integrator}/{shard}"),
    priority: 2  # cubes, claims and page wait for the last run; figures are drawn beside these
    params:
        # Without samples, a run file holds reduced numbers.
        task=lambda wildcards: (
            task("nearharmonic_paper.experiments.paper.run:integrate", **shard_of(wildcards))
            if CONFIG.samples
            else task("nearharmonic_paper.experiments.paper.reductions:integrate_and_reduce", **shard_of(wildcards))
        ),
        earlier="nearharmonic_paper.experiments.paper.earlier:Earlier",
    script:
        "../scripts/task.py"


rule reduce_method:
    input:
        runs=lambda wildcards: run_files(wildcards.system)[wildcards.integrator],
    output:
        reduced=f"{RESULTS}/reduced/{{system}}/{{integrator}}.h5",
    log:
        LOG("reduce/{system}/{integrator}"),
    priority: 2
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.reductions:reduce_method",
            sweep=SWEEPS[wildcards.system],
            integrator=wildcards.integrator,
        ),
    script:
        "../scripts/task.py"


rule reduce:
    input:
        unpack(lambda wildcards: reduced_files(wildcards.system)),
    output:
        cube=CUBE("{system}"),
    log:
        LOG("reduce/{system}"),
    wildcard_constraints:
        system="|".join(SWEEPS),  # other cubes have rules of their own
    priority: 2
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.reductions:reduce",
            sweep=SWEEPS[wildcards.system],
            integrators=CONFIG.methods,
        ),
    script:
        "../scripts/task.py"


rule decompose:
    output:
        cube=CUBE("sho_terms"),
    log:
        LOG("reduce/sho_terms"),
    priority: 2
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.tableaus:decompose", integrators=CONFIG.decomposed
        ),
    script:
        "../scripts/task.py"


rule skipped:
    input:
        **{system: CUBE(system) for system in SWEEPS},
    output:
        table=f"{RESULTS}/tables/skipped.csv",
    log:
        LOG("tables/skipped"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.run:omissions_table",
            sweeps=CONFIG.sweeps,
            integrators=CONFIG.methods,
        ),
    script:
        "../scripts/task.py"


rule paper_tables:
    output:
        **PAPER_TABLES,
    log:
        LOG("tables/paper_tables"),
    priority: 2  # the claims wait for it
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.paper.tableaus:paper_tables", integrators=CONFIG.compared
        ),
    script:
        "../scripts/task.py"


rule figures:
    input:
        [FIGURE(one.stem) for one in PAPER_FIGURES if one.by_default],


rule tables:
    input:
        TABLE_FILES,
