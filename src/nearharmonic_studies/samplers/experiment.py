"""Declaration of the experiment on samplers."""

from nearharmonic_paper.tasks.experiment import Experiment
from nearharmonic_studies.samplers.settings import SamplersSettings

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
    figures={
        "samplers_gaussian": "Hamiltonian Monte Carlo on Gaussians",
        "samplers_targets": "Hamiltonian Monte Carlo on other targets",
        "samplers_trained": "Gains of methods trained for Hamiltonian Monte Carlo",
    },
    values=lambda config: {"family": config.samplers.families, "target": config.samplers.targets},
    runs=("samplers/trained_{family}", "samplers/limits", "samplers/gaussians", "samplers/chains_{target}"),
)
