"""Declaration of the derivation."""

from nearharmonic_paper.experiments.derivation.settings import DerivationSettings
from nearharmonic_paper.tasks.experiment import Experiment

EXPERIMENT = Experiment(
    name="derivation",
    title="Derivation",
    about="Derivation of the coefficients of Table 4 from random starts, with proofs.",
    target="derive",
    place=1,
    duration="50 s",
    settings=DerivationSettings,
    key="derive",
    effect="Effort of the search of `derive` for Table 4",
    tables=(
        "table4_derived",
        "derived_counts",
        "derived_errors",
        "derived_families",
        "derived_orders",
        "derived_routes",
        "derived_solutions",
    ),
    others=("derived/coefficients.toml",),
)
