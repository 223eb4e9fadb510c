"""Methods trained on near-harmonic systems: the search for each purpose, and the modules that register what it finds."""

from nearharmonic.training.published import published_names
from nearharmonic.experiments.trained.purposes import PURPOSES

TRAINED_METHODS = expand(f"{RESULTS}/derived/trained_{{purpose}}.toml", purpose=CONFIG.trained.purposes)


def methods_before(wildcards):
    """What the search of a purpose begins with: the method of a window beside it, if that is trained as well."""
    after = PURPOSES[wildcards.purpose].after
    return [f"{RESULTS}/derived/trained_{after}.toml"] if after in CONFIG.trained.purposes else []


rule train:
    input:
        before=methods_before,
    output:
        document=f"{RESULTS}/derived/trained_{{purpose}}.toml",
        landscape=TABLE("trained_landscape_{purpose}"),
    log:
        LOG("trained/search_{purpose}"),
    wildcard_constraints:
        purpose="|".join(CONFIG.trained.purposes),
    params:
        task=lambda wildcards: task(
            "experiments.trained.search:train",
            purpose=wildcards.purpose,
            settings=CONFIG.trained.search,
            published=published_names(),
        ),
    script:
        "../scripts/task.py"


rule register_trained:
    input:
        documents=TRAINED_METHODS,
    output:
        plain=f"{RESULTS}/derived/trained.py",
        modified=f"{RESULTS}/derived/trained_modified.py",
    log:
        LOG("trained/registration"),
    params:
        task=task("experiments.trained.registration:register"),
    script:
        "../scripts/task.py"
