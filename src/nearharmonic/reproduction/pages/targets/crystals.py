"""The tables of docs/results/crystals.md, from the cube of the target ``crystals``."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import xarray as xr

from nearharmonic.output.page import filled_page
from nearharmonic.output.store import read
from nearharmonic.reproduction.claims.results import short
from nearharmonic.reproduction.pages.trained import label, table

#: Forces in the fastest period that the tables show: the nearest ones of the cube.
SHOWN, COMPARED, BATHED = (40.0, 26.0, 16.0, 10.0, 6.3), 26.0, (14.0, 10.0)
#: Temperature of the table of errors, over that of the melting point, and kinds of methods.
WARM, KINDS = 0.1, {"general": "best general", "paper": "best of the paper", "trained": "best trained"}


def leaders(cube: xr.Dataset) -> str:
    """Return the leading method and its lead in decades, by crystal, temperature and forces."""
    forces = [nearest(cube, "forces", one) for one in SHOWN]
    lines = []
    for crystal in cube.crystal.values:
        for temperature in cube.temperature.values:
            one = cube.sel(crystal=crystal, temperature=temperature)
            cells = [cell(str(one.leader.sel(forces=n).item()), float(one.lead.sel(forces=n))) for n in forces]
            lines.append((str(crystal), f"{temperature:g}", *cells))
    return table(("crystal", "T / T of melting", *(f"{n:g} forces" for n in forces)), lines, left=7)


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
PARTS = {"leaders": leaders, "errors": errors, "drift": drift, "averages": averages}


def page(page: str, cube: str, integrators: Sequence[str], systems: Sequence[str]) -> dict[str, str]:
    """Fill the page from the path of the cube."""
    found = read(cube)
    return {"page": filled_page(page, {mark: made(found) for mark, made in PARTS.items()})}
