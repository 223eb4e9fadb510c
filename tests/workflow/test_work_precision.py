"""The target work_precision: a job that uses all cores, its files, and no cost for other targets."""

from __future__ import annotations

import csv
import json
import re

import h5py
import pytest
import yaml

from nearharmonic.errors import NearharmonicError
from nearharmonic_paper.config.reading import load
from support.projects.workflow_project import ROOT

SMOKE = ("--configfile", "config/smoke.yaml")
SYSTEMS = ("sho", "henon_heiles", "kepler")


@pytest.mark.slow
def test_it_is_a_target_of_its_own(project):
    assert not {name for name in project.jobs(*SMOKE) if name.startswith("work_precision")}
    assert project.jobs("work_precision", *SMOKE) == {
        "work_precision_times": 1,
        "work_precision_figure": 3,
        "work_precision_table": 3,
        "library_times_figures": 1,
        "library_times_table": 1,
        "work_precision": 1,
    }


@pytest.mark.slow
def test_figure_of_regularised_systems_is_drawn_where_config_has_them(drawn):
    jobs = drawn.jobs("work_precision", "--configfile", "config/regularised.yaml")
    assert (jobs["regularised_times_figure"], jobs["work_precision_figure"]) == (1, 4)


@pytest.mark.slow
@pytest.mark.parametrize("cores", ["2", "8"])
def test_the_job_that_takes_times_holds_all_cores(project, cores):
    # The profile keeps jobs quiet; here they are to be seen.
    done = project.snakemake("results/smoke/cubes/work_precision.h5", "-n", "--quiet", "host", "--cores", cores, *SMOKE)
    threads = [line.split(":")[1].strip() for line in done.stdout.splitlines() if line.strip().startswith("threads:")]
    assert threads == [cores]


@pytest.mark.slow
def test_times_are_in_a_file_of_their_own(everything):
    """All other files have the same bytes every time."""
    holding = set()
    for path in (everything.folder / "results/tiny").rglob("*.h5"):
        with h5py.File(path) as file:
            names = []
            file.visit(names.append)
            if "cpu" in file.attrs or any("time_" in name for name in names):
                holding.add(path.name)
    assert holding == {"work_precision.h5"}


@pytest.mark.slow
def test_the_file_names_the_machine_and_the_settings(everything):
    with h5py.File(everything.folder / "results/tiny/cubes/work_precision.h5") as file:
        for key in ("cpu", "clock", "pinned_core", "load_average", "measured", "code_digest", "coefficients_digest"):
            assert file.attrs[key]
        assert json.loads(file.attrs["settings"])["methods"] == ["ruth", "babs7o7h", "aba864"]
        assert set(file) == {*SYSTEMS, *(name for name in file if name.endswith("_position"))}
        times = file["kepler/time_trajectory"][:]
        assert (times[..., 0] <= times[..., 2]).sum() == (times[..., 0] > 0).sum() > 0


@pytest.mark.slow
def test_figures_and_tables_say_that_they_are_timings(everything):
    results = everything.folder / "results/tiny"
    assert "Measured 20" in (results / "tables/work_precision_sho.md").read_text()
    with (results / "tables/work_precision_sho.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert {row["measure"] for row in table} == {"max", "mean", "position"}
    assert {row["kind"] for row in table} == {"splitting", "peer"}


BAD = (
    ({"integrators": ["leapfrg"]}, "work_precision.integrators: unknown integrator 'leapfrg'"),
    ({"peers": ["heyok"]}, "work_precision.peers[0] = 'heyok' is not allowed"),
    ({"longest": 0}, "work_precision.longest = 0 is not allowed: a finite number above 0"),
    ({"evaluations": 3}, "work_precision.evaluations = 3 is not allowed: an integer from 100"),
    ({"point_per_decade": 3}, "'point_per_decade'. Did you mean 'points_per_decade'?"),
)


@pytest.mark.parametrize(("change", "says"), BAD)
def test_a_bad_section_is_refused_with_what_is_allowed(change, says):
    config = yaml.safe_load((ROOT / "config/smoke.yaml").read_text(encoding="utf-8"))
    with pytest.raises(NearharmonicError, match=re.escape(says)):
        load(config | {"work_precision": change})
