"""Declared figures: a decorated function is a figure, and its files are named after the function.

The decorator names the cube of the figure. The workflow reads the declarations from the source text, because the import
of matplotlib takes longer than the start of the workflow.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from nearharmonic_paper.tasks.code.sources import ROOT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawing = TypeVar("Drawing", bound="Callable[..., Figure]")

#: Cube of a figure that is drawn for each system; names of its files and targets begin with the name of the system.
EVERY_SYSTEM = "{system}"


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """A figure that a workflow draws.

    Attributes
    ----------
    function : str
        ``module:name`` below the package of a function that takes the cube, an ``xarray.Dataset``, if there is one.
    stem : str
        Name of the files, without ending.
    target : str
        Target of the workflow.
    cube : str or None
        Name of the cube that the figure shows; None for a figure that computes its own data.
    caption : str
        Text below the figure.
    category : str
        Section of the figure in a report.
    profile : bool
        True for the energy-error figure of a system. Every system has files with this form of name; if a system
        declares its own figure, it is drawn once and stored under both names.
    """

    function: str
    stem: str
    target: str
    cube: str | None
    caption: str
    category: str = "Figures"
    profile: bool = False


def figure(
    *, cube: str | None, caption: str, target: str = "", category: str = "Figures", profile: bool = False
) -> Callable[[Drawing], Drawing]:
    """Declare the decorated function a figure, drawn in the house style.

    Parameters
    ----------
    cube, caption, target, category, profile
        Literals, as the attributes of :class:`Declaration`; ``target`` is the name of the function if not given.
    """

    def decorate(function: Drawing) -> Drawing:
        from nearharmonic.plotting.style import house_style

        return house_style(function)

    return decorate


def figures_of(packages: Collection[str], systems: Collection[str], cubes: Collection[str] = ()) -> list[Declaration]:
    """Return the figures that packages or modules declare, if the config has their cubes.

    Parameters
    ----------
    packages : collection of str
        Dotted names of packages or modules; they are not imported.
    systems : collection of str
        Systems of the config; each has a cube of its name.
    cubes : collection of str
        Names of the other cubes.

    Returns
    -------
    list of Declaration
        A figure of :data:`EVERY_SYSTEM` occurs once for each system.
    """
    declared = [one for package in packages for one in _declarations(ROOT.joinpath(*package.split(".")))]
    profiles = {one.cube: one for one in declared if one.profile and one.cube != EVERY_SYSTEM}
    found = []
    for one in declared:
        if one.cube == EVERY_SYSTEM:
            own = profiles if one.profile else {}
            found += [
                replace(own.get(n, one), stem=f"{n}_{one.stem}", target=f"{n}_{one.target}", cube=n) for n in systems
            ]
        elif one.cube is None or one.cube in systems or one.cube in cubes:
            found.append(one)
    return found


def _declarations(folder: Path) -> Iterator[Declaration]:
    for path in sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]:
        text = path.read_text(encoding="utf-8")
        if "@figure(" not in text:
            continue
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for name, told in _decorated(ast.parse(text)):
            yield Declaration(**{"function": f"{module}:{name}", "stem": name, "target": name} | told)


def _decorated(tree: ast.Module) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name of each decorated function of a module, and the keywords of its decorator."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef):
            continue
        for decorator in node.decorator_list:
            if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) == "figure":
                yield node.name, {str(k.arg): ast.literal_eval(k.value) for k in decorator.keywords}
