"""Declaration of the timings."""

from nearharmonic_paper.experiments.work_precision import WorkPrecisionSettings
from nearharmonic_paper.tasks.experiment import Experiment

EXPERIMENT = Experiment(
    name="work_precision",
    title="Run time against error",
    about="Run time against error, compared with other libraries; it depends on the machine.",
    place=6,
    duration="6 min",
    settings=WorkPrecisionSettings,
    effect="Runs that `work_precision` times",
    cubes={
        "work_precision": (
            "solver, point, in a group for each system",
            "errors and measured times of each method and library, over its step sizes or tolerances",
        )
    },
    tables=("library_times",),
    figures={
        "library_times_trajectory": "One trajectory, beside other libraries",
        "library_times_ensemble": "Ensembles, beside other libraries",
        "work_precision_{system}": "Run time against error",
        "regularised_times": "Regularised Kepler problem",
    },
    others=("tables/work_precision_{system}.csv", "tables/work_precision_{system}.md"),
    measured=("cubes/work_precision", "tables/", "figures/"),
)
