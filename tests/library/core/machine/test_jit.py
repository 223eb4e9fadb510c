"""Functions of numba on disk: reused by a new process, and recompiled after an edit of their dependencies."""

from __future__ import annotations

import importlib
import resource
import sys

import pytest

from nearharmonic.core import disk
from nearharmonic.core.reals import jit

CALLEE = """
from nearharmonic.core.reals import jit

NUMBER = 2.0

@jit
def callee_of_a_test(x):
    return NUMBER * x
"""
CALLER = """
from nearharmonic.core.reals import jit
from callee_of_a_test import callee_of_a_test

@jit
def caller_of_a_test(x):
    return callee_of_a_test(x) + 1.0
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("NEARHARMONIC_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(disk, "_WARNED", [])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # of an edit within a second, Python would not notice
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")
    (tmp_path / "caller_of_a_test.py").write_text(CALLER, encoding="utf-8")
    return tmp_path


def loaded_anew():
    """The caller's value at 1, and how often it was found on disk."""
    for name in ("callee_of_a_test", "caller_of_a_test"):
        sys.modules.pop(name, None)
    caller = importlib.import_module("caller_of_a_test").caller_of_a_test
    return caller(1.0), sum(caller.stats.cache_hits.values())


@pytest.mark.slow
@pytest.mark.parametrize("place", [".", "elsewhere"])
def test_an_edit_of_a_callees_constant_compiles_the_caller_again(folder, place):
    callee = folder / place / "callee_of_a_test.py"
    callee.write_text(CALLEE, encoding="utf-8")
    assert [loaded_anew() for _ in range(2)] == [(3.0, 0), (3.0, 1)]
    callee.write_text(CALLEE.replace("2.0", "3.0"), encoding="utf-8")
    assert loaded_anew() == (4.0, 0)


@pytest.mark.parametrize(("mode", "size"), [(0o777, resource.RLIM_INFINITY), (0o700, 100)])
def test_a_shared_folder_and_a_full_disk_cost_one_warning(folder, caplog, mode, size):
    (folder / "cache").mkdir()
    (folder / "cache").chmod(mode)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        assert [jit(function)(1.0) for function in (lambda x: x + 1, lambda x: x + 2)] == [2.0, 3.0]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [record.getMessage().count("NEARHARMONIC_CACHE_DIR") for record in caplog.records] == [1]
    assert not list(folder.rglob("*.nb?"))
