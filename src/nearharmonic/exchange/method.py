"""The method of another library: kicks and drifts in double precision."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nearharmonic.errors import SettingError
from nearharmonic.integrators import integrators
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import First, Tableau

Flow = Literal["kick", "drift"]


@dataclass(frozen=True)
class Move:
    """A kick, p -= coefficient tau dV/dq, or a drift, q += coefficient tau dT/dp."""

    flow: Flow
    coefficient: float


@dataclass(frozen=True)
class Method:
    """A splitting method of plain kicks and drifts, in double precision.

    Attributes
    ----------
    tableau : Tableau
        The method.
    moves : tuple of Move
        A step, the first move first: ``stages + 1`` of the outer operator and ``stages`` of the inner one in turns.
    """

    tableau: Tableau
    moves: tuple[Move, ...]

    @property
    def first(self) -> First:
        """The operator that begins and ends a step."""
        return self.tableau.first

    @property
    def stages(self) -> int:
        """Forces of a step, if the last kick of a step and the first of the next share one."""
        return self.tableau.stages

    @property
    def joint(self) -> Move:
        """The last move of a step and the first of the next as one: a library that allows it shares their force."""
        return Move(self.moves[0].flow, self.moves[-1].coefficient + self.moves[0].coefficient)


def method_for(library: str, method: str | Tableau) -> Method:
    """Return a method for a library that evaluates the forces of V and nothing else.

    Parameters
    ----------
    library : str
        Name of the library as it writes itself, for messages.
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau.

    Raises
    ------
    UnknownNameError
        There is no such integrator; the message has the nearest names.
    SettingError
        The method has modified potentials or a processor.
    """
    tableau = method if isinstance(method, Composition) else integrators[method]
    if tableau.implicit:
        raise SettingError(
            f"{tableau.name} cannot run in {library}: it is implicit, and no sequence of kicks and drifts"
        )
    if tableau.modified:
        reason = f"its modified potentials need the gradient of |grad V|^2, for which {library} has no hook"
        raise SettingError(f"{tableau.name} cannot run in {library}: {reason}")
    if tableau.processed:
        raise SettingError(
            f"{tableau.name} cannot run in {library}: its processor must be undone before each output, and {library} "
            f"does not say when it reads the state"
        )
    outer, inner = tableau.rows_double()
    names: tuple[Flow, Flow] = ("kick", "drift") if tableau.first == "kick" else ("drift", "kick")
    moves = [Move(names[0], outer[0])]
    for c_inner, c_outer in zip(inner, outer[1:], strict=True):
        moves += [Move(names[1], c_inner), Move(names[0], c_outer)]
    return Method(tableau, tuple(moves))
