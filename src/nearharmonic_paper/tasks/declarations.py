"""Figures that the workflow draws of cubes, as experiments declare them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

#: Cube of a figure that is drawn for each system; its name holds the same placeholder.
EVERY_SYSTEM = "{system}"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure, which an experiment declares under the name of its files.

    Attributes
    ----------
    draw : str
        ``module:name`` below the package of a function that takes the cube, an ``xarray.Dataset``, if there is one.
    title : str
        Heading.
    caption : str
        Text below the figure.
    cube : str or None
        Name of the cube that the figure shows; None for a figure that computes its own data.
    settings : mapping
        Keyword arguments of the function.
    target : str
        Target of the workflow; by default the name of the files.
    category : str
        Section of the figure in a report.
    profile : bool
        True for the energy-error figure of a system. Every system has files with this form of name; if a system
        declares its own figure, it is drawn once and stored under both names.
    stem, experiment : str
        Name of the files, without ending, and name of the experiment: :func:`figures_of` fills them in.
    """

    draw: str
    title: str
    caption: str
    cube: str | None
    settings: Mapping[str, Any] = field(default_factory=dict)
    target: str = ""
    category: str = "Figures"
    profile: bool = False
    stem: str = ""
    experiment: str = ""


def figures_of(systems: Collection[str], cubes: Collection[str] = ()) -> list[Figure]:
    """Return the declared figures whose cubes a config has.

    Parameters
    ----------
    systems : collection of str
        Systems of the config; each has a cube of its name.
    cubes : collection of str
        Names of the other cubes.

    Returns
    -------
    list of Figure
        A figure of :data:`EVERY_SYSTEM` occurs once for each system.
    """
    from nearharmonic_paper.tasks.experiment import experiments

    declared = [
        replace(figure, stem=stem, target=figure.target or stem, experiment=experiment.name)
        for experiment in experiments().values()
        for stem, figure in experiment.figures.items()
        if isinstance(figure, Figure)
    ]
    profiles = {figure.cube: figure for figure in declared if figure.profile and figure.cube != EVERY_SYSTEM}
    found = []
    for figure in declared:
        if figure.cube == EVERY_SYSTEM:
            for system in systems:
                stem, own = figure.stem.format(system=system), profiles if figure.profile else {}
                found.append(replace(own.get(system, figure), stem=stem, target=stem, cube=system))
        elif figure.cube is None or figure.cube in systems or figure.cube in cubes:
            found.append(figure)
    return found
