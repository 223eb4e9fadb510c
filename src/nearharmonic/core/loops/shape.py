"""Forms of compiled loops: systems of one form share the loops, for all numbers of coordinates and lanes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple


@dataclass(frozen=True, kw_only=True)
class Form:
    """Arithmetic and order of a step.

    Attributes
    ----------
    extended, compensated : bool
        ``extended``: states are double-doubles. ``compensated``: sums are compensated.
    ahead : bool
        True if the position is ready one operation after the force.
    modified : bool
        True if kicks use a modified potential.
    turning : bool
        True if an oscillator is solved exactly.
    resting : bool
        True if some coordinates never move; they are not updated.
    quick : bool
        True if energies are measured in double wherever that is accurate enough.
    large : bool
        True if states are in memory.
    unit_masses : bool
        True if T = p.p / 2, for states in memory.
    stages : bool
        True for a collocation method, one move of which is a step.
    timed : bool
        True if a coordinate is the time, and other sums are plain: that of the time is compensated.
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
    stages: bool = False
    timed: bool = False

    @property
    def parts(self) -> int:
        """Number of doubles of a number."""
        return 2 if self.extended else 1


class Motion(NamedTuple):
    """Functions that the loops of a form call; f denotes the forces that moves take.

    ``load(rows, moves, parameters)`` returns the running state and the output state, ``first(state, moves,
    parameters)`` the forces of the first move, ``move(state, row, f, parameters)`` the next state, ``behind(state,
    moves, row, parameters)`` the forces after the move of a row, ``last(state, moves, row, parameters)`` these forces
    and V, ``closed(state, row, f, parameters)`` the state at the end of a step. ``save(rows, state, seen)`` stores both
    states.
    """

    load: Any
    first: Any
    move: Any
    behind: Any
    last: Any
    closed: Any
    save: Any


class Measured(NamedTuple):
    """Energies of an output state, each ``f(seen, parameters)``.

    ``energy`` is H as a pair; ``energies`` are H as a pair, T, and 0; ``rounding`` is the rounding error of H in
    double, absolute and relative; ``potential`` and ``kinetic`` are V and T in double.
    """

    energy: Any
    energies: Any
    rounding: Any
    potential: Any
    kinetic: Any
