"""Every file of examples runs as printed, draws its picture, and is in gallery, config and tables."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.image import imread

import nearharmonic as nh
from nearharmonic.systems.user_file import load_system
from nearharmonic_paper.config import load
from support.results.page_inputs import benchmark

# --- every file of examples runs as printed, draws its picture, fits on a screen, and is in the gallery and the config


ROOT = Path(__file__).parents[3]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
SYSTEMS = [path for path in EXAMPLES if "SYSTEM = " in path.read_text(encoding="utf-8")]
CONFIG = yaml.safe_load((ROOT / "examples/examples.yaml").read_text(encoding="utf-8"))
#: The others take seconds each.
SOME = {"fourth_order"}
ALL = [pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stem not in SOME)) for path in EXAMPLES]
#: Runs a file for each line of its input, in a process of its own, whose modules are loaded once for all.
RUNNER = """
import os, runpy, sys
import matplotlib.backends.backend_agg, xarray
import nearharmonic as nh
for name in nh.__all__:
    getattr(nh, name)
for line in sys.stdin:
    path, folder = line.rstrip("\\n").split("\\t")
    if not (child := os.fork()):
        os.chdir(folder)
        sys.stdout = open(f"{folder}.printed", "w")
        runpy.run_path(path, run_name="__main__")
        sys.exit()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="module")
def runner():
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-W", "error", "-c", RUNNER], env=environment, **pipes) as process:
        yield process


@pytest.mark.slow
@pytest.mark.parametrize("path", ALL)
def test_an_example_draws_its_picture_into_the_working_directory(runner, path, tmp_path):
    folder = tmp_path / "here"
    folder.mkdir()
    runner.stdin.write(f"{path}\t{folder}\n")
    runner.stdin.flush()
    assert runner.stdout.readline() == "0\n"
    picture = folder / f"{path.stem}.png"
    assert (tmp_path / "here.printed").read_text(encoding="utf-8") == f"wrote {picture.resolve()}\n"
    assert [file.name for file in folder.iterdir()] == [picture.name]
    pixels = imread(picture)[..., :3]
    assert pixels.shape[0] > 700
    assert 0.01 < (pixels < 0.9).any(axis=-1).mean() < 0.9  # neither empty nor full


def test_there_are_as_many_examples_as_asked_for():
    assert len(SYSTEMS) >= 10
    assert {load_system(path).name for path in SYSTEMS} == {path.stem for path in SYSTEMS}


@pytest.mark.slow
def test_the_config_draws_the_ten_methods_on_every_example():
    with nh.systems.defining({}), nh.integrators.defining({}):
        config = load(CONFIG, files=[ROOT / "examples/examples.yaml"])
        assert {Path(each["file"]).stem for each in CONFIG["systems"].values()} == {path.stem for path in SYSTEMS}
        paper = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
        assert config.methods == tuple(paper["integrators"])


def test_the_gallery_has_each_example_once():
    page = (ROOT / "docs/results/examples.md").read_text(encoding="utf-8")
    gallery = page[: page.index("## Which method")]
    assert sorted(re.findall(r"^\| \[(\w+)\.py\]", gallery, flags=re.MULTILINE)) == [path.stem for path in EXAMPLES]
    for path in SYSTEMS:
        compared = load_system(path).energies[0].traced
        assert (f"| [{path.stem}](../../examples/{path.name}) |" in page) == compared


@pytest.mark.slow
def test_paths_of_examples_stand_where_names_do():
    curve = nh.sweep(str(ROOT / "examples/morse.py"), str(ROOT / "examples/fourth_order.py"), [0.4, 0.2])
    assert np.log2(curve.max_energy_error[0] / curve.max_energy_error[1]) == pytest.approx(4, abs=0.5)


# --- anharmonicity of orbits, and the tables of docs/results/examples.md that compare methods by it -------------------


PAGE = (ROOT / "docs/results/examples.md").read_text(encoding="utf-8")


examples = benchmark("near_harmonic")


@pytest.fixture(scope="module")
def systems():
    """The examples."""
    return examples.examples_in((ROOT / "examples").glob("*.py"))


def variation(system, tau, t_end, **start):
    return examples.variation(examples.Orbit(system=system, family="", start=start), tau, t_end)


def table(name):
    """Rows of cells of a table of the page; an empty first cell means the one above."""
    (text,) = re.findall(rf"<!-- {name} -->\n(.*?)\n<!-- end -->", PAGE, flags=re.DOTALL)
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in text.splitlines()[2:]]
    for above, row in pairwise(rows):
        row[0] = row[0] or above[0]
    return rows


def test_the_hessian_of_a_harmonic_system_does_not_vary():
    assert variation(nh.systems["sho"], 0.1, 50.0) == (0, 1)
    masses = nh.System(name="two", V=lambda q: 2 * q[0] ** 2 + q[0] * q[1] + q[1] ** 2, q0=[1, 2], p0=[0, 0], t_end=1,
                       masses=("4", "1/4"))  # fmt: skip
    delta, omega = variation(masses, 0.02, 10.0)
    assert delta < 1e-14  # rounding of the mean over samples
    # det([[4/4 - w2, 1], [1, 2 * 4 - w2]]) = 0
    assert omega == pytest.approx(np.sqrt(4.5 + np.sqrt(4.5**2 - 7)), rel=5e-3)  # rounded to three digits


@pytest.mark.slow
def test_variation_of_pendulum_is_that_of_its_cosine_along_orbit(systems):
    pendulum = systems["pendulum"]
    q = nh.integrate(pendulum, "srkn_a14", 0.01, samples=257, q0=[1.0]).q.values[:, 0]
    delta, omega = variation(pendulum, 0.01, 60.0, q0=[1.0])
    stiffness = np.cos(q)
    assert delta == pytest.approx(stiffness.std() / np.sqrt((stiffness**2).mean()), rel=1e-6)
    assert omega == pytest.approx(np.sqrt(9.80665), rel=5e-3)


def test_circular_kepler_orbit_varies_by_its_rotating_axes():
    circle = replace(
        nh.systems["kepler"], q0=("1", "0"), p0=("0", "1"), parameters={"GM": "1"}, t_end="62.83185307179586"
    )
    delta, omega = variation(circle, 0.01, 20 * np.pi)
    # W = 1 - 3 r r has the norm sqrt(5), and -1/2 is its mean over a turn: norm sqrt(1/2).
    assert delta == pytest.approx(np.sqrt(1 - 0.5 / 5), rel=5e-3)
    assert omega == pytest.approx(np.sqrt(2), rel=5e-3)


@pytest.mark.slow
def test_random_probes_find_the_variation_of_a_large_system(systems, monkeypatch):
    chain = systems["fput_recurrence"]
    formed = variation(chain, 0.5, 200.0)
    monkeypatch.setattr(examples, "FORMED", 5)
    probed = variation(chain, 0.5, 200.0)
    assert probed == pytest.approx(formed, rel=0.25)  # 16 probes at 9 samples


@pytest.mark.slow
@pytest.mark.parametrize("place", [1, 2, 6])
def test_a_row_of_the_page_is_found_again(systems, place):
    orbit = [*examples.families(systems)][place]
    (text,) = (row for row in table("families") if row[:2] == [orbit.family, orbit.amplitude])
    again = examples.table_of_families([examples.measured(orbit)]).splitlines()[-1]
    assert [cell.strip() for cell in again.strip("|").split("|")] == text
