"""Rows of the tables of the ensembles, from cubes made by hand; what cubes add to the maps, from closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic_paper.experiments.stability.reductions import (
    henon_heiles_cube,
    henon_heiles_table,
    kepler_cube,
    kepler_table,
    rounding_cube,
    rounding_table,
    stacked,
)

ONE = {"units": "1", "long_name": "made by hand"}
QUANTILES = (0.05, 0.5, 0.95, 1.0)


def cube_of(reduction, runs):
    return reduction(stacked(list(runs), runs.values()))


def henon_heiles(shares):
    """Escaped shares over (energy, tau_per_stage); the quantile q at step size number i errs by (i + 1) q."""
    errors = np.array([1.0, 2.0, 3.0, 4.0])[None, :, None] * np.array(QUANTILES) * np.ones((2, 1, 1))
    return xr.Dataset(
        {
            "escaped": (("energy", "tau_per_stage"), np.array(shares), ONE),
            "energy_error": (("energy", "tau_per_stage", "quantile"), errors, ONE),
        },
        coords={"tau_per_stage": [0.1, 0.2, 0.3, 0.4], "energy": [0.125, 1 / 6], "quantile": list(QUANTILES)},
    )


@pytest.fixture
def ensembles():
    runs = {
        "leapfrog": henon_heiles([[0, 0.01, 0.011, 0], [0.5, 0, 0, 0]]),
        "ruth": henon_heiles([[0, 0, 0, 0], [0, 0, 0.2, 0.1]]),
    }
    return cube_of(henon_heiles_cube, runs)


def test_row_has_largest_trusted_step_errors_and_share_of_limit(ensembles):
    """One percent is trusted; a loss ends it, though coarser steps lose none. Limits: 2, and 1.573401947 over 3."""
    rows = {(row["integrator"], row["energy"]): row for row in henon_heiles_table(ensembles).records()}
    assert rows["leapfrog", 0.125] == {
        "integrator": "leapfrog",
        "energy": 0.125,
        "linear_limit_tau_per_stage": 2.0,
        "tau_per_stage_escaped_up_to_0.01": 0.2,
        "median_energy_error_there": 1.0,
        "worst_energy_error_there": 2.0,
        "share_of_linear_limit": 0.1,
    }
    ruth = rows["ruth", 0.125]
    assert ruth["linear_limit_tau_per_stage"] == pytest.approx(1.573401947 / 3, rel=1e-9)
    assert ruth["share_of_linear_limit"] == pytest.approx(0.4 * 3 / 1.573401947, rel=1e-9)
    assert (ruth["median_energy_error_there"], ruth["worst_energy_error_there"]) == (2.0, 4.0)
    assert rows["ruth", 1 / 6]["tau_per_stage_escaped_up_to_0.01"] == 0.2


def test_a_method_that_is_never_trusted_has_no_errors_there(ensembles):
    (row,) = [
        r for r in henon_heiles_table(ensembles).records() if (r["integrator"], r["energy"]) == ("leapfrog", 1 / 6)
    ]
    assert np.isnan(
        [v for k, v in row.items() if k not in {"integrator", "energy", "linear_limit_tau_per_stage"}]
    ).all()


def test_kepler_evaluations_are_steps_times_stages_at_nearest_eccentricity():
    """Errors 1e-6 (100 (1 + e) / n)^2 of n steps a period: the contour lies at 100 (1 + e) steps."""
    grid = np.array([0.0, 0.21, 0.3, 0.52, 0.79, 0.9, 0.96, 0.99])
    steps = np.array([10, 1000])
    states = ("tau_per_stage", "eccentricity", "sample", "component"), np.zeros((2, 8, 3, 2)), ONE
    errors = ("tau_per_stage", "eccentricity"), 1e-6 * (100 * (1 + grid) / steps[:, None]) ** 2, ONE
    part = xr.Dataset(
        {"q": states, "p": states, "energy_error": errors, "steps_per_orbit": ("tau_per_stage", steps, ONE)},
        coords={"tau_per_stage": [0.1, 0.001], "eccentricity": grid, "component": [0, 1]},
    )
    cube = cube_of(kepler_cube, {"leapfrog": part, "babs7o7h": part})
    assert not {"q", "p", "sample", "component"} & set(cube.variables)
    assert cube.evaluations_per_orbit.sel(integrator="leapfrog").values.tolist() == [10, 1000]
    assert cube.evaluations_per_orbit.sel(integrator="babs7o7h").values.tolist() == [70, 7000]
    first, second = kepler_table(cube).records()
    shown = {"e_0.000": 100, "e_0.210": 121, "e_0.520": 152, "e_0.790": 179, "e_0.900": 190, "e_0.960": 196,
             "e_0.990": 199}  # fmt: skip
    assert first == {"integrator": "leapfrog"} | {k: pytest.approx(v) for k, v in shown.items()}
    assert second == {"integrator": "babs7o7h"} | {k: pytest.approx(7 * v) for k, v in shown.items()}


TIME = np.array([1.0, 4.0, 9.0, 16.0])


def rounding(scale):
    """Two orbits: energy errors (1, -3) t^(1/2), lags (2, 4) t^(3/2); in the other source energies grow as t."""
    energy, lag = np.array([[1.0], [-3.0]]), np.array([[2.0], [4.0]])
    return xr.Dataset(
        {
            "energy_error": (
                ("source", "orbit", "sample"), scale * np.array([energy * TIME**0.5, energy * TIME]), ONE,
            ),
            "lag": (
                ("source", "orbit", "sample"), scale * np.array([lag * TIME**1.5] * 2), ONE | {"units": "rad"},
            ),
            "time": ("sample", TIME, ONE),
        },
        coords={"source": ["plain", "coefficients"]},
    ).set_coords("time")  # fmt: skip


def test_rounding_rows_have_power_law_final_rms_and_bias():
    """At t = 16: rms of energies 4 sqrt((1 + 9)/2) and mean |-1| 4; of lags 64 sqrt((4 + 16)/2) and 3 x 64."""
    cube = cube_of(rounding_cube, {"leapfrog": rounding(1.0), "ruth": rounding(10.0)})
    rows = {(r["integrator"], r["source"], r["quantity"]): r for r in rounding_table(cube).records()}
    assert len(rows) == 8
    for name, scale in (("leapfrog", 1), ("ruth", 10)):
        energy, lag = rows[name, "plain", "energy_error"], rows[name, "plain", "lag"]
        assert energy["exponent"] == pytest.approx(0.5, rel=1e-12)
        assert energy["rms_at_end"] == pytest.approx(scale * 4 * 5**0.5, rel=1e-14)
        assert energy["bias_over_rms"] == pytest.approx(1 / 5**0.5, rel=1e-14)
        assert lag["exponent"] == pytest.approx(1.5, rel=1e-12)
        assert lag["rms_at_end"] == pytest.approx(scale * 64 * 10**0.5, rel=1e-14)
        assert lag["bias_over_rms"] == pytest.approx(3 / 10**0.5, rel=1e-14)
        assert (energy["brouwer"], lag["brouwer"]) == (0.5, 1.5)
        # Without one orbit the exponent is the same: both errors are pure powers.
        assert abs(energy["interval_95"]) < 1e-12
        assert rows[name, "coefficients", "energy_error"]["exponent"] == pytest.approx(1.0, rel=1e-12)
        assert rows[name, "coefficients", "energy_error"]["brouwer"] == ""
    np.testing.assert_allclose(cube.energy_error_rms.sel(integrator="ruth", source="plain"), 10 * 5**0.5 * TIME**0.5)
    assert (cube.lag_bias.attrs["units"], cube.lag_exponent.attrs["units"], cube.lag_rms.attrs["units"]) == (
        "rad", "1", "rad",
    )  # fmt: skip


def test_cube_of_one_method_has_times_of_each_method():
    assert cube_of(rounding_cube, {"leapfrog": rounding(1.0)}).time.dims == ("integrator", "sample")


def test_interval_of_exponent_is_jackknife_of_its_orbits():
    """Three orbits whose squares are 1 at t = 1 and 2, 2, 8 at t = 4: without one, their means there are 5, 5 and 2.

    The exponents a, a, b differ by ln(5/2)/(2 ln 4); their squares about the mean sum to 2/3 (a - b)^2, which the
    jackknife multiplies by (n - 1)/n = 2/3; t_0.975 is 4.302653 for two degrees of freedom.
    """
    errors = np.sqrt([[1.0, 2.0], [1.0, 2.0], [1.0, 8.0]])
    over = ("source", "orbit", "sample")
    part = xr.Dataset(
        {"energy_error": (over, [errors], ONE), "lag": (over, [errors], ONE), "time": ("sample", [1.0, 4.0], ONE)},
        coords={"source": ["plain"]},
    )
    first, _ = rounding_table(cube_of(rounding_cube, {"leapfrog": part})).records()
    assert first["exponent"] == pytest.approx(np.log(4) / (2 * np.log(4)), rel=1e-14)
    assert first["interval_95"] == pytest.approx(4.302652729749462 * 2 / 3 * np.log(2.5) / (2 * np.log(4)), rel=1e-13)
