"""Figures of the page, interactive and static, with their texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from functools import cache
from typing import TYPE_CHECKING, Any

from nearharmonic.output.store import read
from nearharmonic.plotting.levels import energy_error_label
from nearharmonic.reproduction.report.plots.panels import Panel
from nearharmonic.reproduction.report.shown.pictures import picture
from nearharmonic.reproduction.report.shown.results import ShownResults, number_of
from nearharmonic.reproduction.tasks.declarations import Declaration
from nearharmonic.reproduction.tasks.experiment import experiments

if TYPE_CHECKING:
    import xarray as xr

#: Package of the interactive figures; figures of other packages are shown as pictures.
_INTERACTIVE = "reproduction.experiments.paper."
_HINT = "A cross on the upper edge is the smallest step size at which a method leaves its energy surface."


@dataclass(kw_only=True)
class ShownFigure:
    """A figure of the page.

    Attributes
    ----------
    anchor : str
        Id of its element.
    title : str
        Heading.
    caption : str
        Text below the static picture.
    hint : str
        One sentence on the additional content of the interactive panels.
    cube : str or None
        Name of the cube of the figure.
    picture : str
        Data URI of the static picture, "" if it is omitted; ``file`` is its path.
    panels : list of Panel
        Interactive panels; empty for a static figure.
    methods : dict of str to str
        Labels of the methods in the panels, by name.
    """

    anchor: str
    title: str
    caption: str
    file: str
    cube: str | None = None
    picture: str = ""
    hint: str = ""
    panels: list[Panel] = field(default_factory=list)
    methods: dict[str, str] = field(default_factory=dict)

    @property
    def plots(self) -> dict[str, Any]:
        """The plots by the ids of their elements."""
        return {f"{self.anchor}-panel-{i}": panel.plot for i, panel in enumerate(self.panels, start=1)}


def interactive(results: ShownResults) -> Iterator[ShownFigure]:
    """Yield the existing figures of the paper, and the existing energy-error figures of other systems."""
    cubes = cache(lambda name: read(results.cube(name)))
    for one in results.figures:
        if one.function.startswith(_INTERACTIVE):
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
            file=f"figures/{stem}.svg",
            cube=one.cube if one else None,
            picture=picture(results.svg(stem)),
        )


def _caption(caption: str, cube: xr.Dataset) -> str:
    """Return ``caption``, with the definition of the energy errors of ``cube`` unless they are relative to |H0|."""
    relative = "|ΔH/H₀|"
    label = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", relative)
    if label == relative:
        return caption
    return f"{caption.replace('relative energy', 'energy')} Energy errors are {label}."


def _figure(one: Declaration, results: ShownResults, title: str, **more: Any) -> ShownFigure:
    number = number_of(one)
    return ShownFigure(
        anchor=f"figure-{number or one.stem}",
        title=f"Figure {number}. {title}" if number else title,
        caption=one.caption,
        file=f"figures/{one.stem}.svg",
        cube=one.cube,
        picture=picture(results.svg(one.stem)),
        **more,
    )


def _drawn(one: Declaration, cubes: Callable[[str], xr.Dataset]) -> tuple[list[Panel], dict[str, str], str, str]:
    """Return panels, methods, title and hint of one figure; no panels if it has no interactive version."""
    if one.profile and one.cube:
        from nearharmonic.reproduction.report.plots.energy_error import energy_error

        cube = cubes(one.cube)
        title = f"Energy error against step size: {cube.attrs['system_label']}"
        return energy_error(cube), _methods(cube), title, _HINT
    title = experiments()["paper"].figures.get(one.stem, one.stem.replace("_", " ").capitalize())
    draw = _OTHERS.get(one.stem)
    panels, methods, hint = draw(cubes(one.cube) if one.cube else None) if draw else ([], {}, "")
    return panels, methods, title, hint


def _decomposition(terms: Any) -> tuple[list[Panel], dict[str, str], str]:
    from nearharmonic.reproduction.report.plots.decomposition import decomposition

    return decomposition(terms), _methods(terms), ""


def _perihelion(cube: Any) -> tuple[list[Panel], dict[str, str], str]:
    from nearharmonic.reproduction.report.plots.perihelion import perihelion

    hint = "The interactive figure has arcseconds per century at each point."
    return perihelion(cube), _methods(cube), hint


def _substeps(_: Any) -> tuple[list[Panel], dict[str, str], str]:
    from nearharmonic.reproduction.experiments.paper.orbits.substeps import paper_panels
    from nearharmonic.reproduction.report.plots.phase_space import phase_space

    paths = paper_panels()
    methods = {path.attrs["integrator"]: path.attrs["label"] for path in paths.values()}
    return phase_space(paths), methods, ""


#: Figures of other quantities than energy errors, by their file names.
_OTHERS = {"fig2_decomposition": _decomposition, "fig4_perihelion": _perihelion, "fig6_substeps": _substeps}


def _methods(cube: xr.Dataset) -> dict[str, str]:
    names, labels = (map(str, cube[name].values) for name in ("integrator", "label"))
    return dict(zip(names, labels, strict=True))
