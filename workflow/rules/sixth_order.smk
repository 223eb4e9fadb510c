"""Beyond the paper: methods of order six with a harmonic order, searched for, ranked and measured."""


rule search_sixth_order:
    output:
        document=f"{RESULTS}/derived/sixth_order.toml",
        sixth_order_counts=TABLE("sixth_order_counts"),
        sixth_order_ranking=TABLE("sixth_order_ranking"),
        sixth_order_measured=TABLE("sixth_order_measured"),
    log:
        LOG("sixth_order"),
    priority: 2  # two cores are free together at the start, and then no more until the end
    threads: 2
    params:
        task=task("reproduction.experiments.sixth_order.run:search", settings=CONFIG.beyond, integrators=CONFIG.methods),
    script:
        "../scripts/task.py"


rule sixth_order:
    input:
        FILES("sixth_order"),


rule beyond:  # the target's former name
    input:
        rules.sixth_order.input,
