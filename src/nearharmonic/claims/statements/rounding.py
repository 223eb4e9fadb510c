"""Section 4.B: double precision, compensated summation, and where its floor lies."""

from __future__ import annotations

import numpy as np

from nearharmonic.claims.claim import Decision, claim, counted
from nearharmonic.claims.results import Results, Undecided, short

#: Half the distance of doubles at 1: what one rounding may change.
UNIT = float(np.finfo(float).eps / 2)


@claim(
    id="compensated-summation",
    paper="Section 4.B, below the list",
    statement="Compensated summation drastically reduces the error of rounding in long integrations",
    threshold="root mean square of the energy error by rounding of the last sample, plain over compensated, at least "
    "10, a decimal digit, for each method",
    needs=("cubes/stability_rounding.h5",),
    target="stability",
)
def compensated_summation(results: Results) -> Decision:
    cube = results.cube("stability_rounding")
    last = cube["energy_error_rms"].isel(sample=-1)
    gains = (last.sel(source="plain") / last.sel(source="compensated")).values
    names = cube["integrator"].values
    worst = int(gains.argmin())
    value = f"{int((gains >= 10).sum())} of {gains.size} methods"
    return counted(list(gains >= 10), f"{value}; gains {short(gains.min())} ({names[worst]}) to {short(gains.max())}")


@claim(
    id="floor-of-double",
    paper="Figure 1, dashed lines",
    statement="Double precision with compensated summation follows extended precision down to its floor of rounding",
    threshold="the two maximum errors differ by at most 10 roundings of a double, 1.1e-15, at every step size at which "
    "both are known: energies are of order 1, and an energy takes five roundings",
    needs=("cubes/sho.h5",),
)
def floor_of_double(results: Results) -> Decision:
    cube = results.cube("sho")
    if "precision" not in cube.dims or "extended" not in cube["precision"].values:
        message = "the config asks for no extended precision on the oscillator"
        raise Undecided(message)
    double, extended = (cube["max_energy_error"].sel(precision=one).values for one in ("double", "extended"))
    known = np.isfinite(double) & np.isfinite(extended)
    off = np.abs(double[known] - extended[known])
    if off.size == 0:
        message = "no run of the oscillator in extended precision is known"
        raise Undecided(message)
    below = extended[known] < UNIT
    floor = double[known][below]
    value = f"{int((off <= 10 * UNIT).sum())} of {off.size} runs, largest difference {short(off.max(), 2)}"
    if floor.size:
        value += f"; floor of the double curves {short(floor.min(), 2)} to {short(floor.max(), 2)}"
    return counted(list(off <= 10 * UNIT), value)
