"""Small cubes made by hand for the figures of the stress tests, as in ``figure_cubes``."""

import numpy as np
import xarray as xr

from support.cubes.figure_cubes import METHODS, TAU, named, powers


def traces(methods=METHODS):
    """Traces that leave the panel, and up to three gaps a method: [2.5, 2.6], [3.5, 4.5] and from 6 on, per step."""
    tau = np.linspace(0, 2.4, 49)
    trace = powers(len(methods), tau.size, seed=6, low=-1, high=1)
    edges = np.full((2, len(methods), 3), np.nan)
    edges[:, :, 0] = [[2.5], [2.6]]
    edges[:, 1:, 1] = [[3.5], [4.5]]
    edges[:, 2:, 2] = [[6.0], [np.inf]]
    edges += np.arange(len(methods))[:, None] / 8
    growth = 0.0123 * (1 + np.arange(len(methods)))[:, None] * np.ones(3)
    growth[0] = np.inf
    over = ("integrator", "gap")
    return xr.Dataset(
        {
            "half_trace": (("integrator", "tau_per_stage"), trace), "start": (over, edges[0]),
            "end": (over, edges[1]), "growth_per_step": (over, growth), "growth_per_time": (over, growth / 7),
        },
        coords={**named(methods), "stages": ("integrator", np.arange(len(methods)) + 2), "tau_per_stage": tau},
    )  # fmt: skip


def amplitudes(methods=METHODS):
    """Errors of the relativistic oscillator at amplitudes of which two are near, but not at, 0.03 and 1."""
    amplitude = [0.004, 0.031, 0.2, 1.02, 7.0]
    shape = (2, len(amplitude), len(methods), TAU.size)
    dims = ("roles", "amplitude", "integrator", "tau_per_stage")
    return xr.Dataset(
        {
            "max_energy_error": (dims, powers(*shape, seed=7)),
            "mean_energy_error": (dims, powers(*shape, seed=8)),
            "relative_error": (dims[:-1], powers(*shape[:-1], seed=9, low=-3, high=1)),
        },
        coords={**named(methods), "roles": ["own", "exchanged"], "amplitude": amplitude, "tau_per_stage": TAU},
        attrs={"compared_at": 0.07},
    )


def ensembles(methods=METHODS):
    """Henon-Heiles maps on three surfaces, five step sizes and three quantiles; escapes just below and above 1 %."""
    energy, tau = [1 / 24, 1 / 8, 1 / 6], np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    shape = (len(methods), len(energy), tau.size)
    error = powers(*shape, 3, seed=10, low=-7.9, high=-0.1)
    escaped = np.zeros(shape)
    escaped[:, 0, 1], escaped[:, 0, 2], escaped[:, 2, 4] = 0.01, 0.011, 1.0
    return xr.Dataset(
        {
            "energy_error": (("integrator", "energy", "tau_per_stage", "quantile"), error),
            "escaped": (("integrator", "energy", "tau_per_stage"), escaped),
            "linear_limit": ("integrator", 0.27 + 0.04 * np.arange(len(methods))),
        },
        coords={**named(methods), "energy": energy, "tau_per_stage": tau, "quantile": [0.25, 0.5, 1.0]},
    )


#: What :func:`orbits` holds of an orbit: (step, eccentricity) of one lost, one whose perihelion is lost, one not run.
LOST, TURNED, NOT_RUN = (1, 5), (2, 5), (5, 1)


def orbits(methods=METHODS):
    """Kepler maps over six step sizes, two of them of as many steps, and six eccentricities from a circle on."""
    eccentricity = 1 - np.geomspace(1, 0.01, 6)
    shape = (len(methods), 6, eccentricity.size)
    error = powers(*shape, seed=11, low=-9.9, high=-0.1)
    advance = powers(*shape, seed=12, low=-9.9, high=-0.1) * np.where(np.arange(6) % 2, 1, -1)
    kept = np.full(shape, 20.0)
    error[:, *LOST], advance[:, *LOST], kept[:, *LOST] = np.inf, np.nan, 3.5
    advance[:, *TURNED] = np.nan
    for values in (error, advance, kept):
        values[:, *NOT_RUN] = np.nan
    advance[:, :, 0] = np.nan
    steps = np.array([[10.0, 20.0, 20.0, 40.0, 80.0, 160.0]] * len(methods))
    for values in (error, advance, kept):
        values[:, 2] = values[:, 1] if values is not advance else values[:, 2]
    dims = ("integrator", "tau_per_stage", "eccentricity")
    stages = 3 + np.arange(len(methods))
    contour = powers(len(methods), eccentricity.size, seed=13, low=1.8, high=2.5)
    contour[:, -1] = np.nan
    return xr.Dataset(
        {
            "energy_error": (dims, error),
            "perihelion_advance": (dims, advance),
            "orbits_kept": (dims, kept),
            "evaluations_per_orbit": (dims[:2], steps * stages[:, None]),
            "evaluations_for_contour": (("integrator", "eccentricity"), contour),
        },
        coords={**named(methods), "tau_per_stage": 1 / (3 * steps[0]), "eccentricity": eccentricity},
    )


def rounding(methods=METHODS):
    """Root mean squares of energy error and lag by four sources, their exponents and intervals."""
    sources, time = ["plain", "compensated", "extended", "coefficients"], np.geomspace(10, 1000, 8)
    both = ("integrator", "source")
    variables = {}
    for i, variable in enumerate(("energy_error", "lag")):
        numbers = powers(len(methods), 4, time.size, seed=14 + i, low=-15, high=-5)
        variables[f"{variable}_rms"] = ((*both, "sample"), numbers)
        exponent = np.random.default_rng(16 + i).uniform(0.3, 1.7, (len(methods), 4))
        variables[f"{variable}_exponent"] = (both, exponent)
        variables[f"{variable}_interval"] = (both, exponent / 10)
    times = np.array([time * (1 + i / 5) for i in range(len(methods))])
    variables["time"] = (("integrator", "sample"), times)
    return xr.Dataset(variables, coords=named(methods) | {"source": sources})
