"""Independence of the library from the reproduction: README's Python runs without packages of the workflow."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.projects.extras import names_of, of_extra

ROOT = Path(__file__).parents[4]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "results/paper" not in block]

ABSENT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names} or name.startswith("nearharmonic_paper"):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""


def names(of=None):
    """Modules of extras that these tests hide: those of the workflow alone, without those of figures, or of ``of``."""
    # matplotlib needs contourpy; pillow has another name as a module.
    words = names_of(of_extra(of)) if of else names_of(of_extra("workflow")) - names_of(of_extra("figures"))
    return {"yaml" if word == "pyyaml" else word.replace("-", "_") for word in words} - {"contourpy"}


def run(code, folder, absent=None):
    words = [sys.executable, "-c", ABSENT.format(names=absent or names()) + code]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "MPLBACKEND": "agg"}
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, env=environment)


def test_the_packages_of_the_workflow_are_absent_in_these_tests(tmp_path):
    assert {"snakemake", "pydantic", "bokeh", "rocrate", "cma", "yaml"} <= names()
    for name in (*names(), "nearharmonic_paper"):
        assert "No module named" in run(f"import {name}", tmp_path).stderr


@pytest.mark.slow
def test_the_python_of_readme_runs_without_the_workflow(tmp_path):
    """Each block by itself, as printed, in one process."""
    assert BLOCKS
    done = run(
        "".join(f"exec(compile({block!r}, 'block {i}', 'exec'), {{}})\n" for i, block in enumerate(BLOCKS)), tmp_path
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_what_the_library_lacks_is_named_in_a_sentence(tmp_path):
    code = "import nearharmonic as nh; nh.tailor('henon_heiles', window=(0.1, 0.15), trials=50)"
    assert "needs the package cma: pip install 'nearharmonic[tailor]'" in run(code, tmp_path).stderr


@pytest.mark.slow
def test_library_runs_without_matplotlib_and_names_its_extra(tmp_path):
    code = """
import nearharmonic as nh
run = nh.integrate("sho", "babps9o7h", 0.9, t_end=9)
curve = nh.sweep("sho", "babps9o7h", [0.9, 0.45], t_end=9)
assert nh.order_of("babps9o7h") == 4
assert callable(nh.recommend)
nh.plot(curve)
"""
    done = run(code, tmp_path, names("figures"))
    assert done.stderr.splitlines()[-1] == (
        "nearharmonic.errors.MissingPackageError: a plot needs the package matplotlib: "
        "pip install 'nearharmonic[figures]'"
    )
