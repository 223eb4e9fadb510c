"""Coefficients of the registered methods as exact fractions, in the order of their application."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from nearharmonic.integrators import integrators


class Method(NamedTuple):
    """Coefficients in the order of their application: outer[0], inner[0], outer[1], ..., outer[-1]."""

    first: str
    outer: tuple[Fraction, ...]
    inner: tuple[Fraction, ...]

    @property
    def stages(self) -> int:
        return len(self.inner)

    def moves(self) -> list[tuple[str, Fraction]]:
        """Return drifts and kicks in the order of their application."""
        other = "kick" if self.first == "drift" else "drift"
        row = [(self.first, self.outer[0])]
        for inner, outer in zip(self.inner, self.outer[1:], strict=True):
            row += [(other, inner), (self.first, outer)]
        return row


METHODS = {
    one.label: Method(one.first, *(tuple(map(Fraction, row)) for row in (one.outer, one.inner)))
    for one in integrators.values()
}
