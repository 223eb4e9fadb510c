"""Run time against error. One job does all measurements and uses all cores, so that no other job runs."""

from nearharmonic.systems import systems


rule work_precision_times:
    output:
        cube=CUBE("work_precision"),
    log:
        LOG("work_precision/times"),
    threads: ALL_CORES
    params:
        # Searched for only if the job is requested, so that other targets start sooner.
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.work_precision.run:measure",
            sweeps=CONFIG.sweeps,
            methods=CONFIG.work_precision.methods(CONFIG.methods),
            settings=CONFIG.work_precision,
            installed=installed(),
        ),
    script:
        "../scripts/task.py"


rule work_precision_figure:
    input:
        cube=CUBE("work_precision"),
    output:
        figure=shown("work_precision_{system}", "Timings", "run time against error, {system}"),
    log:
        LOG("work_precision/figure_{system}"),
    params:
        **LOOK,
        captions={
            "Timings": (
                "Error against the wall time of one trajectory on one core: largest and mean relative energy error, "
                "and error of the position at the end against the exact orbit. Left, the paper's methods; middle, "
                "methods beyond the paper; right, other libraries as their users use them (dashed). The broad pale "
                "line is the best of the paper's methods at each time, the dotted one the same for "
                "each trajectory of an ensemble. Times are the least of several repeats that took turns; "
                "they depend on the machine, which is named below."
            )
        },
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.work_precision.figures:work_precision", system=wildcards.system
        ),
    script:
        "../scripts/task.py"


rule work_precision_table:
    input:
        cube=CUBE("work_precision"),
    output:
        csv=f"{RESULTS}/tables/work_precision_{{system}}.csv",
        md=f"{RESULTS}/tables/work_precision_{{system}}.md",
    log:
        LOG("work_precision/table_{system}"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_paper.experiments.work_precision.tables:time_to_error", system=wildcards.system
        ),
    script:
        "../scripts/task.py"


# Files on all systems together, by the names of the results, and the function that makes them.
_TOGETHER = {
    "library_times_figures": (
        {"trajectory": FIGURE("library_times_trajectory"), "lanes": FIGURE("library_times_ensemble")},
        lambda: task(
            "nearharmonic_paper.experiments.work_precision.figures:comparison_figures", names=list(CONFIG.systems)
        ),
    ),
    "regularised_times_figure": (
        {"figure": FIGURE("regularised_times")},
        lambda: task(
            "nearharmonic_paper.experiments.work_precision.figures:regularised_figures",
            names=list(CONFIG.systems),
        ),
    ),
    "library_times_table": (
        {"table": TABLE("library_times")},
        lambda: task("nearharmonic_paper.experiments.work_precision.tables:comparison", names=list(CONFIG.systems)),
    ),
}

for _name, (_files, _made) in _TOGETHER.items():

    rule:
        name:
            _name
        input:
            cube=CUBE("work_precision"),
        output:
            **_files,
        log:
            LOG(f"work_precision/{_name}"),
        params:
            **LOOK,
            task=lambda wildcards, made=_made: made(),
        script:
            "../scripts/task.py"


# Drawn if a config has a regularised system.
_IS_DRAWN = any(systems[name].regularisation is not None for name in CONFIG.systems)
_LEFT_OUT = [] if _IS_DRAWN else FIGURE("regularised_times")


rule work_precision:
    input:
        [name for name in FILES("work_precision") if name not in _LEFT_OUT],
        SHOWN("work_precision"),
