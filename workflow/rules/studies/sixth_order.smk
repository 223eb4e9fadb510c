"""Methods of order six with a harmonic order, which are not in the paper: search, ranking and measurements."""


rule search_sixth_order:
    output:
        **{stem: TABLE(stem) for stem in EXPERIMENTS["sixth_order"].tables},
        document=f"{RESULTS}/derived/sixth_order.toml",
    log:
        LOG("sixth_order"),
    priority: 2  # two cores are free together only at the start
    threads: 2
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.sixth_order.search:search", settings=CONFIG.beyond, integrators=CONFIG.methods
        ),
    script:
        "../../scripts/task.py"


rule sixth_order:
    input:
        FILES("sixth_order"),
        SHOWN("sixth_order"),


rule beyond:  # the former name of the target, which warns: record.smk
    input:
        rules.sixth_order.input,
