"""Invariants that a system declares beside its energy: their values at the samples, and how far they drift."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nearharmonic.errors import SystemDefinitionError
from nearharmonic.output.dataset import Variables, described
from nearharmonic.systems.system import System

Floats = NDArray[np.float64]


def invariant_values(system: System, q: ArrayLike, p: ArrayLike) -> dict[str, Floats]:
    """Return each invariant of ``system`` at some states, evaluated in double precision.

    Parameters
    ----------
    system : System
        A system of d coordinates.
    q, p : (..., d) array of float
        States.

    Returns
    -------
    dict
        Arrays (..., k) by the name of the invariant, k its number of components.

    Raises
    ------
    SystemDefinitionError
        An invariant cannot be evaluated.
    """
    shape = np.shape(q)[:-1]
    state = tuple(tuple(np.moveaxis(np.asarray(x, float), -1, 0)) for x in (q, p))
    constants, found = system.constants(float), {}
    for name, function in system.invariants.items():
        try:
            value = function(*state, *constants)
            parts = value if isinstance(value, tuple | list) else (value,)
            found[name] = np.stack([np.broadcast_to(np.asarray(part, float), shape) for part in parts], axis=-1)
        except Exception as error:
            message = f"{system.name}: the invariant {name} cannot be evaluated: {type(error).__name__}: {error}"
            raise SystemDefinitionError(message) from error
    return found


def invariant_drifts(system: System, q: Floats, p: Floats, diverged: Any) -> Variables:
    """Return how far each invariant of ``system`` drifts in each of R runs, by ``<name>_drift``.

    Parameters
    ----------
    system : System
        A system of d coordinates.
    q, p : (R, S, d) array of float
        States at the samples, the first of them at t = 0; NaN where a run has no sample.
    diverged : (R,) array of bool
        Whether each run left its energy surface.

    Returns
    -------
    Variables
        Over ``tau_per_stage``: the maximum over the samples of |I - I0| / |I0|, Euclidean for a vector, or of |I - I0|
        where I0 = 0; infinite where the run left its energy surface. The ``long_name`` says which.
    """
    found: Variables = {}
    for name, values in invariant_values(system, q, p).items():
        start = values[:, :1]
        scale = float(np.linalg.norm(start[0, 0]))
        distance = np.linalg.norm(values - start, axis=-1)
        largest = np.where(diverged, np.inf, np.nanmax(distance, axis=1) / (scale or 1.0))
        measure = "|I - I0|/|I0|" if scale else "|I - I0|, where I0 = 0"
        what = f"I the {name.replace('_', ' ')} in double precision"
        text = f"maximum over the samples of {measure}, {what}, inf if diverged"
        found[f"{name}_drift"] = ("tau_per_stage",), largest, described(text)
    return found
