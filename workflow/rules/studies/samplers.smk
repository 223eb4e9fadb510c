"""Hamiltonian Monte Carlo with each method: searches for coefficients, exact Gaussians, chains on each target, a cube."""

_SAMPLED = CONFIG.samplers.targets
_SEARCHES = [RUN(f"samplers/trained_{family}") for family in CONFIG.samplers.families]


rule samplers_search:
    output:
        run=RUN("samplers/trained_{family}"),
    log:
        LOG("samplers/trained_{family}"),
    wildcard_constraints:
        family="|".join(CONFIG.samplers.families),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.samplers.run:train",
            family=wildcards.family,
            settings=CONFIG.samplers,
        ),
    script:
        "../../scripts/task.py"


rule samplers_limits:
    input:
        trained=_SEARCHES,
    output:
        run=RUN("samplers/limits"),
    log:
        LOG("samplers/limits"),
    params:
        task=lambda wildcards: task("nearharmonic_studies.samplers.run:measure_limits", settings=CONFIG.samplers),
    script:
        "../../scripts/task.py"


rule samplers_gaussians:
    input:
        trained=_SEARCHES,
    output:
        run=RUN("samplers/gaussians"),
    log:
        LOG("samplers/gaussians"),
    params:
        task=lambda wildcards: task("nearharmonic_studies.samplers.run:gaussians", settings=CONFIG.samplers),
    script:
        "../../scripts/task.py"


rule samplers_chains:
    input:
        trained=_SEARCHES,
    output:
        run=RUN("samplers/chains_{target}"),
    log:
        LOG("samplers/chains_{target}"),
    wildcard_constraints:
        target="|".join(_SAMPLED),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.samplers.run:measure", target=wildcards.target, settings=CONFIG.samplers
        ),
    script:
        "../../scripts/task.py"


rule samplers_cube:
    input:
        gaussians=RUN("samplers/gaussians"),
        limits=RUN("samplers/limits"),
        chains=[RUN(f"samplers/chains_{one}") for one in _SAMPLED],
    output:
        cube=CUBE("samplers"),
        table=TABLE("samplers"),
    log:
        LOG("samplers/cube"),
    params:
        task=lambda wildcards: task("nearharmonic_studies.samplers.results:reduce", settings=CONFIG.samplers),
    script:
        "../../scripts/task.py"


rule samplers:
    input:
        FILES("samplers"),
        SHOWN("samplers"),
