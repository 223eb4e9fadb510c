"""Statistics over problems: quantiles, means over resamples, and the intervals that hold most of these."""

from __future__ import annotations

from math import frexp, ldexp

import numpy as np
import xarray as xr

from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import bounds_coordinate, coordinate

#: Number of resamples of the problems, and coverage of an interval.
RESAMPLES, CONFIDENCE = 1000, 0.95
#: Of the anharmonicities of the problems.
QUANTILES = (0.05, 0.5, 0.95)


def anharmonicity_quantiles(runs: xr.Dataset, problems: str) -> xr.DataArray:
    """Return the quantiles over ``problem`` of the anharmonicity; ``problems`` names these in words."""
    fractions = coordinate("quantile", list(QUANTILES), f"fraction of the {problems} that are less anharmonic")
    found: xr.DataArray = runs.anharmonicity.quantile(QUANTILES, "problem", skipna=False).transpose(..., "quantile")
    return found.assign_coords(fractions).assign_attrs(runs.anharmonicity.attrs)


def resampled_means(values: xr.DataArray, seed: int, resamples: int = RESAMPLES) -> xr.DataArray:
    """Return the means of ``values`` over ``problem`` in each resample of the problems, along ``resample``.

    All methods, step sizes and strengths share the problems of a resample.
    """
    count = values.sizes["problem"]
    counts = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), resamples)
    means: xr.DataArray = xr.apply_ufunc(
        _means, values, kwargs={"counts": counts}, input_core_dims=[["problem"]], output_core_dims=[["resample"]]
    )
    return means


def _means(values: Floats, counts: Floats) -> Floats:
    """Return means (..., R) over the last axis of M problems, weighted by ``counts`` (R, M).

    The order of additions in a matrix product depends on the processor. The values are therefore rounded to multiples
    of a power of two for which all sums are exact in any order: by at most 10^-12 for logarithms of 192 problems. NaN
    stays NaN.
    """
    sizes = counts.sum(axis=1)
    _, exponent = frexp(float(np.nanmax(np.abs(values))) * int(sizes.max()))
    unit = ldexp(1.0, exponent - 52)
    found: Floats = np.rint(values / unit) @ counts.T.astype(float) * unit / sizes
    return found


def interval(values: xr.DataArray) -> xr.DataArray:
    """Return the ends, along ``bound``, of the interval with :data:`CONFIDENCE` of the resamples."""
    tails = [0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2]
    ends = values.quantile(tails, "resample", skipna=False).rename(quantile="bound")
    return ends.transpose(..., "bound").assign_coords(bounds_coordinate())
