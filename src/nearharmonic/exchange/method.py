"""The method of another library: kicks and drifts in double precision."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from nearharmonic.errors import SettingError
from nearharmonic.integrators import integrators
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import First, Tableau

Flow = Literal["kick", "drift"]

#: Relative difference of two forces that rounding may cause, for a sum of a thousand terms.
ROUNDING = 1e-12
#: Sizes of the velocities at which a force is compared, relative to the largest velocity of the state.
SIZES = (1.0, 2.0**-10, 2.0**10)
#: Angle in radians: cosines of its multiples are spread evenly, without a period.
GOLDEN_ANGLE = np.pi * (3 - 5**0.5)


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


@dataclass
class VelocityCheck:
    """Comparisons of a force from outside at one position and several velocities, in a few steps of a run.

    The first comparison takes three further velocities, of all :data:`SIZES`, and each later one a single velocity.
    Components of a velocity differ, so that forces of velocity differences are found as well.

    Attributes
    ----------
    compared : int
        Velocities compared so far; each costs a force.
    step : int
        Number of steps before the last comparison.
    """

    compared: int = 0
    step: int = 0

    def due(self, step: int, *, last: bool = False) -> bool:
        """Return True before steps 1, 2, 3, 5, 9, ..., and the last step unless a comparison was in the last fifth."""
        return not self.compared or step >= 2 * max(self.step, 0.5) or (last and 4 * step > 5 * self.step)

    def direction(self, size: int) -> Any:
        """Return ``size`` different numbers from -1 to 1, which change with each comparison."""
        return np.cos(GOLDEN_ANGLE * (self.compared + 1) * np.arange(1, size + 1))

    def finds(self, force: Callable[[Any], Any], velocities: Any, step: int, known: Any = None) -> bool:
        """Return True if a force depends on velocities.

        Parameters
        ----------
        force : callable
            Forces or accelerations of given velocities at the time and the positions of a state.
        velocities : array
            Velocities of the state, or momenta.
        step : int
            Number of steps before.
        known : array, optional
            Force at ``velocities``. By default it is evaluated.
        """
        known = force(velocities) if known is None else known
        if not np.isfinite(known).all():
            return False
        scale, bound = float(np.abs(velocities).max()) or 1.0, ROUNDING * np.abs(known).max()
        self.step = step
        for _ in range(1 if self.compared else len(SIZES)):
            shift = SIZES[self.compared % len(SIZES)] * scale * self.direction(np.size(velocities))
            self.compared += 1
            other = shift.reshape(np.shape(velocities))
            there = force(other)
            if np.abs(there - known).max() > bound and self._differ(force, velocities, other, there, bound):
                return True
        return False

    @staticmethod
    def _differ(force: Callable[[Any], Any], velocities: Any, other: Any, there: Any, bound: float) -> bool:
        """Return True if forces at two velocities differ by more than repetitions of the one ``there`` do.

        A force may be a sum of threads in any order, or an iteration that stops early.
        """
        for _ in range(4):
            here, again = force(velocities), force(other)
            noise, there = np.abs(again - there).max(), again
            if np.abs(again - here).max() <= max(bound, 10 * noise):
                return False
        return True
