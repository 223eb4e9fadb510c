"""Multiprecision is reset after each test, and kernels are compiled once per session."""

from __future__ import annotations

import mpmath
import pytest
from hypothesis import settings

# A busy machine is no fault: tests have no deadline of their own.
settings.register_profile("shared", deadline=None)
settings.load_profile("shared")


@pytest.fixture(autouse=True)
def _working_precision():
    with mpmath.workdps(60):
        yield
