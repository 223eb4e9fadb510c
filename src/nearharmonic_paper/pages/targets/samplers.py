"""The tables of docs/results/samplers.md, from the cube of the target ``samplers``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from nearharmonic.output.page import filled_page
from nearharmonic.output.store import read
from nearharmonic_paper.pages.trained import table
from nearharmonic_studies.samplers.run import LEAST, MOST

#: Beginning of the names of the methods that the experiment trains.
SEARCHED = "searched_"


def gaussians(cube: xr.Dataset) -> str:
    """Return the gain over leapfrog of each method, by dimension; the largest of each is bold."""
    gains = cube["gaussian_gain"]
    header = ("method", *(f"n = {n:g}" for n in gains.dimension.values))
    rows = []
    for name, label in zip(cube.integrator.values, cube.label.values, strict=True):
        values = gains.sel(integrator=name).values
        best = gains.max("integrator").values
        rows.append((str(label), *(marked(f"{one:.2f}", one == top) for one, top in zip(values, best, strict=True))))
    return table(header, rows)


def targets(cube: xr.Dataset) -> str:
    """Return the gain over leapfrog and its interval of each method, by target; the largest of each is bold."""
    header = ("method", *map(str, _labels(cube)))
    best = cube["gain"].max("integrator")
    rows = []
    for name, label in zip(cube.integrator.values, cube.label.values, strict=True):
        one = cube.sel(integrator=name)
        cells = [
            marked(interval(one.isel(target=k), "gain"), float(one["gain"][k]) == float(best[k]))
            for k in range(cube.sizes["target"])
        ]
        rows.append((str(label), *cells))
    return table(header, rows)


def trained(cube: xr.Dataset) -> str:
    """Return the gain of the trained methods over the best other one, by target, and on quartic oscillators."""
    names = [str(name) for name in cube.integrator.values if str(name).startswith(SEARCHED)]
    header = ("target", "best of the others", *(str(cube["label"].sel(integrator=name).item()) for name in names))
    rows = []
    for k, target in enumerate(_labels(cube)):
        one = cube.isel(target=k)
        best = str(cube["label"].sel(integrator=one["best"].item()).item())
        rows.append((target, best, *(interval(one.sel(integrator=name), "over_best") for name in names)))
    for strength in cube["strength"].values:
        special = cube.sel(strength=strength)
        cells = []
        for name in names:
            middle, half = (float(special[one].sel(trained_for=name)) for one in ("special_gain", "special_half"))
            cells.append(f"{middle:.2f} ({middle - half:.2f} to {middle + half:.2f})")
        rows.append((f"1000 oscillators, b = {strength:g}", "the best at this b", *cells))
    return table(header, rows, left=2)


def alone(cube: xr.Dataset) -> str:
    """Return the gains of methods that were trained for one strength, at each strength."""
    names = [str(name) for name in cube["trained_for"].values if not str(name).startswith(SEARCHED)]
    header = ("trained for", *(f"used at b = {b:g}" for b in cube["strength"].values))
    rows = []
    for name in names:
        values = cube["special_gain"].sel(trained_for=name).values
        rows.append((f"b = {name}", *(f"{one:.2f}" for one in values)))
    return table(header, rows)


def interval(one: xr.Dataset, what: str) -> str:
    """A gain and its 95 % interval."""
    middle, low, high = (float(one[f"{what}{end}"]) for end in ("", "_low", "_high"))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def marked(cell: str, best: bool) -> str:
    """A cell, bold if it is the best."""
    return f"**{cell}**" if best else cell


def verdict(cube: xr.Dataset) -> str:
    """Return a sentence on the largest and the least gain of trained methods on targets of another kind."""
    unseen = cube.sel(target=[one for one in cube.target.values if one != "quartic"])
    names = [name for name in cube.integrator.values if str(name).startswith(SEARCHED)]
    gains = unseen["over_best"].sel(integrator=names)
    place = np.unravel_index(int(gains.values.argmax()), gains.shape)
    at = {"target": gains.target.values[place[gains.dims.index("target")]],
          "integrator": gains.integrator.values[place[gains.dims.index("integrator")]]}  # fmt: skip
    return (
        f"On targets of another kind than those of the training, the largest gain is "
        f"{interval(unseen.sel(at), 'over_best')}, of {cube['label'].sel(integrator=at['integrator']).item()} on "
        f"`{at['target']}`; the smallest is {float(gains.min()):.2f}."
    )


def ends(cube: xr.Dataset) -> str:
    """Return a sentence on the best step sizes that lie at an end of their grid."""
    found = []
    for name in cube["integrator"].values:
        one = cube.sel(integrator=name)
        steps = [*zip(_labels(one), one["tau"].values, strict=True)]
        steps += [
            (f"Gaussian, n = {n:g}", one["gaussian_tau"].sel(dimension=n).item()) for n in one["dimension"].values
        ]
        outside = [where for where, tau in steps if not 1.001 * LEAST < tau < 0.999 * MOST]
        found += [f"{where} ({one['label'].item()})" for where in outside]
    text = f"The grid is {LEAST} to {MOST} per stage, over the highest frequency. "
    return text + (f"Best steps at its ends: {', '.join(found)}." if found else "No best step lies at its ends.")


def _labels(cube: xr.Dataset) -> list[str]:
    """Names of the targets, without the mathematics of figures."""
    found = map(str, cube["target_label"].values)
    return [one.replace(r"$\phi^4$", "φ⁴").replace(r" $\times$ ", " × ") for one in found]


#: Marks of the page, and what stands between them.
PARTS = {
    "gaussians": gaussians,
    "targets": targets,
    "trained": trained,
    "alone": alone,
    "verdict": verdict,
    "ends": ends,
}


def page(page: str, cube: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, str]:
    """Fill the page."""
    found = read(cube)
    return {"page": filled_page(page, {mark: made(found) for mark, made in PARTS.items()})}
