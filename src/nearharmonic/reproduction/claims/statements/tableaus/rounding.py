"""Section 4.B: double precision, compensated summation, and where its floor lies."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.reproduction.claims.claim import Decision, background, finding, tallied
from nearharmonic.reproduction.claims.judging.definitions import GREATLY
from nearharmonic.reproduction.claims.results import Results, label, require, short

if TYPE_CHECKING:
    import xarray as xr

#: Half the distance of doubles at 1: what one rounding may change.
UNIT = float(np.finfo(float).eps / 2)


@background(
    id="compensated-summation",
    paper="Section 4.B, below the list",
    sentence="Compensated summation drastically reduces truncation errors for long-term symplectic integration",
    statement="Compensated summation drastically reduces errors of rounding in long integrations",
    threshold="the root mean square of the energy error by rounding at least ten times larger with plain than with "
    f"compensated sums, for each method; median of the last 20 samples; {GREATLY.brief}. The paper calls rounding "
    "truncation",
    bound=GREATLY.number,
    needs=("cubes/stability_rounding.h5",),
)
def compensated_summation(results: Results, factor: float) -> Decision:
    cube = results.cube("stability_rounding")
    rms = cube["energy_error_rms"].isel(sample=slice(-20, None))
    gains = (rms.sel(source="plain") / rms.sel(source="compensated")).median("sample").values
    worst = label(str(cube["integrator"].values[gains.argmin()]))
    gained = f"; gains {short(gains.min(), 2)} ({worst}) to {short(gains.max(), 2)}"
    return tallied(gains >= factor, "methods", f"{gained}{_runs(cube)}")


def _runs(cube: xr.Dataset) -> str:
    """Describe the runs, as far as the cube says."""
    told = f"; {cube.sizes['orbit']} Kepler orbits" if "orbit" in cube.sizes else ""
    if "time" in cube:
        ends = cube["time"].values[:, -1]
        told += f" of {ends.min():.0f} to {ends.max():.0f} periods"
    steps = json.loads(cube.attrs.get("settings", "{}")).get("settings", {}).get("steps")
    return told + (f" in {steps} steps" if steps else "")


@finding(
    id="floor-of-double",
    paper="Figure 1, dashed lines; the statement is this project's",
    sentence="The dashed lines show benchmark profiles for integrators of corresponding color using extended precision",
    statement="Double precision with compensated summation follows extended precision down to its floor of rounding",
    threshold="maximum errors in double and extended precision differ by at most 10 roundings of a double, 1.1 × "
    "10⁻¹⁵, at every step size with both: energies are of order 1, and an energy takes five roundings",
    bound=10.0,
    needs=("cubes/sho.h5",),
)
def floor_of_double(results: Results, roundings: float) -> Decision:
    cube = results.cube("sho")
    require("extended" in cube["precision"].values, "the config asks for no extended precision on the oscillator")
    double, extended = (cube["max_energy_error"].sel(precision=one).values for one in ("double", "extended"))
    known = np.isfinite(double) & np.isfinite(extended)
    off = np.abs(double[known] - extended[known])
    require(off.size, "no run of the oscillator in extended precision is known")
    floor = double[known & (extended < UNIT)]
    beside = f", largest difference {short(off.max(), 2)}"
    if floor.size:
        beside += f"; floor of the double curves {short(floor.min(), 2)} to {short(floor.max(), 2)}"
    return tallied(off <= roundings * UNIT, "runs", beside)
