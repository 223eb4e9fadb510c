"""Results have the same bits on a processor without vectors of 256 bits and without fused multiply-add."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import nearharmonic as nh
from support.projects.decisive_computations import digests

PROGRAM = Path(__file__).parents[1] / "support/projects/decisive_computations.py"


def older_processor():
    """The environment in which numpy, BLAS, the C library and the compiler see one: docs/explanation/processors.md."""
    features = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])  # type: ignore[index]
    return {
        "OPENBLAS_CORETYPE": "Prescott",
        "NPY_DISABLE_CPU_FEATURES": " ".join(features),
        "NUMBA_CPU_NAME": "generic",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX512F,-FMA4",
        "PYTHONPATH": str(Path(nh.__file__).parents[1]),
    }


@pytest.mark.slow
def test_another_processor_computes_the_same_bits():
    environment = os.environ | older_processor()
    done = subprocess.run([sys.executable, PROGRAM], env=environment, capture_output=True, text=True, check=True)
    there, libraries_there = json.loads(done.stdout)
    here, libraries_here = digests()
    assert there == here
    if libraries_there == libraries_here:
        pytest.skip("the libraries have the same bits, so that this machine shows nothing")
