"""Kernels compile without numba, which takes longer to load than the integrations of a figure."""

import os
import subprocess
import sys

import pytest

#: Imports of a job, and runs of few and of many coordinates, in lanes, in double-double, of a regularised system, with
#: functions.
TEXT = """
import sys
sys.modules["numba"] = None  # what Python itself does to forbid an import
import numpy as np
import nearharmonic as nh
from nearharmonic.math import cos
from nearharmonic_paper.experiments.paper import reductions, run
from nearharmonic_paper.tasks import job
nh.sweep("henon_heiles", "aba864", [0.1, 0.2, 0.3], t_end=10)
nh.integrate("sho", "ruth", 0.1, t_end=1, precision="extended")
nh.integrate("kepler_regularised", "leapfrog", 40, t_end=400)
nh.ensemble("henon_heiles", "leapfrog", 0.1, t_end=1, q0=np.full((3, 2), 0.1), p0=np.full((3, 2), 0.1))
chain = nh.System(
    name="chain", V=lambda q: sum((x - y) ** 4 for x, y in zip(q[1:], q)), q0=["0.1"] * 60, p0=["0"] * 60, t_end="1",
)
nh.integrate(chain, "leapfrog", 0.1)
pendulum = nh.System(name="pendulum", V=lambda q: -cos(q[0]), q0=["1"], p0=["0"], t_end="1")
nh.integrate(pendulum, "leapfrog", 0.1)
"""


@pytest.mark.slow
def test_a_process_compiles_and_finds_kernels_without_numba(tmp_path):
    variables = os.environ | {"NEARHARMONIC_CACHE_DIR": str(tmp_path)}
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", TEXT], env=variables, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_job_needs_no_numba(breakable):
    """A module of this name in front of numba's: a job that imports it fails."""
    stub = breakable.folder / "src/numba"
    stub.mkdir()
    (stub / "__init__.py").write_text("raise ImportError('numba is not needed here')\n")
    cube = breakable.folder / "results/tiny/cubes/sho.h5"
    cube.unlink()
    for run in (breakable.folder / "results/tiny/runs/sho").rglob("*.h5"):
        run.unlink()
    done = breakable.snakemake("results/tiny/cubes/sho.h5", "-j1", "--configfile", "config/tiny.yaml")
    assert done.returncode == 0, done.stdout
    assert cube.exists()
    assert "integrate" in done.stdout
