"""Declaration of the comparison of an oscillator solved exactly with T + V."""

from nearharmonic_paper.experiments.exact_oscillator import ExactOscillatorSettings
from nearharmonic_paper.tasks.experiment import Experiment, Figure

FIGURES = {
    "exact_oscillator_error": Figure(
        draw="nearharmonic_paper.experiments.exact_oscillator.figure:exact_oscillator_error",
        title="Energy error against amplitude",
        cube="exact_oscillator",
        category="Beyond the paper",
        caption=(
            "Energy error of the Hénon-Heiles system against amplitude, at equal numbers of force evaluations; the "
            "step size per stage is in each panel. Solid: the paper's methods, which split H into T and V. Dashed: "
            "methods for near-integrable systems and trained ones, with the oscillator solved exactly by rotations and "
            "the cubic terms in the kicks. A point is the median of the maximum error over trajectories drawn from an "
            "energy surface. Thin vertical lines: where a dashed curve crosses the best solid one, with 95 % intervals "
            "in grey. Left of its line, solving the oscillator exactly has the smaller error."
        ),
    ),
    "exact_oscillator_charge": Figure(
        draw="nearharmonic_paper.experiments.exact_oscillator.figure:exact_oscillator_charge",
        title="Amplitude up to which the exact oscillator is ahead, against its cost",
        cube="exact_oscillator",
        category="Beyond the paper",
        caption=(
            "Amplitude up to which a method that solves the oscillator exactly has a smaller error than the best of "
            "the paper's methods, which split H into T and V. The axis is its charge: the cost of its evaluation "
            "relative to one with T and V. At a charge c its steps are c times as long. Bands are 95 % intervals. "
            "Charge 1 compares by evaluations; the ratio of measured times compares by time. A curve ends where no "
            "amplitude favours the exact oscillator."
        ),
    ),
}

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
            "exact oscillator is ahead, by the cost of its step",
        )
    },
    tables=("exact_oscillator", "exact_oscillator_times"),
    figures=FIGURES,
    runs=("exact_oscillator/trajectories",),
    measured=("tables/exact_oscillator_times",),
)
