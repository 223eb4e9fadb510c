"""The table of what was left out: planned omissions, and runs that ended early."""

from __future__ import annotations

import csv

import xarray as xr

from nearharmonic.plan import Omission
from nearharmonic.settings import Config, Sweep
from nearharmonic.tables import skipped, write_csv

CONFIG = Config(
    name="test",
    integrators=("ruth",),
    decomposition=("ruth",),
    sweeps=(
        Sweep(
            system="henon_heiles",
            t_end="30",
            lowest=0.1,
            highest=1.0,
            points_per_decade=1,
            precision=("double",),
            summation="compensated",
            samples=10,
            shards=1,
        ),
    ),
)
ROW = Omission(
    system="henon_heiles",
    integrator="ruth",
    precision="double",
    what="the rest of a run",
    reason="it left its energy surface",
    runs=1,
    evaluations=18,
)


def cube(*, layered):
    """100 steps of 3 x 0.1 that stayed, 10 steps of 3 x 1 that left after 4: 30 - 12 = 18 evaluations spared."""
    runs = xr.Dataset(
        {
            "status": (("integrator", "tau_per_stage"), [["ok", "diverged"]]),
            "steps": (("integrator", "tau_per_stage"), [[100, 10]]),
            "evaluations": (("integrator", "tau_per_stage"), [[300, 12]]),
        },
        coords={"integrator": ["ruth"], "tau_per_stage": [0.1, 1.0]},
    )
    return runs.expand_dims(precision=["double"]) if layered else runs


def test_a_run_that_left_its_energy_surface_spares_the_rest_of_its_steps():
    assert skipped(CONFIG, {"henon_heiles": cube(layered=False)}) == [ROW]
    assert skipped(CONFIG, {"henon_heiles": cube(layered=True)}) == [ROW]


def test_the_table_has_one_line_for_each_omission(tmp_path):
    write_csv(tmp_path / "skipped.csv", [ROW])
    with (tmp_path / "skipped.csv").open(newline="") as file:
        (line,) = csv.DictReader(file)
    assert (line["reason"], line["runs"], line["evaluations"]) == ("it left its energy surface", "1", "18")
    assert [path.name for path in tmp_path.iterdir()] == ["skipped.csv"]
