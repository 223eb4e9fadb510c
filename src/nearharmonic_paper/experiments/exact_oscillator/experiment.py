"""Declaration of the comparison of an oscillator solved exactly with T + V."""

from nearharmonic_paper.experiments.exact_oscillator.settings import ExactOscillatorSettings
from nearharmonic_paper.tasks.experiment import Experiment

EXPERIMENT = Experiment(
    name="exact_oscillator",
    title="Oscillator solved exactly",
    about="Energy error against amplitude, for the splitting T + V and for an exactly solved oscillator.",
    place=3,
    duration="20 s",
    settings=ExactOscillatorSettings,
    effect="Runs of `exact_oscillator`, which are compared with T and V",
    cubes={
        "exact_oscillator": (
            "tau_per_stage, integrator, energy, exact_integrator, charge",
            "energy errors with T and V and with the oscillator solved exactly; `crossing`, the energy up to which the "
            "latter is ahead, by what its step costs",
        )
    },
    tables=("exact_oscillator", "exact_oscillator_times"),
    figures={
        "exact_oscillator_error": "Energy error against amplitude",
        "exact_oscillator_charge": "Amplitude up to which the exact oscillator is ahead, against its cost",
    },
    runs=("exact_oscillator/trajectories",),
    measured=("tables/exact_oscillator_times",),
)
