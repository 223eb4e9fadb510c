"""Multiprecision is reset after each test, and kernels are compiled once per session."""

from __future__ import annotations

import mpmath
import pytest


@pytest.fixture(autouse=True)
def _working_precision():
    with mpmath.workdps(60):
        yield
