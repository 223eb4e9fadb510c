"""docs/how_to/continuous_integration.md: its steps from an empty folder, its statuses, and files that it names."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from nearharmonic.cli import INTERRUPTED, main

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/how_to/continuous_integration.md").read_text(encoding="utf-8")
CONFIGS = (ROOT / "docs/how_to/configs.md").read_text(encoding="utf-8")
(WORKFLOW,) = (yaml.safe_load(text) for text in re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL))
STEPS = WORKFLOW["jobs"]["results"]["steps"]
RUN = [step["run"] for step in STEPS if step.get("run", "").startswith("nearharmonic")]


def run(command, folder, **environment):
    words = [sys.executable, "-m", "nearharmonic.cli", *command.split()[1:]]
    path = {"PYTHONPATH": str(ROOT / "src"), "PYTHONWARNINGS": "ignore"}
    return subprocess.run(
        words, cwd=folder, env=os.environ | path | environment, capture_output=True, text=True, check=False
    )


@pytest.mark.long
def test_steps_of_the_workflow_succeed_in_an_empty_folder(tmp_path):
    (tmp_path / "mine.yaml").write_text(re.search(r"```yaml\n(.*?)```", CONFIGS, flags=re.DOTALL)[1], encoding="utf-8")
    first, *rest = RUN
    kernels = {"NEARHARMONIC_CACHE_DIR": str(tmp_path / ".kernels")}
    done = run(first, tmp_path, **kernels)
    assert done.returncode == 0, done.stderr
    assert any((tmp_path / ".kernels").rglob("*"))
    shutil.copytree(tmp_path / "results/mine/cubes", tmp_path / "reference/mine/cubes")
    shutil.rmtree(tmp_path / "results")
    done = run(first, tmp_path, **kernels)
    assert done.returncode == 0, done.stderr
    for command in rest:
        done = run(command, tmp_path)
        assert done.returncode == 0, done.stdout
    kept = next(step["with"]["path"] for step in STEPS if "upload-artifact" in step.get("uses", ""))
    assert all((tmp_path / path).is_dir() for path in kept.split())


def test_environment_and_cache_name_the_same_folder():
    folder = WORKFLOW["jobs"]["results"]["env"]["NEARHARMONIC_CACHE_DIR"]
    (cached,) = [step["with"]["path"] for step in STEPS if "cache" in step.get("uses", "")]
    assert folder == f"${{{{ github.workspace }}}}/{cached}"


def test_actions_of_the_page_have_versions_of_this_project():
    own = "".join(path.read_text(encoding="utf-8") for path in ROOT.glob(".github/workflows/*.yml"))
    for step in STEPS:
        name, _, version = step.get("uses", "actions/cache@v4").partition("@")
        assert name == "actions/cache" or f"{name}@{version}" in own


def test_page_says_what_the_smoke_workflow_runs():
    smoke = yaml.safe_load((ROOT / ".github/workflows/smoke.yml").read_text(encoding="utf-8"))
    commands = [step["run"] for step in smoke["jobs"]["smoke"]["steps"] if "run" in step]
    (named,) = re.findall(r"runs\n`(snakemake .*?)`", PAGE)
    assert any(command.endswith(named) for command in commands)
    assert any("-c constraints.txt" in command for command in commands)
    for workflow in ("smoke.yml", "ci.yml"):
        text = (ROOT / ".github/workflows" / workflow).read_text(encoding="utf-8")
        assert yaml.safe_load(text)[True].keys() >= {"push", "pull_request"}  # YAML 1.1 reads the key "on" as true
        assert f"`{workflow}`" in PAGE


#: Words of a command for each status of the table.
STATUSES = {
    "verify": (None, ["paper"], ["none"]),  # other code made the small result; a sound one is verified above
    "compare": (["paper", "copy"], ["paper", "other"], ["paper", "none"]),
    "recommend": (
        ["sho", "--error", "1e-3", "--methods", "ruth", "--t-end", "20"],
        ["sho", "--error", "1e-15", "--methods", "leapfrog", "--t-end", "20", "--budget", "100"],
        ["sho", "--error", "-1"],
    ),
    "verify-tableau": (["leapfrog.toml"], ["wrong.toml"], ["none.toml"]),
}


@pytest.mark.slow
@pytest.mark.usefixtures("project", "copy", "other")
def test_statuses_of_the_table_are_those_of_the_commands():
    rows = re.findall(r"^\| `nearharmonic ([\w-]+)`", PAGE, flags=re.MULTILINE)
    assert {*rows} == {*STATUSES, "tailor"}  # the page of tailor has its own test
    Path("leapfrog.toml").write_text('first = "kick"\norder = 2\nkick = ["0.5", "0.5"]\ndrift = ["1"]\n')
    Path("wrong.toml").write_text('first = "kick"\norder = 4\nkick = ["0.5", "0.5"]\ndrift = ["1"]\n')
    for command, cases in STATUSES.items():
        for status, words in enumerate(cases):
            if words is not None:
                assert main([command, *words]) == status, (command, words)
    assert INTERRUPTED == 130


@pytest.mark.long
def test_a_refused_target_or_config_has_status_2(tmp_path):
    (tmp_path / "mine.yaml").write_text("name: mine\n", encoding="utf-8")
    assert run("nearharmonic reproduce --config mine.yaml", tmp_path).returncode == 2
    assert run("nearharmonic reproduce fig7", tmp_path).returncode == 2
    assert not (tmp_path / "results").exists()
