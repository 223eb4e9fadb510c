rule compile:
    # Once for each system, so that the jobs that fan out find the kernels and do not compile them side by side.
    output:
        touch(f"{RESULTS}/logs/compile/{{system}}.done"),
    log:
        f"{RESULTS}/logs/compile/{{system}}.log",
    priority: 1  # all runs wait for these
    params:
        precisions=lambda wildcards: SWEEPS[wildcards.system].precision,
        code=lambda wildcards: code_of(wildcards.system, "batch"),
    script:
        "../scripts/compile.py"
