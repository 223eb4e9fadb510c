"""``nearharmonic reproduce``: the workflow in an empty folder, from the sources and from a wheel."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from nearharmonic.cli import main
from nearharmonic.errors import SettingError
from nearharmonic_paper.commands import put_into
from nearharmonic_paper.record.description import workflow_root

ROOT = Path(__file__).parents[2]
#: What the workflow reads beside the package.
FILES = {
    path.relative_to(ROOT).as_posix()
    for pattern in ("Snakefile", "workflow/**/*.*", "config/*.*", "profiles/*/*.yaml")
    for path in ROOT.glob(pattern)
    if path.suffix != ".pyc"
}


def files_in(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_empty_folder_gets_the_workflow_and_keeps_what_one_changes(tmp_path):
    put_into(tmp_path)
    assert files_in(tmp_path) == FILES
    assert all((tmp_path / name).read_bytes() == (ROOT / name).read_bytes() for name in FILES)
    (tmp_path / "config/config.yaml").write_text("name: mine\n")
    put_into(tmp_path)
    assert (tmp_path / "config/config.yaml").read_text() == "name: mine\n"


def test_folder_of_another_workflow_is_refused_and_left_alone(tmp_path):
    (tmp_path / "Snakefile").write_text("rule all:\n")
    with pytest.raises(SettingError, match="this Snakefile is another one"):
        put_into(tmp_path)
    assert files_in(tmp_path) == {"Snakefile"}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--config", "config/smok.yaml"], "config = 'config/smok.yaml' is not allowed: a file that exists"),
        (["-j", "0"], "-j = '0' is not allowed: an integer of at least 1"),
        (["-j", "x"], "-j = 'x' is not allowed: an integer"),
    ],
)
def test_bad_input_ends_before_anything_is_written(tmp_path, monkeypatch, capsys, words, says):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert says in line
    assert files_in(tmp_path) == set()


def test_wheel_carries_every_file_of_the_workflow():
    data = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["data-files"]
    named = {
        (place.removeprefix("share/nearharmonic").lstrip("/") + "/" + path.name).lstrip("/")
        for place, patterns in data.items()
        for pattern in patterns
        for path in ROOT.glob(pattern)
    }
    assert named == FILES
    assert workflow_root() == ROOT


@pytest.mark.slow
def test_installed_wheel_draws_a_figure_in_an_empty_folder(tmp_path):
    pip = [sys.executable, "-m", "pip", "-q"]
    subprocess.run([*pip, "wheel", str(ROOT), "--no-deps", "-w", str(tmp_path / "wheels")], check=True)
    (wheel,) = (tmp_path / "wheels").iterdir()
    prefix = tmp_path / "prefix"
    subprocess.run(
        [*pip, "install", "--no-deps", "--ignore-installed", "--prefix", str(prefix), str(wheel)], check=True
    )
    (packages,) = prefix.glob("lib/python*/site-packages")
    folder = tmp_path / "empty"
    folder.mkdir()
    words = [sys.executable, "-m", "nearharmonic.cli", "reproduce", "fig1", "--config", "config/smoke.yaml", "-j1"]
    environment = {**os.environ, "PYTHONPATH": str(packages)}
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert files_in(folder) >= FILES | {"results/smoke/figures/fig1_sho.svg", "results/smoke/manifest.json"}
    done = subprocess.run(
        [*words[:4], "fig9"], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "No rule to produce fig9" in done.stderr + done.stdout
