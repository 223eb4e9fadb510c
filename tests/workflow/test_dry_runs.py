"""Dry runs of the shipped configs."""

import pytest

SMOKE = ("--configfile", "config/smoke.yaml")


@pytest.fixture(scope="module")
def paper(drawn):
    """The jobs of the paper's config."""
    return drawn.jobs()


@pytest.fixture(scope="module")
def smoke(drawn):
    """The jobs of the smoke config."""
    return drawn.jobs(*SMOKE)


def test_the_paper_fans_out_over_methods_systems_and_shards(paper):
    assert paper["integrate"] == 10 * 3
    assert (paper["compile"], paper["reduce"], paper["decompose"]) == (3, 3, 1)
    drawn = "sho sho_terms henon_heiles kepler henon_heiles_and_kepler substeps substeps_displaced"
    assert {name for name in paper if name.startswith("draw_")} == {f"draw_{cubes}" for cubes in drawn.split()}


@pytest.mark.slow
def test_the_smoke_run_is_the_same_workflow(smoke, paper):
    assert set(smoke) == set(paper)
    assert smoke["integrate"] == 3 * 3


@pytest.mark.slow
def test_the_linter_asks_for_environments_and_for_nothing_else(project):
    asked = project.snakemake("--lint").stdout
    titles = {line.strip() for line in asked.splitlines() if line.startswith("    * ")}
    assert titles == {"* Specify a conda environment or container for each rule.:"}  # common.smk says why none does


@pytest.mark.slow
def test_one_shard_for_each_step_size_works(project):
    # Henon-Heiles has 11 step sizes in the smoke config: two decades of 5, ends included.
    assert project.jobs("fig3", *SMOKE, "--config", "shards=1000")["integrate"] == 3 * 11


@pytest.mark.slow
def test_a_config_stands_alone(project):
    (project.folder / "alone.yaml").write_text(
        "name: alone\nintegrators: [ruth]\n"
        "systems: {sho: {tau_per_stage: {lowest: 0.1, highest: 1, points_per_decade: 4}}}\n"
    )
    jobs = project.jobs("--configfile", "alone.yaml")
    assert (jobs["compile"], jobs["integrate"]) == (1, 1)
    drawn = {"draw_sho", "draw_sho_terms", "draw_substeps", "draw_substeps_displaced"}
    assert {name for name in jobs if name.startswith("draw_")} == drawn
