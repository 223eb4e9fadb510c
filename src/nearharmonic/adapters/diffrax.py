"""Methods as solvers of diffrax, with a pair of terms as its ``SemiImplicitEuler``."""

from __future__ import annotations

from operator import add
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from nearharmonic.exchange.method import Method, method_for
from nearharmonic.integrators.tableau import Tableau

__all__ = ["Splitting"]

State = tuple[Any, Any]


class Splitting(diffrax.AbstractSolver):  # type: ignore[misc]  # diffrax is not among the types that mypy reads
    """A method as solver of ``diffrax.diffeqsolve``, with constant steps.

    The terms are a pair ``(ODETerm(velocity), ODETerm(force))`` and the state is a pair ``(q, p)`` of arrays or trees
    of arrays: ``velocity(t, p, args)`` is dT/dp, and ``force(t, q, args)`` is -dV/dq. Both may depend on time: a drift
    is at the time that the kicks have reached, and a kick at the time that the drifts have reached.

    A step evaluates the force ``stages`` times. With kicks first the solver state hands the last force of a step to the
    next step, and ``init`` adds one evaluation. ``SaveAt(ts=...)`` and ``SaveAt(dense=True)`` interpolate with the
    derivatives at both ends of a step: with drifts first they cost two further forces per step.

    Parameters
    ----------
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau.

    Raises
    ------
    UnknownNameError
        There is no such integrator.
    SettingError
        The method has modified potentials or a processor.

    Notes
    -----
    Times between steps are interpolated by cubic Hermite polynomials, whose error is of order 4 in the step. Where that
    is too much, take ``SaveAt(steps=True)``, or ``diffrax.StepTo(ts)`` for the steps themselves. An interval that is no
    multiple of ``dt0`` is divided by diffrax.

    Gradients are by ``RecursiveCheckpointAdjoint``, ``DirectAdjoint`` or ``ForwardMode``. ``BacksolveAdjoint``
    takes no solver of two terms. The step has no error estimate, so that step size controllers that need one refuse it.

    A run that goes on from ``solver_state`` of another takes its force. If the state has been changed since, leave out
    ``solver_state`` or pass ``made_jump=True``.

    A method that requires a quadratic kinetic energy keeps its order if ``velocity`` is linear in p; otherwise it has
    order 2.

    References
    ----------
    ``diffrax.SemiImplicitEuler``, which takes the same terms; ``diffrax.AbstractSolver``.

    Examples
    --------
    >>> import diffrax, nearharmonic as nh
    >>> terms = diffrax.ODETerm(lambda t, p, args: p), diffrax.ODETerm(lambda t, q, args: -q)
    >>> run = diffrax.diffeqsolve(terms, nh.adapters.diffrax.Splitting("babs7o7h"), 0, 10, 0.5, (1.0, 0.0))
    """

    term_structure: ClassVar[Any] = (diffrax.ODETerm, diffrax.ODETerm)
    interpolation_cls: ClassVar[Any] = diffrax.ThirdOrderHermitePolynomialInterpolation

    method: Method = eqx.field(static=True)

    def __init__(self, method: str | Tableau) -> None:
        self.method = method_for("diffrax", method)

    def order(self, terms: Any) -> int:
        """Return the order of the method."""
        return self.method.tableau.order

    def func(self, terms: Any, t0: Any, y0: State, args: Any) -> State:
        """Return dq/dt and dp/dt."""
        velocity, force = terms
        q, p = y0
        return velocity.vf(t0, p, args), force.vf(t0, q, args)

    def init(self, terms: Any, t0: Any, t1: Any, y0: State, args: Any) -> Any:
        """Return the force at the start if kicks are first, and nothing otherwise."""
        return self.func(terms, t0, y0, args)[1] if self.method.first == "kick" else None

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: State, args: Any, solver_state: Any, made_jump: Any
    ) -> tuple[State, None, dict[str, Any], Any, Any]:
        """Return the state at ``t1``, and what interpolation and the next step take."""
        velocity, force = terms
        q, p = y0
        span = t1 - t0
        controls = [term.contr(t0, t1) for term in terms]
        kick_first = self.method.first == "kick"
        lengths = jnp.asarray([move.coefficient for move in self.method.moves], jnp.result_type(span))

        def kick(p: Any, here: Any, c: Any) -> Any:
            return _sum(p, force.prod(here, c * controls[1]))

        def drift(q: Any, p: Any, c: Any, kicked: Any) -> Any:
            return _sum(q, velocity.prod(velocity.vf(t0 + kicked * span, p, args), c * controls[0]))

        def drift_and_kick(carry: Any, pair: Any) -> tuple[Any, None]:
            (q, p, drifted, kicked, _), (c_drift, c_kick) = carry, pair
            q, drifted = drift(q, p, c_drift, kicked), drifted + c_drift
            here = force.vf(t0 + drifted * span, q, args)
            return (q, kick(p, here, c_kick), drifted, kicked + c_kick, here if kick_first else None), None

        start = jax.lax.cond(made_jump, lambda: force.vf(t0, q, args), lambda: solver_state) if kick_first else None
        begin = velocity.vf(t0, p, args), start if kick_first else force.vf(t0, q, args)
        kicked = lengths[0] if kick_first else jnp.zeros_like(span)
        carry = q, kick(p, start, lengths[0]) if kick_first else p, jnp.zeros_like(span), kicked, start
        pairs = (lengths[1:] if kick_first else lengths[:-1]).reshape(-1, 2)
        (q, p, _, kicked, here), _ = jax.lax.scan(drift_and_kick, carry, pairs)  # compiles the force once
        if not kick_first:
            q = drift(q, p, lengths[-1], kicked)
        end = velocity.vf(t1, p, args), here if kick_first else force.vf(t1, q, args)
        slopes = [tuple(t.prod(vf, c) for t, vf, c in zip(terms, at, controls, strict=True)) for at in (begin, end)]
        # What nobody interpolates is never computed: the compiler removes the velocities and forces at the ends.
        dense = {"y0": y0, "y1": (q, p), "k0": slopes[0], "k1": slopes[1]}
        return (q, p), None, dense, here, diffrax.RESULTS.successful


def _sum(values: Any, changes: Any) -> Any:
    """Return the sum, leaf by leaf."""
    return jax.tree_util.tree_map(add, values, changes)
