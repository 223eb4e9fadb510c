"""Declaration of the stress tests."""

from typing import Any

from nearharmonic.systems import systems
from nearharmonic_paper.experiments.stability.settings import StabilitySettings
from nearharmonic_paper.tasks.experiment import Experiment

ENSEMBLES = ("henon_heiles", "kepler", "rounding")


def intervals(config: Any) -> dict[str, str]:
    """Return the end of the interval of each autonomous system: that of the config, or else that of the system.

    A regularised system is integrated in another phase space than that of its states, and left out.
    """
    own = {n: one.t_end for n, one in systems.items() if not one.time_dependent and one.regularisation is None}
    return own | {sweep.system: sweep.t_end for sweep in config.sweeps if sweep.system in own}


EXPERIMENT = Experiment(
    name="stability",
    title="Stability",
    about="Linear limits, ensembles, Kepler maps, round-off growth, structure, T not quadratic.",
    place=4,
    duration="70 s",
    settings=StabilitySettings,
    effect="Stress tests of the methods by `stability`",
    cubes={
        "linear_stability": (
            "integrator, tau_per_stage, gap",
            "`half_trace` of the oscillator's step matrix; `start` and `end` of the gaps in which a method is "
            "unstable, and the growth in them",
        ),
        "structure": (
            "system, integrator",
            "symplectic defect of the tangent map, distance from the start after a run and the run back, and drift of "
            "the energy, each beside what rounding gives",
        ),
        "kinetic_energy": (
            "roles, amplitude, integrator, tau_per_stage",
            "energy errors of the relativistic oscillator, with the roles of drift and kick exchanged as well",
        ),
        "stability_henon_heiles": (
            "integrator, energy, tau_per_stage, quantile",
            "`energy_error` and share `escaped` of ensembles on energy surfaces; `trusted_up_to`, the step size up to "
            "which at most 1 % escape",
        ),
        "stability_kepler": (
            "integrator, tau_per_stage, eccentricity",
            "`energy_error`, `perihelion_advance` and `orbits_kept` of Kepler orbits; `evaluations_for_contour`, the "
            "cost of an error of 10⁻⁶",
        ),
        "stability_rounding": (
            "integrator, source, orbit, sample",
            "`energy_error` and `lag` by rounding alone, their root mean squares, and exponents of their growth",
        ),
    },
    tables=(
        "linear_stability",
        "stability_henon_heiles",
        "stability_kepler",
        "stability_rounding",
        "structure",
        "kinetic_energy",
    ),
    figures={
        "linear_stability": "Linear stability",
        "henon_heiles_stability": "Ensembles on energy surfaces of Hénon and Heiles",
        "kepler_stability": "Kepler orbits by eccentricity",
        "rounding_growth": "Growth of rounding errors",
        "kinetic_energy": "A kinetic energy that is not quadratic",
    },
    values=lambda config: {
        "ensemble": ENSEMBLES,
        "integrator": config.stepwise,
        "autonomous": intervals(config),
    },
    runs=("stability/{ensemble}/{integrator}", "stability/structure/{autonomous}", "stability/kinetic_energy"),
)
