rule integrate:
    input:
        compiled=f"{RESULTS}/logs/compile/{{system}}.done",
    output:
        f"{RESULTS}/runs/{{system}}/{{integrator}}/{{shard}}.h5",
    log:
        f"{RESULTS}/logs/integrate/{{system}}/{{integrator}}/{{shard}}.log",
    params:
        sweep=lambda wildcards: asdict(SWEEPS[wildcards.system]),
        code=lambda wildcards: code_of(wildcards.system, "integrate", "store"),
        coefficients=lambda wildcards: coefficients_digest([integrators[wildcards.integrator]]),
    script:
        "../scripts/integrate.py"
