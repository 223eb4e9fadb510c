"""Reductions of the stress tests on datasets made by hand, whose results are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic_paper.experiments.stability.kepler.reductions import reduction as of_maps
from nearharmonic_paper.experiments.stability.kepler.run import kepler_apoapsis

METHODS = ["leapfrog", "babs7o7h"]
ECCENTRICITIES = [0.0, 0.3, 0.6]


def turned(rates):
    """States at apoapsis, once a period, of ellipses that turn by ``rates`` (integrator, tau) a period."""
    places = ("integrator", "tau_per_stage", "eccentricity", "sample", "component")
    e, angle = np.broadcast_arrays(np.array(ECCENTRICITIES)[:, None], np.array(rates)[..., None, None] * np.arange(6))
    states = kepler_apoapsis(e.ravel(), angle.ravel()).reshape(*angle.shape, 8)
    return xr.Dataset(
        {"q": (places, states[..., 0:2]), "p": (places, states[..., 4:6])},
        {"integrator": METHODS, "eccentricity": ECCENTRICITIES, "tau_per_stage": [0.1, 0.01]},
    )


@pytest.fixture
def orbits():
    """The first method loses the last orbit at the coarse step size; the second skips it at the fine one."""
    runs = turned([[1e-3, -0.2], [0.4, 1e-9]])
    errors = np.full((2, 2, 3), 1e-3)
    errors[0, 0, 2], errors[1, 1, 2] = np.inf, np.nan
    runs["energy_error"] = ("integrator", "tau_per_stage", "eccentricity"), errors
    runs["steps_per_orbit"] = ("integrator", "tau_per_stage"), [[10, 100], [2, 14]]
    return runs


def test_advance_is_rate_of_turning_of_ellipses_that_are_kept(orbits):
    """The angle is computed to a few roundings of 2 pi, so that a rate over 5 periods is known to 1e-15."""
    advance = of_maps.of(orbits).perihelion_advance
    assert advance.dims == ("integrator", "tau_per_stage", "eccentricity")
    assert np.isnan(advance.sel(eccentricity=0)).all()
    assert advance.sel(eccentricity=0.3).values == pytest.approx(np.array([[1e-3, -0.2], [0.4, 1e-9]]), abs=2e-15)
    assert np.isnan(advance.sel(eccentricity=0.6)).values.tolist() == [[True, False], [False, True]]


def test_orbit_contour_is_at_crossing_of_its_power_law():
    """c n^-2 is 1e-6 at 1000 sqrt(c); each doubling of n counts once or twice, as coarse grids round."""
    n = np.array([100, 100, 200, 400, 800, 1600, 1600, 3200, 6400])
    factor = np.array([[0.25, 1.0], [4.0, 100.0]])
    places = ("integrator", "tau_per_stage", "eccentricity")
    cube = xr.Dataset(
        {
            "evaluations_per_orbit": (("integrator", "tau_per_stage"), [n, n]),
            "energy_error": (places, factor[:, None, :] / (1.0 * n * n)[:, None]),
        },
        {"integrator": METHODS, "eccentricity": [0.1, 0.2], "tau_per_stage": 1 / np.arange(1, 10)},
    )
    contour = of_maps.of(cube, over="tau_per_stage").evaluations_for_contour
    assert contour.values == pytest.approx(np.array([[500, 1000], [2000, np.nan]]), rel=1e-12, nan_ok=True)
