"""Derivatives of an observable with respect to the coefficients of a tableau.

Along the run backwards u = -lambda_p and w = lambda_q are the derivatives of the observable at the end with respect to
the state of each operator. A kick by c tau adds -c tau grad V(q) to p; the derivative with respect to c is therefore
tau u.grad V(q), which is tau times the potential of the sensitive system. For a drift it is tau times its kinetic
energy. All steps are reversed at once, from the states at their ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System

#: Maximum number of numbers of the states at all steps, 1 GB.
MOST_NUMBERS = 125_000_000


def check_coefficients(system: System, tableau: Tableau, steps: int, members: int) -> None:
    """Raise an error for methods without such derivatives, and for runs whose states need too much memory.

    ``system`` is the sensitive system of the run backwards.

    Raises
    ------
    SettingError
        An implicit method, one with modified potentials, or too many steps.
    """
    if tableau.implicit or tableau.modified:
        what = "it has no kicks and drifts by V and T alone, with respect to whose coefficients it could be derived"
        raise bad_setting("integrator", tableau.name, what)
    if 4 * system.dimension * steps * members > MOST_NUMBERS:
        most = MOST_NUMBERS // (4 * system.dimension * members)
        raise bad_setting("coefficients", True, f"up to {most} steps here, whose states are in memory, not {steps}")


def coefficient_derivatives(system: System, tableau: Tableau, tau: float, q: Floats, p: Floats) -> dict[str, Floats]:
    """Return the derivatives (M, K) of the observable with respect to the K kicks and to the drifts of a tableau.

    Parameters
    ----------
    system : System
        Sensitive system with D coordinates.
    tableau : Tableau
        Method whose steps are reversed.
    tau : float
        Its step size.
    q, p : (M, N, D) array of float
        States of the sensitive system at the ends of the N steps.
    """
    rows = {"kick": list(map(float, tableau.kick)), "drift": list(map(float, tableau.drift))}
    found = {name: np.empty((len(q), len(row))) for name, row in rows.items()}
    outer, inner = ("kick", "drift") if tableau.first == "kick" else ("drift", "kick")
    formulas = system.formulas()
    states = {"kick": list(np.moveaxis(q, -1, 0)), "drift": list(np.moveaxis(p, -1, 0))}
    energy, slope = {"kick": formulas.V, "drift": formulas.T}, {"kick": formulas.grad_V, "drift": formulas.grad_T}
    sign = {"kick": 1.0, "drift": -1.0}  # backwards, kicks add the gradient to p
    for i in reversed(range(len(rows[outer]))):
        for name in (outer, inner) if i else (outer,):
            j = i if name == outer else i - 1
            moved = states["drift" if name == "kick" else "kick"]
            found[name][:, j] = tau * np.broadcast_to(energy[name](tuple(states[name])), q.shape[:2]).sum(axis=1)
            _add(moved, slope[name](tuple(states[name])), sign[name] * rows[name][j] * tau)
    return found


def _add(components: list[Floats], slopes: Sequence[Any], factor: float) -> None:
    """Add multiples of ``slopes`` to the components of a state; some slopes may be constants."""
    for i, slope in enumerate(slopes):
        components[i] = components[i] + factor * slope
