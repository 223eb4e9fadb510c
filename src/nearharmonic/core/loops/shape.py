"""Forms of compiled loops: systems of one form share them, whatever their coordinates and lanes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple


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
    large : bool
        Whether states lie in memory.
    unit_masses : bool
        Whether T = p.p / 2, for states in memory.
    """

    extended: bool = False
    compensated: bool = False
    ahead: bool = False
    modified: bool = False
    turning: bool = False
    resting: bool = False
    quick: bool = False
    large: bool = False
    unit_masses: bool = False

    @property
    def parts(self) -> int:
        """Doubles of a number."""
        return 2 if self.extended else 1


class Motion(NamedTuple):
    """Functions that the loops of a form call; f are forces, whatever the moves take.

    ``load(rows, moves, parameters)`` returns the state that runs and the one that was seen, ``first(state, moves,
    parameters)`` the forces of the first move, ``move(state, row, f, parameters)`` the next state, ``behind(state,
    moves, row, parameters)`` the forces behind the move of a row, ``last`` of the same arguments these and V,
    ``closed(state, row, f, parameters)`` the state at the end of a step; ``save(rows, state, seen)`` puts both back.
    """

    load: Any
    first: Any
    move: Any
    behind: Any
    last: Any
    closed: Any
    save: Any


class Measured(NamedTuple):
    """Energies of a state that is seen, each ``f(seen, parameters)``.

    ``energy`` is H as a pair; ``energies`` are H as a pair, T, and 0; ``rounding`` is that of H in double, absolute and
    relative; ``potential`` and ``kinetic`` are V and T in double.
    """

    energy: Any
    energies: Any
    rounding: Any
    potential: Any
    kinetic: Any
