BEYOND = with_defaults(config, read_schema(Path(workflow.basedir) / "workflow/schemas/config.schema.yaml"))["beyond"]
BEYOND_TABLES = [
    f"{RESULTS}/tables/{stem}.{suffix}"
    for stem in ("sixth_order_counts", "sixth_order_ranking", "sixth_order_measured")
    for suffix in ("csv", "md", "tex")
]
BEYOND_FILES = [f"{RESULTS}/derived/sixth_order.toml", *BEYOND_TABLES]


rule search_sixth_order:
    output:
        document=f"{RESULTS}/derived/sixth_order.toml",
        tables=BEYOND_TABLES,
    log:
        f"{RESULTS}/logs/beyond.log",
    threads: 2
    params:
        settings=BEYOND,
        integrators=CONFIG.integrators,
        code=code_digest("nearharmonic.search.tables", "nearharmonic.search.registration", "nearharmonic.render.table"),
        coefficients=coefficients_digest(integrators[name] for name in CONFIG.integrators),
    script:
        "../scripts/beyond.py"


rule beyond:
    input:
        BEYOND_FILES,
