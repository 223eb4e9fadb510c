"""Grids that change between two runs of the workflow, and grids of many shards."""

import pytest
import xarray as xr

CONFIG = """
name: {name}
integrators: [ruth]
systems:
  sho:
    t_end: 50
    tau_per_stage: {{lowest: 0.001, highest: 1, points_per_decade: {points}}}
samples: {samples}
shards: {shards}
"""

pytestmark = pytest.mark.slow


@pytest.fixture
def cube(project):
    """Make the cube of a grid, and open it."""

    def make(name, points, samples=20, shards=1):
        config = project.folder / f"{name}.yaml"
        config.write_text(CONFIG.format(name=name, points=points, samples=samples, shards=shards))
        done = project.snakemake("-j2", "--configfile", str(config), "--", f"results/{name}/cubes/sho.h5")
        assert done.returncode == 0, done.stdout
        return xr.load_dataset(project.folder / f"results/{name}/cubes/sho.h5", engine="h5netcdf")

    return make


def test_finer_grid_takes_over_what_the_coarse_one_made(project, cube):
    results = project.folder / "results/coarse"
    cube("coarse", 4)
    refined = cube("coarse", 8)
    log = (results / "logs/integrate/sho/ruth/0.log").read_text()
    assert "double: 13 of 25 runs are of an earlier plan" in log
    assert not (results / "logs/earlier").exists()
    assert refined.drop_attrs().identical(cube("fine", 8).drop_attrs())
    name = "runs/sho/ruth/0.h5"
    assert (results / name).read_bytes() == (project.folder / "results/fine" / name).read_bytes()


def test_cube_of_many_shards_is_that_of_one(project, cube):
    whole = cube("whole", 6)
    parted = cube("parted", 6, samples=0, shards=12)
    assert (project.folder / "results/parted/reduced/sho/ruth.h5").is_file()
    assert len(list((project.folder / "results/parted/runs/sho/ruth").iterdir())) == 12
    assert parted.max_energy_error.identical(whole.max_energy_error)
    assert parted.steps.identical(whole.steps)
