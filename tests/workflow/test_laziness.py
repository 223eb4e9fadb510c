"""Nothing is computed that the requested target does not need: the files a run would make, and those it did make."""

from __future__ import annotations

import re

import pytest
import yaml

SMOKE = ("--configfile", "config/smoke.yaml")
METHODS = ("ruth", "yoshida_s7o6a", "babs7o7h")
LINE = "force evaluations done"


def outputs(project, target):
    """The files that a dry run for ``target`` would write, below results/smoke/."""
    done = project.snakemake(target, "-n", *SMOKE, "--quiet", "host")
    assert done.returncode == 0, done.stdout
    found = re.findall(r"^ +output: (.*)$", done.stdout, re.MULTILINE)
    return {name.removeprefix("results/smoke/") for line in found for name in line.split(", ")}


def runs_of(system):
    return {f"runs/{system}/{method}/{shard}.h5" for method in METHODS for shard in (0, 1)}


def figure(stem):
    return {f"figures/{stem}.{suffix}" for suffix in ("pdf", "svg", "png")}


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("fig2", {"cubes/sho_terms.h5", *figure("fig2_decomposition")}),
        (
            "fig4",
            {"logs/compile/kepler.done", *runs_of("kepler"), "cubes/kepler.h5", *figure("fig4_perihelion")},
        ),
        ("results/smoke/cubes/sho.h5", {"logs/compile/sho.done", *runs_of("sho"), "cubes/sho.h5"}),
        (
            "linear_stability",
            {
                "cubes/linear_stability.h5",
                *(f"tables/linear_stability.{suffix}" for suffix in ("csv", "md", "tex")),
                *figure("linear_stability"),
            },
        ),
    ],
)
def test_a_target_asks_for_the_files_it_needs_and_for_no_other(project, target, expected):
    assert outputs(project, target) == expected


def test_a_target_made_leaves_its_files_and_their_logs_alone(project):
    done = project.snakemake("fig2", "-j1", *SMOKE)
    assert done.returncode == 0, done.stdout
    results = project.folder / "results/smoke"
    made = {str(path.relative_to(results)) for path in results.rglob("*") if path.is_file()}
    assert made == {
        "cubes/sho_terms.h5",
        *figure("fig2_decomposition"),
        "logs/reduce/sho_terms.log",
        "logs/render/fig2_decomposition.log",
    }
    assert LINE not in done.stdout


def test_a_run_ends_with_one_line_on_what_was_skipped_and_a_second_run_says_nothing(project):
    config = yaml.safe_load((project.folder / "config/smoke.yaml").read_text())
    config |= {"name": "least", "integrators": ["ruth"], "shards": 1, "decomposition": ["ruth"]}
    config["systems"] = {"sho": {"t_end": 5, "tau_per_stage": {"lowest": 0.1, "highest": 1, "points_per_decade": 2}}}
    (project.folder / "least.yaml").write_text(yaml.safe_dump(config))
    least = ("results/least/tables/skipped.csv", "-j1", "--configfile", "least.yaml")
    assert LINE not in project.snakemake(*least, "-n").stdout
    assert project.snakemake(*least).stdout.count(LINE) == 1
    assert LINE not in project.snakemake(*least).stdout
