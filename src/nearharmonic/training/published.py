"""Methods for comparison with trained ones: all registered methods except those of this project."""

from __future__ import annotations

from collections.abc import Iterable

from nearharmonic.integrators import integrators, modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import Row, Tableau

#: Prefix of the names of trained methods.
TRAINED = "trained_"
#: Prefix of the names of methods that are trained with the oscillator solved exactly.
TRAINED_EXACT = "trained_exact_"
#: Modules of this project's own methods: found by order conditions, and trained.
OURS = ("nearharmonic_2026", "nearharmonic_2026_modified", "trained", "trained_exact", "trained_polynomial")


def module_of(name: str) -> str:
    """Return the last part of the name of the module that registers a method."""
    return str(integrators.module_of(name)).rpartition(".")[2]


def published_names() -> tuple[str, ...]:
    """Return the names of all published methods without modified potentials."""
    return tuple(name for name in plain_integrators.registered if module_of(name) not in OURS)


def modified_names() -> tuple[str, ...]:
    """Return the names of all methods with modified potentials except processed and trained ones.

    Published methods come first.
    """
    found = [name for name, one in modified_integrators.items() if not (one.processed or name.startswith(TRAINED))]
    return tuple(sorted(found, key=lambda name: module_of(name) in OURS))


def published(methods: Iterable[Tableau]) -> list[Tableau]:
    """Return the methods of other authors among registered ones."""
    return [one for one in methods if module_of(one.name) not in OURS]


# --- Coefficients as Python text, for files that define a tableau.
def palindrome_lines(name: str, row: Row, indent: str) -> list[str]:
    """Return the lines, indented by ``indent``, of a symmetric row as the argument ``name`` of a tableau."""
    half = len(row) // 2
    numbers = [f'"{c}"' for c in row[:half]] + [f'centre="{c}"' for c in row[half : len(row) - half]]
    return [f"{indent}{name}=palindrome(", *(f"{indent}    {number}," for number in numbers), f"{indent}),"]
