# Ensembles: Henon-Heiles energy surfaces, Kepler maps, growth of round-off. One job a method, then cube, table, figure.
from nearharmonic.stability.loading import load_stability

try:
    ENSEMBLES = load_stability(config, read_schema(Path(workflow.basedir) / "workflow/schemas/config.schema.yaml"))
except NearharmonicError as error:
    raise WorkflowError(str(error)) from None

# Ensemble -> the module that runs it, the system whose file it takes its formulas from, and its figure.
ENSEMBLE_MODULES = {
    "henon_heiles": ("henon_heiles_ensemble", "henon_heiles", "henon_heiles_stability"),
    "kepler": ("kepler_maps", "kepler", "kepler_stability"),
    "rounding": ("rounding_growth", "kepler", "rounding_growth"),
}


wildcard_constraints:
    ensemble="|".join(ENSEMBLE_MODULES),


def ensemble_code(ensemble):
    """Digest of the code that runs one ensemble."""
    runs, system, _ = ENSEMBLE_MODULES[ensemble]
    return code_digest(f"nearharmonic.stability.{runs}", "nearharmonic.store", systems.module_of(system))


rule stability_compile:
    output:
        touch(f"{RESULTS}/logs/compile/stability_{{ensemble}}.done"),
    log:
        f"{RESULTS}/logs/compile/stability_{{ensemble}}.log",
    priority: 1  # all runs wait for these
    params:
        module=lambda wildcards: ENSEMBLE_MODULES[wildcards.ensemble][0],
        code=lambda wildcards: ensemble_code(wildcards.ensemble),
    script:
        "../scripts/stability_compile.py"


rule stability_run:
    input:
        compiled=f"{RESULTS}/logs/compile/stability_{{ensemble}}.done",
    output:
        f"{RESULTS}/runs/stability/{{ensemble}}/{{integrator}}.h5",
    log:
        f"{RESULTS}/logs/stability/{{ensemble}}/{{integrator}}.log",
    params:
        module=lambda wildcards: ENSEMBLE_MODULES[wildcards.ensemble][0],
        settings=lambda wildcards: asdict(ENSEMBLES[wildcards.ensemble]),
        code=lambda wildcards: ensemble_code(wildcards.ensemble),
        coefficients=lambda wildcards: coefficients_digest([integrators[wildcards.integrator]]),
    script:
        "../scripts/stability_run.py"


rule stability_cube:
    input:
        **{name: f"{RESULTS}/runs/stability/{{ensemble}}/{name}.h5" for name in CONFIG.integrators},
    output:
        cube=f"{RESULTS}/cubes/stability_{{ensemble}}.h5",
        table=multiext(f"{RESULTS}/tables/stability_{{ensemble}}", ".csv", ".md", ".tex"),
    log:
        f"{RESULTS}/logs/stability/{{ensemble}}.log",
    params:
        settings=lambda wildcards: asdict(ENSEMBLES[wildcards.ensemble]),
        code=code_digest("nearharmonic.stability.cubes", "nearharmonic.render.table", "nearharmonic.store"),
        coefficients=coefficients_digest(integrators[name] for name in CONFIG.integrators),
    script:
        "../scripts/stability_cube.py"


for _ensemble, (_, _, _module) in ENSEMBLE_MODULES.items():
    _stem = f"{RESULTS}/figures/{_module}"
    STABILITY_FILES += multiext(_stem, ".pdf", ".svg", ".png")
    STABILITY_FILES += multiext(f"{RESULTS}/tables/stability_{_ensemble}", ".csv", ".md", ".tex")

    rule:
        name:
            _module
        input:
            f"{RESULTS}/cubes/stability_{_ensemble}.h5",
        output:
            multiext(_stem, ".pdf", ".svg"),
            png=report(f"{_stem}.png", caption="../report/figure.rst", category="Stability", labels={"figure": _module}),
        log:
            f"{RESULTS}/logs/render/{_module}.log",
        params:
            module=_module,
            caption=caption_of(_module),
            code=code_digest(f"nearharmonic.render.{_module}", "nearharmonic.store"),
        script:
            "../scripts/render.py"
