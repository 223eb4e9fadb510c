"""The shipped configs: their plans and their sizes."""

from pathlib import Path

import pytest
import yaml

from nearharmonic.integrators import BENCHMARKED
from nearharmonic_paper.config import load
from support.projects.plans import planned_runs

ROOT = Path(__file__).parents[2]


def mapping(name):
    return yaml.safe_load((ROOT / "config" / name).read_text(encoding="utf-8"))


def loaded(name):
    return load(mapping(name))


def planned(config):
    return config.sweeps, config.integrators


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("config.yaml", "paper"), ("smoke.yaml", "smoke"), ("regularised.yaml", "regularised"),
        ("smoke_physics.yaml", "smoke_physics"),
    ],
)  # fmt: skip
def test_a_config_is_valid_and_named(file, name):
    assert loaded(file).name == name


def test_paper_takes_ten_methods_in_order_on_three_systems():
    paper = loaded("config.yaml")
    assert paper.integrators == BENCHMARKED
    assert [sweep.system for sweep in paper.sweeps] == ["sho", "henon_heiles", "kepler"]


def test_paper_has_intervals_and_grids_that_its_figures_show():
    for sweep in loaded("config.yaml").sweeps:
        assert sweep.points_per_decade >= 40
        if sweep.system == "kepler":
            assert (sweep.t_end, sweep.lowest) == ("87660", 0.01)  # ten years of 8766 h
        else:
            assert (sweep.t_end, sweep.lowest, sweep.highest) == ("500", 1e-4, 1.0)


def test_the_plan_of_the_paper_has_every_run_once():
    runs = planned_runs(*planned(loaded("config.yaml")))
    points = [(r.sweep.system, r.integrator, r.precision, tau) for r in runs for tau in r.tau_per_stage]
    assert len(points) == len(set(points))
    double = [point for point in points if point[2] == "double"]
    assert len(double) == 10 * (161 + 161 + 199)  # 4, 4 and 4.95 decades of 40, ends included
    assert {point[0] for point in points if point[2] == "extended"} == {"sho"}


def test_smoke_run_has_shape_of_paper_with_fewer_steps():
    paper, smoke = loaded("config.yaml"), loaded("smoke.yaml")
    assert [s.system for s in smoke.sweeps] == [s.system for s in paper.sweeps]
    assert [s.precision for s in smoke.sweeps] == [s.precision for s in paper.sweeps]
    assert {run.precision for run in planned_runs(*planned(smoke))} == {"double", "extended"}
    steps = {c.name: sum(sum(run.steps) for run in planned_runs(*planned(c))) for c in (paper, smoke)}
    assert steps["smoke"] < steps["paper"] / 1000
