"""Declaration of the experiment on trained methods."""

from nearharmonic_paper.tasks.experiment import Experiment, Figure
from nearharmonic_studies.trained.settings import TrainedSettings

#: Title, caption and cube of each figure.
_FIGURES = {
    "trained_error": (
        "Energy error on ensembles",
        "trained",
        "Energy error against the step size per force evaluation, in radians of the fastest small oscillation, on "
        "problems outside the training. Curves are means, over the problems of an ensemble, of the maximum error at "
        "any step. Grey: range of all published methods of the registry. Blue: the best published method at each step "
        "size. Orange: the best trained method, named by the marker. The area between them is orange where trained "
        "methods have smaller errors, blue where published ones do. The strength of a random potential measures its "
        "anharmonicity.",
    ),
    "trained_gain": (
        "Gain over the best published method",
        "trained",
        "Gain of the best trained method over the best published one at equal cost, in decades of the mean energy "
        "error, against the step size per force evaluation in radians of the fastest small oscillation. Above 0 the "
        "trained method has the smaller error. Bands are 95 % intervals by resampling the problems, with the best "
        "methods chosen anew each time. The strength of a random potential measures its anharmonicity.",
    ),
    "trained_ideas": (
        "Six ideas, by anharmonicity",
        "trained_ideas",
        "Gains of six ideas on random potentials of two coordinates, from almost harmonic to strongly anharmonic, at "
        "equal cost. Above: gain of the best method of each idea over the best general method, in decades of the mean "
        "energy error, against the variation of the Hessian along the orbits. Bands are 95 % intervals over the "
        "potentials. Below: the leading idea at each anharmonicity and step size, among all ideas and among those with "
        "the splitting T + V. Numbers and depth of colour are its lead over the second in decades. An evaluation with "
        "the oscillator solved exactly is charged its longer time. The smallest errors, at small anharmonicities and "
        "step sizes, are rounding.",
    ),
}
FIGURES = {
    stem: Figure(
        draw=f"nearharmonic_studies.trained.page:{stem}",
        title=title,
        cube=cube,
        category="Beyond the paper",
        caption=caption,
    )
    for stem, (title, cube, caption) in _FIGURES.items()
}

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
    figures=FIGURES,
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
