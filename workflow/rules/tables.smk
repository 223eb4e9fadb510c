TABLE_FILES = [f"{RESULTS}/tables/skipped.csv"]


rule skipped:
    input:
        **{system: f"{RESULTS}/cubes/{system}.h5" for system in SWEEPS},
    output:
        f"{RESULTS}/tables/skipped.csv",
    log:
        f"{RESULTS}/logs/tables/skipped.log",
    params:
        config=asdict(CONFIG),
        code=code_digest("nearharmonic.tables", "nearharmonic.store", *METHOD_MODULES),
    script:
        "../scripts/skipped.py"


rule manifest:
    input:
        [path for system in SWEEPS for name in CONFIG.integrators for path in run_files(system, name)],
        expand("{results}/cubes/{cube}.h5", results=RESULTS, cube=[*SWEEPS, "sho_terms"]),
        FIGURE_FILES,
        TABLE_FILES,
    output:
        f"{RESULTS}/manifest.json",
    log:
        f"{RESULTS}/logs/manifest.log",
    script:
        "../scripts/manifest.py"
