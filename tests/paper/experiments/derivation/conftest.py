"""Isolated cases of the derivation, solved once for all tests."""

from __future__ import annotations

import pytest

from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic_paper.experiments.derivation.conditions import Equations
from nearharmonic_paper.experiments.derivation.families import solve

SEED = 20150106


@pytest.fixture(scope="session")
def five():
    return solve(Equations(5, 6), RandomStarts(4000, SEED, box=2.5, bound=20.0))


@pytest.fixture(scope="session")
def six():
    return solve(Equations(6, 7), RandomStarts(8000, SEED, box=2.5, bound=20.0))
