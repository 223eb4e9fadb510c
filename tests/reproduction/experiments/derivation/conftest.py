"""Isolated cases of the derivation, solved once for all tests."""

from __future__ import annotations

import pytest

from nearharmonic.reproduction.experiments.derivation.conditions import Equations
from nearharmonic.reproduction.experiments.derivation.isolated import solve

SEED = 20150106


@pytest.fixture(scope="session")
def five():
    return solve(Equations(5, 6), starts=4000, seed=SEED)


@pytest.fixture(scope="session")
def six():
    return solve(Equations(6, 7), starts=8000, seed=SEED)
