"""Functions of numba on disk: found again by a second process, and compiled again after an edit of what they use."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

MODULES = {
    "constants.py": "NUMBER = 2.0\n",
    "callee.py": """
from nearharmonic.core.jit import jit
from constants import NUMBER

@jit
def callee(x):
    return NUMBER * x
""",
    "caller.py": """
from nearharmonic.core.jit import jit
from callee import callee

@jit
def caller(x):
    return callee(x) + 1.0

print(caller(1.0), sum(caller.stats.cache_hits.values()))
""",
}


@pytest.fixture
def folder(tmp_path):
    for name, text in MODULES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def told(folder, cache):
    environment = os.environ | {"NEARHARMONIC_CACHE_DIR": str(cache)}
    command = [sys.executable, "caller.py"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True)


def test_an_edit_of_a_callees_constant_compiles_the_caller_again(folder):
    cache = folder / "cache"
    assert [told(folder, cache).stdout for _ in range(2)] == ["3.0 0\n", "3.0 1\n"]
    (folder / "constants.py").write_text("NUMBER = 3.0\n", encoding="utf-8")
    assert told(folder, cache).stdout == "4.0 0\n"


@pytest.mark.parametrize("cache", ["constants.py", "/proc/nearharmonic", "open"])
def test_a_folder_that_cannot_be_used_costs_one_warning(folder, cache):
    (folder / "open").mkdir()
    (folder / "open").chmod(0o777)
    done = told(folder, folder / cache)
    assert done.stdout == "3.0 0\n"
    assert done.stderr.count("NEARHARMONIC_CACHE_DIR") == 1
    assert not list(folder.rglob("*.nb?"))
