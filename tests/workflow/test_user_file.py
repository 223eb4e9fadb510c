"""A config with one system and one integrator of a user: its figure, its cube, and what an edit makes again."""

from __future__ import annotations

import h5py
import pytest
import yaml

from support.projects.workflow_project import ROOT, Project

pytestmark = pytest.mark.slow

MINE = {
    "name": "mine",
    "integrators": ["fourth_order.py"],
    "systems": {
        "well": {"file": "quartic_well.py", "t_end": 5, "parameters": {"b": "0.2"},
                 "tau_per_stage": {"lowest": 0.1, "highest": 0.2, "points_per_decade": 4}},
        "sho": {"t_end": 5, "tau_per_stage": {"lowest": 0.1, "highest": 0.2, "points_per_decade": 4}},
    },
    "samples": 5,
}  # fmt: skip
OPTION = ("--configfile", "own/mine.yaml")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The project with a config, a system and an integrator in a folder of their own, after one figure is drawn."""
    project = Project(tmp_path_factory.mktemp("user_file"))
    own = project.folder / "own"
    own.mkdir()
    for name in ("quartic_well.py", "fourth_order.py"):
        (own / name).write_text((ROOT / "examples" / name).read_text(encoding="utf-8"))
    (own / "mine.yaml").write_text(yaml.safe_dump(MINE))
    done = project.snakemake("well_energy_error", "-j2", *OPTION)
    assert done.returncode == 0, done.stdout
    return project


def test_figure_and_cube_have_name_that_config_gives(made):
    assert (made.folder / "results/mine/figures/well_energy_error.png").stat().st_size > 5000
    with h5py.File(made.folder / "results/mine/cubes/well.h5") as cube:
        assert (cube.attrs["system"], cube.attrs["system_label"]) == ("well", "quartic well")
        assert cube["integrator"][:].tolist() == [b"five_leapfrogs"]
        assert 0 < cube["max_energy_error"][0, 0, 0] < 0.01
        # Each substep of a splitting method keeps the angular momentum of a central force: rounding alone is left.
        assert cube["angular_momentum_drift"][:].max() < 1e-14


def test_edit_runs_what_depends_on_file_and_nothing_else(made):
    path = made.folder / "own/quartic_well.py"
    text = path.read_text()
    path.write_text(text.replace("b * square**2 / 4", "b * square**2 / 8 * 2"))
    jobs = made.jobs("figures", *OPTION)
    path.write_text(f"# a comment\n{text}")
    unchanged = made.jobs("well_energy_error", *OPTION)
    path.write_text(text)
    others = {  # not made yet
        "draw_sho": 1, "draw_sho_terms": 1, "decompose": 1, "draw_substeps": 1, "draw_substeps_displaced": 1,
        "displaced": 1, "figures": 1,
    }  # fmt: skip
    assert jobs == {"compile": 2, "integrate": 2, "reduce": 2, "draw_well": 1, **others}
    assert unchanged == {}


def test_a_bad_file_ends_with_status_2_and_one_message(made):
    config = made.folder / "bad.yaml"
    config.write_text(yaml.safe_dump(MINE | {"systems": {"kepler": MINE["systems"]["well"]}}))
    done = made.snakemake("-j1", "--configfile", "bad.yaml")
    assert done.returncode == 2
    assert done.stdout.count("kepler is a registered system, taken as it is") == 1
    assert "Traceback" not in done.stdout
