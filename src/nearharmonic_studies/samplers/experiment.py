"""Declaration of the experiment on samplers."""

from nearharmonic_paper.tasks.experiment import Experiment, Figure
from nearharmonic_studies.samplers.settings import SamplersSettings

#: Title and caption of each figure.
_FIGURES = {
    "samplers_gaussian": (
        "Hamiltonian Monte Carlo on Gaussians",
        "Hamiltonian Monte Carlo on Gaussians with frequencies log-uniform over a decade, computed exactly. (A) Cost "
        "of a sample against dimension, at the best step size and length: gradients divided by the smallest mean "
        "squared jump of any mode, in units of twice its variance. (B) Gain over the first method.",
    ),
    "samplers_targets": (
        "Hamiltonian Monte Carlo on other targets",
        "Gain of methods over leapfrog in gradients per effective sample of the slowest observable, on targets that "
        "are not Gaussian. Bars are 95 % intervals over chains. Other chains chose the step size and the trajectory "
        "length of each method from a grid.",
    ),
    "samplers_trained": (
        "Gains of methods trained for Hamiltonian Monte Carlo",
        "Gain of methods trained for Hamiltonian Monte Carlo over the best of the other methods, with 95 % intervals. "
        "(A) Products of 1000 quartic oscillators of strength b, from starts outside the training. Methods of four "
        "stages are trained for one strength alone, and methods of three to five stages for the strengths 0.1, 0.5 and "
        "2 together. (B) The methods for three strengths on the other targets, by chains.",
    ),
}
FIGURES = {
    stem: Figure(
        draw=f"nearharmonic_studies.samplers.results:{stem}",
        title=title,
        cube="samplers",
        category="Beyond the paper",
        caption=caption,
    )
    for stem, (title, caption) in _FIGURES.items()
}

EXPERIMENT = Experiment(
    name="samplers",
    title="Samplers",
    about="Gradients per effective sample of Hamiltonian Monte Carlo, on Gaussians and on five other targets.",
    place=9,
    duration="8 min",
    settings=SamplersSettings,
    effect="Chains of `samplers`",
    cubes={
        "samplers": (
            "target, integrator, dimension",
            "gradients per effective sample, gains over leapfrog and over the best known method with intervals, "
            "acceptance, best step size and length; gains of methods that are trained for one strength",
        )
    },
    tables=("samplers",),
    figures=FIGURES,
    values=lambda config: {"family": config.samplers.families, "target": config.samplers.targets},
    runs=("samplers/trained_{family}", "samplers/limits", "samplers/gaussians", "samplers/chains_{target}"),
)
