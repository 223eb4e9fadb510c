# Run time against error. One job measures everything and holds all cores, so that nothing runs beside it.
from importlib.util import find_spec

from nearharmonic.peers import LIBRARIES
from nearharmonic.work_precision_settings import load_work_precision

try:
    TIMED = load_work_precision(config, read_schema(Path(workflow.basedir) / "workflow/schemas/config.schema.yaml"))
except NearharmonicError as error:
    raise WorkflowError(str(error)) from None

TIMED_METHODS = [*CONFIG.integrators, *TIMED.integrators]
WORK_PRECISION_FILES = expand(
    "{results}/{path}",
    results=RESULTS,
    path=[
        "cubes/work_precision.h5",
        *expand("figures/work_precision_{system}.{suffix}", system=SWEEPS, suffix=["pdf", "svg", "png"]),
        *expand("tables/work_precision_{system}.{suffix}", system=SWEEPS, suffix=["csv", "md"]),
    ],
)


rule work_precision_times:
    output:
        f"{RESULTS}/cubes/work_precision.h5",
    log:
        f"{RESULTS}/logs/work_precision/times.log",
    threads: workflow.cores
    params:
        sweeps=[asdict(sweep) for sweep in SWEEPS.values()],
        methods=TIMED_METHODS,
        settings=asdict(TIMED),
        # A library that is installed later on is to be timed as well.
        installed={library: find_spec(library) is not None for library in LIBRARIES},
        code=code_digest("nearharmonic.work_precision", "nearharmonic.store", *map(systems.module_of, SWEEPS)),
        coefficients=coefficients_digest([integrators[name] for name in TIMED_METHODS]),
    script:
        "../scripts/work_precision_times.py"


rule work_precision_figure:
    input:
        f"{RESULTS}/cubes/work_precision.h5",
    output:
        multiext(f"{RESULTS}/figures/work_precision_{{system}}", ".pdf", ".svg"),
        png=report(
            f"{RESULTS}/figures/work_precision_{{system}}.png",
            caption="../report/figure.rst",
            category="Timings",
            labels={"figure": "run time against error, {system}"},
        ),
    log:
        f"{RESULTS}/logs/work_precision/figure_{{system}}.log",
    params:
        caption=caption_of("work_precision"),
        code=lambda wildcards: code_of(wildcards.system, "render.work_precision", "work_precision", "store"),
    script:
        "../scripts/work_precision_figure.py"


rule work_precision_table:
    input:
        f"{RESULTS}/cubes/work_precision.h5",
    output:
        csv=f"{RESULTS}/tables/work_precision_{{system}}.csv",
        md=f"{RESULTS}/tables/work_precision_{{system}}.md",
    log:
        f"{RESULTS}/logs/work_precision/table_{{system}}.log",
    params:
        code=lambda wildcards: code_of(wildcards.system, "time_to_error", "work_precision", "store"),
    script:
        "../scripts/work_precision_table.py"
