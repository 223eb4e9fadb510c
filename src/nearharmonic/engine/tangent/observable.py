"""Observables as expressions of states and parameters, for their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import Any

import numpy as np

from nearharmonic.core.formulas.number import Constant
from nearharmonic.engine.runs.setup import Setup
from nearharmonic.errors import SystemDefinitionError, bad_setting, unknown_name
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.quantities import Observable, Vector
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.energy import Energy

#: Digits of the derivatives of an observable in extended precision, more than the 32 of its numbers.
DIGITS = 50


class DifferentiableObservable:
    """A function g of states and parameters, with its derivatives.

    Parameters
    ----------
    observable : str or callable
        The name of an observable or invariant of the system, or a formula ``g(q, p)`` or ``g(q, p, *parameters)``.
    system : System
        System of d coordinates and P parameters.

    Raises
    ------
    NearharmonicError
        An unknown name, or a function that is no formula.
    """

    def __init__(self, observable: Any, system: System) -> None:
        d, count = system.dimension, len(system.parameters)
        known = {**system.invariants, **system.observables}
        if isinstance(observable, str):
            if observable not in known:
                raise unknown_name(f"observable of {system.name}", observable, known)
            self.name, function = observable, known[observable]
        else:
            self.name, function = getattr(observable, "__name__", type(observable).__name__), observable
        allowed = "a formula g(q, p) or g(q, p, *parameters), or the name of an observable of the system"
        if not callable(function):
            raise bad_setting("observable", observable, allowed)
        self.unit = getattr(function, "unit", "unknown")
        given = count if _takes(function, 2 + count) else 0
        if not _takes(function, 2 + given):
            raise bad_setting("observable", self.name, f"{allowed}; this function takes other arguments")

        def formula(x: Vector) -> Any:
            try:
                value = function(x[:d], x[d : 2 * d], *x[2 * d : 2 * d + given])
            except IndexError as error:
                raise IndexError(f"{error}: q and p have {d} component{'s' * (d > 1)}") from error
            return value[0] if isinstance(value, tuple | list) and len(value) == 1 else value

        self._energy = Energy(system.name, "observable", formula, 2 * d + count, ())
        try:
            self._energy.trace()
        except SystemDefinitionError as error:
            raise bad_setting("observable", self.name, f"{allowed}: {error}") from error

    def derivatives(self, problem: Setup, state: Floats, parameters: Floats) -> Floats:
        """Return derivatives and then the value (2 d + P + 1, M, 2), as pairs, at M states.

        Parameters
        ----------
        problem : Setup
            Arithmetic: doubles, or double-doubles.
        state : (M, 4, d) array of float
            Positions and momenta with the digits below them.
        parameters : (M or 1, 2 P) array of float
            Parameters, as pairs.
        """
        rows = np.broadcast_to(parameters.reshape(len(parameters), -1, 2), (len(state), parameters.shape[1] // 2, 2))
        pairs = np.concatenate([state[:, :2].transpose(0, 2, 1), state[:, 2:].transpose(0, 2, 1), rows], axis=1)
        if problem.numerics.precision == "extended":
            return np.stack([_in_multiprecision(self._energy, row) for row in pairs], axis=1)
        found = np.zeros((pairs.shape[1] + 1, len(state), 2))
        with np.errstate(all="ignore"):
            for i, values in enumerate(self._energy.gradient_and_value(tuple(pairs.sum(axis=2).T))):
                found[i, :, 0] = float(values) if isinstance(values, Constant) else values
        return found


def _in_multiprecision(energy: Energy, pairs: Floats) -> Floats:
    """Return derivatives and value as pairs, at one point of pairs (n, 2); NaN where it is not finite."""
    import mpmath

    if not np.isfinite(pairs).all():
        return np.full((len(pairs) + 1, 2), np.nan)
    with mpmath.workdps(DIGITS):
        values = energy.gradient_and_value(tuple(mpmath.mpf(high) + mpmath.mpf(low) for high, low in pairs.tolist()))
        return np.array([(high := float(x), float(mpmath.mpf(x) - high)) for x in values])


def _takes(function: Callable[..., Any], count: int) -> bool:
    """Return True if a function may be called with so many arguments, or has no signature."""
    called = function.function if isinstance(function, Observable) else function
    try:
        signature(called).bind(*range(count))
    except TypeError:
        return False
    except ValueError:  # a function written in C
        return True
    return True
