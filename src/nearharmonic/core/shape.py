"""What compiled loops depend on: systems of one form share them, whatever their coordinates and lanes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Form:
    """Arithmetic and order of a step.

    Attributes
    ----------
    extended, compensated : bool
        Arithmetic of states and of sums.
    ahead : bool
        Whether the position is ready one operation behind the force.
    modified : bool
        Whether kicks are of a modified potential.
    turning : bool
        Whether an oscillator is solved exactly.
    resting : bool
        Whether there are coordinates that never move, and are left alone.
    quick : bool
        Whether energies are measured in double where that is certain.
    energy : {"every", "samples", "none"}
        As for :func:`nearharmonic.core.kernel.build`.
    """

    extended: bool
    compensated: bool
    ahead: bool
    modified: bool
    turning: bool
    resting: bool
    quick: bool
    energy: str

    @property
    def parts(self) -> int:
        """Doubles of a number."""
        return 2 if self.extended else 1
