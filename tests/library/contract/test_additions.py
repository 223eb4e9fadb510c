"""A method is one file, and a system one file and its line in a config: tests hold without any other edit."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = next(folder for folder in Path(__file__).parents if (folder / "pyproject.toml").exists())
#: What is no source, in the top folder or in any.
MADE = {".git", ".venv", ".snakemake", ".hypothesis", "results", "build"}
METHOD = '''"""A method of order two that is in no paper (2026), doi:10.1000/added."""

from nearharmonic import Tableau, palindrome

TABLEAUS = (
    Tableau(
        name="added_method", label="Added method", order=2, first="kick", kick=palindrome("0.2", "0.3"),
        drift=palindrome("0.3", centre="0.4"), source="Nobody (2026), doi:10.1000/added", digits=80,
    ),
)
'''
SYSTEM = '''"""A quartic oscillator, H = p^2/2 + q^4/4."""

from nearharmonic import System

SYSTEM = System(
    name="added_system", label="added system", V=lambda q: q[0] ** 4 / 4, q0=("1",), p0=("0",), t_end="100",
    source="a textbook", surface_reason="at twice the energy a run is on another orbit",
)
'''
LINE = "  added_system: {tau_per_stage: {lowest: 0.01, highest: 1, points_per_decade: 20}}\n"
#: Tests outside of this folder that walk a registry, or read a page about it.
FILES = (
    "test_style.py", "test_decided.py", "test_config.py", "test_examples.py", "test_methods.py", "test_cli.py",
    "test_order.py", "test_linear_stability.py", "test_plan.py", "test_tableaus.py",
)  # fmt: skip
#: A plugin that leaves out the cases of entries that were there before, which their own files have not changed.
PLUGIN = """
def pytest_collection_modifyitems(items):
    import nearharmonic as nh
    before = {name for name in (*nh.integrators, *nh.systems) if not name.startswith("added_")}
    names = lambda item: {str(getattr(x, "name", x)) for x in getattr(item, "callspec", None).params.values()}
    items[:] = [item for item in items if not hasattr(item, "callspec") or not names(item) & before]
"""


def made(folder, names):
    """The names in a folder that are not copied."""
    caches = {name for name in names if name == "__pycache__" or name.endswith("_cache")}
    return caches | (MADE if Path(folder) == ROOT else set())


@pytest.mark.slow
def test_method_and_system_are_a_file_each(tmp_path):
    tree = shutil.copytree(ROOT, tmp_path / "tree", ignore=made)
    (tree / "src/nearharmonic/integrators/added_2026.py").write_text(METHOD, encoding="utf-8")
    (tree / "src/nearharmonic/systems/added_system.py").write_text(SYSTEM, encoding="utf-8")
    (tmp_path / "only_added.py").write_text(PLUGIN, encoding="utf-8")
    config = tree / "config/smoke.yaml"
    config.write_text(config.read_text(encoding="utf-8").replace("\nsystems:\n", f"\nsystems:\n{LINE}"))
    tests = tree / Path(__file__).relative_to(ROOT).parts[0]
    chosen = [tree / Path(__file__).parent.relative_to(ROOT), *(x for name in FILES for x in tests.rglob(name))]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tree / "src"), str(tmp_path)])}
    words = ["-q", "-n0", "-p", "no:cacheprovider", "-p", "only_added"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words, *chosen], cwd=tree, env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-5000:]
    options = ["--config", "config/smoke.yaml", "--error", "1e-3", "--methods", "ruth,added_method"]
    words = ["recommend", "added_system", *options]
    told = subprocess.run(
        [sys.executable, "-m", "nearharmonic.cli", *words], cwd=tree, env=environment, capture_output=True, text=True,
        check=True,
    ).stdout  # fmt: skip
    assert "added system, t = 100: " in told
    assert " added_method " in told
