"""The tables of docs/results/crystals.md, from the cube of the target ``crystals``."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite

import numpy as np
import xarray as xr

from nearharmonic.output.page import filled_page
from nearharmonic.output.store import read
from nearharmonic_paper.claims.results import short
from nearharmonic_paper.pages.trained import label, signed, table
from nearharmonic_studies.crystals.reductions import UNREGISTERED, USELESS

#: Forces in the fastest period that the tables show: the nearest ones of the cube.
SHOWN, COMPARED, BATHED = (40.0, 26.0, 20.0, 16.0, 13.0, 10.0, 6.3), 26.0, (14.0, 10.0)
#: Temperature of the table of errors, over that of the melting point, and kinds of methods.
WARM, KINDS = 0.1, {"general": "best general", "paper": "best of the paper", "trained": "best trained"}
#: Forces at which leads of the method trained on crystals are shown, that of the middle of its window, the lead that a
#: registered method has, from this temperature in K, and the warmest one over melting.
AROUND, MIDDLE = (26.0, 20.0, 16.0, 13.0, 10.0), 16.0
REQUIRED, COLDEST, WARMEST = 0.3, 50.0, 0.3


def leaders(cube: xr.Dataset) -> str:
    """Return the leading method and its lead in decades, by crystal, temperature and forces."""
    forces = [nearest(cube, "forces", one) for one in SHOWN]
    lines = []
    for crystal in cube.crystal.values:
        for temperature in cube.temperature.values:
            one = cube.sel(crystal=crystal, temperature=temperature)
            cells = [cell(str(one.leader.sel(forces=n).item()), float(one.lead.sel(forces=n))) for n in forces]
            lines.append((str(crystal), f"{temperature:g}", *cells))
    return table(("crystal", "T / T of melting", *(f"{n:g} forces" for n in forces)), lines, left=9)


def cell(name: str, lead: float) -> str:
    """A leader and its lead; a dash without one."""
    return f"{label(name)} {lead:.1f}" if name and isfinite(lead) else "–"


def errors(cube: xr.Dataset) -> str:
    """Return the errors of leapfrog and of the best methods of each kind, by crystal, with size and anharmonicity."""
    temperature, forces = nearest(cube, "temperature", WARM), nearest(cube, "forces", COMPARED)
    lines = []
    for crystal in cube.crystal.values:
        one = cube.sel(crystal=crystal, temperature=temperature, forces=forces, quantile=0.5)
        best = [one.max_energy_error.where(one.kind == kind).min().item() for kind in KINDS]
        values = [one.max_energy_error.sel(integrator="leapfrog").item(), *best]
        lines.append(
            (str(crystal), str(one.coordinates.item()), f"{one.delta.item():.2f}", *(short(x, 2) for x in values))
        )
    return table(("crystal", "coordinates", "δ", "leapfrog", *KINDS.values()), lines)


def trained(cube: xr.Dataset) -> str:
    """Return the lead in decades of the method trained on crystals over all others, by crystal and temperature."""
    lead = lead_on_crystals(cube)
    forces = [nearest(cube, "forces", one) for one in AROUND]
    lines = []
    for crystal in cube.crystal.values:
        melting = float(cube.melting.sel(crystal=crystal))
        for temperature in cube.temperature.values:
            leads = [float(lead.sel(crystal=crystal, temperature=temperature, forces=n)) for n in forces]
            kelvin = f"{temperature * melting:.0f}" if isfinite(melting) else ""
            lines.append(
                (str(crystal), f"{temperature:g}", kelvin, *(signed(one, 1) if isfinite(one) else "–" for one in leads))
            )
    return table(("crystal", "T / T of melting", "T in K", *(f"{n:g} forces" for n in forces)), lines)


def verdict(cube: xr.Dataset) -> str:
    """Return the lead at the middle of the window, from the temperature that was asked for up to ``WARMEST``."""
    warm = (cube.temperature * cube.melting.fillna(inf) >= COLDEST) & (cube.temperature <= WARMEST)
    found = lead_on_crystals(cube).sel(forces=nearest(cube, "forces", MIDDLE)).where(warm).values
    leads = np.sort(found[np.isfinite(found)])
    return (
        f"With {nearest(cube, 'forces', MIDDLE):g} forces, from {COLDEST:g} K up to {WARMEST:g} of the melting point, "
        f"its lead over every other method is {leads[0]:.2f} to {leads[-1]:.2f} decades, {np.median(leads):.2f} in the "
        f"middle, and at least {REQUIRED:g} in {np.count_nonzero(leads >= REQUIRED)} of {len(leads)} cases."
    )


def lead_on_crystals(cube: xr.Dataset) -> xr.DataArray:
    """Return the lead in decades of the method trained on crystals over the best registered method."""
    error, ours = cube.max_energy_error.sel(quantile=0.5), cube.kind == UNREGISTERED
    own, other = (error.where(which).min("integrator") for which in (ours, ~ours))
    lead: xr.DataArray = np.log10(other / own).where(np.minimum(own, other) < USELESS)
    return lead


def averages(cube: xr.Dataset) -> str:
    """Return the errors of the mean potential energy in per cent, by method and by place of friction and noise."""
    exact = float(cube.potential.sel(averaged="leapfrog", bath="middle", spacing=cube.spacing.max()))
    places = [(nearest(cube, "spacing", n), bath) for n in BATHED for bath in ("middle", "ends")]
    lines = []
    for name in cube.averaged.values:
        one = cube.potential.sel(averaged=name)
        found = [float(one.sel(bath=bath, spacing=n)) for n, bath in places]
        cells = [f"{100 * (x / exact - 1):+.1f}" if isfinite(x) else "–" for x in found]
        lines.append((label(str(name)), *cells))
    return table(("method", *(f"{n:g} forces, {bath}" for n, bath in places)), lines)


def drift(cube: xr.Dataset) -> str:
    """Return the largest change of the energy over the long runs of each crystal, by method."""
    largest = abs(cube.drift).max("run")
    lines = [
        (label(str(name)), *(short(float(x), 1) for x in largest.sel(drifting=name).values))
        for name in cube.drifting.values
    ]
    return table(("method", *map(str, cube.crystal.values)), lines)


def nearest(cube: xr.Dataset, name: str, wanted: float) -> float:
    """Return the value of a coordinate that is nearest to a number."""
    return float(cube[name].sel({name: wanted}, method="nearest"))


#: Marks of the page, and what stands between them.
PARTS = {
    "leaders": leaders,
    "errors": errors,
    "trained": trained,
    "verdict": verdict,
    "drift": drift,
    "averages": averages,
}


def page(page: str, cube: str, integrators: Sequence[str], systems: Sequence[str]) -> dict[str, str]:
    """Fill the page from the path of the cube."""
    found = read(cube)
    return {"page": filled_page(page, {mark: made(found) for mark, made in PARTS.items()})}
