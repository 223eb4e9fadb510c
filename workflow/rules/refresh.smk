"""The claims and the page again, where they show files that a target has made anew."""


rule refresh:  # claims and page again, if they are there and older than the files of a target
    input:
        lambda wildcards: [path for path in getattr(rules, wildcards.target).input if path != SHOWN(wildcards.target)],
    output:
        touch(SHOWN("{target}")),
    log:
        LOG("shown/{target}"),
    wildcard_constraints:
        target="|".join({target for one in EXPERIMENTS.values() for target in (one.target, one.cubes_target)}),
    priority: -1  # they show what other jobs make
    threads: ALL_CORES
    params:
        # In this order: the page shows the claims.
        documents=lambda wildcards: [
            document(rules.decide_claims, LOG("tables/claims")) | {"task": claims_task()},
            document(rules.page, LOG("report")) | {"task": page_task()},
        ],
    script:
        "../scripts/refresh.py"


localrules:
    refresh,
