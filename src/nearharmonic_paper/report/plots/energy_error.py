"""The benchmark profile of any system: energy errors against tau/s, maximum and mean, in linked panels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh import models as bokeh
from bokeh.models import ColumnDataSource as Source
from bokeh.models import Plot

from nearharmonic.plotting.levels import LARGEST_ERROR, energy_error_label, envelope, floor_name, floor_near
from nearharmonic_paper.report.plots import panels
from nearharmonic_paper.report.plots.panels import Panel

if TYPE_CHECKING:
    import xarray as xr

#: Variable -> title of the panel, and beginning of the label of its y axis.
PANELS = {
    "max_energy_error": ("A. Maximum over all steps", "max"),
    "mean_energy_error": ("B. Mean over all steps", "mean"),
}
#: Height of the crosses, relative to the upper end of the axis.
_EDGE = 0.8


def energy_error(cube: xr.Dataset) -> list[Panel]:
    """Draw the energy errors of every method of ``cube``, like the static figure.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally led by precision. Diverged runs are on the upper
    edge: the first one of a method as a cross, the others only for the hover. The panels share both axes.
    """
    profile = _Profile(cube)
    for precision in cube["precision"].values.tolist() if "precision" in cube.dims else [""]:
        layer = cube.sel(precision=precision) if precision else cube
        for turn in range(layer.sizes["integrator"]):
            profile.draw(
                envelope(layer.isel(integrator=turn), PANELS, panels.COLUMNS),
                (turn, layer.sizes["integrator"]),
                precision,
            )
    return profile.panels()


class _Profile:
    """The panels during drawing, and the renderers for their hovers."""

    def __init__(self, cube: xr.Dataset) -> None:
        unit = cube["tau_per_stage"].attrs.get("units", "1")
        self._unit = "" if unit == "1" else f" {unit}"
        floors = {name: floor for name in PANELS if (floor := floor_near([cube], name))}
        ranges = (
            panels.span([cube["tau_per_stage"].values], logarithmic=True),
            panels.span(
                [*(cube[name].values for name in PANELS), [*floors.values()]], logarithmic=True, highest=LARGEST_ERROR
            ),
        )
        self._edge = ranges[1].end * _EDGE
        x_label = "step size per stage, τ/s" + (f" ({unit})" if self._unit else "")
        label = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", "|ΔH/H₀|")
        self._labels = {name: f"{symbol} {label}" for name, (_, symbol) in PANELS.items()}
        self._plots = {name: panels.new_plot(ranges, (x_label, self._labels[name])) for name in PANELS}
        for plot in self._plots.values():
            _add_slopes(plot)
        for name, floor in floors.items():
            panels.add_level(self._plots[name], floor, floor_name(floor))
        self._hits: dict[str, list[Any]] = {name: [] for name in PANELS}
        self._crosses: dict[str, list[Any]] = {name: [] for name in PANELS}

    def draw(self, runs: xr.Dataset, turn: tuple[int, int], precision: str) -> None:
        """Draw the runs of one method, dimension tau_per_stage; extended precision is dashed and has no markers."""
        method, label = str(runs["integrator"].item()), str(runs["label"].item())
        extended = precision == "extended"
        label += ", extended precision" if extended else ""
        columns = _columns(runs)
        source, lost = panels.source_of(**panels.marked(columns, ("x", "max_energy_error"), turn)), self._lost(runs)
        for name, plot in self._plots.items():
            line = {"line_dash": [5, 3], "line_width": 1.1} if extended else {}
            panels.add_line(plot, source, ("x", name), method, **line)
            if not extended:
                panels.add_markers(plot, source, ("x", name), method)
            self._hits[name] += panels.add_hits(plot, source, ("x", name), method, label)
            if lost is not None:
                cross = {"marker": "x", "angle": 0.0}
                self._crosses[name].append(panels.add_markers(plot, lost, ("x", "edge"), method, label, **cross))

    def _lost(self, runs: xr.Dataset) -> Any:
        """Return the crosses of diverged runs; None if there are none."""
        gone = np.flatnonzero(runs["status"].values == "diverged")
        if not gone.size:
            return None
        return panels.source_of(
            x=runs["tau_per_stage"].values[gone],
            edge=np.full(gone.size, self._edge),
            **{panels.MARKED: (np.arange(gone.size) == 0).astype(np.uint8)},
            evaluations=runs["evaluations"].values[gone],
            status=[f"diverged at step {step}" for step in runs["diverged_at"].values[gone]],
        )

    def panels(self) -> list[Panel]:
        """The finished panels."""
        for name, plot in self._plots.items():
            for renderers, field in ((self._hits[name], f"@{name}{{%.4e}}"), (self._crosses[name], "∞")):
                rows = [("method", "$name"), ("τ/s", f"@x{{%.6g}}{self._unit}"), (self._labels[name], field)]
                panels.add_hover(plot, renderers, [*rows, ("evaluations", "@evaluations{0,0}"), ("status", "@status")])
        return [Panel(title=PANELS[name][0], plot=plot) for name, plot in self._plots.items()]


def _add_slopes(plot: Plot) -> None:
    """Draw two short lines of slope 4 and 6 in the empty lower right corner, to read the order of a curve."""
    x, y = plot.x_range.end / 6, plot.y_range.start * 30
    ends = [(4 * x, y * 4.0**order) for order in (4, 6)]
    lines = Source(data={"x": [np.array([x, a]) for a, _ in ends], "y": [np.array([y, b]) for _, b in ends]})
    look = {"line_color": "#8a8a8a", "line_width": 1.0}
    panels.add(plot, lines, bokeh.MultiLine(xs="x", ys="y", **look))
    words = {"text_color": "#595959", "text_font": panels.FONT, "text_font_size": "11px"}
    # Above the steeper line and below the other one: a narrow window has no room on the right of their ends.
    plot.add_layout(bokeh.Label(text="order 6", x=4 * x, y=y * 4.0**6, x_offset=-6, text_align="right", **words))
    plot.add_layout(bokeh.Label(text="order 4", x=4 * x, y=y, text_align="right", text_baseline="top", **words))


def _columns(runs: xr.Dataset) -> dict[str, Any]:
    """Return the runs of one method from the first to the last with a drawable error."""
    columns = {name: panels.drawable(runs[name].values) for name in PANELS}
    there = np.flatnonzero(np.any([np.isfinite(values) for values in columns.values()], axis=0))
    kept = slice(there[0], there[-1] + 1) if there.size else slice(0)
    columns |= {"x": runs["tau_per_stage"].values, "evaluations": runs["evaluations"].values}
    columns |= {"status": runs["status"].values.astype(str)}
    return {name: values[kept] for name, values in columns.items()}
