"""Independence of the library from the reproduction: README's Python runs without packages of the workflow."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "results/paper" not in block]

ABSENT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names} or name.startswith("nearharmonic.reproduction"):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""


def names():
    words = (re.match(r"[\w.-]+", one)[0] for one in PROJECT["optional-dependencies"]["workflow"])
    # matplotlib needs contourpy.
    return {"yaml" if word == "pyyaml" else word.replace("-", "_") for word in words} - {"contourpy"}


def run(code, folder):
    words = [sys.executable, "-c", ABSENT.format(names=names()) + code]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "agg"}
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, env=environment)


def test_the_packages_of_the_workflow_are_absent_in_these_tests(tmp_path):
    assert {"snakemake", "pydantic", "bokeh", "rocrate", "cma", "yaml"} <= names()
    for name in (*names(), "nearharmonic.reproduction"):
        assert "No module named" in run(f"import {name}", tmp_path).stderr


@pytest.mark.slow
def test_the_python_of_readme_runs_without_the_workflow(tmp_path):
    """Each block by itself, as printed, in one process."""
    assert BLOCKS
    done = run(
        "".join(f"exec(compile({block!r}, 'block {i}', 'exec'), {{}})\n" for i, block in enumerate(BLOCKS)), tmp_path
    )
    assert done.returncode == 0, done.stderr


def test_what_the_library_lacks_is_named_in_a_sentence(tmp_path):
    code = "import nearharmonic as nh; nh.tailor('henon_heiles', window=(0.1, 0.15), trials=50)"
    assert "needs the package cma: pip install 'nearharmonic[tailor]'" in run(code, tmp_path).stderr
