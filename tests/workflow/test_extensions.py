"""Additions of a user take one place: a system, an observable, a figure, an experiment, the workflow as a module."""

import json
import shutil

import h5py
import pytest
import yaml

from support.projects.workflow_project import ROOT, TINY, Project

pytestmark = pytest.mark.slow

#: An experiment with all its parts: the folders of its source and of its tests.
ADDED = ROOT / "tests/support/projects/added"

QUARTIC = '''"""Quartic oscillator, H = (p^2 + q^2)/2 + q^4/4."""

from nearharmonic.systems.system import System


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

from nearharmonic.plotting.style import house_style, new_figure


@house_style
def positions(cube: Any) -> Any:
    """Draw the largest position."""
    drawn = new_figure(4, 3)
    drawn.subplots().plot(cube.tau_per_stage, cube.largest_position.sel(precision="double", integrator="ruth"))
    return drawn
'''
DECLARED = """    "positions": Figure(
        draw="nearharmonic_paper.experiments.paper.positions:positions",
        title="Positions",
        cube="quartic",
        caption="The largest position. Against the step size.",
    ),
"""
CONFIG = {
    "name": "added",
    "integrators": ["ruth", "aba864"],
    "systems": {"quartic": {"tau_per_stage": {"lowest": 0.025, "highest": 0.1, "points_per_decade": 4}}},
    "samples": 10,
    "added": {"steps": 3},
}


def insert(path, before, line):
    text = path.read_text(encoding="utf-8")
    assert text.count(before) == 1
    path.write_text(text.replace(before, f"{line}\n{before}"), encoding="utf-8")


def add_experiment(project):
    """Copy the folders of an experiment and of its tests into the project; include its rules in the Snakefile."""
    room = "src/nearharmonic_paper/experiments/added"
    shutil.copytree(ADDED / "source", project.folder / room)
    tests = project.folder / "tests/paper/experiments/added"
    shutil.copytree(ADDED / "tests", tests)
    (tests / "checks_of_added.py").rename(tests / "test_added.py")
    insert(project.folder / "Snakefile", 'include: "workflow/rules/two_steps.smk"', f'include: "{room}/rules.smk"')


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """The project with a system, an observable, a figure and an experiment more."""
    project = Project(tmp_path_factory.mktemp("extended"))
    package = project.folder / "src"
    (package / "nearharmonic/systems/quartic.py").write_text(QUARTIC, encoding="utf-8")
    with (package / "nearharmonic_paper/experiments/paper/reductions.py").open("a", encoding="utf-8") as file:
        file.write(REDUCTION)
    (package / "nearharmonic_paper/experiments/paper/positions.py").write_text(FIGURE, encoding="utf-8")
    declaring = package / "nearharmonic_paper/experiments/paper/experiment.py"
    insert(declaring, '    "{system}_energy_error": Figure(', DECLARED)
    add_experiment(project)
    (project.folder / "added.yaml").write_text(yaml.safe_dump(CONFIG))
    done = project.snakemake("quartic_energy_error", "added", "-j2", "--configfile", "added.yaml")
    assert done.returncode == 0, done.stdout
    return project.folder / "results/added"


def test_system_is_one_file_with_cube_and_energy_error_figure(extended):
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


def test_a_figure_of_a_cube_is_one_function_and_one_declaration(extended):
    assert (extended / "figures/positions.pdf").stat().st_size > 1000


def test_an_experiment_is_a_folder_and_one_line(extended):
    """Its settings, run, cube, table and figure."""
    header, *rows = (extended / "tables/added.csv").read_text().splitlines()
    assert header == "integrator,error"
    assert [row.partition(",")[0] for row in rows] == ["ruth", "aba864"]
    with h5py.File(extended / "cubes/added.h5") as cube:
        assert cube["energy_error"].shape == (2, 3)
    assert (extended / "figures/one_step.png").stat().st_size > 5000


def files_of(folder):
    """Texts of all files that one may edit, by name."""
    skipped = {"results", ".snakemake", "__pycache__", ".pytest_cache", ".hypothesis"}
    paths = (path for path in folder.rglob("*") if path.is_file() and not skipped & {*path.parts})
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def test_an_experiment_has_its_place_everywhere_by_its_declaration(tmp_path):
    """Section of the page, statement, tests of figures and targets; documents are generated."""
    project = Project(tmp_path / "project")
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("tests", "docs", "examples"):
        shutil.copytree(ROOT / name, project.folder / name, ignore=ignored)
    shutil.copy(ROOT / "README.md", project.folder)
    before = files_of(project.folder)
    add_experiment(project)
    after = files_of(project.folder)
    folders = ("src/nearharmonic_paper/experiments/added/", "tests/paper/experiments/added/")
    touched = {name for name in after if after[name] != before.get(name)}
    assert {name for name in touched if not name.startswith(folders)} == {"Snakefile"}
    assert project.python("-m", "nearharmonic_paper.config").returncode == 0
    generated = {name for name, text in files_of(project.folder).items() if text != after.get(name)}
    assert generated == {
        "docs/index.md",
        "docs/how_to/files.md",
        "config/README.md",
        "workflow/schemas/config.schema.yaml",
    }
    contracts = (
        "-n0", "-p", "no:cacheprovider", "tests/library/contract/test_experiments.py",
        "tests/library/contract/test_figures.py",
    )  # fmt: skip
    chosen = ("-k", "added or one_step or every or documents")
    done = project.python("-m", "pytest", *contracts, folders[1], *chosen)
    assert done.returncode == 0, done.stdout
    (project.folder / folders[1] / "example_cubes.py").unlink()
    missing = project.python("-m", "pytest", *contracts, "-k", "example")
    assert "1 failed" in missing.stdout
    with (project.folder / "config/tiny.yaml").open("a", encoding="utf-8") as config:
        config.write((ADDED / "tests/tiny.yaml").read_text())
    done = project.snakemake("added", "report", "-j2", *TINY)
    assert done.returncode == 0, done.stdout
    page = (project.results / "report.html").read_text(encoding="utf-8")
    assert '<h2 id="added">Added by a test</h2>' in page
    assert "Energy error after one step" in page
    claims = {one["id"]: one for one in json.loads((project.results / "tables/claims.json").read_text())}
    assert claims["added-small-steps"]["verdict"] == "holds"
    assert project.nearharmonic("verify", "tiny").returncode == 0


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
