"""Methods as integrators of JAX MD at constant energy, in place of ``jax_md.simulate.nve``."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax_md import dataclasses, partition, quantity, simulate, util

from nearharmonic.errors import bad_setting
from nearharmonic.exchange.method import Method, method_for
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.written import is_real

__all__ = ["NVEState", "nve"]

#: The default of JAX MD.
UNIT_MASS = util.f32(1.0)

Init = Callable[..., Any]
Apply = Callable[..., Any]


@dataclasses.dataclass
class NVEState(simulate.NVEState):  # type: ignore[misc]  # JAX MD has no types
    """State of JAX MD at constant energy, with the ``force_position`` at which its force was evaluated.

    A method with kicks first ends at it; one with drifts first does not.
    """

    force_position: Any


def nve(
    energy_or_force: Callable[..., Any], shift: Callable[..., Any], step: float, method: str | Tableau
) -> tuple[Init, Apply]:
    """Return the two functions of a simulation at constant energy, as ``jax_md.simulate.nve`` does.

    A step evaluates the force ``stages`` times: once for each kick, except that the last kick of a step and the first
    of the next share a force if kicks are first. The state holds this force. If its position has been changed since,
    the step evaluates the force again. So does each step from a ``jax_md.simulate.NVEState``, which does not tell.

    Parameters
    ----------
    energy_or_force : callable
        Energy (a scalar) or forces of the positions, shape (n, dimension), with further keyword arguments.
    shift : callable
        Function that displaces positions, from ``jax_md.space``.
    step : float
        Step size in the unit of time of the simulation; a traced number of JAX is not checked.
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau, with kicks or drifts first.

    Returns
    -------
    init : callable
        ``init(key, R, kT, mass=1.0, **kwargs)``, which returns an :class:`NVEState` with momenta of temperature ``kT``.
        Masses are one number or an array of shape (n,). Other arguments go to JAX MD and to the energy.
    apply : callable
        ``apply(state, **kwargs)``, one step. ``dt`` in place of ``step``, other arguments go to the energy and to
        ``shift``. Both functions are compiled, and may be used inside ``jit``, ``vmap``, ``scan`` and ``grad``.

    Raises
    ------
    UnknownNameError
        There is no such integrator.
    SettingError
        The step is no finite number above 0, the method has modified potentials or a processor, or, from ``init``, a
        mass is no finite number above 0 or the masses have another shape.

    Notes
    -----
    The kinetic energy of particles is quadratic, so that all methods without modified potentials keep their order. JAX
    MD rotates a ``rigid_body`` by a splitting of order 2, and every method then has this order at most.

    The argument ``t`` is time, at the beginning of a step: ``apply(state, t=i * step)``. Each kick evaluates the energy
    at the time of its positions, and a method with kicks first takes one force more. Every other argument is constant
    during a step, and a force that depends on time through it has order 1. A change of it, such as a box, acts on the
    first kick of the next step only if the position changes too, as in ``jax_md.simulate.nve``. ``init`` evaluates the
    force anew.

    A step of s stages carries atoms s times as far as leapfrog at the same number of forces: by the largest partial sum
    of its drifts, at most 1.06 for registered methods, times ``step`` and the velocity. Arguments that are a
    ``jax_md.partition.NeighborList`` are therefore updated at each stage, so that no neighbour is missed. If
    ``dr_threshold`` is several times the way of the fastest atom in a step, few lists are built within steps. A list
    that overflows within a step causes a warning. Under ``vmap`` JAX builds a list at each stage.

    References
    ----------
    ``jax_md.simulate.nve``, whose step is ``method="verlet"``. JAX MD rounds its step to single precision.

    Examples
    --------
    >>> import jax, nearharmonic as nh
    >>> init, apply = nh.adapters.jax_md.nve(lambda R: 0.5 * (R**2).sum(), lambda R, dR: R + dR, 0.5, "babs7o7h")
    >>> state = apply(init(jax.random.PRNGKey(0), jax.numpy.ones((2, 3)), kT=0.1))
    """
    _check_step("step", step)
    splitting = method_for("JAX MD", method)
    force = quantity.canonicalize_force(energy_or_force)
    library_init, _ = simulate.nve(energy_or_force, shift)

    def init(key: Any, R: Any, kT: Any, mass: Any = UNIT_MASS, **kwargs: Any) -> NVEState:
        _check_masses(mass, R)
        state = library_init(key, R, kT, mass=mass, **kwargs)
        return NVEState(state.position, state.momentum, state.force, state.mass, state.position)

    compiled = jax.jit(partial(_step, splitting, force, shift))

    def apply(state: Any, **kwargs: Any) -> Any:
        dt = kwargs.pop("dt", step)
        _check_step("dt", dt)
        return compiled(state, dt, kwargs)

    return init, apply


def _step(
    method: Method, force: Callable[..., Any], shift: Callable[..., Any], state: Any, dt: Any, kwargs: dict[str, Any]
) -> Any:
    """Return the state after one step: pairs of a drift and a kick, and the kick before or the drift after them."""
    number = jnp.result_type(*jax.tree_util.tree_leaves(state.position))
    # In the precision of the state: a step in double precision must not promote it.
    lengths = jnp.stack([jnp.asarray(move.coefficient * dt, number) for move in method.moves])
    kick_first = method.first == "kick"
    lists = {key: value for key, value in kwargs.items() if isinstance(value, partition.NeighborList)}
    fixed = {key: value for key, value in kwargs.items() if key not in lists}

    def at(drifted: Any) -> dict[str, Any]:
        """Return the arguments of a stage, with the time to which the drifts have come."""
        return {**fixed, "t": fixed["t"] + drifted} if "t" in fixed else fixed

    def evaluated(state: Any, lists: Any, drifted: Any) -> tuple[Any, Any]:
        lists = {key: value.update(state.position, **at(drifted)) for key, value in lists.items()}
        state = state.set(force=force(state.position, **at(drifted), **lists))
        return state.set(force_position=state.position) if isinstance(state, NVEState) else state, lists

    def drift_and_kick(carry: Any, pair: Any) -> tuple[Any, None]:
        state, lists, drifted = carry
        drifted += pair[0]
        state = simulate.position_step(state, shift, pair[0], **at(drifted), **lists)
        state, lists = evaluated(state, lists, drifted)
        return (simulate.momentum_step(state, pair[1]), lists, drifted), None

    start = jnp.zeros_like(lengths[0])
    if kick_first:
        known = isinstance(state, NVEState) and "t" not in fixed  # a stored force belongs to a position, not to a time
        carry = (state, lists)
        state, lists = jax.lax.cond(
            _anywhere(_has_moved(state)) if known else True, lambda c: evaluated(c[0], c[1], start), lambda c: c, carry
        )
        state = simulate.momentum_step(state, lengths[0])
    pairs = (lengths[1:] if kick_first else lengths[:-1]).reshape(-1, 2)
    # A loop compiles the force once, not once a stage.
    (state, lists, drifted), _ = jax.lax.scan(drift_and_kick, (state, lists, start), pairs)
    for key, value in lists.items():
        warn = partial(jax.debug.callback, partial(_warn_of_overflow, key), value.did_buffer_overflow)
        jax.lax.cond(value.did_buffer_overflow != 0, warn, lambda: None)
    if kick_first:
        return state
    return simulate.position_step(state, shift, lengths[-1], **at(drifted + lengths[-1]), **lists)


def _warn_of_overflow(key: str, overflow: Any) -> None:
    """Warn from compiled code; in a batch it also runs for members without overflow."""
    if np.any(overflow):
        warnings.warn(f"{key} overflowed within a step: allocate it again with a larger capacity", stacklevel=2)


def _has_moved(state: NVEState) -> Any:
    """Return True if the position has changed since the force was computed."""
    pairs = zip(jax.tree_util.tree_leaves(state.position), jax.tree_util.tree_leaves(state.force_position), strict=True)
    return jnp.stack([jnp.any(now != then) for now, then in pairs]).any()


def _any_of_batch(_size: int, _batched: Any, condition: Any) -> tuple[Any, bool]:
    return _anywhere(condition.any(axis=0)), False


#: Whether a condition holds for any member of a batch: with one condition for each, ``vmap`` evaluates both branches.
_anywhere = jax.custom_batching.custom_vmap(lambda condition: condition)
_anywhere.def_vmap(_any_of_batch)


def _check_step(key: str, step: Any) -> None:
    """Raise an error for a step that is no finite number above 0, unless JAX traces it."""
    if isinstance(step, jax.core.Tracer):
        return
    single = step.item() if isinstance(step, jax.Array | np.ndarray | np.generic) and step.ndim == 0 else step
    if not is_real(single) or not 0 < float(single) < float("inf"):
        raise bad_setting(key, step, "a finite number above 0")


def _check_masses(mass: Any, position: Any) -> None:
    """Raise an error for masses that are not above 0, or not one for each particle, unless JAX traces them."""
    for leaf in jax.tree_util.tree_leaves(mass):
        if isinstance(leaf, jax.core.Tracer):
            continue
        numbers = isinstance(leaf, np.ndarray | jax.Array) and leaf.dtype.kind not in "bcmMOSU"
        if not (numbers or is_real(leaf)) or not np.all((np.asarray(leaf) > 0) & np.isfinite(leaf)):
            raise bad_setting("mass", leaf, "finite numbers above 0")
    if isinstance(mass, np.ndarray | jax.Array) and isinstance(position, np.ndarray | jax.Array):
        n = position.shape[0]
        if mass.shape not in ((), (n,), (n, 1)):
            raise bad_setting("mass", f"shape {mass.shape}", f"one number, or an array of shape ({n},)")
