"""Every file of examples runs as printed, draws its picture, fits on a screen, and is in the gallery and the config."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.image import imread

import nearharmonic as nh
from nearharmonic.systems.user_file import load_system
from nearharmonic_paper.config import load

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


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_one_described_file_of_at_most_sixty_lines(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= 60
    assert text.startswith('"""')
    assert "source=" in text


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
