"""Derivation of coefficients: the sets of Table 4 from random starts, with proofs."""


rule derive_coefficients:
    output:
        **{stem: TABLE(stem) for stem in EXPERIMENTS["derivation"].tables},
        document=f"{RESULTS}/derived/coefficients.toml",
    log:
        LOG("derive"),
    priority: 1  # the longest job on one core starts first, so that no core is idle at the end
    params:
        task=lambda wildcards: task("nearharmonic_paper.experiments.derivation.run:derive", settings=CONFIG.derive),
    script:
        "../scripts/task.py"


rule derive:
    input:
        FILES("derivation"),
        SHOWN("derive"),
