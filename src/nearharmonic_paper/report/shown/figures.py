"""Figures of the page, interactive and static, with their texts and the legend of the methods."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from nearharmonic.integrators import integrators
from nearharmonic.output.store import read
from nearharmonic.plotting.palette import style_of
from nearharmonic.plotting.profile import energy_error_label, energy_of
from nearharmonic_paper.experiments.paper.orbits.substeps import paper_panels
from nearharmonic_paper.report.panels import MARKERS, Panel
from nearharmonic_paper.report.plots import decomposition, energy_error, perihelion, phase_space
from nearharmonic_paper.report.shown.declared import PAPER, anchor_of, number_of
from nearharmonic_paper.report.shown.pictures import picture
from nearharmonic_paper.report.shown.results import ShownResults
from nearharmonic_paper.tasks.declarations import Figure

if TYPE_CHECKING:
    import xarray as xr

_HINT = "A cross on the upper edge is the smallest step size at which a method leaves its energy surface."


@dataclass(kw_only=True)
class ShownFigure:
    """A figure of the page, with its files and the pictures of them as data URIs, "" if they are omitted.

    ``anchor`` is the id of its element, and the name of the page of this figure alone. ``hint`` is a sentence on what
    the interactive panels have besides. ``statements`` are those of the paper that it decides or illustrates, the worst
    first, and ``methods`` the labels in its panels by name. The energy errors of a system that the paper does not have
    ``is_own``.
    """

    anchor: str
    title: str
    caption: str
    stem: str
    cube: str | None = None
    picture: str = ""
    thumbnail: str = ""
    statements: list[dict[str, Any]] = field(default_factory=list)
    hint: str = ""
    panels: list[Panel] = field(default_factory=list)
    methods: dict[str, str] = field(default_factory=dict)
    is_own: bool = False

    @property
    def files(self) -> dict[str, str]:
        """Paths of its files from the page, by names for links."""
        cube = {"data (HDF5)": f"cubes/{self.cube}.h5"} if self.cube else {}
        alone = {"figure alone": f"{self.anchor}.html"} if self.panels else {}
        return {kind.upper(): f"figures/{self.stem}.{kind}" for kind in ("pdf", "svg", "png")} | cube | alone

    @property
    def plots(self) -> dict[str, Any]:
        """The plots by the ids of their elements."""
        return {f"{self.anchor}-panel-{i}": panel.plot for i, panel in enumerate(self.panels, start=1)}


def interactive(results: ShownResults) -> Iterator[ShownFigure]:
    """Yield the existing figures of the paper, and the existing energy-error figures of other systems."""
    cubes = cache(lambda name: read(results.cube(name)))
    for one in results.figures:
        if one.experiment == PAPER:
            number, title, caption = number_of(one), one.title, one.caption
            data: Any = cubes(one.cube) if one.cube else None
            more: dict[str, Any] = {}
            if one.profile and data is not None:
                title = f"Energy error against step size: {data.attrs['system_label']}"
                caption = _caption(caption, data)
                more = {"panels": energy_error(data), "hint": _HINT}
            elif one.stem in _DRAWN:
                draw, hint = _DRAWN[one.stem]
                data = paper_panels() if data is None else data
                more = {"panels": draw(data), "hint": hint}
            if more:
                more["methods"] = _methods(data)
            title = f"Figure {number}. {title}" if number else title
            own = one.profile and number is None
            yield _shown(results, one.stem, anchor_of(one), title, replace(one, caption=caption), is_own=own, **more)


def static(results: ShownResults, titles: Mapping[str, str]) -> Iterator[ShownFigure]:
    """Yield the other figures whose file names match one of the patterns in ``titles``.

    The part of the name that matches the wildcard, the name of a system, is added to the title.
    """
    declared, labels = {one.stem: one for one in results.figures}, results.labels
    for stem in results.stems("figures", ".svg", list(titles)):
        pattern = next(pattern for pattern in titles if fnmatch(stem, pattern))
        rest = stem.removeprefix(pattern.rstrip("*")) if "*" in pattern else ""
        title = titles[pattern] + (f": {labels.get(rest, rest)}" if rest else "")
        yield _shown(results, stem, f"figure-{stem}", title, declared.get(stem))


def _shown(results: ShownResults, stem: str, anchor: str, title: str, one: Figure | None, **more: Any) -> ShownFigure:
    caption, cube = (one.caption, one.cube) if one else ("", None)
    small, drawing = results.thumbnail(stem), picture(results.svg(stem))
    return ShownFigure(
        anchor=anchor, title=title, caption=caption, stem=stem, cube=cube, picture=drawing, thumbnail=small, **more
    )


def _caption(caption: str, cube: xr.Dataset) -> str:
    """Return ``caption`` with the energy of ``cube``, and what its errors are unless they are relative to |H0|."""
    relative = "|ΔH/H₀|"
    label = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", relative)
    if label != relative:
        caption = f"{caption.replace('relative energy', 'energy')} Energy errors are {label}."
    return f"{caption} The energy at the start is H₀ = {H0}." if (H0 := energy_of(cube.attrs)) else caption


#: Interactive figures of other quantities than energy errors, by their file names: drawing function and hint.
_DRAWN: dict[str, tuple[Callable[[Any], list[Panel]], str]] = {
    "fig2_decomposition": (decomposition, ""),
    "fig4_perihelion": (perihelion, "The interactive figure has arcseconds per century at each point."),
    "fig6_substeps": (phase_space, ""),
}


def _methods(cube: Any) -> dict[str, str]:
    if isinstance(cube, dict):  # paths of substeps
        return {path.attrs["integrator"]: path.attrs["label"] for path in cube.values()}
    names, labels = (map(str, cube[name].values) for name in ("integrator", "label"))
    return dict(zip(names, labels, strict=True))


def coefficients(methods: Iterable[str]) -> list[dict[str, Any]]:
    """Return the coefficients of registered methods as doubles, as ``nearharmonic export --to json`` writes them."""
    from nearharmonic.exchange.export import export

    told = [json.loads(export(integrators[name], "json")) for name in methods if name in integrators]
    plain = [one for one in told if not one.get("square")]
    rows = [{key: list(map(float, one[key])) for key in ("kick", "drift")} for one in plain]
    return [{key: one[key] for key in ("name", "label", "first")} | row for one, row in zip(plain, rows, strict=True)]


class Entry(NamedTuple):
    """A method in the legend: name, label, and marker as an SVG path with colours."""

    method: str
    label: str
    outline: str
    colour: str
    fill: str


def entries(figures: Iterable[ShownFigure]) -> list[Entry]:
    """Return an entry for each method that a figure draws, in the order of the figure with the most methods."""
    drawn = sorted(figures, key=lambda figure: -len(figure.methods))
    methods = {method: label for figure in reversed(drawn) for method, label in figure.methods.items()}
    ordered = dict.fromkeys(method for figure in drawn for method in figure.methods)
    return [
        Entry(name, methods[name], MARKERS[one.marker].outline, one.colour, one.colour if one.filled else "#ffffff")
        for name, one in zip(ordered, map(style_of, ordered), strict=True)
    ]
