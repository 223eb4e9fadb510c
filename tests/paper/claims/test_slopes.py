"""Local slopes and the lengths of their ranges, for curves with known values."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic_paper.claims.claim import Undecided
from nearharmonic_paper.claims.judging import BAND, LONG, SHORT, Curves, large_steps, local_slopes, orders

X = np.geomspace(1e-4, 1, 161)  # forty a decade


def curves(error):
    """A curve of the error given as a function of the step size, with a floor of 1e-16."""
    dims = ("integrator", "tau_per_stage")
    row = np.maximum(error(X), 1e-16)[None]
    cube = xr.Dataset(
        {"max_energy_error": (dims, row), "tau": (dims, 3 * X[None])},
        coords={"integrator": ["one"], "tau_per_stage": X},
    )
    return Curves(cube)


def pieces(*powers):
    """A curve through 1e-6 at 0.01 with a power of the step size in each piece: (from, power)."""

    def error(x):
        log, found = np.log10(x), np.zeros(x.size)
        for (low, power), (high, _) in zip(powers, (*powers[1:], (np.inf, 0)), strict=True):
            found += power * (np.clip(log, low, high) - np.clip(-2.0, low, high))
        return 1e-6 * 10**found

    return error


def test_the_local_slope_of_a_power_law_is_its_power():
    found = local_slopes(curves(lambda x: 7 * x**4), "one")
    inside = (X > 1e-3) & (X < 0.9)
    assert found[inside] == pytest.approx(4, abs=1e-9)


def test_the_local_slope_is_fitted_to_five_step_sizes():
    error = lambda x: x**4 * np.where(abs(x - X[80]) < 1e-9, np.e, 1)  # noqa: E731
    found = local_slopes(curves(error), "one")
    near = np.arange(161)[np.abs(found - 4) > 1e-6]
    assert near.tolist() == [78, 79, 81, 82]  # at the point itself it is even
    # Least squares over the places -2 ... 2 of a fortieth of a decade: weight k/10 of a unit of ln(e).
    assert found[78] - 4 == pytest.approx(0.2 * 40 / np.log(10))


def test_ten_step_sizes_per_decade_decide_no_order():
    """Neighbours are a tenth of a decade apart: each is alone in its window, whatever the error does."""
    few = Curves(curves(lambda x: 7 * x**4).cube.isel(tau_per_stage=slice(None, None, 4)))
    with pytest.raises(Undecided, match=r"fewer than three step sizes in 0\.1 decades"):
        orders(few, {"one": 4}, BAND)


def test_a_gap_leaves_no_slope_beside_it():
    found = local_slopes(curves(lambda x: np.where(abs(x - X[80]) < 1e-9, np.inf, x**4)), "one")
    assert np.isnan(found[78:83]).all()
    assert np.isfinite(found[[77, 83]]).all()


@pytest.mark.parametrize(("off", "verdict"), [(-0.51, "fails"), (-0.49, "holds"), (0.49, "holds"), (0.51, "fails")])
def test_a_slope_keeps_to_an_order_within_the_band(off, verdict):
    assert orders(curves(lambda x: x ** (4 + off)), {"one": 4}, BAND).verdict == verdict


@pytest.mark.parametrize(
    ("decades", "verdict"),
    [(LONG + 0.1, "holds"), (LONG, "holds in part"), (SHORT + 0.1, "holds in part"), (SHORT, "fails")],
)
def test_the_length_of_the_stretch_decides(decades, verdict):
    """Slope 6 between slopes of 4 and 9: windows at both ends hold two slopes, and take up to a tenth of a decade."""
    error = pieces((-9, 4), (-2, 6), (-2 + decades, 9))
    decision = orders(curves(error), {"one": 6}, BAND)
    assert decision.verdict == verdict


def test_rounding_has_no_order():
    with pytest.raises(Undecided, match="fewer than three step sizes at which all curves are truncation"):
        orders(curves(lambda x: 0 * x), {"one": 4}, BAND)


def test_large_steps_are_the_decade_below_one_percent():
    asked = large_steps(curves(lambda x: x**2), "one")  # 1 % at 0.1
    assert X[asked.asked].min() == pytest.approx(0.01, rel=0.06)
    assert X[asked.asked].max() == pytest.approx(0.1, rel=0.06)
    with pytest.raises(Undecided, match="in the decade below an error of 1 %"):
        large_steps(curves(lambda x: 1e-3 * x), "one")
