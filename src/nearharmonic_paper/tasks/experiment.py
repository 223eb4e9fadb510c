"""Declarations of experiments: the sources of config sections, targets, reserved names, and sections of the page.

Each folder of :data:`ROOMS` declares ``EXPERIMENT`` in its module ``experiment``; there is no other list
of experiments. No job imports these modules, so that a new title invalidates no result.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cache
from importlib import import_module
from itertools import product
from typing import Any

from nearharmonic_paper.tasks.provenance import ROOT

# --- Figures that the workflow draws of cubes, as experiments declare them.

#: Cube of a figure that is drawn for each system; its name holds the same placeholder.
EVERY_SYSTEM = "{system}"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure, which an experiment declares under the name of its files.

    Attributes
    ----------
    draw : str
        ``module:name`` below the package of a function that takes the cubes, each an ``xarray.Dataset``.
    title : str
        Heading.
    caption : str
        Text below the figure.
    cube : str or None
        Name of the cube that the figure shows; None for a figure of several or of its own data.
    cubes, method : tuple of str, str
        Cubes of a figure of several, of which it shows those that a config has, and a method that it cannot do without.
    settings : mapping
        Keyword arguments of the function.
    column : mapping
        Further ones for the figure of the width of a column of text.
    target : str
        Target of the workflow; by default the name of the files.
    category : str
        Section of the figure in a report.
    profile : bool
        True for the energy-error figure of a system. A system with its own figure has no other.
    by_default : bool
        False for a figure that only its target and ``everything`` draw.
    stem, experiment : str
        Name of the files, without ending, and name of the experiment: :func:`figures_of` fills them in.
    """

    draw: str
    title: str
    caption: str
    cube: str | None = None
    cubes: tuple[str, ...] = ()
    method: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    column: Mapping[str, Any] = field(default_factory=dict)
    target: str = ""
    category: str = "Figures"
    profile: bool = False
    by_default: bool = True
    stem: str = ""
    experiment: str = ""


def figures_of(systems: Collection[str], cubes: Collection[str] = ()) -> list[Figure]:
    """Return the declared figures whose cubes a config has."""
    declared = [
        replace(figure, stem=stem, target=figure.target or stem, experiment=experiment.name)
        for experiment in experiments().values()
        for stem, figure in experiment.figures.items()
        if isinstance(figure, Figure)
    ]
    own = {figure.cube for figure in declared if figure.profile}
    found = []
    for figure in declared:
        if figure.cube == EVERY_SYSTEM:
            for system in systems:
                stem = figure.stem.format(system=system)
                if not (figure.profile and system in own):
                    found.append(replace(figure, stem=stem, target=stem, cube=system))
        elif figure.cubes:
            here = tuple(cube for cube in figure.cubes if cube in systems or cube in cubes)
            found += [replace(figure, cubes=here)] if here else []
        elif figure.cube is None or figure.cube in systems or figure.cube in cubes:
            found.append(figure)
    return found


#: Packages of experiments: the paper's, and those that go beyond it.
ROOMS = ("nearharmonic_paper.experiments", "nearharmonic_studies")
#: Endings of the files of a table and of a figure.
OF_A_TABLE, OF_A_FIGURE = (".csv", ".md", ".tex"), (".pdf", ".svg", ".png")
_PLACEHOLDER = re.compile(r"\{(\w+)\}")


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """An experiment.

    Names of files have no endings and may contain placeholders, such as ``{system}``.

    Attributes
    ----------
    name : str
        Name of the folder.
    title, about : str
        Heading, and a sentence on the content.
    target : str
        Target of the workflow for its files; by default ``name``.
    cubes_target : str
        Target for its cubes and their derived files, which ``everything`` has; by default ``target``.
    place : int
        Position among the experiments, in the config, on the page of results and in documents; equal positions are
        sorted by name.
    duration, cubes_duration : str
        Times for its target and for ``cubes_target`` on two cores; the second by default the first.
    settings : type or None
        Dataclass of its section of the config, None without settings.
    key, effect : str
        Key of that section, by default ``name``, and effect of the settings.
    cubes : mapping of str to (str, str)
        Dimensions and contents of its cubes, by name.
    tables : tuple of str
        Names of its tables of three files.
    figures : mapping of str to Figure or str
        Its figures, by name: those that the workflow draws of cubes, and the titles of those that other jobs draw.
    others : tuple of str
        All other files of its target, with folders and endings.
    runs : tuple of str
        Names of its run files, which are intermediate files.
    values : callable
        Function of the config that returns the values of placeholders except ``{system}``.
    measured : tuple of str
        Beginnings of the names of files with measured times.
    """

    name: str
    title: str
    about: str
    target: str = ""
    cubes_target: str = ""
    place: int = 100
    duration: str = ""
    cubes_duration: str = ""
    settings: type | None = None
    key: str = ""
    effect: str = ""
    cubes: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    tables: tuple[str, ...] = ()
    figures: Mapping[str, Figure | str] = field(default_factory=dict)
    others: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()
    values: Callable[[Any], Mapping[str, Iterable[str]]] = field(default=lambda config: {}, repr=False)
    measured: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for member, default in (
            ("target", "name"), ("cubes_target", "target"), ("key", "name"), ("cubes_duration", "duration"),
        ):  # fmt: skip
            object.__setattr__(self, member, getattr(self, member) or getattr(self, default))

    def files(self, **values: Iterable[str]) -> list[str]:
        """Return the names of the files of its target, relative to the folder of results."""
        return [name for file in self._unfilled() for name in _filled(file, values)]

    def run_files(self, **values: Iterable[str]) -> list[str]:
        """Return the names of its run files; arguments of :meth:`files`."""
        return [f"runs/{name}.h5" for stem in self.runs for name in _filled(stem, values)]

    def kinds_of_runs(self, **values: Iterable[str]) -> dict[str, str]:
        """Return one run file of each kind; arguments of :meth:`files`.

        Files of one kind differ in the last part of their names alone, and its placeholders stand in the key.
        """
        found = {}
        for stem in self.runs:
            folder, _, last = stem.rpartition("/")
            for place in _filled(folder, values):
                first = next(_filled(last, values), None)
                if first is not None:
                    found[f"runs/{place}/{last}.h5"] = f"runs/{place}/{first}.h5"
        return found

    def makes(self, name: str) -> bool:
        """Return True if a file belongs to its target, for any values of placeholders."""
        return any(fnmatchcase(name, _pattern(file)) for file in self._unfilled())

    def _unfilled(self) -> list[str]:
        """Names of the files of its target, with placeholders."""
        cubes = [f"cubes/{stem}.h5" for stem in self.cubes]
        tables = [f"tables/{stem}{suffix}" for stem in self.tables for suffix in OF_A_TABLE]
        figures = [f"figures/{stem}{suffix}" for stem in self.figures for suffix in OF_A_FIGURE]
        return [*cubes, *tables, *figures, *self.others]

    @property
    def table_patterns(self) -> tuple[str, ...]:
        """Patterns for :mod:`fnmatch` of the names of all its tables."""
        others = [name for name in self.others if name.startswith("tables/")]
        stems = (*self.tables, *(name.removeprefix("tables/").rpartition(".")[0] for name in others))
        return tuple(dict.fromkeys(map(_pattern, stems)))

    @property
    def figure_titles(self) -> dict[str, str]:
        """Titles of its figures, by patterns of their names."""
        titles = {stem: one if isinstance(one, str) else one.title for stem, one in self.figures.items()}
        return {_pattern(stem): title for stem, title in titles.items()}


def _filled(stem: str, values: Mapping[str, Iterable[str]]) -> Iterator[str]:
    """Yield ``stem`` with each combination of values of its placeholders."""
    names = list(dict.fromkeys(_PLACEHOLDER.findall(stem)))
    for chosen in product(*(values[name] for name in names)):
        yield stem.format(**dict(zip(names, chosen, strict=True)))


def _pattern(stem: str) -> str:
    return _PLACEHOLDER.sub("*", stem)


@cache
def folders() -> tuple[str, ...]:
    """Return the dotted names of all experiments' folders."""
    places = ((room, path) for room in ROOMS for path in ROOT.joinpath(*room.split(".")).glob("*/__init__.py"))
    return tuple(sorted(f"{room}.{path.parent.name}" for room, path in places))


@cache
def experiments() -> dict[str, Experiment]:
    """Return all experiments by name, in the order of their positions."""
    found: list[Experiment] = []
    for folder in folders():
        declared = import_module(f"{folder}.experiment")
        found.append(declared.EXPERIMENT)
        if found[-1].name != folder.rpartition(".")[2]:
            message = f"{declared.__file__} declares the experiment {found[-1].name!r}"
            raise LookupError(message)
    return {one.name: one for one in sorted(found, key=lambda one: (one.place, one.name))}


def beside_the_paper() -> list[Experiment]:
    """Return the experiments that have a target and a section of the page of their own."""
    return [one for one in experiments().values() if one.target != "all"]
