"""Methods trained on near-harmonic systems: the search for each purpose, and the modules that register the methods."""

from nearharmonic_studies.trained.settings import PURPOSES, trained_before

TRAINED_METHODS = expand(f"{RESULTS}/derived/trained_{{purpose}}.toml", purpose=CONFIG.trained.purposes)


rule train:
    input:
        # The method of a neighbouring window.
        before=lambda wildcards: expand(
            f"{RESULTS}/derived/trained_{{purpose}}.toml",
            purpose=trained_before(wildcards.purpose, CONFIG.trained.purposes),
        ),
    output:
        document=f"{RESULTS}/derived/trained_{{purpose}}.toml",
        landscape=TABLE("trained_landscape_{purpose}"),
    log:
        LOG("trained/search_{purpose}"),
    wildcard_constraints:
        purpose="|".join(CONFIG.trained.purposes),
    params:
        task=lambda wildcards: task(
            "nearharmonic_studies.trained.search:train",
            purpose=wildcards.purpose,
            settings=CONFIG.trained.search,
            known=PURPOSES[wildcards.purpose].known,
        ),
    script:
        "../../scripts/task.py"


rule register_trained:
    input:
        documents=TRAINED_METHODS,
    output:
        module=f"{RESULTS}/derived/trained.py",
        exact_module=f"{RESULTS}/derived/trained_exact.py",
        polynomial_module=f"{RESULTS}/derived/trained_polynomial.py",
    log:
        LOG("trained/registration"),
    params:
        task=lambda wildcards: task("nearharmonic_studies.trained.search:register"),
    script:
        "../../scripts/task.py"
