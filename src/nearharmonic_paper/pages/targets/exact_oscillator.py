"""The tables of docs/results/exact_oscillator.md, from the cube of the target ``exact_oscillator``."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import inf

import numpy as np
import xarray as xr

from nearharmonic.output.page import filled_page
from nearharmonic.output.store import read
from nearharmonic_paper.experiments.exact_oscillator.reductions import BEST, crossing_table
from nearharmonic_paper.experiments.exact_oscillator.settings import CHARGES
from nearharmonic_paper.pages.trained import signed, table

#: Charges of the table, beside which the figure has the others.
SHOWN = CHARGES[:2]


def leads(cube: xr.Dataset) -> str:
    """Return by how many decades the best exact method is ahead of the best of T + V, at the ends of the energies."""
    medians = cube.sel(quantile=0.5, charge=1.0)
    split, exact = medians.energy_error.min("integrator"), medians.exact_energy_error.min("exact_integrator")
    decades = np.log10(split / exact).isel(energy=[0, -1])
    header = ("τ/s", *(f"H = {Fraction(H).limit_denominator(10**6)}" for H in decades.energy.values.tolist()))
    rows = [
        (f"{tau:g}", *(signed(one, 1) for one in decades.sel(tau_per_stage=tau).values.tolist()))
        for tau in decades.tau_per_stage.values.tolist()
    ]
    return table(header, rows)


def crossings(cube: xr.Dataset) -> str:
    """Return a row for each method and step size: the amplitudes up to which it errs less than the best of T + V."""
    found = {}
    for row in crossing_table(cube).records():
        if row["T + V"] == BEST:
            found[row["exact oscillator"], row["tau_per_stage"], row["charge"]] = row
    pairs = [(name, tau) for name in cube.exact_label.values.tolist() for tau in cube.tau_per_stage.values.tolist()]
    rows = [(name, f"{tau:g}", *(cell(found[name, tau, charge]) for charge in SHOWN)) for name, tau in pairs]
    return table(("method", "τ/s", *(f"charge {charge:g}" for charge in SHOWN)), rows, left=4)


def cell(row: dict[str, float]) -> str:
    """An amplitude and its interval."""
    at, low, high = (row[f"amplitude{end}"] for end in ("", "_low", "_high"))
    return {0: "nowhere", inf: "everywhere"}.get(at, f"{at:.3g} ({low:.3g} to {high:.3g})")


def page(page: str, cube: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page."""
    found = read(cube)
    return {"page": filled_page(page, {"leads": leads(found), "crossings": crossings(found)})}
