"""Tables of docs/results/samplers.md, from the cube of the target ``samplers``."""

from __future__ import annotations

import numpy as np
import xarray as xr

from nearharmonic.output.store import read
from nearharmonic_paper.pages.filling import fills, table
from nearharmonic_studies.samplers.run import LEAST, MOST

#: Beginning of the names of the methods that the experiment trains.
SEARCHED = "searched_"


@fills
def page(cube: str) -> dict[str, str]:
    """Gains over leapfrog, gains of trained methods, and the number of best steps at an end of the grid."""
    found = read(cube)
    labels = dict(zip(found.integrator.values, found.label.values, strict=True))
    targets = [str(one).replace(r"$\phi^4$", "φ⁴").replace(r" $\times$ ", " × ") for one in found.target_label.values]
    gaussian, gain, special = found.gaussian_gain, found.gain, found.special_gain
    best_gaussian, best_gain = gaussian == gaussian.max("integrator"), gain == gain.max("integrator")
    trained = [name for name in labels if name.startswith(SEARCHED)]
    rows = [
        (target, labels[one.best.item()], *(interval(one.sel(integrator=name), "over_best") for name in trained))
        for target, one in zip(targets, each(found, "target"), strict=True)
    ]
    for b in found.strength.values:
        both = [found[name].sel(strength=b, trained_for=trained).values for name in ("special_gain", "special_half")]
        cells = [
            f"{middle:.2f} ({middle - half:.2f} to {middle + half:.2f})" for middle, half in zip(*both, strict=True)
        ]
        rows.append((f"1000 oscillators, b = {b:g}", "the best at this b", *cells))
    taus = np.concatenate([found.tau.values.ravel(), found.gaussian_tau.values.ravel()])
    return {
        "gaussians": table(
            ("method", *(f"n = {n:g}" for n in found.dimension.values)),
            [
                (label, *(marked(f"{x.item():.2f}", top) for x, top in zip(
                    gaussian.sel(integrator=name), best_gaussian.sel(integrator=name), strict=True)))
                for name, label in labels.items()
            ],
        ),
        "targets": table(
            ("method", *targets),
            [
                (label, *(marked(interval(one, "gain"), top) for one, top in zip(
                    each(found.sel(integrator=name), "target"), best_gain.sel(integrator=name), strict=True)))
                for name, label in labels.items()
            ],
        ),
        "trained": table(("target", "best of the others", *(labels[name] for name in trained)), rows, left=2),
        "alone": table(
            ("trained for", *(f"used at b = {b:g}" for b in found.strength.values)),
            [
                (f"b = {name}", *(f"{x:.2f}" for x in special.sel(trained_for=name).values))
                for name in found.trained_for.values if not name.startswith(SEARCHED)
            ],
        ),
        "ends": f"The grid is {LEAST} to {MOST} per stage, over the highest frequency. Of {taus.size} best steps "
        f"{np.count_nonzero((taus <= 1.001 * LEAST) | (taus >= 0.999 * MOST))} lie at its ends.",
    }  # fmt: skip


def each(cube: xr.Dataset, name: str) -> list[xr.Dataset]:
    """The parts of a dataset along a dimension."""
    return [cube.isel({name: i}) for i in range(cube.sizes[name])]


def interval(one: xr.Dataset, what: str) -> str:
    """A gain and its 95 % interval."""
    middle, low, high = (float(one[f"{what}{end}"]) for end in ("", "_low", "_high"))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def marked(cell: str, best: xr.DataArray) -> str:
    """A cell, bold if it is the best."""
    return f"**{cell}**" if best else cell
