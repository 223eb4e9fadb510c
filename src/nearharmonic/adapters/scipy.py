"""Methods as solvers of :func:`scipy.integrate.solve_ivp`, with a fixed step."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import DenseOutput, OdeSolver

from nearharmonic.engine.settings import checked_count, checked_tau
from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.exchange.method import ROUNDING, Method, VelocityCheck, method_for
from nearharmonic.integrators.tableau import Tableau

Vector = NDArray[np.float64]
#: Right-hand side at a time, of positions and velocities.
RightHandSide = Callable[[float, Vector], Vector]

#: Most positions, and most steps of a run.
MOST_POSITIONS, MOST_STEPS = 10**9, 10**12


@dataclass(frozen=True)
class State:
    """A state, and its acceleration if a kick has needed it or needs it next."""

    t: float
    q: Vector
    v: Vector
    acceleration: Vector | None = None

    @property
    def y(self) -> Vector:
        """Positions and then velocities."""
        return np.concatenate([self.q, self.v])


def advanced(method: Method, right_hand_side: RightHandSide, state: State, t: float) -> State:
    """Return the state behind one step that ends at the time ``t``.

    Every kick evaluates the force at the time and the positions to which the drifts have come. A kick that follows no
    drift takes the acceleration that is known.
    """
    tau, now, q, v, acceleration = t - state.t, state.t, state.q, state.v, state.acceleration
    for move in method.flows:
        if move.flow == "drift":
            q, now, acceleration = q + move.coefficient * tau * v, now + move.coefficient * tau, None
            continue
        if acceleration is None:
            # A copy, because the function may return the same array each time.
            acceleration = right_hand_side(now, np.concatenate([q, v]))[q.size :].copy()
        v = v + move.coefficient * tau * acceleration
    return State(t, q, v, acceleration)


class ShortenedStep(DenseOutput):  # type: ignore[misc]  # scipy has no types
    """State within a step: the result of a shortened step of the method from the start of the step.

    Its error is at most one step's error, of the order of the method. Each time evaluates the forces of a step, and
    the ends of the step none.
    """

    def __init__(self, method: Method, right_hand_side: RightHandSide, old: State, new: State) -> None:
        super().__init__(old.t, new.t)
        self._method, self._right_hand_side, self._old, self._new = method, right_hand_side, old, new

    def _call_impl(self, t: NDArray[np.float64]) -> Vector:
        if t.ndim:
            return np.stack([self._at(float(single)) for single in t], axis=-1)
        return self._at(float(t))

    def _at(self, t: float) -> Vector:
        for end in (self._old, self._new):
            if t == end.t:
                return end.y
        return advanced(self._method, self._right_hand_side, self._old, t).y


class SplittingSolver(OdeSolver):  # type: ignore[misc]  # scipy has no types
    """A solver of scipy that takes equal steps of a splitting method: :func:`solver` makes its subclasses."""

    method: Method
    dimension: int
    t: float
    y: Vector

    def __init__(
        self, fun: RightHandSide, t0: float, y0: ArrayLike, t_bound: float, max_step: float = np.inf,
        vectorized: bool = False, **extraneous: object,
    ) -> None:  # fmt: skip
        state, dimension = np.asarray(y0), self.dimension
        if state.shape != (2 * dimension,) or not np.isrealobj(state):
            allowed = f"{dimension} real positions and then {dimension} real velocities"
            raise bad_setting("y0", y0, allowed)
        step = checked_tau(max_step, "max_step")
        if not isfinite(t_bound - t0):
            raise bad_setting("t_span", (t0, t_bound), "two finite times, between which all steps are equal")
        if ignored := sorted(extraneous):
            warnings.warn(f"steps are fixed: {', '.join(ignored)} has no effect", stacklevel=3)
        super().__init__(fun, t0, y0, t_bound, vectorized)
        self._start, self._taken = float(t0), 0
        # A quotient such as 0.3 / 0.1 is rounded up to the next integer by mistake without the factor.
        self._steps = checked_count("steps", max(1, ceil(abs(t_bound - t0) / step * (1 - 2**-50))), MOST_STEPS)
        start = State(self._start, self.y[:dimension].copy(), self.y[dimension:].copy())
        self._velocities = VelocityCheck()
        self._old = self._state = self._far = replace(start, acceleration=self._acceleration(start, start.v))
        self._compare(self._state)

    def _acceleration(self, state: State, velocities: Vector) -> Vector:
        """Return the accelerations of ``fun`` at a state with other velocities, after a check of what it returns."""
        rate: Vector = self.fun(state.t, np.concatenate([state.q, velocities]))
        if rate.shape != self.y.shape:
            raise SettingError(f"fun returns an array of shape {rate.shape}, y has the shape {self.y.shape}")
        if not np.allclose(rate[: state.q.size], velocities, rtol=ROUNDING, atol=0):
            raise SettingError(
                f"the first {state.q.size} values of fun are not the last {state.q.size} of y: y must be "
                "positions and then velocities, dq/dt = v, not momenta"
            )
        return rate[state.q.size :].copy()

    def _compare(self, state: State) -> None:
        """Raise an error if the accelerations at a state depend on velocities."""
        if self._velocities.finds(partial(self._acceleration, state), state.v, self._taken, state.acceleration):
            raise SettingError(
                f"the accelerations of fun depend on the velocities, at t = {state.t:g}: splitting needs V(q, t)"
            )
        self._direction = self._velocities.direction(state.q.size)

    def _step_impl(self) -> tuple[bool, str | None]:
        if not np.array_equal(self.y, self._state.y):  # the user has changed y, and a force would be stale
            self._state = State(self.t, self.y[: self.dimension].copy(), self.y[self.dimension :].copy())
        self._taken += 1
        last = self._taken == self._steps
        t = self.t_bound if last else self._start + (self.t_bound - self._start) * (self._taken / self._steps)
        new = advanced(self.method, self.fun, self._state, t)
        if not np.isfinite(new.y).all():
            return False, f"the state behind the step to t = {t:g} is not finite"
        # Velocities may act in a part of space alone: the state farthest in some direction is compared.
        if self._direction @ new.q > self._direction @ self._far.q:
            self._far = new
        for state in (self._far, new) if last else (self._far,) if self._velocities.due(self._taken) else ():
            self._compare(state)
            self._far = new
        self._old, self._state, self.t, self.y = self._state, new, t, new.y
        return True, None

    def _dense_output_impl(self) -> ShortenedStep:
        return ShortenedStep(self.method, self.fun, self._old, self._state)


def solver(method: str | Tableau, dimension: int) -> type[SplittingSolver]:
    """Return a solver for the argument ``method`` of :func:`scipy.integrate.solve_ivp`.

    The state y is ``dimension`` positions and then as many velocities, and ``fun(t, y)`` returns velocities and
    accelerations, which depend on positions and time alone. Masses are part of ``fun``, and y holds velocities, not
    momenta: the kinetic energy is quadratic, as some methods require. A run compares accelerations at several
    velocities: at its start, at its end, and after steps 1, 2, 4, 8, ... at the state farthest in some direction. The
    energy is not compared: a step that is too large for a close encounter ends with status 0 all the same.

    Options of ``solve_ivp``:

    - ``max_step`` is the step, in the unit of t. The interval is divided into equal steps of at most this length, and
      the last one ends at the end of the interval. An interval that runs backwards has negative steps.
    - ``rtol``, ``atol`` and other options have no effect, which a warning says.
    - ``events``, ``t_eval`` and ``dense_output`` evaluate the method itself: a shortened step aside, from the start of
      the step. A state within a step has at most the error of one step. The trajectory does not depend on them.
      Each such state costs the forces of a step; a root of an event needs about eight.
    - ``vectorized`` is allowed and has no effect on the cost.

    A run of n steps calls ``fun`` ``n stages`` times, in both roles: the last kick of a step and the first kick of the
    next share a call. The comparisons add at most ``2 log2(n) + 10`` calls, and ``nfev`` counts them.

    Parameters
    ----------
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau. It runs in its own role.
    dimension : int
        Number of positions.

    Returns
    -------
    type
        A subclass of :class:`scipy.integrate.OdeSolver`.

    Raises
    ------
    SettingError
        The dimension is no positive integer, or the method has modified potentials or a processor. The solver raises
        it for a bad ``max_step``, ``t_span`` or ``y0``, and for a ``fun`` that is not as above.
    UnknownNameError
        There is no such integrator; the message has the nearest names.

    References
    ----------
    :class:`scipy.integrate.OdeSolver`, https://docs.scipy.org/doc/scipy/reference/generated/scipy.integrate.OdeSolver.html

    Examples
    --------
    >>> import nearharmonic as nh
    >>> from scipy.integrate import solve_ivp
    >>> aba864 = nh.adapters.scipy.solver("aba864", 1)
    >>> print(solve_ivp(lambda t, y: (y[1], -y[0]), (0, 20), (1.0, 0.0), method=aba864, max_step=0.5).y[:, -1])
    [ 0.40812134 -0.91292582]
    """
    members: dict[str, Any] = {
        "method": method_for("scipy", method),
        "dimension": checked_count("dimension", dimension, MOST_POSITIONS),
        "__doc__": SplittingSolver.__doc__,
    }
    return type("SplittingSolver", (SplittingSolver,), members)
