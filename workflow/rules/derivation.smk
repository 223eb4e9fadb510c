"""Derivation of coefficients: the sets of Table 4 from random starts, with proofs."""


rule derive_coefficients:
    output:
        document=f"{RESULTS}/derived/coefficients.toml",
        table4_derived=TABLE("table4_derived"),
        derived_solutions=TABLE("derived_solutions"),
        derived_counts=TABLE("derived_counts"),
        derived_families=TABLE("derived_families"),
        derived_orders=TABLE("derived_orders"),
        derived_routes=TABLE("derived_routes"),
        derived_errors=TABLE("derived_errors"),
    log:
        LOG("derive"),
    priority: 1  # the longest job on one core starts first, so that no core is idle at the end
    params:
        task=task("reproduction.experiments.derivation.run:derive", settings=CONFIG.derive),
    script:
        "../scripts/task.py"


rule derive:
    input:
        FILES("derivation"),
