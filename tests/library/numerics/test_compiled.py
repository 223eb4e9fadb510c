"""Functions of compiled loops, against mpmath."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from nearharmonic.numerics.compiled import exponential, logarithm

pytestmark = pytest.mark.slow  # numba compiles each function


def test_exponential_is_correct_to_one_ulp():
    for x in (*np.linspace(-699.5, 699.5, 401), 1e-300, 0.34657, -0.34658):
        exact = mpmath.exp(mpmath.mpf(float(x)))
        assert abs(mpmath.mpf(exponential(float(x))) / exact - 1) < 1.5 * 2.0**-52
    assert (exponential(-1e4), exponential(1e4)) == (0, np.inf)


def test_logarithm_is_correct_to_one_ulp():
    for x in (*np.geomspace(1e-300, 1e300, 101), 0.99, 1.0, 1.01):
        exact = mpmath.log(mpmath.mpf(float(x)))
        assert abs(mpmath.mpf(logarithm(float(x))) - exact) <= 1.5 * 2.0**-52 * abs(exact)
    assert (logarithm(-1.0), logarithm(0.0)) == (np.inf, np.inf)
