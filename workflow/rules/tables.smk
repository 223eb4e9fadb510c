PAPER_TABLES = multiext(
    f"{RESULTS}/tables/",
    *(
        f"{stem}.{suffix}"
        for stem in (
            "table1_structure",
            "table2_recursion",
            "table2_values",
            "table3_even_orders",
            "table4_coefficients",
            "integrators",
        )
        for suffix in ("csv", "md", "tex")
    ),
)
TABLE_FILES = [f"{RESULTS}/tables/skipped.csv", *PAPER_TABLES]


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


rule paper_tables:
    output:
        PAPER_TABLES,
    log:
        f"{RESULTS}/logs/tables/paper_tables.log",
    params:
        code=code_digest("nearharmonic.paper_tables", "nearharmonic.coefficient_table", "nearharmonic.render.table"),
        coefficients=coefficients_digest(integrators.values()),
    script:
        "../scripts/paper_tables.py"


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
