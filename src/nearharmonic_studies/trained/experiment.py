"""Declaration of the experiment on trained methods."""

from nearharmonic_paper.tasks.experiment import Experiment
from nearharmonic_studies.trained.settings import TrainedSettings

EXPERIMENT = Experiment(
    name="trained",
    title="Trained methods",
    about="Methods trained on near-harmonic systems, tested on systems outside the training.",
    cubes_target="trained_proof",
    place=5,
    duration="30 min",
    cubes_duration="3 min",
    settings=TrainedSettings,
    effect="Training of methods, and the problems on which they are compared",
    cubes={
        "trained": (
            "ensemble, integrator, point",
            "`mean_log_error` of all methods on problems that none was trained on, and the `gain` of the best trained "
            "method over the best published one",
        ),
        "trained_ideas": (
            "idea, tau_per_stage, strength",
            "`mean_log_error` of the best method of each idea over the strength of the anharmonicity, and the idea "
            "that leads",
        ),
    },
    tables=(
        "trained_gains",
        "trained_ideas",
        "trained_landscape_{purpose}",
        "trained_long",
        "trained_methods",
        "trained_times",
    ),
    figures={
        "trained_error": "Energy error on ensembles",
        "trained_gain": "Gain over the best published method",
        "trained_ideas": "Six ideas, by anharmonicity",
    },
    others=(
        "derived/trained_{purpose}.toml",
        "derived/trained.py",
        "derived/trained_exact.py",
        "derived/trained_polynomial.py",
    ),
    values=lambda config: {"purpose": config.trained.purposes},
    runs=("trained/proof", "trained/ideas", "trained/long"),
    measured=("tables/trained_times",),
)
