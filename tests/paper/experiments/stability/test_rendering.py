"""The stress tests from their tasks to their cubes."""

from __future__ import annotations

import pytest
import xarray as xr

from nearharmonic.output.dataset import assembled
from nearharmonic_paper.experiments.stability.reductions import henon_heiles_cube, kepler_cube, rounding_cube, stacked
from nearharmonic_paper.experiments.stability.settings import (
    EnsembleSettings,
    EvaluationsGrid,
    EvenStepSizes,
    MapSettings,
    RoundingSettings,
)
from nearharmonic_paper.tasks.job import covered, write
from nearharmonic_paper.tasks.provenance import function_of, provenance, task

METHODS = ("ruth", "babps9o7h")
SMALL = {
    "henon_heiles": EnsembleSettings(
        trajectories=10,
        energies=("1/24", "1/6"),
        t_end="20",
        tau_per_stage=EvenStepSizes(lowest="0.1", highest="0.7", spacing="0.1"),
    ),
    "kepler": MapSettings(
        eccentricities=6,
        highest_eccentricity=0.9,
        orbits=3,
        evaluations_per_orbit=EvaluationsGrid(lowest=10.0, highest=1000.0, points_per_decade=4),
    ),
    "rounding": RoundingSettings(ensemble=3, steps=8000, evaluations_per_orbit=400, seed=1),
}
REDUCTIONS = {"henon_heiles": henon_heiles_cube, "kepler": kepler_cube, "rounding": rounding_cube}


def results(asked, **inputs):
    """Result of a job of the task ``asked``, with nothing in reach that its digests do not cover."""
    with covered(asked):
        return function_of(asked)(**asked["settings"], **inputs)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Run files of each ensemble, by method; the last method first."""
    folder, made = tmp_path_factory.mktemp("runs"), {}
    for name, settings in SMALL.items():
        for method in reversed(METHODS):
            asked = task(
                f"nearharmonic_paper.experiments.stability.run:{name}_measure", integrator=method, settings=settings
            )
            path = str(folder / f"{name}-{method}.h5")
            write(results(asked)["run"], [path], provenance(asked))
            made.setdefault(name, {})[method] = path
    return made


@pytest.mark.parametrize("name", SMALL)
def test_cube_holds_runs_in_order_of_methods(runs, name):
    room = "nearharmonic_paper.experiments.stability"
    asked = task(f"{room}.reductions:{name}", integrators=METHODS, settings=SMALL[name])
    cube = results(asked, **runs[name])["cube"]
    made = {
        method: results(task(f"{room}.run:{name}_measure", integrator=method, settings=SMALL[name]))["run"]
        for method in METHODS
    }
    parts = {method: assembled(run.variables, run.coordinates, {}) for method, run in made.items()}
    expected = REDUCTIONS[name](stacked(METHODS, [parts[method] for method in METHODS]))
    xr.testing.assert_equal(cube, expected)
    assert cube.integrator.values.tolist() == list(METHODS)
    assert cube.attrs == {}
