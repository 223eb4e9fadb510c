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
            found[name] = np.empty((*shape, len(value) if isinstance(value, tuple | list) else 1))
            for i, part in enumerate(value if isinstance(value, tuple | list) else (value,)):
                found[name][..., i] = part
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
    return _drifts(invariant_values(system, q, p), diverged)


def invariant_variables(system: System, q: Floats, p: Floats, diverged: Any) -> Variables:
    """Return the invariants of ``system`` over (tau_per_stage, sample), and behind them what ``invariant_drifts`` does.

    Those of a vector have a dimension more, ``<name>_component``. Arguments and errors are those of
    :func:`invariant_drifts`.
    """
    found = invariant_values(system, q, p)
    shown: Variables = {}
    for name, values in found.items():
        text = described(f"{name.replace('_', ' ')}, an invariant, in the units of the system", "")
        if values.shape[-1] == 1:
            shown[name] = ("tau_per_stage", "sample"), values[..., 0], text
        else:
            shown[name] = ("tau_per_stage", "sample", f"{name}_component"), values, text
    return shown | _drifts(found, diverged)


def _drifts(invariants: dict[str, Floats], diverged: Any) -> Variables:
    """The drift of each invariant, from its values (R, S, k)."""
    found: Variables = {}
    for name, values in invariants.items():
        scale = float(np.hypot.reduce(values[0, 0]))
        change = (values - values[:, :1]) / (scale or 1.0)
        # fmax passes over NaN, of which the first sample has none.
        largest = np.fmax.reduce(np.hypot.reduce(change, axis=-1), axis=1)
        largest[diverged] = np.inf
        measure = "|I - I0|/|I0|" if scale else "|I - I0|, where I0 = 0"
        what = f"I the {name.replace('_', ' ')} in double precision"
        text = f"maximum over the samples of {measure}, {what}, inf if diverged"
        found[f"{name}_drift"] = ("tau_per_stage",), largest, described(text)
    return found
