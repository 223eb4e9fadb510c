"""Check of the invariants that a user declares: their Poisson brackets with H vanish along a run.

Drifts do not tell a wrong invariant from a coarse step, as a method conserves most invariants only to its order. The
bracket {I, H} = dI/dq dH/dp - dI/dp dH/dq of an invariant vanishes at every state, on an approximate orbit as well.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from math import hypot

import numpy as np

from nearharmonic.engine.runs.invariants import invariant_values
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.remembered import remembered
from nearharmonic.systems.definition.system import System

#: States of a run at which brackets are evaluated, and largest number of coordinates for which they are.
STATES, MOST_COORDINATES = 3, 64
#: Two steps of the central differences, over the norms of q and of p. Where both give the same bracket, their errors,
#: a hundred times as large for the first, are negligible.
STEPS = (1e-5, 1e-6)
#: Largest |{I, H}| of an invariant, over |grad I| |grad H|; differences have errors near 1e-9.
TOLERANCE = 1e-4
#: Largest relative difference of the two brackets.
AGREEMENT = 0.1


class InvariantWarning(UserWarning):
    """A declared invariant is not conserved."""


@remembered
def _checked(system: System) -> set[str]:
    """Return the invariants of a system that are checked; the caller adds to them."""
    return set()


def warn_of_changing(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> None:
    """Warn of each invariant that the exact solutions through the states of a run do not conserve, once for a system.

    Parameters
    ----------
    system : System
        A system of d coordinates.
    q, p : (S, d) array of float
        States of the run; those that are not finite are left out.
    constants : sequence of floats
        Parameters of the run.

    Warns
    -----
    InvariantWarning
        An invariant is not conserved.
    """
    finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1))
    if q.shape[1] > MOST_COORDINATES or not finite.size or not system.invariants.keys() - _checked(system):
        return
    _checked(system).update(system.invariants)
    rows = dict.fromkeys(finite[np.linspace(0, len(finite) - 1, STATES).round().astype(int)].tolist())
    rates = [_rates(system, q[row], p[row], constants) for row in rows]
    for name in system.invariants:
        if (rate := max(one[name] for one in rates)) > TOLERANCE:
            message = (
                f"{system.name}: the invariant {name} is not conserved: at a state of the run its rate of change is "
                f"{rate:.2g} of |grad {name}| |grad H|"
            )
            warnings.warn(message, InvariantWarning, stacklevel=2)


def _rates(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> dict[str, float]:
    """Return |{I, H}| over |grad I| |grad H| of each invariant at a state, 0 where the differences are not exact."""
    coarse, fine = (_rates_of(_gradients(system, q, p, constants, step)) for step in STEPS)
    return {name: rate if abs(rate - coarse[name]) <= AGREEMENT * rate else 0.0 for name, rate in fine.items()}


def _rates_of(gradients: dict[str, Floats]) -> dict[str, float]:
    """Return the rate of each invariant, the largest of its components; NaN where one has no value."""
    force, velocity = np.split(gradients.pop("H")[:, 0], 2)
    rates = {}
    for name, columns in gradients.items():
        of_q, of_p = np.split(columns, 2)
        sizes = np.linalg.norm(columns, axis=0) * hypot(np.linalg.norm(force), np.linalg.norm(velocity))
        rates[name] = float(np.max(abs(velocity @ of_q - force @ of_p) / np.where(sizes > 0, sizes, 1.0)))
    return rates


def _gradients(system: System, q: Floats, p: Floats, constants: Sequence[float], step: float) -> dict[str, Floats]:
    """Return central differences (2 d, k) of H and the invariants, in units of the norms of q and of p."""
    ends = []
    for signed in (step, -step):
        x, y = _moved(q, p, signed)
        states = zip(map(tuple, x.tolist()), map(tuple, y.tolist()), strict=True)
        energies = [[float(system.energy(*state, constants, 0.0))] for state in states]
        ends.append({"H": np.array(energies), **invariant_values(system, x, y, constants)})
    return {name: (ends[0][name] - ends[1][name]) / (2 * step) for name in ends[0]}


def _moved(q: Floats, p: Floats, step: float) -> Iterator[Floats]:
    """Yield q and p (2 d, d) with one coordinate or momentum of each row moved."""
    d = len(q)
    for x, first in ((q, 0), (p, d)):
        rows = np.tile(x, (2 * d, 1))
        rows[first : first + d] += step * (float(np.linalg.norm(x)) or 1.0) * np.eye(d)
        yield rows
