"""Additions of a user take one place: a system, an observable, a figure, an experiment, the workflow as a module."""

from __future__ import annotations

import h5py
import pytest
import yaml

from support.projects.workflow_project import Project

QUARTIC = '''"""Quartic oscillator, H = (p^2 + q^2)/2 + q^4/4."""

from nearharmonic.systems.definition.system import System


def V(q):
    (x,) = q
    return x * x / 2 + x**4 / 4


def grad_V(q):
    (x,) = q
    return (x + x**3,)


SYSTEM = System(
    name="quartic", label="quartic oscillator", V=V, grad_V=grad_V, q0=("1",), p0=("0",), t_end="20",
    units={"q": "1", "p": "1", "t": "1", "energy": "1"}, source="made up for this test",
)
'''
REDUCTION = '''

@reduction("q")
def largest_position(runs: xr.Dataset) -> xr.DataArray:
    """Largest |q| of the samples."""
    return abs(runs.q).max(["sample", "component"]).assign_attrs(described("largest |q| of the samples"))
'''
FIGURE = '''"""A figure of a cube that exists."""

from __future__ import annotations

from typing import Any

from nearharmonic.reproduction.tasks.declarations import figure
from nearharmonic.plotting.style import new_figure


@figure(cube="quartic", caption="The largest position. Against the step size.")
def positions(cube: Any) -> Any:
    """Draw the largest position."""
    drawn = new_figure(4, 3)
    drawn.subplots().plot(cube.tau_per_stage, cube.largest_position.sel(precision="double", integrator="ruth"))
    return drawn
'''
SETTINGS = '''"""What may be asked of the test."""

from __future__ import annotations

from dataclasses import dataclass

from nearharmonic.reproduction.experiments.entries import STRICT, setting, whole_from


@dataclass(frozen=True, kw_only=True)
class AddedSettings:
    """How often."""

    __pydantic_config__ = STRICT

    repeats: int = setting("How often", default=3, **whole_from(1))
'''
RUN = '''"""Numbers of the test."""

from __future__ import annotations

from nearharmonic.reproduction.experiments.added.settings import AddedSettings
from nearharmonic.output.table import Table


def count(settings: AddedSettings) -> dict[str, Table]:
    """Count."""
    return {"table": Table(header=("number",), rows=[(i,) for i in range(settings.repeats)], caption="Numbers.")}
'''
RULES = '''"""An experiment that was added."""


rule count_numbers:
    output:
        table=TABLE("added"),
    log:
        LOG("added"),
    params:
        task=task("reproduction.experiments.added.run:count", settings=CONFIG.added),
    script:
        "../scripts/task.py"


rule added:
    input:
        rules.count_numbers.output,
'''
CONFIG = {
    "name": "added",
    "integrators": ["ruth", "aba864"],
    "systems": {"quartic": {"tau_per_stage": {"lowest": 0.025, "highest": 0.1, "points_per_decade": 4}}},
    "samples": 10,
    "added": {"repeats": 2},
}


def insert(path, before, line):
    text = path.read_text(encoding="utf-8")
    assert text.count(before) == 1
    path.write_text(text.replace(before, f"{line}\n{before}"), encoding="utf-8")


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """The project with a system, an observable, a figure and an experiment more."""
    project = Project(tmp_path_factory.mktemp("extended"))
    package = project.folder / "src/nearharmonic"
    (package / "systems/quartic.py").write_text(QUARTIC, encoding="utf-8")
    with (package / "reproduction/experiments/paper/reductions.py").open("a", encoding="utf-8") as file:
        file.write(REDUCTION)
    (package / "reproduction/experiments/paper/figures/positions.py").write_text(FIGURE, encoding="utf-8")
    folder = package / "reproduction/experiments/added"
    folder.mkdir()
    for name, text in (("__init__", '"""Added."""\n'), ("settings", SETTINGS), ("run", RUN)):
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    (project.folder / "workflow/rules/added.smk").write_text(RULES, encoding="utf-8")
    # One line in config.py, with the import that it needs, and the include of the rule file.
    insert(
        package / "reproduction/config/config.py",
        "    derive: DerivationSettings",
        '    added: AddedSettings = setting("How `added` counts", default=AddedSettings)',
    )
    insert(
        package / "reproduction/config/config.py",
        "from nearharmonic.reproduction.experiments.derivation.settings",
        "from nearharmonic.reproduction.experiments.added.settings import AddedSettings",
    )
    insert(project.folder / "Snakefile", 'include: "workflow/rules/figures.smk"', 'include: "workflow/rules/added.smk"')
    (project.folder / "added.yaml").write_text(yaml.safe_dump(CONFIG))
    done = project.snakemake("quartic_energy_error", "added", "-j2", "--configfile", "added.yaml")
    assert done.returncode == 0, done.stdout
    return project.folder / "results/added"


def test_a_system_is_one_file_and_gets_its_cube_and_its_energy_error_figure(extended):
    with h5py.File(extended / "cubes/quartic.h5") as cube:
        assert cube["max_energy_error"].shape == (1, 2, 3)
        assert (cube["max_energy_error"][:] < 1).all()
    assert (extended / "figures/quartic_energy_error.png").stat().st_size > 5000


def test_an_observable_reaches_its_cube_by_one_function(extended):
    with h5py.File(extended / "cubes/quartic.h5") as cube:
        assert cube["largest_position"].shape == (1, 2, 3)
        assert cube["largest_position"].attrs["long_name"] == "largest |q| of the samples"
        # Energy is conserved well enough for the turning points to stay at 1.
        assert (abs(cube["largest_position"][:] - 1) < 0.05).all()


def test_a_figure_of_an_existing_cube_is_one_function(extended):
    assert (extended / "figures/positions.pdf").stat().st_size > 1000


def test_an_experiment_is_a_folder_a_rule_file_and_one_line_in_the_config(extended):
    assert (extended / "tables/added.csv").read_text() == "number\n0\n1\n"


@pytest.mark.slow
def test_another_workflow_takes_this_one_as_a_module(tmp_path):
    project = Project(tmp_path / "project")
    outer = tmp_path / "outer"
    outer.mkdir()
    config = {
        "name": "inner", "integrators": ["ruth"], "samples": 5,
        "systems": {"sho": {"t_end": 5, "tau_per_stage": {"lowest": 0.1, "highest": 1, "points_per_decade": 2}}},
    }  # fmt: skip
    (outer / "Snakefile").write_text(
        f"module nearharmonic:\n    snakefile: {str(project.folder / 'Snakefile')!r}\n    config: {config!r}\n\n"
        "use rule * from nearharmonic as inner_*\n\n"
        "rule mine:\n    default_target: True\n    input: 'results/inner/cubes/sho.h5'\n"
    )
    project.folder = outer
    done = project.snakemake("mine", "-j1")
    assert done.returncode == 0, done.stdout
    assert (outer / "results/inner/cubes/sho.h5").is_file()
