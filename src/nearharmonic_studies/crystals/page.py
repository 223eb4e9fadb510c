"""Tables of docs/results/crystals.md, from the cube of the target ``crystals``."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from math import isfinite

import numpy as np
import xarray as xr

from nearharmonic.output.store import read
from nearharmonic_paper.pages.filling import fills, label, short, shown, signed, table
from nearharmonic_studies.crystals.reductions import UNREGISTERED, USELESS

#: Forces in the fastest period, of which the cube's nearest are shown: of leaders, of leads of the method trained on
#: crystals, of errors, and of averages.
FORCES, AROUND, COMPARED, BATHED = (40, 26, 20, 16, 13, 10, 6.3), (26, 20, 16, 13, 10), 26, (14, 10)
#: Temperature of the table of errors, over that of the melting point, and kinds of methods.
WARM, KINDS = 0.1, {"general": "best general", "paper": "best of the paper", "trained": "best trained"}


@fills
def page(cube: str) -> dict[str, str]:
    """Leaders, errors, leads of the method trained on crystals, drift, and averages with a thermostat."""
    found = read(cube)
    median = found.max_energy_error.sel(quantile=0.5)
    ours = found.kind == UNREGISTERED
    own, other = (median.where(which).min("integrator") for which in (ours, ~ours))
    lead = np.log10(other / own).where(np.minimum(own, other) < USELESS)

    def by_forces(heads: list[str], wanted: tuple[float, ...], cell: Callable[..., str], left: int) -> str:
        """A row for each crystal and temperature, a column for each number of forces."""
        forces = [nearest(found, "forces", n) for n in wanted]
        rows = []
        for crystal, temperature in product(found.crystal.values, found.temperature.values):
            kelvin = [shown(temperature * float(found.melting.sel(crystal=crystal)), ".0f", "")] * (len(heads) - 2)
            places = ({"crystal": crystal, "temperature": temperature, "forces": n} for n in forces)
            rows.append((str(crystal), f"{temperature:g}", *kelvin, *(cell(**place) for place in places)))
        return table([*heads, *(f"{n:g} forces" for n in forces)], rows, left)

    def leader(**place: object) -> str:
        name, decades = str(found.leader.sel(place).item()), float(found.lead.sel(place))
        return f"{label(name)} {decades:.1f}" if name and isfinite(decades) else "–"

    heads = ["crystal", "T / T of melting"]
    return {
        "leaders": by_forces(heads, FORCES, leader, left=9),
        "errors": errors(found, median),
        "trained": by_forces([*heads, "T in K"], AROUND, lambda **at: signed(float(lead.sel(at)), 1) or "–", left=1),
        "drift": table(
            ("method", *map(str, found.crystal.values)),
            [
                (label(str(name)), *(short(float(x), 1) for x in abs(found.drift).max("run").sel(drifting=name)))
                for name in found.drifting.values
            ],
        ),
        "averages": averages(found),
    }


def errors(cube: xr.Dataset, median: xr.DataArray) -> str:
    """Errors of leapfrog and of the best methods of each kind, by crystal, with size and anharmonicity."""
    place = {"temperature": nearest(cube, "temperature", WARM), "forces": nearest(cube, "forces", COMPARED)}
    rows = []
    for crystal in cube.crystal.values:
        one, error = cube.sel(place, drop=True).sel(crystal=crystal), median.sel(place).sel(crystal=crystal)
        best = [error.sel(integrator="leapfrog"), *(error.where(cube.kind == kind).min() for kind in KINDS)]
        rows.append(
            (str(crystal), str(one.coordinates.item()), f"{one.delta.item():.2f}", *(short(float(x), 2) for x in best))
        )
    return table(("crystal", "coordinates", "δ", "leapfrog", *KINDS.values()), rows)


def averages(cube: xr.Dataset) -> str:
    """Errors of the mean potential energy in per cent, by method and by place of friction and noise."""
    exact = float(cube.potential.sel(averaged="leapfrog", bath="middle", spacing=cube.spacing.max()))
    places = list(product((nearest(cube, "spacing", n) for n in BATHED), ("middle", "ends")))
    rows = []
    for name in cube.averaged.values:
        found = (float(cube.potential.sel(averaged=name, bath=bath, spacing=n)) for n, bath in places)
        rows.append((label(str(name)), *(shown(100 * (x / exact - 1), "+.1f") for x in found)))
    return table(("method", *(f"{n:g} forces, {bath}" for n, bath in places)), rows)


def nearest(cube: xr.Dataset, name: str, wanted: float) -> float:
    """The value of a coordinate that is nearest to a number."""
    return float(cube[name].sel({name: wanted}, method="nearest"))
