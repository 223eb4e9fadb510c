"""Declaration of an experiment that a test adds to a copy of the project."""

from nearharmonic_paper.experiments.added.settings import AddedSettings

from nearharmonic_paper.tasks.experiment import Experiment, Figure

EXPERIMENT = Experiment(
    name="added",
    title="Added by a test",
    about="Energy errors of the oscillator after one step.",
    duration="1 s",
    settings=AddedSettings,
    effect="Steps that `added` takes",
    cubes={"added": ("integrator, tau", "`energy_error` after one step from q = 0, p = 1")},
    tables=("added",),
    figures={
        "one_step": Figure(
            draw="nearharmonic_paper.experiments.added.figure:one_step",
            title="Energy error after one step",
            cube="added",
            caption="Energy error of the oscillator after one step. Against the step size, each method.",
        )
    },
    runs=("added/steps",),
)
