"""Modules import one another in one direction."""

from __future__ import annotations

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4] / "src/nearharmonic"


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
    assert graph["nearharmonic.engine.trajectory"]  # edges are found
    TopologicalSorter(graph).prepare()
