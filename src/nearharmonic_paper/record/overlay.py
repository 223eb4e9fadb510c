"""Energy errors of two results in one figure: solid lines for the first, dashed ones for the second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.lines import Line2D

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.output.store import double_runs
from nearharmonic.plotting import style
from nearharmonic_paper.record.query import system_cube, system_cubes

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FIGURES = (".pdf", ".png", ".svg")
#: Columns of panels: variable and title.
MEASURES = (("max_energy_error", "maximum over all steps"), ("mean_energy_error", "mean over all steps"))
DASHES: Any = (0, (4, 2))
#: Upper end of the axis: an error of ten times the energy is not meaningful.
LARGEST_ERROR = 10.0


def save_overlay(results: Mapping[str, Path], place: str) -> Path:
    """Draw the energy errors of two results, folders by the names in the legend, and write the figure.

    Another ending of the file than :data:`FIGURES`, or no system of which both have a cube, is a SettingError.
    """
    path = Path(place)
    if path.suffix not in FIGURES:
        raise bad_setting("figure", place, f"a file that ends in {', '.join(FIGURES)}")
    cubes = [{file.stem: file for file in system_cubes(folder)} for folder in results.values()]
    common = [name for name in cubes[0] if name in cubes[1]]
    if not common:
        raise SettingError(f"no figure: {' and '.join(results)} have no system in common")
    pairs = {name: [double_runs(system_cube(found[name])) for found in cubes] for name in common}
    (written,) = style.save(overlay(list(results), pairs), [path])
    return written


@style.house_style
def overlay(results: Sequence[str], pairs: Mapping[str, Sequence[xr.Dataset]]) -> Figure:
    """Draw a row of panels for each system, maximum on the left and mean on the right.

    ``pairs[system]`` are the cubes of both results, over (integrator, tau_per_stage).
    """
    labels: dict[str, str] = {}
    for cube in (cube for pair in pairs.values() for cube in pair):
        labels |= dict(zip(map(str, cube["integrator"].values), map(str, cube["label"].values), strict=True))
    lines_of_legend = -(-(len(labels) + 2) // 4)
    height = 0.75 + 0.2 * lines_of_legend + 2.9 * len(pairs)
    drawn = style.new_figure(7.5, height)
    top = 1 - (0.35 + 0.2 * lines_of_legend) / height
    drawn.subplots_adjust(left=0.1, right=0.985, top=top, bottom=0.5 / height, hspace=0.34, wspace=0.09)
    grid = drawn.subplots(len(pairs), len(MEASURES), squeeze=False, sharex="row", sharey="row")
    for row, (name, pair) in zip(grid, pairs.items(), strict=True):
        for axes, (variable, says) in zip(row, MEASURES, strict=True):
            _draw(axes, pair, variable, list(labels))
            axes.set_title(f"{pair[0].attrs.get('system_label', name)}: {says}", loc="left", fontsize=9, pad=4)
            unit = pair[0]["tau_per_stage"].attrs.get("units", "1")
            axes.set_xlabel(r"step size per stage, $\tau/s$" + ("" if unit == "1" else f"  ({unit})"))
        row[0].set_ylabel(r"$|\Delta H/H_0|$")
        row[0].margins(x=0.02, y=0.03)
        for axes in row:
            style.log_scale(axes, "xy")
        if row[0].get_ylim()[1] > LARGEST_ERROR:
            row[0].set_ylim(top=LARGEST_ERROR)
    handles = style.method_handles(labels, labels.values())
    lines: list[dict[str, Any]] = [{"linewidth": 2.4, "alpha": 0.4}, {"linewidth": 1.0, "linestyle": DASHES}]
    handles += [
        Line2D([], [], color="#404040", label=result, **line) for result, line in zip(results, lines, strict=True)
    ]
    drawn.legend(handles=handles, loc="upper center", ncols=4, columnspacing=1.8)
    return drawn


def _draw(axes: Axes, pair: Sequence[xr.Dataset], variable: str, methods: Sequence[str]) -> None:
    """Draw the first as a pale, broad line with markers, the second as thin dashes that are visible on it."""
    for cube, second in zip(pair, (False, True), strict=True):
        tau: Any = cube["tau_per_stage"].values
        for position, name in enumerate(methods):
            if name not in cube["integrator"].values:
                continue
            errors, line = cube[variable].sel(integrator=name).values, style.style_of(name)
            if second:
                axes.plot(tau, errors, zorder=4, **line.line(marker="none", linestyle=DASHES, linewidth=1.0))
            else:
                marked = style.mark_every(position, len(methods), len(tau))
                axes.plot(tau, errors, zorder=2, **line.line(marker="none", linewidth=2.4, alpha=0.4))
                axes.plot(tau, errors, zorder=3, markevery=marked, **line.points())
