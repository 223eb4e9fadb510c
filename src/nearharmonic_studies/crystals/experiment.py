"""Declaration of the experiment on crystals."""

from nearharmonic_paper.tasks.experiment import Experiment, Figure
from nearharmonic_studies.crystals.settings import CrystalsSettings

#: Title and caption of each figure.
_FIGURES = {
    "crystals_error": (
        "Energy error on crystals",
        "Energy error on crystals against force evaluations per period of the fastest phonon. Columns are crystals, "
        "rows are temperatures relative to the melting point. Curves are medians over equilibrated starts of the "
        "maximum error, in units of the mean kinetic energy. A curve ends where a run diverges.",
    ),
    "crystals_map": (
        "Best method by temperature and step size",
        "The kind of method with the smallest maximum energy error, by temperature relative to the melting point and "
        "force evaluations per period of the fastest phonon. Numbers and depth of colour are its lead over the best "
        "method of another kind, in decades. Blank: every method has an error above a tenth of the mean kinetic "
        "energy.",
    ),
    "crystals_phonons": (
        "Phonons and the windows of trained methods",
        "Above: density of phonons of each crystal at rest, over frequency divided by the highest. Below: the windows "
        "of step sizes for which methods were trained, as frequency times step size per stage. Grey bands: the upper "
        "half of the frequencies of a crystal, at a given number of force evaluations per period of the fastest "
        "phonon.",
    ),
    "crystals_gain": (
        "Gain of trained methods against anharmonicity",
        "Gain of the best trained method over the best general one, in decades of the maximum energy error, against "
        "the variation of the Hessian along the trajectory. A point is a crystal at a temperature, for one of two "
        "numbers of force evaluations per period of the fastest phonon.",
    ),
    "crystals_long_runs": (
        "Drift of the energy and averages with a thermostat",
        "Above: drift of the energy, by a straight line fitted over a long run of a small crystal, in units of the "
        "mean kinetic energy. A point is a start. Below: mean potential energy of a chain with friction and noise, "
        "relative to a harmonic crystal, at equal numbers of force evaluations. Bars are standard errors. Friction and "
        "noise act in the middle of a step (B; leapfrog is then BAOAB) or at both ends (C).",
    ),
}
FIGURES = {
    stem: Figure(
        draw=f"nearharmonic_studies.crystals.results:{stem}",
        title=title,
        cube="crystals",
        category="Beyond the paper",
        caption=caption,
    )
    for stem, (title, caption) in _FIGURES.items()
}

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
    figures=FIGURES,
    values=lambda config: {"crystal": config.crystals.crystals},
    runs=("crystals/errors_{crystal}", "crystals/drift_{crystal}", "crystals/averages"),
)
