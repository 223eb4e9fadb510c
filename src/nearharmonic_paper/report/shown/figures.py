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
from nearharmonic.plotting.levels import energy_error_label, energy_of
from nearharmonic.plotting.palette import style_of
from nearharmonic_paper.experiments.paper.orbits.substeps import paper_panels
from nearharmonic_paper.report.plots.decomposition import decomposition
from nearharmonic_paper.report.plots.energy_error import energy_error
from nearharmonic_paper.report.plots.markers import MARKERS
from nearharmonic_paper.report.plots.panels import Panel
from nearharmonic_paper.report.plots.perihelion import perihelion
from nearharmonic_paper.report.plots.phase_space import phase_space
from nearharmonic_paper.report.shown.declared import OTHERS, PAPER, anchor_of, number_of
from nearharmonic_paper.report.shown.pictures import picture
from nearharmonic_paper.report.shown.results import ShownResults
from nearharmonic_paper.tasks.declarations import Declaration
from nearharmonic_paper.tasks.experiment import experiments

if TYPE_CHECKING:
    import xarray as xr

_HINT = "A cross on the upper edge is the smallest step size at which a method leaves its energy surface."


@dataclass(kw_only=True)
class ShownFigure:
    """A figure of the page.

    Attributes
    ----------
    anchor : str
        Id of its element, and name of the page of this figure alone.
    title : str
        Heading.
    stem : str
        Name of its files, without ending.
    caption : str
        Text below the static picture.
    hint : str
        One sentence on the additional content of the interactive panels.
    cube : str or None
        Name of the cube of the figure.
    picture : str
        Data URI of the static picture, "" if it is omitted.
    thumbnail : str
        Data URI of the small picture.
    statements : list of dict
        The statements of the paper that it decides or illustrates, the worst first.
    panels : list of Panel
        Interactive panels; empty for a static figure.
    methods : dict of str to str
        Labels of the methods in the panels, by name.
    is_own : bool
        True for the energy errors of a system that the paper does not have.
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
        if one.function.startswith(PAPER):
            shown, methods, title, hint = _drawn(one, cubes)
            caption = _caption(one.caption, cubes(one.cube)) if one.profile and one.cube else one.caption
            yield _figure(replace(one, caption=caption), results, title, panels=shown, methods=methods, hint=hint)


def static(results: ShownResults, titles: Mapping[str, str]) -> Iterator[ShownFigure]:
    """Yield the other figures whose file names match one of the patterns in ``titles``.

    The part of the name that matches the wildcard, the name of a system, is added to the title.
    """
    declared, labels = {one.stem: one for one in results.figures}, results.labels
    for stem in results.stems("figures", ".svg", list(titles)):
        pattern = next(pattern for pattern in titles if fnmatch(stem, pattern))
        rest = stem.removeprefix(pattern.rstrip("*")) if "*" in pattern else ""
        title = titles[pattern] + (f": {labels.get(rest, rest)}" if rest else "")
        one = declared.get(stem)
        yield ShownFigure(
            anchor=f"figure-{stem}",
            title=title,
            caption=one.caption if one else "",
            stem=stem,
            cube=one.cube if one else None,
            picture=picture(results.svg(stem)),
            thumbnail=results.thumbnail(stem),
        )


def _caption(caption: str, cube: xr.Dataset) -> str:
    """Return ``caption`` with the energy of ``cube``, and what its errors are unless they are relative to |H0|."""
    relative = "|ΔH/H₀|"
    label = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", relative)
    if label != relative:
        caption = f"{caption.replace('relative energy', 'energy')} Energy errors are {label}."
    return f"{caption} The energy at the start is H₀ = {H0}." if (H0 := energy_of(cube.attrs)) else caption


def _figure(one: Declaration, results: ShownResults, title: str, **more: Any) -> ShownFigure:
    number = number_of(one)
    return ShownFigure(
        anchor=anchor_of(one),
        title=f"Figure {number}. {title}" if number else title,
        caption=one.caption,
        stem=one.stem,
        cube=one.cube,
        picture=picture(results.svg(one.stem)),
        thumbnail=results.thumbnail(one.stem),
        is_own=one.profile and number is None,
        **more,
    )


def _drawn(one: Declaration, cubes: Callable[[str], xr.Dataset]) -> tuple[list[Panel], dict[str, str], str, str]:
    """Return panels, methods, title and hint of one figure; no panels if it has no interactive version."""
    cube = cubes(one.cube) if one.cube else None
    if one.profile and cube is not None:
        title = f"Energy error against step size: {cube.attrs['system_label']}"
        return energy_error(cube), _methods(cube), title, _HINT
    title = experiments()["paper"].figures.get(one.stem, one.stem.replace("_", " ").capitalize())
    if one.stem not in OTHERS:
        return [], {}, title, ""
    if one.stem == "fig6_substeps":
        paths = paper_panels()
        methods = {path.attrs["integrator"]: path.attrs["label"] for path in paths.values()}
        return phase_space(paths), methods, title, ""
    draw, hint = _OTHERS[one.stem]
    return draw(cube), _methods(cube), title, hint


#: Figures of other quantities than energy errors, by their file names: drawing function and hint.
_OTHERS: dict[str, tuple[Callable[[Any], list[Panel]], str]] = {
    "fig2_decomposition": (decomposition, ""),
    "fig4_perihelion": (perihelion, "The interactive figure has arcseconds per century at each point."),
}


def _methods(cube: Any) -> dict[str, str]:
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
