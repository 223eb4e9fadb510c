"""What Snakemake would do for the ensembles of the stress tests."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize("figure", ["henon_heiles_stability", "kepler_stability", "rounding_growth"])
def test_a_map_asks_for_one_job_a_method_and_nothing_else(project, figure):
    jobs = project.jobs(figure)
    assert jobs == {figure: 1, "stability_cube": 1, "stability_run": 10, "stability_compile": 1}


def test_the_target_holds_all_three(project):
    jobs = project.jobs("stability", "--configfile", "config/smoke.yaml")
    assert (jobs["stability_cube"], jobs["stability_run"], jobs["stability_compile"]) == (3, 3 * 3, 3)


def test_the_paper_asks_for_none(project):
    assert not {name for name in project.jobs() if name.startswith("stability_")}


def test_a_bad_section_ends_with_one_message_before_any_job(project):
    text = (project.folder / "config/smoke.yaml").read_text().replace("trajectories: 64", "trajectories: 0")
    (project.folder / "bad.yaml").write_text(text)
    done = project.snakemake("stability", "-j1", "--configfile", "bad.yaml")
    assert done.returncode == 1
    assert done.stdout.count("stability.henon_heiles.trajectories = 0 is not allowed: a whole number from 1") == 1
    assert "Traceback" not in done.stdout
