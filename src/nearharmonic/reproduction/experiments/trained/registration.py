"""Generator of the module that registers trained methods, from the results of their searches."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.training.source_text import palindrome_lines

#: Head of the module.
HEAD = '''"""Methods trained on near-harmonic systems.

Coefficients of symmetric compositions that make the energy error of an ensemble of problems small over a window of step
sizes, and meet their order conditions exactly: the experiment ``trained`` has the search, and docs/results/trained.md
compares their errors with those of other methods. Each note has the window in tau/s, in radians of the fastest
oscillation, the ensemble, the limit of linear stability, the seed, and the digest of the run that found the method.
"""

{imports}

SOURCE = (
    "trained by nearharmonic (experiments.trained, docs/results/trained.md); searches began with published methods, "
    "those of Blanes & Moan (2002), J. Comput. Appl. Math. 142, 313, doi:10.1016/S0377-0427(01)00492-7, among them"
)

TABLEAUS = ('''
#: Maximum length of a line for formatters.
LONGEST = 120


def register(documents: Sequence[str]) -> dict[str, str]:
    """Return the text of the ``module``, from the paths of the TOML files of searches."""
    methods = [tomllib.loads(Path(place).read_text(encoding="utf-8")) for place in documents]
    names = [*(["QUADRATIC_KINETIC_ENERGY"] if any(map(_needs_requirement, methods)) else []), "Tableau", "palindrome"]
    imports = f"from nearharmonic.integrators.tableau import {', '.join(names)}"
    lines = [HEAD.format(imports=imports)]
    for one in methods:
        lines += ["    Tableau(", *(f"        {line}" for line in _fields(one)), "    ),"]
    return {"module": "\n".join([*lines, ")", ""])}


def _needs_requirement(one: Mapping[str, Any]) -> bool:
    """Return True if a method needs a quadratic T but has no squares that imply it."""
    return one["family_order"] > 4 and "square" not in one


def _fields(one: Mapping[str, Any]) -> list[str]:
    lines = [
        f'name="{one["name"]}",', f'label="{one["name"].replace("_", " ")}",', f"order={one['family_order']},",
        f'first="{one["first"]}",',
    ]  # fmt: skip
    for row in ("kick", "square", "drift"):
        if row in one:
            lines += palindrome_lines(row, one[row], "")
    lines += ["source=SOURCE,", f"digits={one['digits']},"]
    if _needs_requirement(one):
        lines.append("requires=QUADRATIC_KINETIC_ENERGY,")
    return [*lines, *_note(one)]


def _note(one: Mapping[str, Any]) -> list[str]:
    low, high = one["window"]
    parts = [f"{one['purpose']}: tau/s {low:.3g} to {high:.3g}; ", f"{one['ensemble']}; "]
    if "stability_limit" in one:
        parts.append(f"stability limit tau = {one['stability_limit']:.4f}; ")
    parts.append(f"seed {one['seed']}; run {one['digest'][:16]}")
    lines: list[str] = []
    line = ""
    for part in parts:
        if len(line) + len(part) > LONGEST - 20:
            lines, line = [*lines, line], ""
        line += part
    return ["note=(", *(f'    "{text}"' for text in [*lines, line]), "),"]
