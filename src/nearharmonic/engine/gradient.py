"""Gradients of observables at the end of a run, by the tangent map of the run backwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.number import Constant
from nearharmonic.engine import description
from nearharmonic.engine.batch import Trajectories
from nearharmonic.engine.settings import KINETIC_POTENTIAL
from nearharmonic.engine.setup import Setup, asked_steps, members_are_given, start_of
from nearharmonic.engine.tangent import check_differentiable, checked_split, product
from nearharmonic.engine.trajectory import Solution
from nearharmonic.errors import SystemDefinitionError, bad_setting, unknown_name
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, log10
from nearharmonic.output.store import Variable, Variables, assembled, described
from nearharmonic.systems.formulas import Energy, MassKineticEnergy, takes_parameters
from nearharmonic.systems.quantities import Observable, Vector
from nearharmonic.systems.remembered import remembered
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
    """Return True if a function may be called with so many arguments, or has no signature, as one written in C."""
    called = function.function if isinstance(function, Observable) else function
    try:
        signature(called).bind(*range(count))
    except (TypeError, ValueError) as error:
        return isinstance(error, ValueError)
    return True


# --- The system whose runs backwards collect derivatives with respect to parameters.
@remembered
def sensitive_system(system: System) -> System:
    """Return the system K of a ``system`` of d coordinates in which the P parameters are coordinates.

    A parameter theta of V is a coordinate without kinetic energy; its momentum collects -dK/dtheta. Its coordinates are
    (q, u, theta) and its momenta (w, p, pi). Where T has parameters too, a second copy of them are momenta, whose
    coordinates chi collect dK/dtheta: (q, u, theta, chi) and (w, p, pi, theta). The derivative with respect to theta is
    then pi - chi.
    """
    formulas, (q0, p0), own = system.formulas(), system.extended_start(str), system.constants(str)
    d, count, constants = formulas.dimension, len(own), system.constants(Constant)
    moving = kinetic_parameters(system)

    def V(x: Vector) -> Any:
        return product(formulas.grad_V(x[:d], *x[2 * d : 2 * d + count]), x[d : 2 * d])

    def T(y: Vector) -> Any:
        parameters = y[2 * d + count :] if moving else constants
        return product(formulas.grad_T(y[d : 2 * d], *parameters), y[:d])

    rest, none = ("0",) * d, ("0",) * count
    return System(
        name=f"{system.name}_sensitive", V=V, T=T, t_end=system.t_end, source=system.source,
        q0=(*q0, "1", *rest[1:], *own, *(none if moving else ())), p0=(*rest, *p0, *none, *(own if moving else ())),
    )  # fmt: skip


def kinetic_parameters(system: System) -> bool:
    """Return True if T is a function of parameters."""
    if isinstance(system.T, MassKineticEnergy):
        return any(isinstance(mass, int) for mass in system.T.masses)
    return bool(system.parameters) and takes_parameters(system.T)


# --- Derivatives of an observable with respect to the coefficients of a tableau.
#
# Along the run backwards u = -lambda_p and w = lambda_q are the derivatives of the observable at the end with respect
# to the state of each operator. A kick by c tau adds -c tau grad V(q) to p; the derivative with respect to c is
# therefore tau u.grad V(q), which is tau times the potential of the sensitive system. For a drift it is tau times its
# kinetic energy. All steps are reversed at once, from the states at their ends.

#: Maximum number of numbers of the states at all steps, 1 GB.
MOST_NUMBERS = 125_000_000


def check_coefficients(system: System, tableau: Tableau, steps: int, members: int) -> None:
    """Raise an error for implicit and modified methods, and for runs whose states need too much memory.

    ``system`` is the sensitive system of the run backwards.
    """
    if tableau.implicit or tableau.modified:
        what = "it has no kicks and drifts by V and T alone, with respect to whose coefficients it could be derived"
        raise bad_setting("integrator", tableau.name, what)
    if 4 * system.dimension * steps * members > MOST_NUMBERS:
        most = MOST_NUMBERS // (4 * system.dimension * members)
        raise bad_setting("coefficients", True, f"up to {most} steps here, whose states are in memory, not {steps}")


def coefficient_derivatives(system: System, tableau: Tableau, tau: float, back: Trajectories) -> dict[str, Floats]:
    """Return the derivatives (M, K) of the observable with respect to the K kicks and to the drifts of a tableau.

    ``back`` has the states of the sensitive ``system`` at the ends of the N steps of size ``tau`` that are reversed.
    """
    rows = {"kick": list(map(float, tableau.kick)), "drift": list(map(float, tableau.drift))}
    shape, formulas = (len(back.q), back.q.shape[1] - 1), system.formulas()
    found = {name: np.empty((shape[0], len(row))) for name, row in rows.items()}
    outer, inner = ("kick", "drift") if tableau.first == "kick" else ("drift", "kick")
    arrays = {"kick": back.q[:, :-1] + back.q_low[:, :-1], "drift": back.p[:, :-1] + back.p_low[:, :-1]}
    states = {name: list(np.moveaxis(values, -1, 0)) for name, values in arrays.items()}
    energy, slope = {"kick": formulas.V, "drift": formulas.T}, {"kick": formulas.grad_V, "drift": formulas.grad_T}
    sign = {"kick": 1.0, "drift": -1.0}  # backwards, kicks add the gradient to p
    for i in reversed(range(len(rows[outer]))):
        for name in (outer, inner) if i else (outer,):
            j, moved = i if name == outer else i - 1, states["drift" if name == "kick" else "kick"]
            found[name][:, j] = tau * np.broadcast_to(energy[name](tuple(states[name])), shape).sum(axis=1)
            for k, component in enumerate(slope[name](tuple(states[name]))):
                moved[k] = moved[k] + sign[name] * rows[name][j] * tau * component
    return found


# --- Gradients at the end of a run.

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
        - ``q0`` and ``p0`` over component, ``parameters`` over parameter: its derivatives, in its unit over the unit
          of the argument; NaN for a diverged run.
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
        with np.errstate(all="ignore"):  # a diverged run has none
            size = float(problem.end) / count
            found = coefficient_derivatives(backward.system, problem.tableau, size, back)
        for name, values in found.items():
            variables[name] = _of_members(values, f"derivative with respect to a {name}", "unknown", f"{name}_number")
    for _, values, _ in (variables[name] for name in ("q0", "p0", "parameters", "kick", "drift") if name in variables):
        values[paths.left_at > 0] = np.nan
    d, units = subject.dimension, subject.units
    variables |= {
        "q": _of_members(paths.q[:, -1, :d], "position at the end", units["q"], "component"),
        "p": _of_members(paths.p[:, -1, :d], "momentum at the end", units["p"], "component"),
        "value": _of_members(slopes[-1, :, 0], f"{function.name} at the end", function.unit),
    }
    errors = description.over("member", description.error_variables(paths, problem))
    errors["evaluations"][1][:] += back.evaluations
    del errors["mean_energy_error"]
    variables |= errors
    if several := members_are_given(q0, p0, parameters, start):
        variables |= description.parameter_variables(problem, given)
    else:
        variables = description.without_members(variables)
    variables["tau"] = description.step_used(problem, count)
    if subject.parameters:
        variables["parameter"] = ("parameter",), np.array(list(subject.parameters)), described("name of the parameter")
    attributes = description.run_attributes(problem, begin, asked_tau) | {"observable": function.name}
    coordinates = ["parameter", *(name for name in variables if several and name.startswith("parameter_"))]
    return assembled(variables, coordinates, attributes)


def _of_members(values: Any, meaning: str, unit: str = "1", *dimensions: str) -> Variable:
    """Return a described variable over members, and over more dimensions."""
    return ("member", *dimensions), values, described(meaning, unit)


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
        what = f"its steps for {system.name}, whose kinetic energy has parameters, are not steps for a quadratic one"
        raise bad_setting("integrator", tableau.name, what)
    if not system.parameters_at_run_time:
        what = "a formula branches on its parameters, and has no derivative with respect to them"
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
    what = "derivative with respect to"
    found: Variables = {
        "q0": _of_members(p[:, :d].copy(), f"{what} q0", "unknown", "component"),
        "p0": _of_members(-q[:, E : E + d], f"{what} p0", "unknown", "component"),
    }
    if count:
        values = p[:, 2 * E : 2 * E + count].copy()
        if kinetic_parameters(system):
            values -= q[:, 2 * E + count :]
        found["parameters"] = _of_members(values, f"{what} the parameter", "unknown", "parameter")
    return found


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
        "round_trip_error": _of_members(error, what, "unknown"), "digits_lost": _of_members(digits, lost),
    }  # fmt: skip
