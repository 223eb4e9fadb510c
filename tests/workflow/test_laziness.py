"""Only files for the requested target are computed: planned files, and files of a run."""

from __future__ import annotations

import re

import pytest
import yaml

from nearharmonic.output.store import read_precisions
from nearharmonic_paper.config import load
from support.projects.plans import planned_runs
from support.projects.targets import METHODS, RECORD, figures

TINY = ("--configfile", "config/tiny.yaml")
LINE = "Computed "


def outputs(project, target):
    """The files that a dry run for ``target`` would write, below results/tiny/."""
    done = project.snakemake(target, "-n", *TINY, "--quiet", "host")
    assert done.returncode == 0, done.stdout
    found = re.findall(r"^ +output: (.*)$", done.stdout, re.MULTILINE)
    return {name.removeprefix("results/tiny/") for line in found for name in line.split(", ")}


def runs_of(system):
    return {f"runs/{system}/{method}/{shard}.h5" for method in METHODS for shard in (0, 1)}


#: What targets need, of which one reads no cube and one integrates nothing, below their results folder, logs left out.
NEEDED = {
    "fig2": {"cubes/sho_terms.h5", *figures("fig2_decomposition")},
    # One job draws all figures of a cube.
    "fig4": {
        *runs_of("kepler"),
        "cubes/kepler.h5",
        *figures("fig4_perihelion", "fig5_kepler"),
    },
    "cubes/sho.h5": {*runs_of("sho"), "cubes/sho.h5"},
    "fig6": figures("fig6_substeps"),
    "linear_stability": {
        "cubes/linear_stability.h5",
        *(f"tables/linear_stability.{suffix}" for suffix in ("csv", "md", "tex")),
        *figures("linear_stability"),
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("target", NEEDED)
def test_target_asks_for_files_it_needs_and_for_no_other(project, target):
    asked = outputs(project, f"results/tiny/{target}" if "/" in target else target)
    assert {name for name in asked if not name.startswith("logs/")} == NEEDED[target]


@pytest.mark.slow
@pytest.mark.parametrize(
    "target", ["cubes/sho.h5", *(pytest.param(target, marks=pytest.mark.slow) for target in ("fig2", "fig4"))]
)
def test_made_target_keeps_its_files_and_jobs_follow_plan(project, target):
    name = f"alone_{target.partition('.')[0].replace('/', '_')}"
    config = yaml.safe_load((project.folder / "config/tiny.yaml").read_text()) | {"name": name}
    (project.folder / f"{name}.yaml").write_text(yaml.safe_dump(config))
    results = project.folder / f"results/{name}"
    asked = f"results/{name}/{target}" if "/" in target else target
    done = project.snakemake(asked, "-j2", "--configfile", f"{name}.yaml")
    assert done.returncode == 0, done.stdout
    assert LINE not in done.stdout
    made = {str(path.relative_to(results)) for path in results.rglob("*") if path.is_file()}
    assert {path for path in made if not path.startswith("logs/")} == NEEDED[target] | RECORD
    loaded = load(config)
    planned = {
        (run.sweep.system, run.integrator, run.precision, tau)
        for run in planned_runs(loaded.sweeps, loaded.integrators)
        for tau in run.tau_per_stage
        if f"cubes/{run.sweep.system}.h5" in made
    }
    integrated = {
        (path.parts[-3], path.parts[-2], precision, float(tau))
        for path in (results / "runs").rglob("*.h5")
        for precision, runs in read_precisions(path).items()
        for tau in runs.tau_per_stage[runs.status != "skipped"].values
    }
    assert integrated == planned


@pytest.mark.slow
def test_run_reports_skipped_work_and_second_run_is_silent(project):
    config = yaml.safe_load((project.folder / "config/tiny.yaml").read_text())
    config |= {"name": "least", "integrators": ["ruth"], "shards": 1, "decomposition": ["ruth"]}
    config["systems"] = {"sho": {"t_end": 5, "tau_per_stage": {"lowest": 0.1, "highest": 1, "points_per_decade": 2}}}
    (project.folder / "least.yaml").write_text(yaml.safe_dump(config))
    least = ("results/least/tables/skipped.csv", "-j1", "--configfile", "least.yaml")
    assert LINE not in project.snakemake(*least, "-n").stdout
    assert project.snakemake(*least).stdout.count(LINE) == 1
    assert LINE not in project.snakemake(*least).stdout
    claims = ("results/least/tables/claims.json", *least[1:])
    said = project.snakemake(*claims).stdout
    assert re.search(r"^Verdicts: of \d+ statements of the paper, .* not decided here; ", said, re.MULTILINE)
    assert (
        "snakemake -j2 derive stability trained_proof --configfile least.yaml decides most of them "
        "(50 s, 70 s, 3 min)" in said
    )
    assert "statements" not in project.snakemake(*claims).stdout
