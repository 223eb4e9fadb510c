"""Packages have a limited number of members: additions need a nested or a new package."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3] / "src/nearharmonic"
#: Folders of data files, one for each source, and the most things side by side in the others.
DATA = {"integrators", "systems"}
MOST, IN_CORE, AT_THE_TOP = 9, 12, 18
LONGEST = 300
ROOMS = [path for path in ROOT.rglob("*") if path.is_dir() and path.name != "__pycache__"]


def things_in(room):
    """Modules, rooms and other files; what Python leaves of a room that is gone counts nothing."""
    names = {"__init__.py", "__pycache__", "py.typed"}
    return sorted(
        path.name
        for path in room.iterdir()
        if path.name not in names and (path.is_file() or any(one.suffix != ".pyc" for one in path.rglob("*.*")))
    )


def test_the_top_and_the_core_are_not_full():
    assert len(things_in(ROOT)) <= AT_THE_TOP
    assert len(things_in(ROOT / "core")) <= IN_CORE


@pytest.mark.parametrize("room", sorted(str(path.relative_to(ROOT)) for path in ROOMS))
def test_a_room_has_few_things(room):
    if room not in DATA | {"core"}:
        assert len(things_in(ROOT / room)) <= MOST, things_in(ROOT / room)


def modules():
    """Paths of all modules by their dotted names."""
    names = {path: ".".join(path.relative_to(ROOT.parent).with_suffix("").parts) for path in ROOT.rglob("*.py")}
    return {name.removesuffix(".__init__"): path for path, name in names.items()}


def imported(tree, names):
    """Modules that a module imports anywhere: at its top, inside of functions, or for types alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in names else node.module


@pytest.mark.slow
def test_no_imports_form_a_loop():
    found = modules()
    del found["nearharmonic"]  # its names are loaded lazily, and it has the version
    graph = {
        name: {one for one in imported(ast.parse(path.read_text()), found) if one in found} - {name}
        for name, path in found.items()
    }
    assert graph["nearharmonic.engine.runs.solution"]  # edges are found
    TopologicalSorter(graph).prepare()


def test_a_module_is_at_most_300_lines_long():
    lengths = {path: len(path.read_text().splitlines()) for path in modules().values()}
    data = {
        path for path in (ROOT / "integrators").iterdir() if path.suffix == ".py" and "TABLEAUS = " in path.read_text()
    }
    assert not {str(path): length for path, length in lengths.items() if length > LONGEST and path not in data}
