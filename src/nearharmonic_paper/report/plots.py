"""The interactive figures: those of the paper, drawn by bokeh from what the static ones show too."""

from __future__ import annotations

from math import isfinite, log10, pi
from string import ascii_uppercase
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh import models as bokeh
from bokeh.models import ColumnDataSource as Source
from bokeh.models import GlyphRenderer as Renderer
from bokeh.models import Plot
from contourpy import contour_generator

from nearharmonic.output.store import double_runs
from nearharmonic.output.table import power_of_ten
from nearharmonic.plotting.profile import (
    LARGEST_ERROR,
    PANELS,
    energy_error_label,
    floor_name,
    floor_near,
    lines,
    style_of,
)
from nearharmonic_paper.claims.claim import short
from nearharmonic_paper.experiments.paper.orbits import (
    MERCURY_RELATIVISTIC_ADVANCE,
    SATISFIED_BELOW,
    advances,
    arcseconds_per_century,
)
from nearharmonic_paper.report import panels
from nearharmonic_paper.report.panels import Panel

if TYPE_CHECKING:
    import xarray as xr

#: Height of the crosses of diverged runs, relative to the upper end of the axis.
_EDGE = 0.8
#: Operator of the outer row -> name of the composition.
_COMPOSITIONS = {"drift": "ABA", "kick": "BAB"}
#: Shades of the Hamiltonian, from low to high.
_SHADES = (
    "#ffffff", "#f9fafb", "#f3f4f6", "#edeff2", "#e6e9ed", "#e0e4e9",
    "#dadfe4", "#d4d9e0", "#ced4db", "#c8ced7", "#c2c9d3", "#b9c3cf",
)  # fmt: skip
_BLUE, _RED, _GREEN = "#0b5fb5", "#d7301f", "#1a9850"
#: A bar across a dot, white.
_BAR = {"marker": "dash", "size": 7, "line_color": "#ffffff", "line_width": 2}
#: (next drift negative, next kick negative) -> meaning, and markers drawn over each other.
_DOTS: dict[tuple[bool, bool], tuple[str, tuple[dict[str, Any], ...]]] = {
    (False, False): ("no negative coefficient follows", ({"size": 7, "fill_color": _BLUE},)),
    (True, False): ("a negative drift follows", ({"size": 11, "fill_color": _RED}, _BAR)),
    (False, True): ("a negative kick follows", ({"size": 10, "fill_color": _GREEN}, _BAR | {"angle": pi / 2})),
    (True, True): (
        "negative drift and kick follow",
        ({"size": 12, "fill_color": _RED}, {"size": 7, "fill_color": _GREEN, "line_color": "#ffffff"}),
    ),
}
_ENDS: dict[str, dict[str, Any]] = {
    "initial": {"marker": "circle", "size": 14, "fill_alpha": 0.0, "line_color": _BLUE, "line_width": 2},
    "final": {"marker": "x", "size": 12, "line_color": _BLUE, "line_width": 2.5},
}


def energy_error(cube: xr.Dataset) -> list[Panel]:
    """Draw the energy errors of every method of ``cube``, like the static figure.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally led by precision. Diverged runs are on the upper
    edge: the first one of a method as a cross, the others only for the hover. The panels share both axes.
    """
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    floors = {name: floor for name in PANELS if (floor := floor_near([cube], name))}
    errors = [*(cube[name].values for name in PANELS), [*floors.values()]]
    ranges = (
        panels.span([cube["tau_per_stage"].values], logarithmic=True),
        panels.span(errors, logarithmic=True, highest=LARGEST_ERROR),
    )
    curves = []
    for line in lines(cube, columns=panels.COLUMNS):
        source = panels.source_of(**panels.marked(_columns(line.runs), ("x", "max_energy_error"), line.turn))
        curves.append((line, source, _lost(line.runs, ranges[1].end * _EDGE)))
    symbols = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", "|ΔH/H₀|")
    found = []
    for letter, (name, statistic) in zip(ascii_uppercase, PANELS.items(), strict=False):
        label = f"{'max' if statistic == 'maximum' else statistic} {symbols}"
        plot = panels.new_plot(ranges, ("step size per stage, τ/s" + _unit(unit, " ({})"), label))
        _add_slopes(plot)
        if name in floors:
            panels.add_level(plot, floors[name], floor_name(floors[name]))
        hits: list[Renderer] = []
        crosses: list[Renderer] = []
        for line, source, lost in curves:
            says = line.label + (", extended precision" if line.extended else "")
            look = {"line_dash": [5, 3], "line_width": 1.1} if line.extended else {}
            panels.add_line(plot, source, ("x", name), line.integrator, **look)
            if not line.extended:
                panels.add_markers(plot, source, ("x", name), line.integrator)
            hits += panels.add_hits(plot, source, ("x", name), line.integrator, says)
            if lost is not None:
                cross = {"marker": "x", "angle": 0.0}
                crosses.append(panels.add_markers(plot, lost, ("x", "edge"), line.integrator, says, **cross))
        for renderers, field in ((hits, f"@{name}{{%.4e}}"), (crosses, "∞")):
            rows = [("method", "$name"), ("τ/s", f"@x{{%.6g}}{_unit(unit)}"), (label, field)]
            panels.add_hover(plot, renderers, [*rows, ("evaluations", "@evaluations{0,0}"), ("status", "@status")])
        found.append(Panel(f"{letter}. {statistic.capitalize()} over all steps", plot))
    return found


def _unit(unit: str, form: str = " {}") -> str:
    return "" if unit == "1" else form.format(unit)


def _columns(runs: xr.Dataset) -> dict[str, Any]:
    """Return the runs of one method from the first to the last with a drawable error."""
    columns = {name: panels.drawable(runs[name].values) for name in PANELS}
    there = np.flatnonzero(np.any([np.isfinite(values) for values in columns.values()], axis=0))
    kept = slice(there[0], there[-1] + 1) if there.size else slice(0)
    columns |= {"x": runs["tau_per_stage"].values, "evaluations": runs["evaluations"].values}
    columns |= {"status": runs["status"].values.astype(str)}
    return {name: values[kept] for name, values in columns.items()}


def _lost(runs: xr.Dataset, edge: float) -> Source | None:
    """Return the crosses of diverged runs; None if there are none."""
    gone = np.flatnonzero(runs["status"].values == "diverged")
    if not gone.size:
        return None
    return panels.source_of(
        x=runs["tau_per_stage"].values[gone],
        edge=np.full(gone.size, edge),
        **{panels.MARKED: (np.arange(gone.size) == 0).astype(np.uint8)},
        evaluations=runs["evaluations"].values[gone],
        status=[f"diverged at step {step}" for step in runs["diverged_at"].values[gone]],
    )


def _add_slopes(plot: Plot) -> None:
    """Draw two short lines of slope 4 and 6 in the empty lower right corner, to read the order of a curve."""
    x, y = plot.x_range.end / 6, plot.y_range.start * 30
    ends = [(4 * x, y * 4.0**order) for order in (4, 6)]
    guides = Source(data={"x": [np.array([x, a]) for a, _ in ends], "y": [np.array([y, b]) for _, b in ends]})
    panels.add(plot, guides, bokeh.MultiLine(xs="x", ys="y", line_color="#8a8a8a", line_width=1.0))
    words = {"text_color": "#595959", "text_font": panels.FONT, "text_font_size": "11px"}
    # Above the steeper line and below the other one: a narrow window has no room on the right of their ends.
    plot.add_layout(bokeh.Label(text="order 6", x=4 * x, y=y * 4.0**6, x_offset=-6, text_align="right", **words))
    plot.add_layout(bokeh.Label(text="order 4", x=4 * x, y=y, text_align="right", text_baseline="top", **words))


def decomposition(terms: xr.Dataset) -> list[Panel]:
    """Draw ``kappa`` of ``terms``, dimensions (integrator, first, order): terms that remain, and terms that vanish.

    Markers with circles are ABA compositions, markers with lines BAB compositions; the panels share the axis of the
    order.
    """
    order, kappa = terms["order"].values, np.array(terms["kappa"].values, dtype=float)
    labels = [str(label) for label in terms["label"].values]
    along = panels.span([order], logarithmic=False)
    remain = panels.span([kappa[kappa >= SATISFIED_BELOW]], logarithmic=True)
    upper = panels.new_plot((along, remain), ("order, λ", "κ"))
    lower = panels.new_plot((along, panels.span([[0, 1]], logarithmic=False)), ("order, λ", ""))
    panels.use_categories(lower, labels)
    for plot in (upper, lower):
        plot.below[0].ticker = bokeh.SingleIntervalTicker(interval=2, num_minor_ticks=2)
    dots: list[Renderer] = []
    bars: list[Renderer] = []
    unseen, bar = {"line_alpha": 0.0, "fill_alpha": 0.0}, {"marker": "dash", "angle": 0.0, "size": 20, "line_width": 2}
    for method, label, one in zip(map(str, terms["integrator"].values), labels, kappa, strict=True):
        for first, composition in _COMPOSITIONS.items():
            values = one[terms["first"].values.tolist().index(first)]
            gone, name = values < SATISFIED_BELOW, f"{label} as {composition}"
            remaining = panels.source_of(order=order, shown=np.where(values >= SATISFIED_BELOW, values, np.nan))
            vanishing = panels.source_of(order=order[gone], row=np.full(gone.sum(), label), shown=values[gone])
            if composition == "ABA":
                dots.append(_circle(upper, remaining, "shown", method, name))
                bars.append(_circle(lower, vanishing, "row", method, name))
            else:
                panels.add_line(upper, remaining, ("order", "shown"), method)
                dots.append(panels.add_markers(upper, remaining, ("order", "shown"), method, name, **unseen))
                bars.append(panels.add_markers(lower, vanishing, ("order", "row"), method, name, **bar))
    for plot, renderers in ((upper, dots), (lower, bars)):
        panels.add_hover(plot, renderers, [("method", "$name"), ("order λ", "@order"), ("|κ|", "@shown{%.4e}")])
    limit = power_of_ten(round(log10(SATISFIED_BELOW)))
    return [
        Panel("A. Error terms that remain: line BAB, circles ABA", upper),
        Panel(f"B. Error terms that vanish, κ below {limit}: bar BAB, circles ABA", lower),
    ]


def _circle(plot: Plot, source: Source, y: str, method: str, name: str) -> Renderer:
    """Draw circles around the marker of the method, which identifies it without colour."""
    panels.add_markers(plot, source, ("order", y), method, size=5, line_width=1)
    circle = {"marker": "circle", "angle": 0.0, "size": 12, "fill_alpha": 0.0, "line_width": 1.1}
    return panels.add_markers(plot, source, ("order", y), method, name, **circle)


def perihelion(cube: xr.Dataset) -> list[Panel]:
    """Draw |perihelion_advance| of ``cube``, over (precision, integrator, tau_per_stage), with its 95 % interval.

    Runs whose interval includes zero are crosses without a line. The dashed line is the advance of general relativity.
    """
    century = arcseconds_per_century(float(cube.attrs["orbital_period"]))
    runs, x, y = double_runs(cube), "per_orbit", "advance"
    told = abs(runs["perihelion_advance"].values)[np.isfinite(runs["perihelion_advance_interval"].values)]
    ranges = (
        panels.span([runs["evaluations_per_orbit"].values], logarithmic=True),
        panels.span([told], logarithmic=True),
    )
    plot = panels.new_plot(ranges, ("force evaluations per orbit", "|perihelion advance| (rad per orbit)"), height=460)
    relativity = f"general relativity: {MERCURY_RELATIVISTIC_ADVANCE}″ per century"
    panels.add_level(plot, MERCURY_RELATIVISTIC_ADVANCE / century, relativity)
    dots: list[Renderer] = []
    for line, evaluations, size, interval, known, unknown in advances(cube, panels.COLUMNS // 2):
        runs, method = line.runs, line.integrator
        columns: dict[str, Any] = {
            x: evaluations,
            y: size,
            "interval": interval,
            "arcseconds": size * century,
            "tau_per_stage": runs["tau_per_stage"].values,
            "evaluations": runs["evaluations"].values if "evaluations" in runs else np.full(size.size, np.nan),
            "status": runs["status"].values.astype(str) if "status" in runs else np.full(size.size, "ok"),
        }
        source = panels.source_of(**panels.marked(columns | {y: np.where(known, size, np.nan)}, (x, y), line.turn))
        panels.add_line(plot, source, (x, y), method, line_width=1.0)
        bars = {x: evaluations[known], "low": (size - interval)[known], "high": (size + interval)[known]}
        ends = bokeh.Segment(x0=x, x1=x, y0="low", y1="high", line_color=style_of(method).colour)
        panels.add(plot, panels.source_of(**bars), ends, method)
        panels.add_markers(plot, source, (x, y), method)
        zero = panels.source_of(**{name: values[unknown] for name, values in columns.items()})
        cross = {"marker": "x", "angle": 0.0, "size": 5, "line_alpha": 0.5}
        crosses = panels.add_markers(plot, zero, (x, y), method, line.label, **cross)
        dots += [*panels.add_hits(plot, source, (x, y), method, line.label), crosses]
    rows = [
        ("method", "$name"),
        ("evaluations per orbit", f"@{x}{{%.5g}}"),
        ("|advance|", f"@{y}{{%.4e}} ± @interval{{%.1e}} rad per orbit"),
        ("", "@arcseconds{%.4g}″ per century"),
        ("τ/s", f"@tau_per_stage{{%.6g}}{_unit(cube['tau_per_stage'].attrs.get('units', '1'))}"),
        ("evaluations", "@evaluations{0,0}"),
        ("status", "@status"),
    ]
    panels.add_hover(plot, dots, rows)
    return [Panel("", plot)]


def phase_space(paths: dict[str, xr.Dataset]) -> list[Panel]:
    """Draw each Dataset of :func:`~nearharmonic_paper.experiments.paper.orbits.substeps` in a panel.

    Panels of one system share their axes and the picture of the Hamiltonian.
    """
    ranges: dict[str, tuple[Any, Any]] = {}
    around: dict[str, tuple[Any, Any]] = {}
    drawn = []
    for letter, path in paths.items():
        system = path.attrs["system"]
        if system not in ranges:
            edges = [path[name].values[[0, -1]].tolist() for name in ("q_grid", "p_grid")]
            ranges[system] = (panels.exactly(*edges[0]), panels.exactly(*edges[1]))
            around[system] = _hamiltonian(path)
        title = f"{letter}. {path.attrs['label']}, {path.attrs['system_label']}"
        plot = panels.new_plot(ranges[system], ("q", "p"), height=400)
        _add_hamiltonian(plot, around[system])
        _add_path(plot, path)
        drawn.append(Panel(title, plot, _energy_statement(path)))
    return drawn


def _hamiltonian(path: xr.Dataset) -> tuple[Any, Any]:
    """Return sources of the picture of the Hamiltonian: the band of each point, and the edges of the bands."""
    q, p, H = (path[name].values for name in ("q_grid", "p_grid", "hamiltonian"))
    levels = np.linspace(H.min(), H.max(), len(_SHADES) + 1)[1:-1]
    bands = np.searchsorted(levels, H).astype(np.uint8)
    place = {"x": [q[0]], "y": [p[0]], "dw": [q[-1] - q[0]], "dh": [p[-1] - p[0]]}
    return Source(data={"bands": [bands], **place}), _lines(path, levels)


def _lines(path: xr.Dataset, levels: Any) -> Any:
    """Return the source of the contours of the Hamiltonian at ``levels``."""
    generator = contour_generator(*(path[name].values for name in ("q_grid", "p_grid", "hamiltonian")))
    lines: list[Any] = [
        np.round(np.asarray(line, dtype=float), 4) for level in levels for line in generator.lines(level)
    ]
    return Source(data={"q": [line[:, 0] for line in lines], "p": [line[:, 1] for line in lines]})


def _add_hamiltonian(plot: Plot, around: tuple[Source, Source]) -> None:
    bands, edges = around
    mapper = bokeh.LinearColorMapper(palette=list(_SHADES), low=-0.5, high=len(_SHADES) - 0.5)
    panels.add(plot, bands, bokeh.Image(image="bands", color_mapper=mapper, x="x", y="y", dw="dw", dh="dh"))
    panels.add(plot, edges, _contours("#8795a5", line_width=0.6))


def _contours(colour: str, **look: Any) -> bokeh.MultiLine:
    return bokeh.MultiLine(xs="q", ys="p", line_color=colour, **look)


def _add_path(plot: Plot, path: xr.Dataset) -> None:
    """Draw the path, its dots and ends, and the energy surface through its start, tagged with the method."""
    method, label = path.attrs["integrator"], path.attrs["label"]
    surface = _lines(path, path["H"].values[:1, 0])
    panels.add(plot, surface, _contours("#1f2d3d", line_width=1.3, line_dash=[5, 3]), method)
    q, p, error = (path[name].values for name in ("q", "p", "energy_error"))
    legs = [_legs(*one, drift_first=path.attrs["first"] == "drift") for one in zip(q, p, strict=True)]
    lines = Source(data={"q": [leg[0] for leg in legs], "p": [leg[1] for leg in legs]})
    panels.add(plot, lines, _contours("#4d5661", line_width=1.0), method)
    for end, at in (("initial", 0), ("final", -1)):
        place = panels.source_of(q=q[:, at], p=p[:, at])
        panels.add_markers(plot, place, ("q", "p"), method, **({"angle": 0.0} | _ENDS[end]))
    signs = np.column_stack([path["next_drift_sign"].values, path["next_kick_sign"].values]) < 0
    hit = []
    for kind, (says, layers) in _DOTS.items():
        chosen = np.flatnonzero((path["kind"].values == "substep") & np.all(signs == kind, axis=1))
        dots = panels.source_of(**{
            name: values[:, chosen].ravel() for name, values in (("q", q), ("p", p), ("error", abs(error)))
        })  # fmt: skip
        for layer in layers:
            look = {"marker": "circle", "angle": 0.0, "line_color": None, "line_width": 1.2} | layer
            renderer = panels.add_markers(plot, dots, ("q", "p"), method, f"{label}: {says}", **look)
        hit.append(renderer)
    rows = [("method", "$name"), ("q, p", "@q{%.4f}, @p{%.4f}"), ("|ΔH/H₀|", "@error{%.2e}")]
    panels.add_hover(plot, hit, rows)


def _legs(q: Any, p: Any, *, drift_first: bool) -> tuple[Any, Any]:
    """Return the path with its corners: drifts move along q, kicks along p."""
    corners = (q[1:], p[:-1]) if drift_first else (q[:-1], p[1:])
    along_q, along_p = (
        np.concatenate([points[:1], np.column_stack([corner, points[1:]]).ravel()])
        for points, corner in zip((q, p), corners, strict=True)
    )
    return along_q, along_p


def _energy_statement(path: xr.Dataset) -> str:
    error, largest = abs(float(path["energy_error"].values[-1, -1])), float(path["max_energy_error"])
    left_at, followed = int(path["left_at"]), int(path.attrs["followed"])
    after = f"|ΔH/H₀| = {short(error, 2) if isfinite(error) else '∞'} after {path.sizes['iteration']} iterations"
    if left_at:
        return f"{after}, leaves its energy surface at iteration {left_at}"
    return f"{after}, up to {short(largest, 2)} in {followed}"
