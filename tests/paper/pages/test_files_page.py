"""The page on files: its tables of variables are those of files made now, and blocks in other languages read them."""

from __future__ import annotations

import re

import pytest

from nearharmonic.engine.settings import Sweep, steps_of
from nearharmonic.output import store
from nearharmonic.output.dataset import assembled
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.paper.grid.plan import Run
from nearharmonic_paper.experiments.paper.reduce import STATES, cube_of, numbers_of
from nearharmonic_paper.experiments.paper.run import integrate_run
from nearharmonic_paper.pages.how_to.variables import ATTRIBUTES
from support.projects.workflow_project import ROOT

PAGE = (ROOT / "docs/how_to/files.md").read_text(encoding="utf-8")
#: End of the interval and step sizes per stage of a small run of each system.
SMALL = {"sho": ("5", (0.05, 0.1, 0.2)), "kepler": ("8766", (2.0, 4.0, 8.0))}
#: Units of Kepler's problem by the words of the tables.
OF_KEPLER = {f"unit of {name}": unit for name, unit in systems["kepler"].units.items()}


def rows(name):
    """Cells of a table between its marks."""
    part = re.search(rf"<!-- {name} -->\n(.*?)<!-- end -->", PAGE, flags=re.DOTALL)[1]
    lines = [line for line in part.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Runs and cubes of two systems as they are in their files, by kind and system."""
    folder, found = tmp_path_factory.mktemp("files"), {}
    for system, (t_end, taus) in SMALL.items():
        sweep = Sweep(
            system=system, t_end=t_end, lowest=taus[0], highest=taus[-1], points_per_decade=3, precision=("double",),
            samples=10, shards=1,
        )  # fmt: skip
        run = Run(
            sweep=sweep, integrator="ruth", precision="double", tau_per_stage=taus,
            steps=tuple(steps_of(t_end, 3 * tau) for tau in taus), samples=10,
        )  # fmt: skip
        runs = assembled(integrate_run(run), ["t"], {"system": system, "integrator": "ruth"})
        places = {kind: folder / f"{kind}_{system}.h5" for kind in ("runs", "cube")}
        store.write_dataset(places["runs"], runs, {})
        cube = cube_of(system, {"ruth": numbers_of([places["runs"]], STATES)})
        store.write_dataset(places["cube"], cube, {})
        found |= {(kind, system): store.read(place) for kind, place in places.items()}
    return found


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["runs", "cube"])
def test_table_has_each_variable_with_dimensions_unit_and_meaning(made, kind):
    kepler, sho = made[kind, "kepler"], made[kind, "sho"]
    named = [row[0].strip("`") for row in rows(kind)]
    assert sorted(named) == sorted(kepler.variables)
    assert {*sho.variables} <= {*named}
    for name, dimensions, unit, meaning in rows(kind):
        variable = kepler[name.strip("`")]
        assert dimensions == ", ".join(variable.dims)
        assert OF_KEPLER.get(unit, unit) == variable.attrs["units"]
        assert meaning.replace("\\", "") == variable.attrs["long_name"]
        if name.strip("`") in sho:
            assert sho[name.strip("`")].attrs["units"] == ("1" if unit in OF_KEPLER else unit)


def test_table_of_attributes_has_those_of_runs_and_cubes(made):
    named = {row[0].strip("`") for row in rows("attributes")}
    for one in made.values():
        assert {*one.attrs} <= named
        for variable in one.variables.values():
            assert all(f"`{name}`" in PAGE for name in variable.attrs)
    assert [[name.strip("`"), *told] for name, *told in rows("attributes")] == [
        [name, *told] for name, told in ATTRIBUTES.items()
    ]
    assert all(meaning for _, meaning in ATTRIBUTES.values())


def test_units_of_kepler_in_the_text_are_its_own():
    units = systems["kepler"].units
    assert f"For Kepler they are {units['t']}, {units['q']} and {units['p']}," in " ".join(PAGE.split())


@pytest.mark.parametrize("language", ["julia", "matlab"])
def test_block_of_another_language_reads_variables_that_exist(made, language):
    (block,) = re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(block.splitlines()) <= 5
    named = re.findall(r'h5read\("results/paper/(\S+?)", "/?(\w+)"\)', block)
    assert named
    assert {path for path, _ in named} == {"cubes/henon_heiles.h5"}
    assert {name for _, name in named} <= {*made["cube", "sho"].variables}
