"""Cube of the samplers, its figures, and the tables of docs/results/samplers.md."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from nearharmonic.math import exp
from nearharmonic.output.store import coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, panel_letter, style_of
from nearharmonic_paper.pages.filling import fills, table
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.samplers.run import LEAST, MOST
from nearharmonic_studies.samplers.settings import SamplersSettings
from nearharmonic_studies.samplers.targets import error_of, student

# --- Gains of methods over leapfrog, and of trained methods over the best known one.

reduction = Reductions()

#: Beginning of the names of the methods that the experiment trains.
SEARCHED = "searched_"
#: Where the fewest gradients are: variables of each target.
PLACE = ("acceptance", "tau", "length")


@reduction("cost", over="part")
def cost(runs: xr.Dataset) -> xr.Dataset:
    """Gradients per effective sample, and gains over the first method and over the best that is not trained here."""
    logs, known = runs.cost, ~runs.integrator.str.startswith(SEARCHED)
    best = logs.isel(part=0, drop=True).where(known, np.inf).idxmin("integrator")
    of_best = "method that is not trained here with the fewest gradients per effective sample"
    found = {"best": best.assign_attrs(described(of_best))}
    for name, shifted, text in (
        ("cost", logs, "gradients per effective sample of the slowest observable"),
        ("gain", logs.isel(integrator=0, drop=True) - logs, "ratio of gradients, first method to this method"),
        ("over_best", logs.sel(integrator=best.item()) - logs, "ratio of gradients, best known method to this method"),
    ):
        values = shifted.transpose(*logs.dims)
        middle = values.isel(part=0, drop=True)
        half = np.apply_along_axis(error_of, -1, values.values) * student(values.sizes["part"] - 2)
        for end, sign, which in (("", 0, ""), ("_low", -1, "lower"), ("_high", 1, "upper")):
            notes = described(f"{which} end of the 95 % interval of the {text}" if which else text)
            shown = np.array(exp(np.clip(middle.values + sign * half, -50, 50)))
            found[name + end] = middle.copy(data=shown).assign_attrs(notes)
    return xr.Dataset(found)


def reduce(settings: SamplersSettings, gaussians: str, limits: str, chains: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` of all targets and its ``table``, from run files.

    ``gaussians``, ``limits``: paths of the runs on Gaussians, and of methods trained for one strength. ``chains``:
    paths of the runs on each other target.
    """
    runs = [read(path) for path in chains]
    names = xr.Dataset(coords=coordinate("target", list(settings.targets), "target")).target
    parts = [reduction.of(one, over="part").assign(one[[*PLACE]]) for one in runs]
    cube = xr.concat(parts, names, coords="minimal", compat="override")
    cube["target_label"] = ("target", [one.attrs["target_label"] for one in runs], described("name of the target"))
    exact = read(gaussians)
    for name in ("gradients", *PLACE):
        cube[f"gaussian_{name}"] = exact[name]
    first = exact["gradients"].isel(integrator=0, drop=True)
    text = "ratio of gradients, first method to this method, on a Gaussian"
    cube["gaussian_gain"] = (first / exact["gradients"]).assign_attrs(described(text))
    special = read(limits)
    cube["training_objective"] = special["known_objective"]
    gains = special["special_gain"]
    cube["special_gain"] = gains.mean("set").assign_attrs(gains.attrs)
    half = gains.std("set", ddof=1) / np.sqrt(gains.sizes["set"]) * student(gains.sizes["set"] - 1)
    cube["special_half"] = half.assign_attrs(described("half of the 95 % interval of the gain, over sets of starts"))
    return {"cube": cube.set_coords(["target_label"]), "table": table_of(cube)}


def table_of(cube: xr.Dataset) -> Table:
    """Return a row for each target and method: gradients, gain with its interval, acceptance, step size, length."""
    gains = [f"{what}{end}" for what in ("gain", "over_best") for end in ("", "_low", "_high")]
    rows = []
    for target, name in product(cube.target.values, cube.integrator.values):
        one = cube.sel(target=target, integrator=name)
        rows.append([str(target), str(name), *(float(one[what]) for what in ("cost", *gains, *PLACE))])
    for n, name in product(cube.dimension.values, cube.integrator.values):
        one = cube.sel(dimension=n, integrator=name)
        known = {"cost": one.gaussian_gradients, "gain": one.gaussian_gain}
        known |= {what: one[f"gaussian_{what}"] for what in PLACE}
        values = (float(known.get(what, np.nan)) for what in ("cost", *gains, *PLACE))
        rows.append([f"Gaussian, n = {n:g}", str(name), *values])
    caption = (
        "Gradients per effective sample of Hamiltonian Monte Carlo with each method, gains over leapfrog and over the "
        "best method that is not trained here, with 95 % intervals, at the best step size (per stage) and length."
    )
    header = ["target", "method", "cost", *gains, "acceptance", "tau_per_stage", "length"]
    return Table(header=header, rows=rows, caption=caption)


# --- Figures: Gaussians, other targets, and what training gains.

#: Methods whose curves are drawn, at most eight.
DRAWN = (
    "leapfrog", "bcss_s3", "bcss_s4", "predescu_s3", "abas5o6h", "babs7o7h", "trained_light", "searched_s4",
)  # fmt: skip
#: Colours of methods that were trained for one strength, and colours and markers of those trained for all.
ALONE, ALL = ("#9ecae1", "#5a9bd4", "#2f6fb0", "#0b3c8c"), (("#e86a10", "o"), ("#8b0000", "s"), ("#00785a", "^"))


@house_style
def samplers_gaussian(cube: xr.Dataset) -> Figure:
    """Draw ``gaussian_gradients`` and ``gaussian_gain`` of ``cube``."""
    names = _drawn(cube)
    drawn = new_figure(8.2, 4.3)
    panels = drawn.subplots(1, 2)
    drawn.subplots_adjust(left=0.085, right=0.985, top=0.92, bottom=0.28, wspace=0.2)
    texts = (("gradients", "gradients / squared jump"), ("gain", "gain over leapfrog"))
    for k, (axes, (what, says)) in enumerate(zip(panels, texts, strict=True)):
        for name in names:
            axes.plot(
                cube["dimension"], cube[f"gaussian_{what}"].sel(integrator=name), **style_of(name).line(markersize=4)
            )
        log_scale(axes, "xy")
        _plain(axes.yaxis, 1, 2, 5)
        axes.set(xlabel="dimension", ylabel=says)
        panel_letter(axes, k, ("cost", "gain")[k])
    handles = method_handles(names, cube["label"].sel(integrator=names).values)
    drawn.legend(handles=handles, loc="lower center", ncols=4, columnspacing=1.4)
    return drawn


@house_style
def samplers_targets(cube: xr.Dataset) -> Figure:
    """Draw ``gain`` of ``cube`` with its interval, a panel for each target."""
    names = list(map(str, cube["integrator"].values))[::-1]
    count = cube.sizes["target"]
    columns = min(3, count)
    rows = -(-count // columns)
    height = (0.21 * len(names) + 0.85) * rows + 0.2
    drawn = new_figure(3.0 * columns + 1.7, height)
    grid = drawn.subplots(rows, columns, squeeze=False, sharey=True)
    left, top, bottom = 1.6 / (3.0 * columns + 1.7), 1 - 0.3 / height, 0.55 / height
    drawn.subplots_adjust(left=left, right=0.985, top=top, bottom=bottom, hspace=0.3, wspace=0.07)
    for axes in grid.flat[count:]:
        axes.set_axis_off()
    for k, target in enumerate(cube["target"].values):
        axes = grid.flat[k]
        one = cube.sel(target=target, integrator=names)
        for place, name in enumerate(names):
            middle, low, high = (float(one[f"gain{end}"][place]) for end in ("", "_low", "_high"))
            _point(axes, middle, low, high, place, style_of(name).colour, style_of(name).marker)
        axes.axvline(1, color="#404040", linewidth=0.8)
        axes.set_yticks(range(len(names)), one["label"].values)
        axes.set_ylim(-0.7, len(names) - 0.3)
        log_scale(axes, "x")
        _plain(axes.xaxis, 1, 1.5, 2, 3, 5, 7)
        panel_letter(axes, k, str(cube["target_label"].values[k]))
        if k % columns == 0:
            axes.set_ylabel("method")
        if k + columns >= count:
            axes.set_xlabel("gain over leapfrog")
    return drawn


@house_style
def samplers_trained(cube: xr.Dataset) -> Figure:
    """Draw ``special_gain`` and ``over_best`` of ``cube``."""
    drawn = new_figure(9.4, 4.4)
    left, right = drawn.subplots(1, 2)
    drawn.subplots_adjust(left=0.075, right=0.985, top=0.92, bottom=0.31, wspace=0.72)
    names = list(map(str, cube["trained_for"].values))
    shared = [name for name in names if name in cube["integrator"].values]
    alone = [name for name in names if name not in shared]
    looks = dict(zip(alone, ((one, "D") for one in ALONE), strict=False)) | dict(zip(shared, ALL, strict=False))
    strengths, handles = np.arange(cube.sizes["strength"]), []
    for (name, (colour, marker)), shift in zip(looks.items(), np.linspace(-0.15, 0.15, len(looks)), strict=True):
        values, half = (cube[one].sel(trained_for=name) for one in ("special_gain", "special_half"))
        look: Any = {
            "color": colour, "marker": marker, "markersize": 4, "linestyle": "--" if name in alone else "-",
            "markerfacecolor": "white" if name in alone else colour,
        }  # fmt: skip
        left.errorbar(strengths + shift, values, half, **look, linewidth=1, capsize=2)
        handles.append(Line2D([], [], label=str(values["trained_label"].item()), **look))
    for axes in (left, right):
        (axes.axhline if axes is left else axes.axvline)(1, color="#404040", linewidth=0.8)
    left.set_xticks(strengths, [f"{one:g}" for one in cube["strength"].values])
    left.set(xlabel="strength of the quartic term, b", ylabel="gain over the best of the others")
    panel_letter(left, 0, "quartic oscillators")
    for name in shared:
        for k, target in enumerate(cube["target"].values):
            one = cube.sel(target=target, integrator=name)
            middle, low, high = (float(one[f"over_best{end}"]) for end in ("", "_low", "_high"))
            place = k + 0.2 * (shared.index(name) - (len(shared) - 1) / 2)
            _point(right, middle, low, high, place, *looks[name])
    right.set_yticks(range(cube.sizes["target"]), cube["target_label"].values, fontsize=8)
    right.set_ylim(cube.sizes["target"] - 0.5, -0.5)
    right.set_xlabel("gain over the best of the others")
    panel_letter(right, 1, "chains")
    drawn.legend(handles=handles, loc="lower center", ncols=3, columnspacing=1.4)
    return drawn


def _drawn(cube: xr.Dataset) -> list[str]:
    every = list(map(str, cube["integrator"].values))
    return every if len(every) <= len(DRAWN) else [name for name in DRAWN if name in every] or every[: len(DRAWN)]


def _point(axes: Axes, middle: float, low: float, high: float, place: float, colour: str, marker: str) -> None:
    axes.plot([low, high], [place, place], color=colour, linewidth=1.4)
    axes.plot([middle], [place], color=colour, marker=marker, markersize=4.5, linestyle="none")


def _plain(axis: Axis, *digits: float) -> None:
    """Label a logarithmic axis of one or two decades at these first digits, without powers."""
    axis.set_major_locator(LogLocator(base=10, subs=digits))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


# --- Tables of docs/results/samplers.md.


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
        "ends": f"The grid is {LEAST} to {MOST} per stage, over the highest frequency. Best steps at its ends: "
        f"{np.count_nonzero((taus <= 1.001 * LEAST) | (taus >= 0.999 * MOST))} of {taus.size}.",
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
