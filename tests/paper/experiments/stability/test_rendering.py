"""The stress tests from their tasks to their files: runs, cubes, tables and figures."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.output.dataset import assembled
from nearharmonic_paper.experiments.stability.ensembles import stacked
from nearharmonic_paper.experiments.stability.henon_heiles.reductions import henon_heiles_cube
from nearharmonic_paper.experiments.stability.kepler.reductions import kepler_cube
from nearharmonic_paper.experiments.stability.rounding.reductions import rounding_cube
from nearharmonic_paper.experiments.stability.rounding.run import SOURCES
from nearharmonic_paper.experiments.stability.settings import (
    EnsembleSettings,
    EvaluationsGrid,
    EvenStepSizes,
    MapSettings,
    RoundingSettings,
)
from nearharmonic_paper.tasks.job import covered, write
from nearharmonic_paper.tasks.provenance import function_of, provenance, task
from support.cubes.stability_cubes import amplitudes, ensembles, orbits, rounding, traces

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
#: Items whose run files have all methods: the settings of each file, and those of the cube, besides the methods.
TOGETHER = {
    "kinetic_energy": ([{}], {}),
    "conservation": (
        [{"system": "sho", "t_end": "50"}, {"system": "kepler", "t_end": "8766"}],
        {"t_end": {"sho": "50", "kepler": "8766"}},
    ),
}


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
                f"nearharmonic_paper.experiments.stability.{name}.run:measure", integrator=method, settings=settings
            )
            path = str(folder / f"{name}-{method}.h5")
            write(results(asked)["run"], [path], provenance(asked))
            made.setdefault(name, {})[method] = path
    return made


@pytest.fixture(scope="module")
def made(runs, tmp_path_factory):
    """Cube and table of each item."""
    found = {}
    for name, settings in SMALL.items():
        asked = task(
            f"nearharmonic_paper.experiments.stability.{name}.reductions:reduce", integrators=METHODS, settings=settings
        )
        found[name] = results(asked, **runs[name])
    for name, (files, settings) in TOGETHER.items():
        paths = [str(tmp_path_factory.mktemp(name) / "run.h5") for _ in files]
        for path, one in zip(paths, files, strict=True):
            asked = task(f"nearharmonic_paper.experiments.stability.{name}.run:measure", integrators=METHODS, **one)
            write(results(asked)["run"], [path], provenance(asked))
        asked = task(
            f"nearharmonic_paper.experiments.stability.{name}.reductions:reduce", integrators=METHODS, **settings
        )
        found[name] = results(asked, **({"run": paths[0]} if len(paths) == 1 else {"runs": paths}))
    return found | {
        "linear": results(task("nearharmonic_paper.experiments.stability.linear.run:measure", integrators=METHODS))
    }


@pytest.fixture(scope="module")
def cubes(made):
    return {name: one["cube"] for name, one in made.items()}


@pytest.mark.parametrize("name", SMALL)
def test_cube_holds_runs_in_order_of_methods(cubes, name):
    module = f"nearharmonic_paper.experiments.stability.{name}.run:measure"
    made = {method: results(task(module, integrator=method, settings=SMALL[name]))["run"] for method in METHODS}
    parts = {method: assembled(run.variables, run.coordinates, {}) for method, run in made.items()}
    expected = REDUCTIONS[name](
        stacked([integrators[method] for method in METHODS], [parts[method] for method in METHODS])
    )
    xr.testing.assert_equal(cubes[name], expected)
    assert cubes[name].integrator.values.tolist() == list(METHODS)
    assert cubes[name].attrs == {}


@pytest.mark.parametrize("name", SMALL)
def test_a_table_has_one_full_row_for_each_combination(made, name):
    header, rows = made[name]["table"].header, made[name]["table"].rows
    others = {
        "henon_heiles": [(1 / 24,), (1 / 6,)],
        "kepler": [()],
        "rounding": [(source, quantity) for source in SOURCES for quantity in ("energy_error", "lag")],
    }[name]
    combinations = [(method, *other) for method in METHODS for other in others]
    assert [tuple(row[: len(combinations[0])]) for row in rows] == combinations
    for row in rows:
        numbers = dict(zip(header, row, strict=True))
        # What is not a number says so: no trusted step, no step size that is fine enough, no law to compare with.
        missing = {key for key, value in numbers.items() if str(value) in {"", "nan"}}
        assert missing <= set(header[3:] if name == "henon_heiles" else header[1:] if name == "kepler" else ["brouwer"])


@pytest.mark.parametrize(
    ("name", "invented"),
    [
        ("henon_heiles", ensembles),
        ("kepler", orbits),
        ("rounding", rounding),
        ("linear", traces),
        ("kinetic_energy", amplitudes),
    ],
)
def test_hand_made_test_cubes_have_shape_of_real_ones(cubes, name, invented):
    by_hand = invented(METHODS)
    for variable in by_hand.variables:
        assert by_hand[variable].dims == cubes[name][variable].dims, variable


def test_small_ensembles_hold_all_that_a_map_distinguishes(cubes):
    assert cubes["henon_heiles"].escaped.max() > 0.01 > cubes["henon_heiles"].escaped.min()
    error = cubes["kepler"].energy_error
    assert np.isinf(error).any()
    assert np.isnan(error).any()
