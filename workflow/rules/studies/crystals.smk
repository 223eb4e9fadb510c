"""Energy errors of methods on crystals: a job for each crystal, one for its long runs, one with a thermostat, a cube."""

from nearharmonic_studies.crystals.settings import AVERAGED, DRIFTING

_CRYSTALS = CONFIG.crystals.crystals


rule crystals_errors:
    output:
        run=RUN("crystals/errors_{crystal}"),
    log:
        LOG("crystals/errors_{crystal}"),
    wildcard_constraints:
        crystal="|".join(_CRYSTALS),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.crystals.run:measure",
            crystal=wildcards.crystal,
            names=CONFIG.crystals.methods,
            settings=CONFIG.crystals,
        ),
    script:
        "../../scripts/task.py"


rule crystals_drift:
    output:
        run=RUN("crystals/drift_{crystal}"),
    log:
        LOG("crystals/drift_{crystal}"),
    wildcard_constraints:
        crystal="|".join(_CRYSTALS),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.crystals.run:drift",
            crystal=wildcards.crystal,
            names=DRIFTING,
            settings=CONFIG.crystals,
        ),
    script:
        "../../scripts/task.py"


rule crystals_averages:
    output:
        run=RUN("crystals/averages"),
    log:
        LOG("crystals/averages"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.crystals.run:averages", names=AVERAGED, settings=CONFIG.crystals
        ),
    script:
        "../../scripts/task.py"


rule crystals_cube:
    input:
        averages=RUN("crystals/averages"),
        errors=[RUN(f"crystals/errors_{one}") for one in _CRYSTALS],
        drifts=[RUN(f"crystals/drift_{one}") for one in _CRYSTALS],
    output:
        cube=CUBE("crystals"),
        table=TABLE("crystals"),
    log:
        LOG("crystals/cube"),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.crystals.results:reduce",
            names=CONFIG.crystals.methods,
            settings=CONFIG.crystals,
        ),
    script:
        "../../scripts/task.py"


rule crystals:
    input:
        FILES("crystals"),
        SHOWN("crystals"),
