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
            "Energy error against amplitude at equal numbers of force evaluations, Henon-Heiles system, for step "
            "sizes per stage as each panel says. Solid: the paper's methods, which split H into T and V. Dashed: "
            "methods for near-integrable systems and trained ones, with the oscillator solved exactly by rotations "
            "and the cubic terms in the kicks. Medians, over trajectories drawn from each energy surface, of the "
            "largest error at any step. Thin vertical lines: where a dashed curve crosses the best of the solid ones; "
            "the grey strips are their 95 % intervals. Left of its line, solving the oscillator exactly errs less."
        ),
    ),
    "exact_oscillator_charge": Figure(
        draw="nearharmonic_paper.experiments.exact_oscillator.figure:exact_oscillator_charge",
        title="Amplitude up to which the exact oscillator is ahead, against its cost",
        cube="exact_oscillator",
        category="Beyond the paper",
        caption=(
            "Amplitude up to which a method with the oscillator solved exactly errs less than the best of the paper's "
            "methods with T and V, against what an evaluation with the exact oscillator costs, relative to one of T "
            "and V; at a charge c its steps are c times as long. Bands are 95 % intervals. At charge 1 the two are "
            "compared by evaluations, at the ratio of their measured times by time: that ratio is in the table of "
            "times. A curve ends where the exact oscillator errs less at no amplitude."
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
            "latter is ahead, by what its step costs",
        )
    },
    tables=("exact_oscillator", "exact_oscillator_times"),
    figures=FIGURES,
    runs=("exact_oscillator/trajectories",),
    measured=("tables/exact_oscillator_times",),
)
