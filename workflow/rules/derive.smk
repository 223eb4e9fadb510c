from nearharmonic.config import with_defaults

DERIVE = with_defaults(config, read_schema(Path(workflow.basedir) / "workflow/schemas/config.schema.yaml"))["derive"]
DERIVE_TABLES = [
    f"{RESULTS}/tables/{stem}.{suffix}"
    for stem in (
        "table4_derived",
        "derived_solutions",
        "derived_counts",
        "derived_families",
        "derived_orders",
        "derived_routes",
        "derived_errors",
    )
    for suffix in ("csv", "md", "tex")
]
DERIVE_FILES = [f"{RESULTS}/derived/coefficients.toml", *DERIVE_TABLES]


rule derive_coefficients:
    output:
        document=f"{RESULTS}/derived/coefficients.toml",
        tables=DERIVE_TABLES,
    log:
        f"{RESULTS}/logs/derive.log",
    params:
        settings=DERIVE,
        code=code_digest(
            "nearharmonic.derivation.tables", "nearharmonic.coefficient_table", "nearharmonic.render.table"
        ),
        coefficients=coefficients_digest(integrators.values()),
    script:
        "../scripts/derive.py"


rule derive:
    input:
        DERIVE_FILES,
