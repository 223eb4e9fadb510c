"""Reductions of every experiment are separate from integrations: an edit of a reduction repeats no integration."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import pytest

from nearharmonic_paper.tasks import sources
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_paper.tasks.sources import closure

EXPERIMENTS = sources.ROOT / "reproduction/experiments"
#: Dotted names of all slices that declare reductions.
SLICES = sorted(
    ".".join(("nearharmonic", *path.parent.relative_to(sources.ROOT).parts))
    for path in EXPERIMENTS.rglob("reductions.py")
)


def test_the_paper_and_the_experiments_beside_it_declare_reductions():
    assert len(SLICES) >= 9
    assert "nearharmonic_paper.experiments.paper" in SLICES


@pytest.mark.parametrize("slice_", SLICES)
def test_what_integrates_reaches_no_reduction_and_what_reduces_does(slice_):
    assert isinstance(import_module(f"{slice_}.reductions").reduction, Reductions)
    assert not {name for name in closure(f"{slice_}.run") if name.endswith((".reductions", ".reduce"))}
    (reduces,) = {name for name in ("reduce", "reductions") if _has(slice_, name, "reduce")}
    assert f"{slice_}.reductions" in closure(f"{slice_}.{reduces}")


def _has(slice_, module, function):
    name = f"{slice_}.{module}"
    return find_spec(name) is not None and hasattr(import_module(name), function)


@pytest.mark.slow
def test_no_job_that_integrates_loads_xarray():
    """Loading it takes longer than a short run."""
    text = "\n".join(["import sys", *(f"import {each}.run" for each in SLICES), "print('xarray' in sys.modules)"])
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
