# Linear limits, structure, and T that is not quadratic: each a cube with tables, two of them with a figure.
from nearharmonic.kinetic_energy import SYSTEM as KINETIC_ENERGY_SYSTEM

METHODS_DIGEST = coefficients_digest(integrators[name] for name in CONFIG.integrators)
# Structure is measured on every system, over the intervals that the config gives or the systems have.
STRUCTURE_T_END = {name: SWEEPS[name].t_end if name in SWEEPS else systems[name].t_end for name in systems}


def tables_of(stem):
    """The files of one table."""
    return multiext(f"{RESULTS}/tables/{stem}", ".csv", ".md", ".tex")


rule linear_limits:
    output:
        cube=f"{RESULTS}/cubes/linear_stability.h5",
        table=tables_of("linear_stability"),
    log:
        f"{RESULTS}/logs/stability/linear_stability.log",
    params:
        integrators=CONFIG.integrators,
        code=code_digest("nearharmonic.linear_limits", "nearharmonic.render.table", "nearharmonic.store"),
        coefficients=METHODS_DIGEST,
    script:
        "../scripts/linear_limits.py"


rule structure:
    output:
        cube=f"{RESULTS}/cubes/structure.h5",
        table=tables_of("structure"),
    log:
        f"{RESULTS}/logs/stability/structure.log",
    params:
        integrators=CONFIG.integrators,
        t_end=STRUCTURE_T_END,
        code=code_digest(
            "nearharmonic.structure_cube",
            "nearharmonic.render.table",
            "nearharmonic.store",
            *map(systems.module_of, STRUCTURE_T_END),
        ),
        coefficients=METHODS_DIGEST,
    script:
        "../scripts/structure.py"


rule amplitudes:
    output:
        cube=f"{RESULTS}/cubes/kinetic_energy.h5",
        table=tables_of("kinetic_energy"),
    log:
        f"{RESULTS}/logs/stability/kinetic_energy.log",
    params:
        integrators=CONFIG.integrators,
        code=code_digest(
            "nearharmonic.kinetic_energy",
            "nearharmonic.render.table",
            "nearharmonic.store",
            systems.module_of(KINETIC_ENERGY_SYSTEM),
        ),
        coefficients=METHODS_DIGEST,
    script:
        "../scripts/amplitudes.py"


for _figure in ("linear_stability", "kinetic_energy"):

    rule:
        name:
            _figure
        input:
            f"{RESULTS}/cubes/{_figure}.h5",
        output:
            multiext(f"{RESULTS}/figures/{_figure}", ".pdf", ".svg"),
            png=report(
                f"{RESULTS}/figures/{_figure}.png",
                caption="../report/figure.rst",
                category="Stability",
                labels={"figure": _figure},
            ),
        log:
            f"{RESULTS}/logs/render/{_figure}.log",
        params:
            module=_figure,
            caption=caption_of(_figure),
            code=code_digest(f"nearharmonic.render.{_figure}", "nearharmonic.store"),
        script:
            "../scripts/render.py"


STABILITY_FILES += [
    *(f"{RESULTS}/cubes/{stem}.h5" for stem in ("linear_stability", "structure", "kinetic_energy")),
    *(path for stem in ("linear_stability", "structure", "kinetic_energy") for path in tables_of(stem)),
    *(
        path
        for stem in ("linear_stability", "kinetic_energy")
        for path in multiext(f"{RESULTS}/figures/{stem}", ".pdf", ".svg", ".png")
    ),
]
