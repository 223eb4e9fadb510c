rule reduce:
    input:
        unpack(lambda wildcards: {name: run_files(wildcards.system, name) for name in CONFIG.integrators}),
    output:
        f"{RESULTS}/cubes/{{system}}.h5",
    log:
        f"{RESULTS}/logs/reduce/{{system}}.log",
    params:
        sweep=lambda wildcards: asdict(SWEEPS[wildcards.system]),
        integrators=CONFIG.integrators,
        code=lambda wildcards: code_of(wildcards.system, "reduce", "store"),
        methods=code_digest(*METHOD_MODULES),
        coefficients=coefficients_digest(integrators[name] for name in CONFIG.integrators),
    script:
        "../scripts/reduce.py"


rule decompose:
    output:
        f"{RESULTS}/cubes/sho_terms.h5",
    log:
        f"{RESULTS}/logs/reduce/sho_terms.log",
    params:
        integrators=CONFIG.decomposition,
        code=code_digest("nearharmonic.reduce", "nearharmonic.decomposition", "nearharmonic.store", *METHOD_MODULES),
        coefficients=coefficients_digest(integrators[name] for name in CONFIG.decomposition),
    script:
        "../scripts/decompose.py"
