"""A config with users' systems and an integrator, run to its end: files, record, archive, and what edits make again."""

from __future__ import annotations

import json
import re
import shutil
import zipfile

import h5py
import pytest
import yaml

import nearharmonic as nh
from nearharmonic.systems.user_file import load_system
from support.projects.workflow_project import ROOT, Project

GRID = {"lowest": 0.05, "highest": 0.25, "points_per_decade": 4}
MINE = {
    "name": "mine",
    "integrators": ["ruth", "fourth_order.py"],
    "systems": {
        "well": {"file": "quartic_well.py", "t_end": 10, "tau_per_stage": GRID},
        "wide": {"file": "quartic_well.py", "q0": [3, 0], "parameters": {"b": 0.5}, "t_end": 5, "tau_per_stage": GRID},
        "venus": {
            "system": "kepler", "q0": ["108.94", 0], "p0": [0, "0.12528"], "t_end": 5000,
            "tau_per_stage": {"lowest": 20, "highest": 100, "points_per_decade": 4},
        },
        "gap": {"file": "clearance.py", "t_end": 10, "tau_per_stage": GRID | {"lowest": 0.02, "highest": 0.1}},
    },
    "samples": 20,
    "overview": ["ruth", "fourth_order.py"],
}  # fmt: skip
OPTION = ("--configfile", "own/mine.yaml")
RESULTS = "results/mine"
TRUST = [word for name in ("quartic_well", "fourth_order", "clearance") for word in ("--trust", f"own/{name}.py")]

pytestmark = pytest.mark.slow  # the figure and the cube of one system alone: test_user_file.py


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The project with a config, a system and an integrator in a folder of their own, after ``snakemake``."""
    project = Project(tmp_path_factory.mktemp("user_files"))
    own = project.folder / "own"
    own.mkdir()
    for name in ("quartic_well.py", "fourth_order.py", "clearance.py"):
        (own / name).write_text((ROOT / "examples" / name).read_text(encoding="utf-8"))
    (own / "mine.yaml").write_text(yaml.safe_dump(MINE))
    done = project.snakemake("-j2", *OPTION)
    assert done.returncode == 0, done.stdout
    return project


def edited(project, name, before, after):
    """A dry run's jobs while a file of the user reads otherwise."""
    path = project.folder / "own" / name
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    try:
        return project.jobs("all", *OPTION)
    finally:
        path.write_text(text)


def test_every_system_has_its_cube_its_figure_and_its_rows(made):
    results = made.folder / RESULTS
    for key in ("well", "wide", "venus", "gap"):
        for suffix in ("pdf", "svg", "png"):
            assert (results / f"figures/{key}_energy_error.{suffix}").stat().st_size > 5000
        with h5py.File(results / f"cubes/{key}.h5") as cube:
            assert cube.attrs["system"] == key
            assert [name.decode() for name in cube["integrator"][:]] == ["ruth", "five_leapfrogs"]
            assert (cube["max_energy_error"][0, :, 0] < 0.01).all()
    rows = [line.split(",")[:2] for line in (results / "tables/skipped.csv").read_text().splitlines()]
    assert {("well", "five_leapfrogs"), ("wide", "ruth"), ("venus", "ruth")} <= {tuple(row) for row in rows}
    page = (results / "report.html").read_text(encoding="utf-8")
    assert all(f'id="figure-{key}_energy_error' in page for key in ("well", "wide", "venus", "gap"))
    assert "five leapfrogs" in page
    assert (results / "figures/fig2_decomposition.pdf").is_file()  # of methods, whatever the systems are
    # Verdicts and long orbits are of the paper's systems, of which there is none.
    absent = (
        "figures/fig1_sho.pdf",
        "tables/claims.json",
        "cubes/henon_heiles_chaos.h5",
        "cubes/substeps_displaced.h5",
    )
    assert not any((results / name).exists() for name in absent)


def test_cube_has_numbers_of_same_run_from_python(made):
    system = load_system(made.folder / "own/quartic_well.py")
    with h5py.File(made.folder / RESULTS / "cubes/well.h5") as cube:
        tau, found = cube["tau"][0, 1, :], cube["max_energy_error"][0, 1, :]
    again = nh.sweep(system, made.folder / "own/fourth_order.py", tau, t_end="10").max_energy_error.values
    assert again.tobytes() == found.tobytes()


def test_edit_of_integrator_reruns_only_its_dependents(made):
    jobs = edited(made, "fourth_order.py", "five leapfrogs", "leapfrogs, five of them")
    drawn = {f"draw_{name}": 1 for name in ("well", "wide", "venus", "gap", "sho_terms")}
    assert jobs == {
        "integrate": 4, "reduce": 4, "decompose": 1, "skipped": 1, "paper_tables": 1, **drawn, "page": 1,
        "all": 1,
    }  # fmt: skip


def test_other_initial_values_run_that_system_alone(made):
    jobs = edited(made, "mine.yaml", "b: 0.5", "b: 0.25")
    assert (jobs["compile"], jobs["integrate"], jobs["reduce"]) == (1, 2, 1)
    assert [name for name in jobs if name.startswith("draw_")] == ["draw_wide"]


def test_removed_system_is_named_at_the_end_alone(made, tmp_path):
    project = made.copy(tmp_path / "removed")
    path = project.folder / "own/mine.yaml"
    config = yaml.safe_load(path.read_text())
    del config["systems"]["venus"]
    path.write_text(yaml.safe_dump(config))
    done = project.snakemake("-j2", *OPTION)
    assert done.returncode == 0, done.stdout
    text = (project.folder / RESULTS / "report.html").read_text(encoding="utf-8")
    (line,) = re.findall("Left over from another config of this name, and not shown: (.*?)</p>", text)
    names = ["cubes/venus", "figure-venus_energy_error", "figures/venus_energy_error"]
    assert re.findall("<code>(.*?)</code>", line) == names
    assert "venus" not in text.replace(line, "")
    rows = project.nearharmonic("runs", "mine").stdout
    assert "Left out: venus, which the config of mine no longer has" in rows.splitlines()[-1]
    assert rows.count("venus") == 1
    assert project.jobs("all", *OPTION) == {}


def test_verify_finds_no_fault_reruns_and_reports_edit(made):
    done = made.nearharmonic("verify", RESULTS, "--rerun", "4")
    assert done.returncode == 2
    assert "own/fourth_order.py (SHA-256 " in done.stderr
    assert made.nearharmonic("verify", RESULTS).returncode == 0
    done = made.nearharmonic("verify", RESULTS, "--rerun", "4", *TRUST)
    assert done.returncode == 0, done.stdout
    assert "4 are bitwise identical" in done.stdout
    path = made.folder / "own/quartic_well.py"
    text = path.read_text()
    path.write_text(text.replace("b * square**2 / 4", "b * square**2 / 8 * 2"))
    done = made.nearharmonic("verify", RESULTS)
    path.write_text(text)
    assert done.returncode == 1
    assert "runs/well/five_leapfrogs/0.h5  was made with other code (and 3 more)" in done.stdout
    assert "venus" not in done.stdout


def test_the_record_holds_the_digest_of_the_files(made):
    (run,) = [json.loads(line) for line in (made.folder / RESULTS / "history.jsonl").read_text().splitlines()]
    assert set(run["user_files"]) == {"own/quartic_well.py", "own/fourth_order.py", "own/clearance.py"}
    with h5py.File(made.folder / RESULTS / "cubes/wide.h5") as cube:
        told = json.loads(cube.attrs["settings"])["definitions"]
    assert told["systems"]["wide"]["file"] == "own/quartic_well.py"
    assert told["systems"]["wide"]["q0"] == ["3", "0"]
    assert told["integrators"]["five_leapfrogs"]["file"] == "own/fourth_order.py"


def test_archive_holds_files_and_its_config_runs_from_them(made, tmp_path):
    place = tmp_path / "mine.zip"
    done = made.nearharmonic("archive", "mine", "-o", str(place))
    assert done.returncode == 0, done.stderr
    assert made.nearharmonic("verify", str(place)).returncode == 0
    unpacked = made.folder / "unpacked"
    with zipfile.ZipFile(place) as archive:
        archive.extractall(unpacked)
    for name in ("quartic_well.py", "fourth_order.py", "clearance.py"):
        assert (unpacked / "user_files" / name).read_text() == (made.folder / "own" / name).read_text()
    config = json.loads((unpacked / "config.json").read_text())
    assert config["systems"]["well"]["file"] == "user_files/quartic_well.py"
    assert config["integrators"] == ["ruth", "user_files/fourth_order.py"]
    cubes = [f"results/again/cubes/{key}.h5" for key in ("well", "venus")]
    done = made.snakemake(*cubes, "-j2", "--configfile", "unpacked/config.json", "--config", "name=again")
    assert done.returncode == 0, done.stdout
    for key in ("well", "venus"):
        with (
            h5py.File(made.folder / f"results/again/cubes/{key}.h5") as again,
            h5py.File(unpacked / f"cubes/{key}.h5") as before,
        ):
            assert all(again[name][()].tobytes() == before[name][()].tobytes() for name in ("tau", "max_energy_error"))


def test_results_are_adopted_by_copy_of_project_that_has_files(made, tmp_path):
    copy = Project(tmp_path / "copy")
    for name in ("own", RESULTS):
        shutil.copytree(made.folder / name, copy.folder / name)
    done = copy.nearharmonic("adopt", "mine")
    assert done.returncode == 2
    assert "is not run: read it, and allow it by --trust own/clearance.py --trust own/fourth_order.py" in done.stderr
    done = copy.nearharmonic("adopt", "mine", *TRUST)
    assert done.returncode == 0, done.stderr
    assert copy.jobs("all", *OPTION) == {}
    path = copy.folder / "own/quartic_well.py"
    path.write_text(path.read_text().replace("b * square**2 / 4", "b * square**2 / 8 * 2"))
    assert copy.jobs("all", *OPTION)["integrate"] == 4
    done = copy.nearharmonic("adopt", "mine")
    assert done.returncode == 1
    assert "was made with other code" in done.stdout + done.stderr
    done = copy.nearharmonic("adopt", "mine", *TRUST)
    assert done.returncode == 2
    assert "own/quartic_well.py is not the file that made results/mine" in done.stderr
