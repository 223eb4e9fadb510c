"""Functions for the formulas of a system: one text for floats, arrays, mpmath numbers and numbers of kernels."""

from __future__ import annotations

from typing import Any

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.number import Number

__all__ = ["sin", "sqrt"]


def sin(x: Any) -> Any:
    """Sine of an angle in radians."""
    return _applied("sin", x)


def _applied(name: str, *operands: Any) -> Any:
    for operand in operands:
        if isinstance(operand, Number):
            return operand.apply(name, *operands[1:])
    raise NotImplementedError
