"""Cube of the runs on crystals, its figures, and the tables of docs/results/crystals.md."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import product
from math import isfinite, nan
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from nearharmonic.integrators import integrators
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import coordinate, described, read
from nearharmonic.output.table import Table, short
from nearharmonic.plotting.profile import text_on
from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, panel_letter, style_of
from nearharmonic_paper.pages.filling import fills, label, shown, signed, table
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.crystals.settings import TRAINED_ON_CRYSTALS, CrystalsSettings
from nearharmonic_studies.crystals.solids import BOLTZMANN

# --- Reductions over the starts of each crystal: leaders, drift and averages.

reduction = Reductions()

#: Kinds of methods by the beginnings of their sources; all others are general.
KINDS = {"paper": ("Nielsen", "found by"), "trained": ("trained by",)}
GENERAL, UNREGISTERED = "general", "trained on crystals"
QUANTILES = (0.1, 0.5, 0.9)
#: An energy error above this part of the mean kinetic energy is useless: no method leads there.
USELESS = 0.1
#: The window of step sizes in the note of a trained method.
_WINDOW = re.compile(r"tau/s ([\d.]+) to ([\d.]+)")
#: Bins of the density of phonons from 0 to the highest frequency.
BINS = 60


@reduction("max_energy_error", over="start")
def max_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the starts of the maximum energy error."""
    return _quantiles(runs.max_energy_error)


@reduction("mean_energy_error", over="start")
def mean_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the starts of the mean energy error."""
    return _quantiles(runs.mean_energy_error)


@reduction("max_energy_error", over="start")
def leaders(runs: xr.Dataset) -> xr.Dataset:
    """The registered method of the smallest median error, and its lead in decades over the best of another kind."""
    runs = runs.drop_sel(integrator=TRAINED_ON_CRYSTALS.name, errors="ignore")
    median = _quantiles(runs.max_energy_error).sel(quantile=0.5, drop=True)
    error = median.transpose(..., "integrator").values
    kinds = np.array([kind_of(str(name)) for name in runs.integrator.values])
    leader = error.argmin(axis=-1)
    best = np.take_along_axis(error, leader[..., None], -1)[..., 0]
    others = np.where(kinds[leader][..., None] == kinds, np.inf, error).min(axis=-1)
    useful = best < USELESS
    with np.errstate(divide="ignore", invalid="ignore"):
        lead = np.where(useful, log(np.minimum(others, 1.0) / best) / log(10.0), np.nan)
    over = median.isel(integrator=0, drop=True)
    names = runs.integrator.values[leader].astype(object)
    of_leader = "method of the smallest median of the maximum error; none if no error is below a tenth"
    of_lead = "log10 of the error of the best method of another kind over the error of the leader"
    found = {"leader": (over.dims, np.where(useful, names, ""), described(of_leader))}
    return xr.Dataset(found | {"lead": (over.dims, lead, described(of_lead))}, over.coords)


def kind_of(name: str) -> str:
    """Return the kind of a method: of the paper and its harmonic conditions, trained, general, or not registered."""
    if name == TRAINED_ON_CRYSTALS.name:
        return UNREGISTERED
    source = integrators[name].source
    return next((kind for kind, begins in KINDS.items() if source.startswith(begins)), GENERAL)


def window_of(name: str) -> tuple[float, float]:
    """Return the window of step sizes per stage that a method was trained for, NaN for other methods."""
    found = _WINDOW.search(integrators[name].note or "") if kind_of(name) == "trained" else None
    return (float(found[1]), float(found[2])) if found else (nan, nan)


def density(frequencies: Floats) -> Floats:
    """Return the density (bins,) of phonons over frequency divided by the highest; its mean is 1."""
    places = np.minimum((frequencies / frequencies.max() * BINS).astype(int), BINS - 1)
    return np.bincount(places[frequencies > 0], minlength=BINS) * BINS / np.count_nonzero(frequencies > 0)


def _quantiles(errors: xr.DataArray) -> xr.DataArray:
    ranks = [min(errors.sizes["start"] - 1, int(q * errors.sizes["start"])) for q in QUANTILES]
    ascending = xr.apply_ufunc(np.sort, errors, input_core_dims=[["start"]], output_core_dims=[["start"]])
    found: xr.DataArray = ascending.isel(start=xr.DataArray(ranks, dims="quantile")).drop_vars("start", errors="ignore")
    fractions = coordinate("quantile", list(QUANTILES), "fraction of the starts that err less")
    text = f"quantile over the starts of the {errors.attrs['long_name']}"
    return found.assign_coords(fractions).assign_attrs(described(text))


def trend(energy: xr.DataArray) -> xr.DataArray:
    """Return the change of the energy (..., run) over the whole run, by a straight line of least squares."""
    look = energy.look - energy.look.mean()
    slope: xr.DataArray = (energy * look).sum("look") / (look * look).sum("look")
    rise: xr.DataArray = slope * (energy.look[-1] - energy.look[0])
    return rise


def reduce(
    names: Sequence[str], settings: CrystalsSettings, averages: str, errors: Sequence[str], drifts: Sequence[str]
) -> dict[str, Any]:
    """Return the ``cube`` of all crystals and its ``table`` of leaders, from run files of the methods ``names``.

    ``averages``: path of the runs with a thermostat. ``errors``, ``drifts``: paths of the runs and of the long runs of
    each crystal.
    """
    crystal_names = list(settings.crystals)
    parts, trends = [], []
    for path, long in zip(errors, drifts, strict=True):
        runs = read(path)
        part = reduction.of(runs, over="start")
        part["delta"] = runs["delta"]
        part["density"] = ("bin", density(runs.frequency.values), described("density of phonons, mean 1", "1"))
        part["coordinates"] = ((), runs.attrs["coordinates"], described("number of coordinates", "1"))
        kelvin = runs.attrs["melting"] / BOLTZMANN if isfinite(runs.attrs["unit_of_time_fs"]) else nan
        part["melting"] = ((), kelvin, described("melting point; none for a model without units", "K"))
        parts.append(part)
        trends.append(trend(read(long).energy))
    crystals = xr.Dataset(coords=coordinate("crystal", crystal_names, "crystal")).crystal
    cube = xr.concat(parts, crystals, coords="minimal", compat="override")
    cube["drift"] = xr.concat(trends, crystals, coords="minimal", compat="override").assign_attrs(
        described("change of H over a long run, by a straight line, in units of the mean kinetic energy", "1")
    )
    kinds = [kind_of(str(name)) for name in cube.integrator.values]
    cube.coords["kind"] = ("integrator", kinds, described("kind of the method"))
    cube["window"] = (
        ("integrator", "bound"), [window_of(str(name)) for name in cube.integrator.values],
        described("step sizes per stage that the method was trained for, times the frequency", "1"),
    )  # fmt: skip
    for name in ("potential", "kinetic"):
        values = read(averages)[name]
        error = values.std("block", ddof=1) / np.sqrt(values.sizes["block"])
        cube[name] = values.mean("block").assign_attrs(values.attrs)
        cube[f"{name}_error"] = error.assign_attrs(described(f"standard error of the {name} energy", "1"))
    return {"cube": cube, "table": table_of(cube)}


def table_of(cube: xr.Dataset) -> Table:
    """Return a row for each crystal, temperature and number of forces: leader, error, and lead."""
    rows = []
    for crystal, temperature, forces in product(*(cube[one].values for one in ("crystal", "temperature", "forces"))):
        one = cube.sel(crystal=crystal, temperature=temperature, forces=forces)
        leader = str(one["leader"].item())
        if leader:
            error = one["max_energy_error"].sel(quantile=0.5, integrator=leader).item()
            rows.append(
                [str(crystal), float(temperature), float(forces), leader, kind_of(leader), error, one["lead"].item()]
            )
    caption = (
        "Methods with the smallest median of the maximum energy error, in units of the mean kinetic energy, by "
        "crystal, temperature relative to the melting point, and forces in a period of the fastest phonon; lead in "
        "decades over the best method of another kind."
    )
    return Table(
        header=["crystal", "temperature", "forces", "leader", "kind", "max_energy_error", "lead"], rows=rows,
        caption=caption,
    )  # fmt: skip


# --- Figures: errors, leaders, phonons, gains, and long runs.

#: Methods whose curves are drawn, at most eight, and colours of the kinds of methods.
DRAWN = (
    "leapfrog", "bcss_s4", "predescu_s3", "babps6o5h", "babs7o7h", "babps9o7h", "trained_coarse", "trained_light",
)  # fmt: skip
LOOKS_OF_KINDS = {
    "general": ("general", "#6b6b6b"),
    "paper": ("harmonic conditions (the paper)", "#e08214"),
    "trained": ("trained", "#c1121f"),
}
#: Colours of the crystals, and the lead in decades with full colour.
CRYSTALS, FULL, PALEST = ("#0b3c8c", "#b45309", "#00785a", "#9d174d"), 1.0, 0.25
#: Forces in the fastest period at which gains and the band of phonons are drawn.
AT = (26.0, 16.0)
FORCES_LABEL = "forces in a period of the fastest phonon"


@house_style
def crystals_error(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (median) of ``cube``: a panel for each crystal and three temperatures."""
    rows = _three(cube["temperature"].values)
    every = list(map(str, cube["integrator"].values))
    names = every if len(every) <= len(DRAWN) else [name for name in DRAWN if name in every] or every[: len(DRAWN)]
    drawn = new_figure(2.6 * cube.sizes["crystal"] + 0.6, 2.3 * len(rows) + 1.1)
    grid = drawn.subplots(len(rows), cube.sizes["crystal"], sharex=True, sharey=True, squeeze=False)
    inches = drawn.get_figheight()
    left, top, bottom = 0.75 / drawn.get_figwidth(), 1 - 0.3 / inches, 1.05 / inches
    drawn.subplots_adjust(left=left, right=0.985, top=top, bottom=bottom, wspace=0.06, hspace=0.18)
    median = cube["max_energy_error"].sel(quantile=0.5)
    for r, temperature in enumerate(rows):
        for c, crystal in enumerate(cube["crystal"].values):
            axes = grid[r, c]
            for name in names:
                errors = median.sel(crystal=crystal, temperature=temperature, integrator=name)
                axes.plot(cube["forces"], errors.where(errors < 1), **style_of(str(name)).line(markersize=3.4))
            log_scale(axes, "y")
            _forces_axis(axes, cube["forces"].values)
            panel_letter(axes, r * cube.sizes["crystal"] + c, rf"{crystal}, $T = {temperature:g}\,T_\mathrm{{melt}}$")
    for axes in grid[:, 0]:
        axes.set_ylabel(r"$\max|\Delta H|\,/\,\langle T\rangle$")
    for axes in grid[-1]:
        axes.set_xlabel("forces per fastest period")
    labels = cube["label"].sel(integrator=names).values
    drawn.legend(handles=method_handles(names, labels), loc="lower center", ncols=8, columnspacing=1.2, handlelength=2)
    return drawn


@house_style
def crystals_map(cube: xr.Dataset) -> Figure:
    """Draw ``leader`` and ``lead`` of ``cube`` over temperature and forces, a panel for each crystal."""
    count = cube.sizes["crystal"]
    columns = 2 if count > 1 else 1
    rows = -(-count // columns)
    drawn = new_figure(4.7 * columns, 0.35 * cube.sizes["temperature"] * rows + 0.7 * rows + 0.9)
    grid = drawn.subplots(rows, columns, squeeze=False)
    inches = drawn.get_figheight()
    drawn.subplots_adjust(left=0.075, right=0.99, top=1 - 0.3 / inches, bottom=0.9 / inches, wspace=0.14, hspace=0.55)
    for axes in grid.flat[count:]:
        axes.set_axis_off()
    for k, crystal in enumerate(cube["crystal"].values):
        _map(grid.flat[k], cube.sel(crystal=crystal))
        panel_letter(grid.flat[k], k, str(crystal))
    handles = [Patch(color=colour, label=label) for label, colour in LOOKS_OF_KINDS.values()]
    drawn.legend(handles=handles, loc="lower center", ncols=3)
    return drawn


def _map(axes: Axes, one: xr.Dataset) -> None:
    shape = one["lead"].shape
    kinds = dict(zip(one["integrator"].values, one["kind"].values, strict=True))
    colours = np.ones((*shape, 3))
    for i, j in np.ndindex(shape):
        leader, lead = str(one["leader"].values[i, j]), float(one["lead"].values[i, j])
        if leader and np.isfinite(lead):
            depth = PALEST + (1 - PALEST) * min(lead / FULL, 1)
            colours[i, j] = 1 - depth * (1 - np.array(to_rgb(LOOKS_OF_KINDS[str(kinds[leader])][1])))
            axes.text(j, i, f"{lead:.1f}", ha="center", va="center", fontsize=7.5, color=text_on(colours[i, j]))
    axes.imshow(colours, aspect="auto", origin="lower", interpolation="nearest")
    axes.set_xticks(range(shape[1]), [f"{value:g}" for value in one["forces"].values])
    axes.set_yticks(range(shape[0]), [f"{value:g}" for value in one["temperature"].values])
    axes.set(xlabel=FORCES_LABEL, ylabel=r"$T\,/\,T_\mathrm{melt}$")
    axes.tick_params(length=0)
    axes.grid(visible=False)


@house_style
def crystals_phonons(cube: xr.Dataset) -> Figure:
    """Draw ``density`` of ``cube``, and the windows of trained methods."""
    drawn = new_figure(7.4, 6.2)
    above, below = drawn.subplots(2, 1, height_ratios=(1.2, 1))
    drawn.subplots_adjust(left=0.17, right=0.98, top=0.95, bottom=0.09, hspace=0.42)
    edges = np.linspace(0, 1, cube.sizes["bin"] + 1)
    for crystal, colour in zip(cube["crystal"].values, CRYSTALS, strict=False):
        above.stairs(cube["density"].sel(crystal=crystal), edges, color=colour, label=str(crystal), linewidth=1.2)
    above.set(xlim=(0, 1), xlabel=r"$\omega\,/\,\omega_\mathrm{max}$", ylabel="density of phonons")
    above.set_ylim(bottom=0)
    above.legend(loc="upper left")
    panel_letter(above, 0, "phonons")
    trained = cube.isel(integrator=np.isfinite(cube["window"].values[:, 0])).sortby(cube["window"][:, 0])
    for k, (name, (low, high)) in enumerate(zip(trained["integrator"].values, trained["window"].values, strict=True)):
        below.plot([low, high], [k, k], color=style_of(str(name)).colour, linewidth=6, solid_capstyle="butt")
    for forces, alpha in ((40, 0.12), (20, 0.22), (10, 0.34)):
        most = 2 * np.pi / forces
        below.axvspan(most / 2, most, color="#808080", alpha=alpha, linewidth=0)
        below.text(
            most / 2**0.5, trained.sizes["integrator"] - 0.35, f"{forces} forces", ha="center", va="bottom", fontsize=8
        )
    below.set_yticks(range(trained.sizes["integrator"]), trained["label"].values)
    log_scale(below, "x")
    below.set(xlim=(0.01, 1), ylim=(-0.6, trained.sizes["integrator"] + 0.3), xlabel=r"$\omega\,\tau/s$")
    panel_letter(below, 1, "windows of trained methods")
    return drawn


@house_style
def crystals_gain(cube: xr.Dataset) -> Figure:
    """Draw the ratio of errors of ``cube`` against ``delta``, a panel for each number of forces."""
    general, trained = (_smallest_errors(cube, kind) for kind in ("general", "trained"))
    shown = sorted({float(cube["forces"].sel(forces=at, method="nearest")) for at in AT}, reverse=True)
    drawn = new_figure(3.6 * len(shown) + 0.6, 3.7)
    grid = drawn.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    drawn.subplots_adjust(left=0.1, right=0.985, top=0.92, bottom=0.24, wspace=0.12)
    for k, (axes, forces) in enumerate(zip(grid, shown, strict=True)):
        for crystal, colour, marker in zip(cube["crystal"].values, CRYSTALS, "os^D", strict=False):
            at = {"crystal": crystal, "forces": forces}
            known = np.isfinite(general.sel(at)) & np.isfinite(trained.sel(at))
            gain = np.log10(general.sel(at).where(known) / trained.sel(at).where(known))
            axes.plot(cube["delta"].sel(crystal=crystal), gain, color=colour, marker=marker, label=str(crystal))
        axes.axhline(0, color="#404040", linewidth=0.8)
        log_scale(axes, "x")
        axes.set_xlabel(r"variation of the Hessian, $\delta$")
        panel_letter(axes, k, f"{forces:g} forces per fastest period")
    grid[0].set_ylabel("gain of trained methods (decades)")
    drawn.legend(*grid[0].get_legend_handles_labels(), loc="lower center", ncols=4)
    return drawn


def _smallest_errors(cube: xr.Dataset, kind: str) -> xr.DataArray:
    """Return the smallest median error of a kind of method, infinite without one."""
    median = cube["max_energy_error"].sel(quantile=0.5)
    return median.where(cube["kind"] == kind, np.inf).min("integrator")


@house_style
def crystals_long_runs(cube: xr.Dataset) -> Figure:
    """Draw ``drift`` and ``potential`` of ``cube``."""
    drawn = new_figure(8.2, 6.4)
    grid: Any = drawn.subplot_mosaic([["drift", "drift"], ["middle", "ends"]])
    drawn.subplots_adjust(left=0.1, right=0.985, top=0.95, bottom=0.15, wspace=0.22, hspace=0.36)
    methods = cube["drifting"].values
    for m, name in enumerate(methods):
        for c, crystal in enumerate(cube["crystal"].values):
            values = np.abs(cube["drift"].sel(crystal=crystal, drifting=name).values)
            grid["drift"].plot(
                np.full(len(values), c + 0.16 * (m - (len(methods) - 1) / 2)), values, **style_of(str(name)).points()
            )
    log_scale(grid["drift"], "y")
    grid["drift"].set_xticks(range(cube.sizes["crystal"]), cube["crystal"].values)
    grid["drift"].set_ylabel(r"$|$change of $H|\,/\,\langle T\rangle$")
    panel_letter(grid["drift"], 0, "drift over a long run")
    grid["ends"].sharey(grid["middle"])
    for k, (place, says) in enumerate((("middle", "bath in the middle of a step"), ("ends", "bath at both ends"))):
        axes = grid[place]
        for name in cube["averaged"].values:
            one = cube.sel(averaged=name, bath=place)
            look = style_of(str(name)).line(markersize=4, capsize=2)
            known = np.isfinite(one["potential"])
            axes.errorbar(cube["spacing"], one["potential"].where(known), one["potential_error"], **look)
        _forces_axis(axes, cube["spacing"].values)
        axes.set_xlabel(FORCES_LABEL)
        panel_letter(axes, k + 1, says)
    grid["middle"].set_ylabel("potential energy / harmonic")
    labels = {
        str(name): label
        for over in ("drifting", "averaged")
        for name, label in zip(cube[over].values, cube[f"{over}_label"].values, strict=True)
    }
    drawn.legend(handles=method_handles(list(labels), list(labels.values())), loc="lower center", ncols=4)
    return drawn


def _three(values: Any) -> list[float]:
    """At most three values: the least, the middle one and the largest."""
    return [float(values[k]) for k in sorted({0, len(values) // 2, len(values) - 1})]


def _forces_axis(axes: Axes, forces: Any) -> None:
    """A logarithmic axis with labels at round numbers of forces; large steps, of few forces, are on the right."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([one for one in (40, 20, 10, 5) if min(forces) <= one <= max(forces)]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlim(1.08 * max(forces), min(forces) / 1.08)


# --- Tables of docs/results/crystals.md.

#: Forces in the fastest period, of which the cube's nearest are shown: of leaders, of leads of the method trained on
#: crystals, of errors, and of averages.
LEADERS_AT, AROUND, COMPARED, BATHED = (40, 26, 20, 16, 13, 10, 6.3), (26, 20, 16, 13, 10), 26, (14, 10)
#: Temperature of the table of errors, over the melting temperature, and kinds of methods.
WARM, COMPARED_KINDS = 0.1, {"general": "best general", "paper": "best of the paper", "trained": "best trained"}


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
        "leaders": by_forces(heads, LEADERS_AT, leader, left=9),
        "errors": errors_table(found, median),
        "trained": by_forces([*heads, "T in K"], AROUND, lambda **at: signed(float(lead.sel(at)), 1) or "–", left=1),
        "drift": table(
            ("method", *map(str, found.crystal.values)),
            [
                (label(str(name)), *(short(float(x), 1) for x in abs(found.drift).max("run").sel(drifting=name)))
                for name in found.drifting.values
            ],
        ),
        "averages": averages_table(found),
    }


def errors_table(cube: xr.Dataset, median: xr.DataArray) -> str:
    """Errors of leapfrog and of the best methods of each kind, by crystal, with size and anharmonicity."""
    place = {"temperature": nearest(cube, "temperature", WARM), "forces": nearest(cube, "forces", COMPARED)}
    rows = []
    for crystal in cube.crystal.values:
        one, error = cube.sel(place, drop=True).sel(crystal=crystal), median.sel(place).sel(crystal=crystal)
        best = [error.sel(integrator="leapfrog"), *(error.where(cube.kind == kind).min() for kind in COMPARED_KINDS)]
        rows.append(
            (str(crystal), str(one.coordinates.item()), f"{one.delta.item():.2f}", *(short(float(x), 2) for x in best))
        )
    return table(("crystal", "coordinates", "δ", "leapfrog", *COMPARED_KINDS.values()), rows)


def averages_table(cube: xr.Dataset) -> str:
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
