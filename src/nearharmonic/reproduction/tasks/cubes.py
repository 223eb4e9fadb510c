"""Names of cubes, which the package of each experiment declares in ``CUBES``.

They are read from the source text, so that no experiment imports another. The module of figures is separate: it reaches
the style of figures, on which results that check names must not depend.
"""

from __future__ import annotations

import ast
from functools import cache

from nearharmonic.reproduction.tasks.sources import ROOT


@cache
def cubes_of(package: str) -> tuple[str, ...]:
    """Return the names in ``CUBES`` of each package directly in ``package``, a dotted name; nothing is imported."""
    found: list[str] = []
    for path in sorted(ROOT.joinpath(*package.split(".")).glob("*/__init__.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and [ast.unparse(name) for name in node.targets] == ["CUBES"]:
                found += ast.literal_eval(node.value)
    return tuple(found)
