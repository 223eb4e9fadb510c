"""Generator of the modules that register trained methods, from the results of their searches."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.training.published import TRAINED_EXACT, palindrome_lines

#: Head of the module of methods for T and V.
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
#: Head of the module of methods for exactly solved oscillators.
EXACT_HEAD = '''"""Methods trained on oscillators with a small rest, for steps that solve the oscillators exactly.

With H = A + epsilon B, A the oscillators and B the rest, they have the declared generalised order: errors are
O(epsilon tau^r1 + epsilon^2 tau^r2). The rest of their freedom makes the energy error of an ensemble of such problems
small over a window of step sizes: the experiment ``trained`` has the search, and docs/results/trained.md compares their
errors with those of other methods. Use: ``nh.integrate(..., split="exact_oscillator")``. Each note has the window in
tau/s, in radians of the fastest oscillation, the ensemble, the limit of linear stability with T and V, the seed, and
the digest of the run that found the method.
"""

{imports}
from nearharmonic.integrators.trained import SOURCE

TABLEAUS = ('''
#: Head of the module of methods for polynomial potentials.
POLYNOMIAL_HEAD = '''"""Methods trained on polynomial potentials.

They have order six or eight for quadratic T and every V of degree three or four, as their notes say, and order four for
any H. Brackets with higher derivatives of V vanish, and their conditions are left out
(:mod:`nearharmonic.exact.lie`). Such potentials: Escorihuela-Tomas (2026), arXiv:2605.06975. The experiment
``trained`` has the search, and docs/results/trained.md compares the errors of the methods with those of others.
"""

{imports}
from nearharmonic.integrators.trained import SOURCE

TABLEAUS = ('''
#: Maximum length of a line for formatters.
LONGEST = 120


def register(documents: Sequence[str]) -> dict[str, str]:
    """Return the texts of ``module``, ``exact_module`` and ``polynomial_module``, from the TOML files of searches."""
    methods = [tomllib.loads(Path(place).read_text(encoding="utf-8")) for place in documents]
    of_module: dict[str, list[Mapping[str, Any]]] = {"module": [], "exact_module": [], "polynomial_module": []}
    for one in methods:
        polynomial = "polynomial_module" if "potential_degree" in one else "module"
        of_module["exact_module" if one["name"].startswith(TRAINED_EXACT) else polynomial].append(one)
    heads = {"module": HEAD, "exact_module": EXACT_HEAD, "polynomial_module": POLYNOMIAL_HEAD}
    return {name: _module(heads[name], chosen) for name, chosen in of_module.items()}


def _module(head: str, methods: Sequence[Mapping[str, Any]]) -> str:
    names = [*(["QUADRATIC_KINETIC_ENERGY"] if any(map(_needs_requirement, methods)) else []), "Tableau", "palindrome"]
    imports = f"from nearharmonic.integrators.tableau import {', '.join(names)}"
    lines = [head.format(imports=imports)]
    for one in methods:
        lines += ["    Tableau(", *(f"        {line}" for line in _fields(one)), "    ),"]
    return "\n".join([*lines, ")", ""])


def _order(one: Mapping[str, Any]) -> int:
    """Return the order for quadratic T and any V."""
    return int(one["order_for_quadratic_T"] if "potential_degree" in one else one["family_order"])


def _needs_requirement(one: Mapping[str, Any]) -> bool:
    """Return True if a method needs a quadratic T but has no squares that imply it."""
    return _order(one) > 4 and "square" not in one


def _fields(one: Mapping[str, Any]) -> list[str]:
    lines = [
        f'name="{one["name"]}",', f'label="{one["name"].replace("_", " ")}",', f"order={_order(one)},",
        f'first="{one["first"]}",',
    ]  # fmt: skip
    for row in ("kick", "square", "drift"):
        if row in one:
            lines += palindrome_lines(row, one[row], "")
    lines += ["source=SOURCE,", f"digits={one['digits']},"]
    if _needs_requirement(one):
        lines.append("requires=QUADRATIC_KINETIC_ENERGY,")
    if "generalised_order" in one:
        lines.append(f"generalised_order=({', '.join(map(str, one['generalised_order']))}),")
    return [*lines, *_note(one)]


def _note(one: Mapping[str, Any]) -> list[str]:
    low, high = one["window"]
    parts = [f"{one['purpose']}: tau/s {low:.3g} to {high:.3g}; ", f"{one['ensemble']}; "]
    if "potential_degree" in one:
        parts.append(f"order {one['family_order']} for V of degree {one['potential_degree']}; ")
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
