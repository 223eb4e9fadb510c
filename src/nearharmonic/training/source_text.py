"""Coefficients as Python text, for files that define a tableau."""

from __future__ import annotations

from nearharmonic.integrators.tableau import Row


def palindrome_lines(name: str, row: Row, indent: str) -> list[str]:
    """Return the lines, indented by ``indent``, of a symmetric row as the argument ``name`` of a tableau."""
    half = len(row) // 2
    numbers = [f'"{c}"' for c in row[:half]] + [f'centre="{c}"' for c in row[half : len(row) - half]]
    return [f"{indent}{name}=palindrome(", *(f"{indent}    {number}," for number in numbers), f"{indent}),"]
