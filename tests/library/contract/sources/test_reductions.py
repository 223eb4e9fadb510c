"""Reductions of every experiment are separate from integrations: an edit of a reduction repeats no integration."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

from nearharmonic_paper.tasks.experiment import folders
from nearharmonic_paper.tasks.provenance import ROOT, closure, path_of
from nearharmonic_paper.tasks.reduction import Reductions

#: Dotted names of all modules that declare reductions, with the folder of each.
MODULES = {
    f"{folder}.{path.stem}": folder
    for folder in folders()
    for path in path_of(folder, ROOT).parent.glob("*reductions.py")
}


def test_the_paper_and_the_experiments_beside_it_declare_reductions():
    assert len(MODULES) >= 9
    assert "nearharmonic_paper.experiments.paper.reductions" in MODULES


@pytest.mark.parametrize("module", MODULES)
def test_what_integrates_reaches_no_reduction_and_what_reduces_does(module):
    assert isinstance(import_module(module).reduction, Reductions)
    assert not {name for name in closure(f"{MODULES[module]}.run") if name.endswith(("reductions", ".reduce"))}
    reduces = module if hasattr(import_module(module), "reduce") else f"{MODULES[module]}.reduce"
    assert module in closure(reduces)


@pytest.mark.slow
def test_no_job_that_integrates_loads_xarray():
    """Loading it takes longer than a short run."""
    text = "\n".join(
        [
            "import sys",
            *(f"import {each}.run" for each in sorted({*MODULES.values()})),
            "print('xarray' in sys.modules)",
        ]
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
