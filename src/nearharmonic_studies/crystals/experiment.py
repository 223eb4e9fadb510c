"""Declaration of the experiment on crystals."""

from nearharmonic_paper.tasks.experiment import Experiment
from nearharmonic_studies.crystals.settings import CrystalsSettings

EXPERIMENT = Experiment(
    name="crystals",
    title="Crystals",
    about="Energy error on argon, copper, silicon and a diatomic chain, against temperature and step size.",
    place=8,
    duration="8 min",
    settings=CrystalsSettings,
    effect="Runs of `crystals`",
    cubes={
        "crystals": (
            "crystal, temperature, integrator, forces, quantile",
            "energy errors in units of the mean kinetic energy, the leader and its lead, density of phonons, variation "
            "of the Hessian, drift, and averages with a thermostat",
        )
    },
    tables=("crystals",),
    figures={
        "crystals_error": "Energy error on crystals",
        "crystals_map": "The best method by temperature and step size",
        "crystals_phonons": "Phonons, and the windows of trained methods",
        "crystals_gain": "Gain of trained methods against anharmonicity",
        "crystals_long_runs": "Drift of the energy, and averages with a thermostat",
    },
    values=lambda config: {"crystal": config.crystals.crystals},
    runs=("crystals/errors_{crystal}", "crystals/drift_{crystal}", "crystals/averages"),
)
