"""Gradients of observables at the end of a run, by the tangent map of the run backwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.number import Constant
from nearharmonic.engine.description import (
    error_variables,
    over,
    parameter_variables,
    run_attributes,
    step_used,
    without_members,
)
from nearharmonic.engine.settings import KINETIC_POTENTIAL
from nearharmonic.engine.setup import Setup, asked_steps, members_are_given, start_of
from nearharmonic.engine.solution import Solution
from nearharmonic.engine.tangent import checked_split
from nearharmonic.engine.variation import (
    check_coefficients,
    check_differentiable,
    coefficient_derivatives,
    kinetic_parameters,
    sensitive_system,
)
from nearharmonic.errors import SystemDefinitionError, bad_setting, unknown_name
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, log10
from nearharmonic.output.dataset import Variables, assembled, described
from nearharmonic.systems.energy import Energy
from nearharmonic.systems.quantities import Observable, Vector
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr


# --- Observables as expressions of states and parameters, for their derivatives.

#: Digits of the derivatives of an observable in extended precision, more than the 32 of its numbers.
DIGITS = 50


class DifferentiableObservable:
    """A function g of states and parameters of a system of d coordinates, with its derivatives.

    ``observable`` is the name of an observable or invariant of the system, or a formula ``g(q, p)`` or ``g(q, p,
    *parameters)``.
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
        """Return derivatives and then the value (2 d + P + 1, M, 2), as pairs, in the arithmetic of ``problem``.

        ``state`` (M, 4, d) are positions and momenta with the digits below them, ``parameters`` (M or 1, 2 P) pairs.
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


#: Relative rounding error of a number: of doubles, and of double-doubles.
ROUNDING = {"double": 2.0**-53, "extended": 2.0**-104}


def gradient(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    observable: Any,
    *,
    t_end: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    split: str = KINETIC_POTENTIAL,
    coefficients: bool = False,
    start: xr.Dataset | Solution | None = None,
) -> xr.Dataset:
    """Differentiate an observable at the end of a discrete run with respect to initial values and parameters.

    The result is the derivative of what the method computes, not of the exact flow. One run forwards and one backwards
    with its tangent map give all derivatives, whatever their number, and keep no state in between: the map is
    symplectic, M^T = J M^-1 J^-1, so that the deviation J^-1 grad g is carried back to the start by the inverse map.
    The inverse of an asymmetric method is its reversed row of coefficients with a negative step.

    Parameters
    ----------
    system, integrator, tau
        As for :func:`nearharmonic.tangent`. A processed method is refused.
    observable : str or callable
        Name of an observable or invariant of the system; or ``g(q, p)`` or ``g(q, p, *parameters)``, a number for
        tuples q and p of d numbers, of the functions that V may have.
    t_end, precision, summation, first, q0, p0, parameters, split
        As for :func:`nearharmonic.tangent`.
    coefficients : bool
        True for the derivatives with respect to the coefficients of the method too. They need the states at the ends of
        all steps in memory, and are for methods with kicks by V alone.
    start : xarray.Dataset or Solution, optional
        Continue from the last sample of this result, as for :func:`nearharmonic.integrate`: ``q0`` and ``p0`` of the
        derivatives are the state there.

    Returns
    -------
    xarray.Dataset
        Over member, if there are several:

        - ``value``: the observable at the end.
        - ``q0`` and ``p0`` over component, ``parameters`` over parameter: its derivatives, in its unit over that of the
          argument. Those of a diverged run are NaN.
        - ``kick`` and ``drift``, if asked for: its derivatives with respect to each coefficient of a step, taken as
          independent of all others.
        - ``round_trip_error``: largest component of the difference between the start and the end of the run backwards.
        - ``digits_lost``: logarithm to base 10 of its ratio to the rounding error of the largest component of the
          start. A double has 16 digits, a double-double 31. The derivatives lose as many, and in chaotic runs one to
          three more, because the curvature of the map multiplies the error of the orbit.
        - ``q`` and ``p`` at the end, ``max_energy_error`` over start and end, ``steps``, ``evaluations`` of both runs,
          ``status``, ``diverged_at`` and ``tau``.

    Raises
    ------
    NearharmonicError
        An unknown name, a setting outside what is allowed, a system that cannot be differentiated twice, or an
        observable that is no formula, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Notes
    -----
    Symplectic adjoint: Sanz-Serna (2016), SIAM Review 58, 3. A parameter is a coordinate without kinetic energy, whose
    momentum collects the derivative. Parameters of T are a second copy, of momenta.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.gradient("kepler", "babps8o7h", 20, lambda q, p: q[0], t_end=1000)
    >>> found.q0.dims, found.parameters.parameter.values.tolist(), found.status.item()
    (('component',), ['GM'], 'ok')
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy="samples",
        split=checked_split(split),
    )  # fmt: skip
    subject = problem.system
    check_differentiable(subject)
    backward = backward_problem(problem)
    function = DifferentiableObservable(observable, subject)
    if isinstance(start, Solution):
        start = start.to_dataset()
    begin = start_of(problem, q0, p0, parameters, start, several=True)
    given, members = begin.parameters, begin.members
    rows = np.broadcast_to(begin.state, (members, begin.state.shape[1]))
    count, asked_tau = asked_steps(problem, tau)
    steps = [count] * members
    if coefficients:
        check_coefficients(backward.system, problem.tableau, count, members)
    paths = problem.run(steps, 2, start=rows, parameters=given)
    end = np.stack([paths.q[:, -1], paths.q_low[:, -1], paths.p[:, -1], paths.p_low[:, -1]], axis=1)
    slopes = function.derivatives(problem, end[..., : subject.dimension], given)
    back = backward.run(steps, count + 1 if coefficients else 2, start=_behind(subject, end, slopes, given))
    variables = _derivatives(problem, back) | _round_trip(problem, rows, back)
    if coefficients:
        variables |= _by_coefficient(problem, backward, float(problem.end) / count, back)
    d, units = subject.dimension, subject.units
    variables |= {
        "q": (("member", "component"), paths.q[:, -1, :d], described("position at the end", units["q"])),
        "p": (("member", "component"), paths.p[:, -1, :d], described("momentum at the end", units["p"])),
    }
    for name in ("q0", "p0", "parameters", "kick", "drift"):
        if name in variables:
            variables[name][1][paths.left_at > 0] = np.nan
    variables["value"] = ("member",), slopes[-1, :, 0], described(f"{function.name} at the end", function.unit)
    errors = over("member", error_variables(paths, problem))
    errors["evaluations"][1][:] += back.evaluations
    del errors["mean_energy_error"]
    variables |= errors
    if several := members_are_given(q0, p0, parameters, start):
        variables |= parameter_variables(problem, given)
    else:
        variables = without_members(variables)
    variables["tau"] = step_used(problem, count)
    if subject.parameters:
        variables["parameter"] = ("parameter",), np.array(list(subject.parameters)), described("name of the parameter")
    attributes = run_attributes(problem, begin, asked_tau) | {"observable": function.name}
    coordinates = ["parameter", *(name for name in variables if several and name.startswith("parameter_"))]
    return assembled(variables, coordinates, attributes)


def backward_problem(problem: Setup) -> Setup:
    """Return the runs of the sensitive system by the inverse of the method of ``problem``.

    A processed method has none, nor has one for quadratic T if T has parameters, nor a system whose formulas decide by
    parameters.
    """
    system, tableau = problem.system, problem.tableau
    if tableau.processed:
        what = "it is processed: a negative step has another processor, and does not invert it"
        raise bad_setting("integrator", tableau.name, what)
    if tableau.requires is not None and kinetic_parameters(system):
        what = f"its steps for {system.name}, whose kinetic energy has parameters, are not those of a quadratic one"
        raise bad_setting("integrator", tableau.name, what)
    if not system.parameters_at_run_time:
        what = "a formula decides by its parameters, and has no derivative with respect to them"
        raise bad_setting("system", system.name, what)
    if not tableau.symmetric:
        kick, drift, square = (row[::-1] for row in (tableau.kick, tableau.drift, tableau.square))
        tableau = replace(tableau, kick=kick, drift=drift, square=square)
    t_end = problem.t_end.removeprefix("-") if problem.t_end.startswith("-") else f"-{problem.t_end}"
    numerics = problem.numerics
    return Setup(
        sensitive_system(system), tableau, t_end=t_end, precision=numerics.precision, summation=numerics.summation,
        energy="none",
    )  # fmt: skip


def _behind(system: System, end: Floats, slopes: Floats, parameters: Floats) -> Floats:
    """Return the states (M, 4 D') of the sensitive system at the end: the orbit with the deviation J^-1 grad g."""
    d, E, count = system.dimension, end.shape[-1], len(system.parameters)
    moving = count * kinetic_parameters(system)
    rows = np.zeros((len(end), 4, 2 * E + count + moving))
    rows[:, :2, :E], rows[:, 2:, E : 2 * E] = end[:, :2], end[:, 2:]
    pairs = slopes.transpose(1, 2, 0)
    rows[:, :2, E : E + d], rows[:, 2:, :d] = -pairs[..., d : 2 * d], pairs[..., :d]
    values = parameters.reshape(len(parameters), count, 2).transpose(0, 2, 1)
    rows[:, :2, 2 * E : 2 * E + count] = values
    rows[:, 2:, 2 * E : 2 * E + count] = pairs[..., 2 * d : 2 * d + count]
    if moving:
        rows[:, 2:, 2 * E + count :] = values
    return rows.reshape(len(end), -1)


def _derivatives(problem: Setup, back: Any) -> Variables:
    """Return the derivatives that the end of the run backwards holds: J times its deviation, and pi - chi."""
    system = problem.system
    d, E, count = system.dimension, problem.states_dimension, len(system.parameters)
    q, p = back.q[:, -1] + back.q_low[:, -1], back.p[:, -1] + back.p_low[:, -1]
    found: Variables = {
        "q0": (("member", "component"), p[:, :d].copy(), described("derivative with respect to q0", "unknown")),
        "p0": (("member", "component"), -q[:, E : E + d], described("derivative with respect to p0", "unknown")),
    }
    if count:
        values = p[:, 2 * E : 2 * E + count].copy()
        if kinetic_parameters(system):
            values -= q[:, 2 * E + count :]
        notes = described("derivative with respect to the parameter", "unknown")
        found["parameters"] = ("member", "parameter"), values, notes
    return found


def _by_coefficient(problem: Setup, backward: Setup, tau: float, back: Any) -> Variables:
    """Return the derivatives with respect to kicks and drifts, from the states at the ends of all steps."""
    q, p = back.q[:, :-1] + back.q_low[:, :-1], back.p[:, :-1] + back.p_low[:, :-1]
    with np.errstate(all="ignore"):  # a diverged run has none
        found = coefficient_derivatives(backward.system, problem.tableau, tau, q, p)
    return {
        name: (("member", f"{name}_number"), values, described(f"derivative with respect to a {name}", "unknown"))
        for name, values in found.items()
    }


def _round_trip(problem: Setup, start: Floats, back: Any) -> Variables:
    """Return the distance between the start and the end of the run backwards, and the digits that it costs."""
    E, d = problem.states_dimension, problem.system.dimension
    begin = start.reshape(len(start), 4, E)
    high = back.q[:, -1, :d] - begin[:, 0, :d], back.p[:, -1, E : E + d] - begin[:, 2, :d]
    low = back.q_low[:, -1, :d] - begin[:, 1, :d], back.p_low[:, -1, E : E + d] - begin[:, 3, :d]
    error = np.abs(np.concatenate(high, axis=1) + np.concatenate(low, axis=1)).max(axis=1)
    size = np.abs(np.concatenate([begin[:, 0, :d], begin[:, 2, :d]], axis=1)).max(axis=1)
    with np.errstate(all="ignore"):
        ratio = error / (np.where(size > 0, size, 1.0) * ROUNDING[problem.numerics.precision])
        digits = np.where(ratio > 1, log10(np.fmax(ratio, 1.0)), np.where(np.isnan(ratio), np.nan, 0.0))
    what = "largest component of the difference between the start and the end of the run backwards"
    lost = "decimal digits lost: logarithm of round_trip_error over the rounding error of the start"
    return {
        "round_trip_error": (("member",), error, described(what, "unknown")),
        "digits_lost": (("member",), digits, described(lost)),
    }
